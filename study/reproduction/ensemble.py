"""Many seeds of one case at once, on every core."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import pandas as pd

from study.equations.model import Model
from study.reproduction import tables
from study.reproduction.identify_case import identify_case
from study.reproduction.make_record import make_record
from study.reproduction.settings import IdentificationSettings, RecordSettings
from study.support.cores import cores
from study.support.errors import DivergenceError

T = TypeVar("T")
S = TypeVar("S")
WANTED = 0.99  # of the seeds, for each noise-free parameter
NOISE_OFFSET = 1_000_000  # noise seeds stand apart from force seeds


def threaded(
    work: Callable[[S], T],
    items: Sequence[S],
    progress: Callable[[int], None] | None = None,
    workers: int | None = None,
) -> list[T]:
    """Results of ``work`` for each item, in order; the kernels and the FFT release the interpreter lock.

    ``progress`` is called with the number of items done; ``workers`` is the number of threads, as many
    as there are cores for this process where it is left out.
    """
    done: list[T] = []
    with ThreadPoolExecutor(workers or cores()) as pool:
        for result in pool.map(work, items):
            done.append(result)
            if progress is not None:
                progress(len(done))
    return done


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

    return pd.concat([f for f in threaded(one, list(seeds), progress, workers) if len(f)], ignore_index=True)


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


def ensemble_page(table: pd.DataFrame, noise: Mapping[str, float]) -> str:
    """What :func:`tolerance_rates` found: which MI/SO estimates of noise-free cases meet their tolerance too seldom.

    ``noise`` is that of each case.
    """
    own = table[(table["estimator"] == "miso") & (table["case"].map(noise) == 0.0)]
    low = own[own["within_tolerance"] < WANTED].sort_values("within_tolerance")
    lines = [
        "# How often each tolerance is met",
        "",
        f"{len(own) - len(low)} of {len(own)} MI/SO estimates of noise-free cases meet their tolerance in at least "
        f"{100.0 * WANTED:g} % of {int(table['seeds'].max())} seeds.",
    ]
    for _, row in low.iterrows():
        rate, error = 100.0 * row["within_tolerance"], 100.0 * row["rate_error"]
        lines.append(f"- {row['case']}: {row['parameter']} in {rate:.1f} ± {error:.1f} %")
    for name, group in table[table["case"].map(noise) == 0.0].groupby("estimator", sort=False):
        if name != "miso":
            met = int((group["within_tolerance"] >= WANTED).sum())
            lines.append(f"- beside it, {str(name).replace('_', ' ')}: {met} of {len(group)} do")
    return "\n".join(lines) + "\n"
