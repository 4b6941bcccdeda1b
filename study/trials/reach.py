"""Of many trials: who was taken for whom, how often the targets of reach were met, and how the error fell."""

import math
from collections.abc import Callable, Mapping
from typing import Any, cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from study.diagnose.verdict import MISSING, NOTHING, UNKNOWN
from study.trials.draw import HIDDEN
from study.trials.runs import NONE, PAIR, REMOVED, SINGLE, Row

Floats = NDArray[np.float64]
LITTLE_NOISE = 0.05  # up to which the true effect has to come first
WITHIN = 1.05  # held-out error after adding, over that of the true model
HALF = 0.5  # what a named tie counts that holds the true effect


def rows_of(table: pd.DataFrame) -> list[Row]:
    """The rows of ``trials.csv``, empty cells as empty words."""
    words = (
        "hidden", "verdict", "first", "named", "tied_with", "second_verdict", "second_named", "second_tied_with",
        "pair", "tie_with_hidden", "trouble",
    )  # fmt: skip
    filled = {c: table[c].astype(object).where(table[c].notna(), "").astype(str) for c in words}
    return cast(list[Row], table.assign(**filled).to_dict("records"))


def first_score(row: Row) -> float:
    """One if the hidden effect is named first, a half if a tie is named that holds it."""
    if row["verdict"] != MISSING:
        return 0.0
    if row["named"] == row["hidden"]:
        return 1.0
    return HALF if row["hidden"] in row["tied_with"].split("+") else 0.0


def right_place(row: Row) -> float:
    """One if the hidden effect stands first among the candidates, whatever the verdict."""
    return float(row["first"] == row["hidden"])


def nothing_score(row: Row) -> float:
    """One if it is said that nothing is missing."""
    return float(row["verdict"] == NOTHING)


def pair_score(row: Row) -> float:
    """One if the two additions are the two hidden effects; ties count nothing here."""
    return float({row["named"], row["second_named"]} == set(row["hidden"].split("+")))


def removed_score(row: Row) -> float:
    """One if an effect that is not in the library is called unknown, or what is named comes with a tie."""
    if row["verdict"] == UNKNOWN:
        return 1.0
    return float(row["verdict"] == MISSING and (row["tied_with"] != "" or row["tie_with_hidden"] == "True"))


def as_good_as_truth(row: Row) -> float:
    """One if the held-out error after adding is within 5 % of that of the true model, fitted in the same way."""
    return float(bool(row["error_after"] <= WITHIN * row["error_true"]))


def _quiet(row: Row) -> bool:
    return row["noise"] <= LITTLE_NOISE


def _kind(kind: str, test: Callable[[Row], bool] = lambda _: True) -> Callable[[Row], bool]:
    return lambda row: row["kind"] == kind and test(row)


TARGETS: tuple[tuple[str, Callable[[Row], bool], Callable[[Row], float], str], ...] = (
    ("true effect named first, noise up to 5 %", _kind(SINGLE, _quiet), first_score, "first"),
    ("true effect named first, noise 10 %", _kind(SINGLE, lambda r: not _quiet(r)), first_score, ""),
    ("true effect heads the list, whatever the verdict, noise up to 5 %", _kind(SINGLE, _quiet), right_place, ""),
    ("nothing missing where nothing is", _kind(NONE), nothing_score, "nothing"),
    ("both of two found by diagnosing and adding twice", _kind(PAIR), pair_score, "both"),
    ("effect out of the library called unknown, or its tie named", _kind(REMOVED), removed_score, "removed"),
    ("error after adding within 5 % of the true model's", _kind(SINGLE), as_good_as_truth, "first"),
    ("the same, of the trials with noise", _kind(SINGLE, lambda r: r["noise"] > 0.0), as_good_as_truth, ""),
)  # fmt: skip


def summary(table: pd.DataFrame, wanted: Mapping[str, float]) -> pd.DataFrame:
    """Each target with the rate that was measured and its binomial standard error.

    A trial that could not be made or diagnosed counts as failed. ``wanted`` holds the rates ``first``, ``nothing``,
    ``both``, ``removed``.
    """
    rows = rows_of(table)
    return pd.DataFrame([_rate(what, rows, member, score, wanted.get(key)) for what, member, score, key in TARGETS])


def _rate(
    what: str, rows: list[Row], member: Callable[[Row], bool], score: Callable[[Row], float], wanted: float | None
) -> Row:
    scores = [0.0 if row["trouble"] else score(row) for row in rows if member(row)]
    rate = float(np.mean(scores)) if scores else math.nan
    error = math.sqrt(max(rate * (1.0 - rate), 0.0) / len(scores)) if scores else math.nan
    met = "" if wanted is None else "yes" if rate >= wanted else "no"
    return {"reach": what, "trials": len(scores), "rate": rate, "standard_error": error,
            "wanted": math.nan if wanted is None else wanted, "met": met}  # fmt: skip


def confusion(table: pd.DataFrame) -> pd.DataFrame:
    """Trials by what was hidden (rows: each effect alone, none) and what was said (columns)."""
    never_hidden = sorted({row["named"] for row in rows_of(table)} - {"", *HIDDEN})
    said = [*HIDDEN, *never_hidden, NOTHING, UNKNOWN]
    hidden = [*HIDDEN, NONE]
    counts = np.zeros((len(hidden), len(said)), dtype=np.int64)
    for row in rows_of(table):
        if row["kind"] in (SINGLE, NONE) and not row["trouble"]:
            counts[hidden.index(row["hidden"] or NONE), said.index(row["named"] or row["verdict"])] += 1
    return pd.DataFrame(counts, index=pd.Index(hidden, name="hidden"), columns=said).reset_index()


def ladder(table: pd.DataFrame) -> pd.DataFrame:
    """Mean held-out response error before and after adding what was found, and that of the true model, by noise."""
    good = table[table["trouble"].isna() | (table["trouble"] == "")]
    rows: list[dict[str, Any]] = []
    for kind, steps in ((SINGLE, ("before", "after", "true")), (PAIR, ("before", "after", "after_two", "true"))):
        for noise, group in good[good["kind"] == kind].groupby("noise"):
            for step in steps:
                errors = _errors(group, step)
                rows.append(
                    {"kind": kind, "noise": noise, "step": step, "trials": len(errors), "mean_error": np.mean(errors),
                     "standard_error": np.std(errors, ddof=1) / math.sqrt(len(errors)) if len(errors) > 1 else math.nan,
                     "median_error": np.median(errors)}
                )  # fmt: skip
    return pd.DataFrame(rows)


def _errors(group: pd.DataFrame, step: str) -> Floats:
    """Errors at a step; where nothing was added the second time, those after the first."""
    values = group[f"error_{step}"]
    if step == "after_two":
        values = values.fillna(group["error_after"])
    return values.dropna().to_numpy(dtype=np.float64)
