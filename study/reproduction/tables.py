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
from study.identify.frequency_domain.inputs import Input
from study.reproduction.settings import IdentificationSettings
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


def parameters(
    case: str, model: Model, found: Mapping[str, Identified], settings: IdentificationSettings
) -> pd.DataFrame:
    """Every parameter of every estimator, one row each (``PARAMETER_COLUMNS``).

    ``tolerance`` is relative where the true value is not zero; where it is zero there is no relative
    error, and ``tolerance`` is absolute, in the parameter's own unit. ``note`` is the estimator's, such as
    that its search did not converge.
    """
    truth = true_parameters(model.values)
    rows: list[dict[str, Any]] = []
    for estimator, identified in found.items():
        for parameter in identified.parameters:
            true = truth.get(parameter.name, 0.0)
            if parameter.name in ("f_n", "zeta") and parameter.name not in truth:
                continue  # a system without stiffness has neither
            judged = judge(parameter.name, true, parameter.value, settings)
            rows.append(
                {"case": case, "estimator": estimator, "parameter": parameter.name, "true": true,
                 "estimate": parameter.value, "standard_error": parameter.error, **judged, "note": identified.note}
            )  # fmt: skip
    return pd.DataFrame(rows, columns=PARAMETER_COLUMNS)


def judge(name: str, true: float, estimate: float, settings: IdentificationSettings) -> dict[str, Any]:
    """Relative error, tolerance and verdict of one estimate."""
    if true != 0.0:
        error, tolerance = (estimate - true) / true, settings.relative.get(name, math.nan)
        return {"relative_error": error, "tolerance": tolerance, "within_tolerance": abs(error) <= tolerance}
    tolerance = settings.absolute.get(name, math.nan)
    return {"relative_error": math.nan, "tolerance": tolerance, "within_tolerance": abs(estimate) <= tolerance}


def frequency_responses(model: Model, found: Mapping[str, Identified]) -> pd.DataFrame:
    """A_j(f) of each estimator that has it, with its standard error and the exact function, in long form."""
    values = {key: value for key, value in model.values.items() if value is not None}
    frames: list[pd.DataFrame] = []
    for estimator, identified in found.items():
        result = identified.responses
        if result is None:
            continue
        for j, item in enumerate(identified.inputs):
            exact = item.response(result.frequency, values)
            frames.append(
                pd.DataFrame(
                    {
                        "frequency": result.frequency,
                        "estimator": estimator,
                        "input": j + 1,
                        "shape": item.shape,
                        "real": result.response[j].real,
                        "imag": result.response[j].imag,
                        "standard_error": np.sqrt(result.covariance[:, j, j].real),
                        "exact_real": exact.real,
                        "exact_imag": exact.imag,
                    }
                )
            )
    return _together(frames, RESPONSE_COLUMNS)


def coherences(found: Mapping[str, Identified]) -> pd.DataFrame:
    """Ordinary, partial, nonlinear and cumulative coherence of each input, in long form; some estimators have none."""
    frames: list[pd.DataFrame] = []
    for estimator, identified in found.items():
        result = identified.analysis or identified.responses
        if not isinstance(result, MisoResult):
            continue
        for j, item in enumerate(identified.inputs):
            frames.append(
                pd.DataFrame(
                    {
                        "frequency": result.frequency,
                        "estimator": estimator,
                        "input": j + 1,
                        "shape": item.shape,
                        "terms": label(item),
                        "ordinary": result.ordinary[j],
                        "partial": result.partial[j],
                        "contribution": result.contribution[j],
                        "cumulative": result.cumulative[j],
                    }
                )
            )
    return _together(frames, COHERENCE_COLUMNS)


def noise_spectra(found: Mapping[str, Identified]) -> pd.DataFrame:
    """G_nn of each estimator that has it, what its inputs leave of the force (4.44), in N^2/Hz, in long form."""
    frames = [
        pd.DataFrame({"frequency": result.frequency, "estimator": estimator, "noise": result.noise})
        for estimator, result in ((name, identified.responses) for name, identified in found.items())
        if result is not None
    ]
    return _together(frames, NOISE_COLUMNS)


def _together(frames: Sequence[pd.DataFrame], columns: list[str]) -> pd.DataFrame:
    """One table of all; with a heading alone where no estimator has such a thing."""
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=columns)


def label(item: Input) -> str:
    """The terms that an input carries, in words."""
    return " + ".join(name.replace("_", " ") for name in item.terms)


def write_csv(table: pd.DataFrame, path: Path) -> None:
    """Write a table with twelve significant digits: more than any estimate has, fewer than rounding has."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as beside:
        table.to_csv(beside, index=False, float_format="%.12g", lineterminator="\n")
