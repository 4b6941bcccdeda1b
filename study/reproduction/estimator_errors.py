"""How far each estimator is from the truth on the very same records, and what it gains over the report's MI/SO."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Floats = NDArray[np.float64]
BASIS = "miso"  # the report's estimator: gains are over its errors
COLUMNS = [
    "case", "estimator", "parameter", "true", "kind", "median_error", "standard_error", "gain",
    "bias", "bias_error", "scatter", "seeds", "found", "noted", "first_error",
]  # fmt: skip
FIRST = 2  # seeds whose median has a column of its own: by it a later run shows that it gives the same errors
ALIKE = 0.01  # share of a median error by which two runs of the same study may differ


def errors(estimates: pd.DataFrame) -> pd.DataFrame:
    """Errors by case, estimator and parameter, from :func:`study.reproduction.ensemble.estimates` of one or more cases.

    Errors are relative where the true value is not zero (``kind``), otherwise in the parameter's own unit.
    ``median_error`` is the median over the seeds of the size of the error; a seed that gives no estimate is farther
    off than any other. ``standard_error`` is that of the median, whatever the distribution. ``gain`` is the median
    error of MI/SO over this one. ``bias`` and ``scatter`` are mean and standard deviation of the signed error.
    ``found`` of ``seeds`` give an estimate, ``noted`` of them with a note, such as that the search did not converge.
    ``first_error`` is the median over the first ``FIRST`` seeds alone.
    """
    seeds = {str(case): sorted(group["seed"].unique()) for case, group in estimates.groupby("case")}
    rows: list[dict[str, Any]] = []
    for (case, estimator, parameter), group in estimates.groupby(["case", "estimator", "parameter"], sort=False):
        first, count, true = seeds[str(case)][:FIRST], len(seeds[str(case)]), float(group["true"].iloc[0])
        signed = (group["estimate"].to_numpy(dtype=np.float64) - true) / (abs(true) or 1.0)
        median, error = middle(np.abs(signed), count)
        scatter = float(np.std(signed, ddof=1)) if len(signed) > 1 else math.nan
        row = {
            "case": case, "estimator": estimator, "parameter": parameter, "true": true,
            "kind": "relative" if true else "absolute", "median_error": median, "standard_error": error,
            "bias": float(signed.mean()), "bias_error": scatter / math.sqrt(len(signed)), "scatter": scatter,
            "seeds": count, "found": len(group), "noted": int(group["note"].astype(bool).sum()),
            "first_error": middle(np.abs(signed[group["seed"].isin(first)]), len(first))[0],
        }  # fmt: skip
        rows.append(row)
    return with_gains(pd.DataFrame(rows, columns=COLUMNS))


def differing_cases(own: pd.DataFrame, kept: pd.DataFrame) -> list[str]:
    """Cases whose first seeds do not come out as those of a kept table did: other settings or other code show there.

    Both are as :func:`errors` gives them; ``kept`` may have cases and estimators that ``own`` lacks. A case differs
    where a ``first_error`` is not in ``kept`` or is off by more than ``ALIKE``.
    """
    keys = ["case", "estimator", "parameter"]
    before = kept.set_index(keys).reindex(pd.MultiIndex.from_frame(own[keys])).reset_index()
    same = np.isclose(before["true"], own["true"], rtol=1e-9, atol=0.0)
    same &= np.isclose(before["first_error"], own["first_error"], rtol=ALIKE, atol=0.0)
    return list(dict.fromkeys(str(case) for case in own.loc[~same, "case"]))


def middle(sizes: Floats, count: int) -> tuple[float, float]:
    """Median of ``count`` sizes of which those that are missing are the largest, and its standard error.

    The ranks of the values below the median are binomial: one standard deviation of them to either side of the
    middle, half of sqrt(count), gives the order statistics that the standard error is half the distance of.
    """
    ranked = np.full(count, math.inf)
    ranked[: len(sizes)] = np.sort(sizes)
    half, spread = 0.5 * (count - 1), 0.5 * math.sqrt(count)
    below, above = max(math.floor(half - spread), 0), min(math.ceil(half + spread), count - 1)
    median = float(np.median(ranked))
    return median, 0.5 * float(ranked[above] - ranked[below]) if math.isfinite(median) else math.inf


def with_gains(table: pd.DataFrame) -> pd.DataFrame:
    """The table with ``gain`` filled in; nan where MI/SO gives nothing to compare with."""
    keys = ["case", "parameter"]
    basis = table[table["estimator"] == BASIS].set_index(keys)["median_error"]
    own = table["median_error"].to_numpy(dtype=np.float64)
    before = basis.reindex(pd.MultiIndex.from_frame(table[keys])).to_numpy(dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):  # two errors of nothing, or two that are boundless
        return table.assign(gain=before / own)


def by_case(table: pd.DataFrame) -> pd.DataFrame:
    """By case and estimator, medians over the parameters with a true value other than zero: of errors and of gains."""
    relative = table[table["kind"] == "relative"]
    return relative.groupby(["case", "estimator"], sort=False)[["median_error", "gain"]].median().reset_index()


def worst_bias(table: pd.DataFrame) -> pd.DataFrame:
    """By case and estimator the parameter with the largest ``ratio`` of bias to scatter.

    ``ratio_error`` is the ratio that chance alone brings.
    """
    scattered = table[table["scatter"] > 0.0]
    ratio = scattered["bias"].abs() / scattered["scatter"]
    ratios = scattered.assign(ratio=ratio, ratio_error=1.0 / np.sqrt(scattered["found"]))
    highest = ratios.groupby(["case", "estimator"], sort=False)["ratio"].idxmax()
    return ratios.loc[highest, ["case", "estimator", "parameter", "ratio", "ratio_error"]].reset_index(drop=True)


def estimator_names(table: pd.DataFrame) -> Sequence[str]:
    """Names of the estimators in the order of the table."""
    return list(dict.fromkeys(str(name) for name in table["estimator"]))
