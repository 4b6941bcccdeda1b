"""Many seeds of one case on every core: how often tolerances are met, and how far each estimator is from the truth.

And what the integrator's setting does to each recovered parameter: every record is made twice from one force, once by
the setting under study, once finely. The difference of the MI/SO estimates is the integrator's doing alone, free of the
leakage that both share.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from study.equations.model import Model
from study.identify.estimators.base import Settings, true_parameters
from study.identify.estimators.in_reverse import miso
from study.reproduction import tables
from study.reproduction.cases import identify_case, make_record
from study.reproduction.settings import IdentificationSettings, IntegratorSettings, RecordSettings
from study.support.arrays import Floats
from study.support.cores import side_by_side
from study.support.errors import DivergenceError
from study.support.numbers import LAST_DIGITS, SAME_RUN

NOISE_OFFSET = 1_000_000  # noise seeds stand apart from force seeds
BASIS = "miso"  # the report's estimator: gains are over its errors
ERROR_COLUMNS = [
    "case", "estimator", "parameter", "true", "kind", "median_error", "standard_error", "gain",
    "bias", "bias_error", "scatter", "seeds", "found", "noted", "first_error",
]  # fmt: skip
FIRST_SEEDS = 2  # whose median has a column of its own: by it a later run shows that it gives the same errors
Estimates = Mapping[str, float]
FINELY = IntegratorSettings(method="rk4", steps_per_sample=16)
STUDIED = [IntegratorSettings(method=m, steps_per_sample=s) for m in ("abm4", "rk4") for s in (1, 2, 4, 8)]
NOTHING_FOUND = {"parameter": "", "true": math.nan, "fine": math.nan, "mean_error": math.nan,
                 "standard_error": math.nan, "relative_error": math.nan}  # fmt: skip


def estimates(
    model: Model, record: RecordSettings, identification: IdentificationSettings, seeds: Iterable[int],
    *, workers: int | None = None, progress: Callable[[int], None] | None = None,
) -> pd.DataFrame:  # fmt: skip
    """Every parameter of every estimator for every seed, as ``tables.parameter_table`` with a column ``seed``.

    A seed whose run diverges leaves one row with the parameter ``diverged`` and the time as its estimate.
    """

    def one(seed: int) -> pd.DataFrame:
        try:
            measured = make_record(model, record, seed=seed, noise_seed=NOISE_OFFSET + seed)
        except DivergenceError as error:
            lost = {"case": record.case, "parameter": "diverged", "estimate": error.time}
            return pd.DataFrame([lost], columns=tables.PARAMETER_COLUMNS).assign(seed=seed)
        found = identify_case(model, measured, identification)
        return tables.parameter_table(record.case, model, found, identification).assign(seed=seed)

    found: list[pd.DataFrame] = []
    for table in side_by_side(one, list(seeds), workers=workers):
        found.append(table)
        if progress is not None:
            progress(len(found))
    return pd.concat([table for table in found if len(table)], ignore_index=True)


def tolerance_rates(table: pd.DataFrame) -> pd.DataFrame:
    """How often each tolerance is met, with the mean and scatter of each estimate.

    A seed that gives no estimate, because its run diverges or the recipe finds nothing, does not meet the
    tolerance: ``found`` of ``seeds`` give one. ``rate_error`` is the binomial standard error of the rate;
    ``error_to_scatter`` is the mean standard error over the scatter that the seeds show.
    """
    rows: list[dict[str, Any]] = []
    seeds = {str(case): int(group["seed"].nunique()) for case, group in table.groupby("case")}
    for (case, estimator, parameter), group in table.groupby(["case", "estimator", "parameter"], sort=False):
        count = seeds[str(case)]
        rate = float(group["within_tolerance"].astype(bool).sum()) / count
        scatter = float(group["estimate"].std(ddof=1))
        error = float(group["standard_error"].mean())
        row = {
            "case": case, "estimator": estimator, "parameter": parameter, "true": float(group["true"].iloc[0]),
            "mean": float(group["estimate"].mean()), "scatter": scatter,
            "error_to_scatter": error / scatter if scatter > 0.0 else math.nan,
            "tolerance": float(group["tolerance"].iloc[0]), "seeds": count, "found": len(group),
            "within_tolerance": rate, "rate_error": math.sqrt(rate * (1.0 - rate) / count),
        }  # fmt: skip
        rows.append(row)
    return pd.DataFrame(rows)


def estimator_errors(found: pd.DataFrame) -> pd.DataFrame:
    """Errors by case, estimator and parameter, from :func:`estimates` of one or more cases.

    Errors are relative where the true value is not zero (``kind``), otherwise in the parameter's own unit.
    ``median_error`` is the median over the seeds of the size of the error; a seed that gives no estimate is farther
    off than any other. ``standard_error`` is that of the median, whatever the distribution. ``gain`` is the median
    error of MI/SO over this one, nan where MI/SO gives nothing to compare with. ``bias`` and ``scatter`` are mean and
    standard deviation of the signed error.
    ``found`` of ``seeds`` give an estimate, ``noted`` of them with a note, such as that the search did not converge.
    ``first_error`` is the median over the ``FIRST_SEEDS`` alone.
    """
    seeds = {str(case): sorted(group["seed"].unique()) for case, group in found.groupby("case")}
    rows: list[dict[str, Any]] = []
    for (case, estimator, parameter), group in found.groupby(["case", "estimator", "parameter"], sort=False):
        first, count, true = seeds[str(case)][:FIRST_SEEDS], len(seeds[str(case)]), float(group["true"].iloc[0])
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
    table, keys = pd.DataFrame(rows, columns=ERROR_COLUMNS), ["case", "parameter"]
    basis = table[table["estimator"] == BASIS].set_index(keys)["median_error"]
    own = table["median_error"].to_numpy(dtype=np.float64)
    before = basis.reindex(pd.MultiIndex.from_frame(table[keys])).to_numpy(dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):  # two errors of nothing, or two that are boundless
        return table.assign(gain=before / own)


def differing_cases(own: pd.DataFrame, kept: pd.DataFrame) -> list[str]:
    """Cases whose first seeds do not come out as those of a kept table did: other settings or other code show there.

    Both are as :func:`estimator_errors` gives them; ``kept`` may have cases and estimators that ``own`` lacks.
    A case differs where a ``first_error`` is not in ``kept`` or is off by more than ``SAME_RUN``.
    """
    keys = ["case", "estimator", "parameter"]
    before = kept.set_index(keys).reindex(pd.MultiIndex.from_frame(own[keys])).reset_index()
    same = np.isclose(before["true"], own["true"], rtol=LAST_DIGITS, atol=0.0)
    same &= np.isclose(before["first_error"], own["first_error"], rtol=SAME_RUN, atol=0.0)
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


def estimator_names(table: pd.DataFrame) -> Sequence[str]:
    """Names of the estimators in the order of the table."""
    return list(dict.fromkeys(str(name) for name in table["estimator"]))


# ---- what the integrator does


def integrator_study(
    models: Mapping[str, Model],
    record: RecordSettings,
    estimation: Settings,
    seeds: Sequence[int],
    readings: Sequence[str],
) -> pd.DataFrame:
    """Every system under every setting: one row a parameter, as ``results/integrator_steps.csv`` holds them.

    ``fine`` is the mean estimate from the finely integrated records, ``mean_error`` the mean over the seeds of the
    estimate less that of the fine record. ``diverged`` of the ``seeds`` left the range of finite numbers;
    ``diverged_seeds`` says which, each with the time. ``parameter`` is empty where every run diverged. The first of the
    ``readings`` of unit variance is studied at every setting, the others (a force of twice the variance, by and large)
    at the report's own: Adams-Bashforth-Moulton, one step a sample.
    """
    rows: list[dict[str, Any]] = []
    for name, model in models.items():
        truth = true_parameters(model.values)
        for reading in readings:
            excitation = record.excitation.model_copy(update={"reading": reading})
            base = record.model_copy(update={"excitation": excitation})
            fine, _ = _estimates(model, base, FINELY, estimation, seeds)
            for integrator in STUDIED if reading == readings[0] else STUDIED[:1]:
                found, lost = _estimates(model, base, integrator, estimation, seeds)
                about = {"system": name, "reading": reading, **integrator.plain()}
                counts = {"seeds": len(seeds), "diverged": len(lost), "diverged_seeds": ", ".join(lost)}
                pairs = [pair for pair in zip(fine, found, strict=True) if all(pair)]
                parts = [_errors(key, truth[key], pairs) for key in (pairs[0][0] if pairs else ()) if key in truth]
                rows += [{**about, **part, **counts} for part in parts or [NOTHING_FOUND]]
    return pd.DataFrame(rows)


def _estimates(
    model: Model, record: RecordSettings, integrator: IntegratorSettings, estimation: Settings, seeds: Sequence[int]
) -> tuple[list[Estimates], list[str]]:
    """Parameters by seed, none where the run diverges, and which seeds those are, each with the time."""
    stepped = record.model_copy(update={"integrator": integrator})

    def run(seed: int) -> tuple[Estimates, str]:
        try:
            simulated = make_record(model, stepped, seed=seed)
        except DivergenceError as error:
            return {}, f"{seed} at {error.time:.4g} s"
        return {p.name: p.value for p in miso(model, simulated, estimation).parameters}, ""

    runs = list(side_by_side(run, seeds))
    return [values for values, _ in runs], [lost for _, lost in runs if lost]


def _errors(name: str, true: float, pairs: Sequence[tuple[Estimates, Estimates]]) -> dict[str, Any]:
    both = [(fine[name], found[name]) for fine, found in pairs if name in fine and name in found]
    fine = np.array([f for f, _ in both])
    error = np.array([found for _, found in both]) - fine
    mean = float(np.mean(error))
    return {
        "parameter": name, "true": true, "fine": float(np.mean(fine)), "mean_error": mean,
        "standard_error": float(np.std(error, ddof=1) / math.sqrt(len(error))) if len(error) > 1 else math.nan,
        "relative_error": mean / true if true != 0.0 else math.nan,
    }  # fmt: skip
