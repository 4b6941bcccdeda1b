"""The estimators' errors in words and tables: what opens the study's page, and the figures of the user's page."""

import math
from collections.abc import Mapping
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
    """Who is how far off: in sentences, then every case and parameter, then bias and scatter under noise."""
    note = (
        f"Median over {int(errors['seeds'].max())} seeds of the error in %, every estimator on the very same records; "
        "in brackets the gain, the error of MI/SO over this one. Where the true value is zero the error is in the "
        "parameter's own unit. `snakemake -j2 estimators` does it with more seeds: `docs/estimators.md`."
    )
    noisy = errors[(errors["case"].map(noise) > 0.0) & (errors["seeds"] >= ENOUGH)]
    picture = Image("Errors of the estimators by parameter and case", "../figures/estimators.png")
    found: list[Block] = [Text(WHO), Bullets(sentences(errors, noise)), picture, Text(note), by_parameter(errors)]
    if len(noisy):
        found += [Text("Under noise on the displacement, bias ± scatter of one estimate, both in %:"), biases(noisy)]
    return found


def sentences(errors: pd.DataFrame, noise: Mapping[str, float]) -> tuple[str, ...]:
    """For each estimator but MI/SO, without noise and with it: how often it is nearer, and by how much."""
    others = [name for name in estimator_errors.estimators(errors) if name != estimator_errors.BASIS]
    loud = errors["case"].map(noise) > 0.0
    parts = (("Without noise", errors[~loud]), ("With noise on the displacement", errors[loud]))
    lines: list[str] = []
    for name in others:
        words = [_gains(where, kept[kept["estimator"] == name]) for where, kept in parts]
        lines.append(f"**{look(name).label}**: " + "; ".join(word for word in words if word) + ".")
    return tuple(lines)


def about(errors: pd.DataFrame) -> str:
    """What the numbers of :func:`overview` are, and of how many records."""
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
    place = where[0].lower() + where[1:]
    return f"{place} nearer than MI/SO in {nearer} of {len(gains)} parameters, its median gain {factor(gains.median())}"


def by_parameter(errors: pd.DataFrame) -> Block:
    """One row a case and parameter, one column an estimator: median error and gain."""
    names = estimator_errors.estimators(errors)
    rows: list[list[str]] = []
    for (case, parameter), group in errors.groupby(["case", "parameter"], sort=False):
        found = {str(row["estimator"]): row for _, row in group.iterrows()}
        rows.append([str(case), str(parameter), *(_cell(found[n]) if n in found else "" for n in names)])
    return table(["case", "parameter", *(look(name).label for name in names)], rows)


def _cell(row: "pd.Series[Any]") -> str:
    scale, unit = (100.0, " %") if row["kind"] == "relative" else (1.0, "")
    size = f"{short(scale * row['median_error'])}{unit}" if math.isfinite(row["median_error"]) else "none"
    return size if row["estimator"] == estimator_errors.BASIS else f"{size} ({factor(row['gain'])})"


def biases(errors: pd.DataFrame) -> Block:
    """One row a case and parameter with a true value: bias and scatter in % by estimator."""
    names = estimator_errors.estimators(errors)
    kept = errors[errors["kind"] == "relative"]
    rows: list[list[str]] = []
    for (case, parameter), group in kept.groupby(["case", "parameter"], sort=False):
        found = {str(row["estimator"]): row for _, row in group.iterrows()}
        cells = [_bias(found[n]) if n in found else "" for n in names]
        rows.append([str(case), str(parameter), *cells])
    return table(["case", "parameter", *(look(name).label for name in names)], rows)


def _bias(row: "pd.Series[Any]") -> str:
    return f"{short(100.0 * row['bias'])} ± {short(100.0 * row['scatter'])}"


def overview(errors: pd.DataFrame) -> Block:
    """One row a case, one column an estimator: the middle one of its parameters' errors, and of their gains."""
    names = estimator_errors.estimators(errors)
    found = estimator_errors.by_case(errors).assign(kind="relative")
    rows: list[list[str]] = []
    for case, group in found.groupby("case", sort=False):
        own = {str(row["estimator"]): row for _, row in group.iterrows()}
        cells = [_cell(own[n]) if n in own else "" for n in names]
        rows.append([str(case), *cells])
    return table(["case", *(look(name).label for name in names)], rows)


def bias_overview(errors: pd.DataFrame, noise: Mapping[str, float]) -> Block:
    """One row a case with noise, one column an estimator: the largest bias over scatter, and whose it is."""
    loud = errors[errors["case"].map(noise) > 0.0]
    names, found = estimator_errors.estimators(errors), estimator_errors.worst_bias(loud)
    rows: list[list[str]] = []
    for case, group in found.groupby("case", sort=False):
        own = {str(row["estimator"]): f"{short(row['ratio'])} ({row['parameter']})" for _, row in group.iterrows()}
        rows.append([str(case), *(own.get(name, "") for name in names)])
    return table(["case", *(look(name).label for name in names)], rows)


def factor(gain: float) -> str:
    """A gain as ``x 3.2``; a dash where there is none to compare with."""
    return "-" if math.isnan(gain) else f"x {short(gain)}"


def short(number: float) -> str:
    """Two digits, without an exponent from 0.01 to 9999: ``0.034``, ``1600``, ``2e4``."""
    if not 99.5 <= abs(number) < LARGE:
        return f"{number:.2g}".replace("e+0", "e").replace("e-0", "e-").replace("e+", "e")
    return f"{float(f'{number:.2g}'):.0f}"
