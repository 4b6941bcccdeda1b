"""What the integrator's setting does to each recovered parameter.

Every record is made twice from one force: once by the setting under study, once finely. The difference of
the MI/SO estimates is the integrator's doing alone, free of the leakage that both share.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from study.equations.model import Model
from study.identify.estimators.base import Settings, true_parameters
from study.identify.estimators.in_reverse import miso
from study.reproduction.cases import make_record
from study.reproduction.ensemble import threaded
from study.reproduction.settings import IntegratorSettings, RecordSettings
from study.support.errors import DivergenceError

Table = Mapping[str, Any]
FINE = IntegratorSettings(method="rk4", steps_per_sample=16)
STUDIED = [IntegratorSettings(method=m, steps_per_sample=s) for m in ("abm4", "rk4") for s in (1, 2, 4, 8)]


@dataclass(frozen=True)
class IntegratorRun:
    """Parameters that one record gives, or the time at which it diverged."""

    values: Mapping[str, float]
    diverged: float | None = None


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
        for reading in readings:
            excitation = record.excitation.model_copy(update={"reading": reading})
            base = record.model_copy(update={"excitation": excitation})
            fine = _runs(model, base, FINE, estimation, seeds)
            for integrator in STUDIED if reading == readings[0] else STUDIED[:1]:
                runs = _runs(model, base, integrator, estimation, seeds)
                about = {"system": name, "reading": reading, **integrator.plain()}
                rows += _rows(about, true_parameters(model.values), fine, runs, seeds)
    return pd.DataFrame(rows)


def _runs(
    model: Model, record: RecordSettings, integrator: IntegratorSettings, estimation: Settings, seeds: Iterable[int]
) -> list[IntegratorRun]:
    stepped = record.model_copy(update={"integrator": integrator})

    def run(seed: int) -> IntegratorRun:
        try:
            simulated = make_record(model, stepped, seed=seed)
        except DivergenceError as error:
            return IntegratorRun({}, error.time)
        return IntegratorRun({p.name: p.value for p in miso(model, simulated, estimation).parameters})

    return threaded(run, list(seeds))


def _rows(
    about: Table, truth: Table, fine: list[IntegratorRun], runs: list[IntegratorRun], seeds: Sequence[int]
) -> list[dict[str, Any]]:
    lost = [f"{s} at {r.diverged:.4g} s" for s, r in zip(seeds, runs, strict=True) if r.diverged is not None]
    kept = [(f.values, r.values) for f, r in zip(fine, runs, strict=True) if f.values and r.values]
    names = [n for n in kept[0][0] if n in truth] if kept else []
    nothing = dict.fromkeys(("true", "fine", "mean_error", "standard_error", "relative_error"), math.nan)
    parts = [{"parameter": n, **_errors(n, truth[n], kept)} for n in names] or [{"parameter": "", **nothing}]
    counts = {"seeds": len(seeds), "diverged": len(lost), "diverged_seeds": ", ".join(lost)}
    return [{**about, **part, **counts} for part in parts]


def _errors(name: str, true: float, kept: list[tuple[Mapping[str, float], Mapping[str, float]]]) -> dict[str, float]:
    pairs = [(f[name], r[name]) for f, r in kept if name in f and name in r]
    fine = np.array([f for f, _ in pairs])
    error = np.array([r for _, r in pairs]) - fine
    mean = float(np.mean(error))
    return {
        "true": true, "fine": float(np.mean(fine)), "mean_error": mean,
        "standard_error": float(np.std(error, ddof=1) / math.sqrt(len(error))) if len(error) > 1 else math.nan,
        "relative_error": mean / true if true != 0.0 else math.nan,
    }  # fmt: skip
