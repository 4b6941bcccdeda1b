"""Of many trials: how often the targets of reach were met, who was taken for whom, and how the error fell.

A tie is scored by whether its set holds the truth and by its size; no size makes up for a truth that is not in it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import numpy as np
import pandas as pd

from study.diagnose.verdict import MISSING, NOTHING, UNKNOWN
from study.equations.terms import same_elsewhere
from study.support.arrays import Floats
from study.trials.draw import HIDDEN
from study.trials.findings import Row
from study.trials.rates import Rate, mean, proportion
from study.trials.runs import COMPLETED, NONE, PAIR, REMOVED, SINGLE, WITH, WITHOUT

VERY_LITTLE, LITTLE = 0.01, 0.05  # noise up to which ties are to be short, and the true effect has to come first
COUNTED = 1e-6  # relative: what is counted or read off has no interval, and no last bit either
WITHIN = 1.05  # held-out error after adding, over that of the true model
WORDS = (
    "kind", "hidden", "response", "known", "faults", "fault", "fault_channel", "faults_found", "fault_rivals",
    "fault_shown", "found", "found_channel", "verdict", "first",
    "tie_set", "second_verdict", "second_tie_set", "whole_tie_set", "pair", "trouble",
)  # fmt: skip
Wanted = Mapping[str, Sequence[float]]
Member = Callable[[Row], bool]
Score = Callable[[Row], float]


def rows_of(table: pd.DataFrame) -> list[Row]:
    """The rows of ``trials.csv``, empty cells as empty words."""
    filled = {c: table[c].astype(object).where(table[c].notna(), "").astype(str) for c in WORDS}
    return cast(list[Row], table.assign(**filled).to_dict("records"))


def first_score(row: Row) -> float:
    """One if the hidden effect is called missing and stands first, or its other form in the same equation does."""
    return float(row["verdict"] == MISSING and (row["first"] == row["hidden"] or _in_another_form(row)))


def _in_another_form(row: Row) -> bool:
    """Whether what stands first is the hidden effect with the displacement counted from another place."""
    if row["response"] == "displacement" or not row["first"]:
        return False
    return same_elsewhere(row["first"], row["hidden"], row["known"].split("+"))


def tied_score(row: Row) -> float:
    """One if the hidden effect is among those that the record cannot tell apart."""
    return float(row["hidden"] in row["tie_set"].split("+"))


def nothing_score(row: Row) -> float:
    """One if it is said that nothing is missing, or nothing but what the fault that was found may be instead.

    An offset of the displacement and a constant force are one equation where all else is linear.
    """
    or_the_fault = row["found"] == row["fault"] and row["first"] in row["fault_rivals"].split("+")
    return float(row["verdict"] == NOTHING or (row["verdict"] == MISSING and or_the_fault))


def pair_score(row: Row) -> float:
    """One if the two that were put first, one after the other, are the two hidden effects."""
    put_first = [row[column].split("+")[0] for column in ("tie_set", "second_tie_set")]
    return float(set(put_first) == set(row["hidden"].split("+")))


def removed_score(row: Row) -> float:
    """One if an effect that is not in the library is called unknown, or is tied, if it may be, with what is named."""
    if row["verdict"] == UNKNOWN:
        return 1.0
    whole = row["whole_tie_set"].split("+")
    return float(row["verdict"] == MISSING and row["first"] in whole and row["hidden"] in whole)


def removed_or_as_good(row: Row) -> float:
    """The same, or what is said leaves no more than the true model: then nothing in the record speaks against it."""
    return max(removed_score(row), as_good_as_truth(row))


def fault_score(row: Row) -> float:
    """One if the fault is named in its channel with an interval that holds its value."""
    if (row["found"], row["found_channel"]) != (row["fault"], row["fault_channel"]):
        return 0.0
    low, true, high = (float(row[column]) for column in ("found_low", "fault_value", "found_high"))
    counted = low == high and math.isclose(low, true, rel_tol=COUNTED)
    return float(counted or low <= true <= high)


def no_fault_score(row: Row) -> float:
    """One if no fault of the measurement is found."""
    return float(row["faults_found"] == "")


def as_good_as_truth(row: Row) -> float:
    """One if the held-out error after adding is within 5 % of that of the true model, fitted in the same way."""
    return float(bool(row["error_after"] <= WITHIN * row["error_true"]))


def _single(test: Member = lambda _: True) -> Member:
    return lambda row: row["kind"] == SINGLE and test(row)


def _kinds(*kinds: str) -> Member:
    return lambda row: row["kind"] in kinds


def _faulty(row: Row) -> bool:
    return row["fault"] != ""


def _visible(row: Row) -> bool:
    """Whether the hidden effect leaves anything to be seen: a constant force behind a high-pass does not."""
    return not row["error_true"] >= row["error_before"]


def _shown(row: Row) -> bool:
    return row["fault_shown"] == "yes"


RATES: tuple[tuple[str, Member, Score, str], ...] = (
    ("true effect first, noise to 5 %", _single(lambda r: r["noise"] <= LITTLE), first_score, "first"),
    ("true effect first, noise 10 %", _single(lambda r: r["noise"] > LITTLE), first_score, "first_in_noise"),
    ("tie set holds the truth", _single(), tied_score, "tied"),
    ("... where the true model leaves less than that without the effect", _single(_visible), tied_score, ""),
    ("nothing missing where nothing is, and of completed models", _kinds(NONE, COMPLETED), nothing_score, "nothing"),
    ("... where nothing is", _kinds(NONE), nothing_score, ""),
    ("... of completed models", _kinds(COMPLETED), nothing_score, ""),
    ("both of two, by diagnose and add", _kinds(PAIR), pair_score, "both"),
    ("out of the library: unknown, or in the tie set", _kinds(REMOVED), removed_score, "removed"),
    ("... or what is said leaves as little as the true model", _kinds(REMOVED), removed_or_as_good, ""),
    ("the fault named, its value within its interval", _faulty, fault_score, "fault"),
    ("... of those that the record shows beside the true equation", _shown, fault_score, ""),
    ("no fault named where there is none", lambda r: not _faulty(r), no_fault_score, ""),
    ("error after adding within 5 % of the true model's", _single(), as_good_as_truth, ""),
)
SIZES: tuple[tuple[str, Member, str], ...] = (
    ("mean size of the tie set, noise to 1 %", lambda r: r["noise"] <= VERY_LITTLE, "size"),
    ("mean size of the tie set, noise 5 %", lambda r: VERY_LITTLE < r["noise"] <= LITTLE, "size_in_noise"),
    ("mean size of the tie set, noise 10 %", lambda r: r["noise"] > LITTLE, ""),
)
HELD = "95 % intervals of coefficients that hold the truth, with noise"


def target_summary(table: pd.DataFrame, wanted: Wanted) -> pd.DataFrame:
    """Each target without and with a fault of the measurement: what was measured, its 95 % interval, and whether met.

    A trial that could not be made or diagnosed counts as failed. A rate is reached if its interval reaches it.
    ``wanted`` holds lists of two, without a fault and with one, or of a single one without (with, for ``fault``).
    """
    rows = rows_of(table)
    found: list[Row] = []
    for faults in (WITHOUT, WITH):
        own = [row for row in rows if row["faults"] == faults]
        for what, member, score, key in RATES:
            scores = [0.0 if row["trouble"] else score(row) for row in own if member(row)]
            found.append(_line(what, faults, proportion(scores), _least(wanted, key, faults), math.inf))
        for what, member, key in SIZES:
            sizes = [float(row["tie_size"]) for row in own if _single(member)(row) and row["tie_set"]]
            found.append(_line(what, faults, mean(sizes), -math.inf, _most(wanted, key, faults)))
        held = [row for row in own if not row["trouble"] and row["noise"] > 0.0 and row["asked"] > 0]
        rate = proportion([row["held"] for row in held], [row["asked"] for row in held])
        found.append(_line(HELD, faults, rate, _least(wanted, "held", faults), _most(wanted, "held_most", faults)))
    return pd.DataFrame([line for line in found if line["trials"]])


def _place(wanted: Wanted, key: str, faults: str) -> float | None:
    values = wanted.get(key, ())
    if key == "fault":
        return values[0] if values and faults == WITH else None
    place = (WITHOUT, WITH).index(faults)
    return values[place] if place < len(values) else None


def _least(wanted: Wanted, key: str, faults: str) -> float:
    value = _place(wanted, key, faults)
    return -math.inf if value is None else value


def _most(wanted: Wanted, key: str, faults: str) -> float:
    value = _place(wanted, key, faults)
    return math.inf if value is None else value


def _line(what: str, faults: str, rate: Rate, least: float, most: float) -> Row:
    asked = math.isfinite(least) or math.isfinite(most)
    met = "" if not asked or not rate.trials else "yes" if rate.high >= least and rate.low <= most else "no"
    return {
        "reach": what, "faults": faults, "trials": rate.trials, "value": rate.value, "low": rate.low,
        "high": rate.high, "least": least if math.isfinite(least) else math.nan,
        "most": most if math.isfinite(most) else math.nan, "reached": met,
    }  # fmt: skip


def confusion(table: pd.DataFrame) -> pd.DataFrame:
    """Trials by what was hidden (rows: each effect alone, none) and what was said (columns)."""
    rows = rows_of(table)
    never_hidden = sorted({_said(row) for row in rows} - {"", NOTHING, UNKNOWN, *HIDDEN})
    said = [*HIDDEN, *never_hidden, NOTHING, UNKNOWN]
    hidden = [*HIDDEN, NONE]
    counts = np.zeros((len(hidden), len(said)), dtype=np.int64)
    for row in rows:
        if row["kind"] in (SINGLE, NONE) and not row["trouble"]:
            counts[hidden.index(row["hidden"] or NONE), said.index(_said(row))] += 1
    return pd.DataFrame(counts, index=pd.Index(hidden, name="hidden"), columns=said).reset_index()


def _said(row: Row) -> str:
    return row["first"] if row["verdict"] == MISSING else row["verdict"]


def error_by_noise(table: pd.DataFrame) -> pd.DataFrame:
    """Mean held-out response error before and after adding what was found, and that of the true model, by noise."""
    good = table[(table["trouble"].isna() | (table["trouble"] == "")) & (table["faults"] == WITHOUT)]
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
    return pd.DataFrame(
        rows, columns=["kind", "noise", "step", "trials", "mean_error", "standard_error", "median_error"]
    )


def _errors(group: pd.DataFrame, step: str) -> Floats:
    """Errors at a step; where nothing was added the second time, those after the first."""
    values = group[f"error_{step}"]
    if step == "after_two":
        values = values.fillna(group["error_after"])
    return values.dropna().to_numpy(dtype=np.float64)
