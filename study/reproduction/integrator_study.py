"""What the integrator's setting does to each recovered parameter.

Every record is made twice from one force: once by the setting under study, once finely. The difference of
the MI/SO estimates is the integrator's doing alone, free of the leakage that both share.
"""

import math
from collections.abc import Mapping, Sequence
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

Estimates = Mapping[str, float]
FINE = IntegratorSettings(method="rk4", steps_per_sample=16)
STUDIED = [IntegratorSettings(method=m, steps_per_sample=s) for m in ("abm4", "rk4") for s in (1, 2, 4, 8)]
NOTHING_FOUND = {"parameter": "", "true": math.nan, "fine": math.nan, "mean_error": math.nan,
                 "standard_error": math.nan, "relative_error": math.nan}  # fmt: skip


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
            fine, _ = _estimates(model, base, FINE, estimation, seeds)
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

    runs = threaded(run, seeds)
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
