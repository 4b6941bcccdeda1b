"""Tables: what was estimated beside what is true, the tolerance, and the verdict."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from study.equations.model import Model
from study.identify.estimators.base import Identified, true_parameters
from study.identify.frequency_domain.conditioned import MisoResult
from study.reproduction.settings import AllowedErrors, IdentificationSettings
from study.support.files import replacing

PARAMETER_COLUMNS = [
    "case", "estimator", "parameter", "true", "estimate", "standard_error",
    "relative_error", "tolerance", "within_tolerance", "note",
]  # fmt: skip
RESPONSE_COLUMNS = [
    "frequency", "estimator", "input", "shape", "real", "imag", "standard_error", "exact_real", "exact_imag",
]  # fmt: skip
COHERENCE_COLUMNS = [
    "frequency", "estimator", "input", "shape", "terms", "ordinary", "partial", "contribution", "cumulative",
]  # fmt: skip
NOISE_COLUMNS = ["frequency", "estimator", "noise"]


def parameter_table(
    case: str, model: Model, estimates: Mapping[str, Identified], settings: IdentificationSettings
) -> pd.DataFrame:
    """Every parameter of every estimator, one row each (``PARAMETER_COLUMNS``).

    ``tolerance`` is relative where the true value is not zero; where it is zero there is no relative
    error, and ``tolerance`` is absolute, in the parameter's own unit. ``note`` is the estimator's, such as
    that its search did not converge.
    """
    truth = true_parameters(model.values)
    rows: list[tuple[Any, ...]] = []
    for estimator, identified in estimates.items():
        for name, value, error in ((p.name, p.value, p.error) for p in identified.parameters):
            if name in ("f_n", "zeta") and name not in truth:
                continue  # a system without stiffness has neither
            true = truth.get(name, 0.0)
            judged = judge_estimate(name, true, value, settings).values()
            rows.append((case, estimator, name, true, value, error, *judged, identified.note))
    return pd.DataFrame(rows, columns=PARAMETER_COLUMNS)


def judge_estimate(name: str, true: float, estimate: float, settings: AllowedErrors) -> dict[str, Any]:
    """Relative error, tolerance and verdict of one estimate."""
    relative = (estimate - true) / true if true else math.nan
    tolerance = (settings.relative if true else settings.absolute).get(name, math.nan)
    within = abs(relative if true else estimate) <= tolerance
    return {"relative_error": relative, "tolerance": tolerance, "within_tolerance": within}


def response_table(model: Model, estimates: Mapping[str, Identified]) -> pd.DataFrame:
    """A_j(f) of each estimator that has it, with its standard error and the exact function, in long form."""
    values = {key: value for key, value in model.values.items() if value is not None}
    parts: list[Sequence[Any]] = []
    for estimator, identified in estimates.items():
        result = identified.responses
        if result is None:
            continue
        for j, item in enumerate(identified.inputs):
            exact, response = item.response(result.frequency, values), result.response[j]
            error = np.sqrt(result.covariance[:, j, j].real)
            parts.append(
                (result.frequency, estimator, j + 1, item.shape, response.real, response.imag, error, exact.real,
                 exact.imag)
            )  # fmt: skip
    return stacked(RESPONSE_COLUMNS, parts)


def coherence_table(estimates: Mapping[str, Identified]) -> pd.DataFrame:
    """Ordinary, partial, nonlinear and cumulative coherence of each input, in long form; some estimators have none."""
    parts: list[Sequence[Any]] = []
    for estimator, identified in estimates.items():
        result = identified.analysis or identified.responses
        if not isinstance(result, MisoResult):
            continue
        for j, item in enumerate(identified.inputs):
            terms = " + ".join(name.replace("_", " ") for name in item.terms)
            parts.append(
                (result.frequency, estimator, j + 1, item.shape, terms, result.ordinary[j], result.partial[j],
                 result.contribution[j], result.cumulative[j])
            )  # fmt: skip
    return stacked(COHERENCE_COLUMNS, parts)


def noise_spectra(estimates: Mapping[str, Identified]) -> pd.DataFrame:
    """G_nn (4.44), the autospectrum of the residual force of each estimator that has one, in N^2/Hz, in long form."""
    results = {estimator: identified.responses for estimator, identified in estimates.items()}
    return stacked(NOISE_COLUMNS, [(r.frequency, name, r.noise) for name, r in results.items() if r is not None])


def stacked(columns: list[str], parts: Sequence[Sequence[Any]]) -> pd.DataFrame:
    """One table of all parts, each a value or an array per column; a heading alone where there is no part."""
    frames = [pd.DataFrame(dict(zip(columns, part, strict=True))) for part in parts]
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=columns)


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write a table with twelve significant digits: more than any estimate has, fewer than rounding has."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as beside:
        table.to_csv(beside, index=False, float_format="%.12g", lineterminator="\n")
