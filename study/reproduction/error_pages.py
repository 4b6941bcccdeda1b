"""The estimators' errors in words and tables: what opens the study's page, and the figures of the user's page."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import pandas as pd

from study.figures.styles import look
from study.reproduction import estimator_errors
from study.support.document import Block, Bullets, Image, Text, table

WHO = (
    "MI/SO is the report's estimator, SI/SO the ordinary analysis that it is held against. The others are ours: a "
    "local polynomial fit without leakage, a fit of the model in free run (output error), and A_j(f) with that run as "
    "instrument. When to use which: [docs/estimators.md](../docs/estimators.md)."
)
ENOUGH = 5  # seeds from which a scatter means something
LARGE = 9950.0  # from here on a number is shown with a power of ten


def opening(errors: pd.DataFrame, noise: Mapping[str, float]) -> list[Block]:
    """How far each estimator is off: in sentences, by case and parameter, then bias and scatter under noise."""
    note = (
        f"Median over {int(errors['seeds'].max())} seeds of the error in %, every estimator on the very same records; "
        "in brackets the gain, the error of MI/SO over this one. Where the true value is zero the error is in the "
        "parameter's own unit. `snakemake -j2 estimators` does it with more seeds: `docs/estimators.md`."
    )
    noisy = errors[(errors["case"].map(noise) > 0.0) & (errors["seeds"] >= ENOUGH)]
    picture = Image("Errors of the estimators by parameter and case", "../figures/estimators.png")
    blocks: list[Block] = [
        Text(WHO),
        Bullets(error_sentences(errors, noise)),
        picture,
        Text(note),
        by_parameter(errors),
    ]
    if len(noisy):
        blocks += [
            Text("Under noise on the displacement, bias ± scatter of one estimate, both in %:"),
            bias_table(noisy),
        ]
    return blocks


def error_sentences(errors: pd.DataFrame, noise: Mapping[str, float]) -> tuple[str, ...]:
    """For each estimator but MI/SO, without noise and with it: how often it is nearer, and by how much."""
    others = [name for name in estimator_errors.estimator_names(errors) if name != estimator_errors.BASIS]
    noisy = errors["case"].map(noise) > 0.0
    parts = (("without noise", errors[~noisy]), ("with noise on the displacement", errors[noisy]))
    lines: list[str] = []
    for name in others:
        words = [_gains(where, part[part["estimator"] == name]) for where, part in parts]
        lines.append(f"**{look(name).label}**: " + "; ".join(word for word in words if word) + ".")
    return tuple(lines)


def about(errors: pd.DataFrame) -> str:
    """What the numbers of :func:`error_overview` are, and from how many records they come."""
    seeds, noted = int(errors["seeds"].max()), errors[errors["noted"] > 0].groupby(["case", "estimator"])["noted"].max()
    trouble = f"{int(noted.sum())} searches did not converge" if len(noted) else "every search converged"
    return (
        f"Median over {seeds} seeds of the error, in %, then the middle one of a case's parameters; in brackets the "
        f"gain, the error of MI/SO over this one, likewise the middle one. Of these runs {trouble}."
    )


def _gains(where: str, own: pd.DataFrame) -> str:
    gains = own["gain"].dropna()
    if gains.empty:
        return ""
    nearer = int((gains > 1.0).sum())
    return f"{where} nearer than MI/SO in {nearer} of {len(gains)} parameters, its median gain {factor(gains.median())}"


def by_estimator(
    table: pd.DataFrame, keys: Sequence[str], names: Sequence[str], cell: Callable[["pd.Series[Any]"], str]
) -> list[list[str]]:
    """One row for each value of the keys, one cell an estimator; it is empty where the table has no such row."""
    rows: list[list[str]] = []
    for key, group in table.groupby(list(keys), sort=False):
        cells = {str(row["estimator"]): cell(row) for _, row in group.iterrows()}
        rows.append([*(str(part) for part in key), *(cells.get(name, "") for name in names)])
    return rows


def _wide(
    errors: pd.DataFrame, keys: Sequence[str], shown: pd.DataFrame, cell: Callable[["pd.Series[Any]"], str]
) -> Block:
    """The table of :func:`by_estimator` under the names of all estimators of ``errors``."""
    names = estimator_errors.estimator_names(errors)
    return table([*keys, *(look(name).label for name in names)], by_estimator(shown, keys, names, cell))


def by_parameter(errors: pd.DataFrame) -> Block:
    """One row a case and parameter, one column an estimator: median error and gain."""
    return _wide(errors, ["case", "parameter"], errors, _error_and_gain)


def _error_and_gain(row: "pd.Series[Any]") -> str:
    scale, unit = (100.0, " %") if row["kind"] == "relative" else (1.0, "")
    size = f"{two_digits(scale * row['median_error'])}{unit}" if math.isfinite(row["median_error"]) else "none"
    return size if row["estimator"] == estimator_errors.BASIS else f"{size} ({factor(row['gain'])})"


def bias_table(errors: pd.DataFrame) -> Block:
    """One row a case and parameter with a true value: bias and scatter in % by estimator."""
    relative = errors[errors["kind"] == "relative"]
    return _wide(
        errors, ["case", "parameter"], relative,
        lambda row: f"{two_digits(100.0 * row['bias'])} ± {two_digits(100.0 * row['scatter'])}",
    )  # fmt: skip


def error_overview(errors: pd.DataFrame) -> Block:
    """One row a case, one column an estimator: the median of its parameters' errors, and of their gains."""
    return _wide(errors, ["case"], estimator_errors.by_case(errors).assign(kind="relative"), _error_and_gain)


def bias_overview(errors: pd.DataFrame, noise: Mapping[str, float]) -> Block:
    """One row a case with noise, one column an estimator: the largest bias over scatter, and whose it is."""
    worst = estimator_errors.worst_bias(errors[errors["case"].map(noise) > 0.0])
    return _wide(errors, ["case"], worst, lambda row: f"{two_digits(row['ratio'])} ({row['parameter']})")


def factor(gain: float) -> str:
    """A gain as ``x 3.2``; a dash where there is none to compare with."""
    return "-" if math.isnan(gain) else f"x {two_digits(gain)}"


def two_digits(number: float) -> str:
    """Two digits, without an exponent from 0.01 to 9999: ``0.034``, ``1600``, ``2e4``."""
    if not 99.5 <= abs(number) < LARGE:
        return f"{number:.2g}".replace("e+0", "e").replace("e-0", "e-").replace("e+", "e")
    return f"{float(f'{number:.2g}'):.0f}"
