"""Columns of the response functions and of the checks of the residual, for the panels of ``check_plots``."""

import math

import numpy as np

from study.compare.comparison import Comparison
from study.compare.residual_checks import residual_checks
from study.compare.response_functions import response_functions
from study.explore.axis_scales import Columns, Floats, Scales, heard

NINETY_FIVE = 1.96  # standard errors to each side


def columns(comparison: Comparison, scales: Scales) -> dict[str, Columns]:
    """By the name of their source; magnitudes in the unit of the response's axis over that of the force."""
    return {"frf": _functions(comparison, scales), **_checks(comparison)}


def _functions(comparison: Comparison, scales: Scales) -> Columns:
    found = response_functions(comparison.prediction)
    keep, size = heard(comparison, found.frequency), scales.response.factor
    measured, predicted = (values[keep] / size for values in found.magnitude)
    half = NINETY_FIVE * found.error[keep] / size
    angles = [_gapped(values[keep]) for values in found.phase]
    return {
        "f": found.frequency[keep], "measured": measured, "predicted": predicted,
        "low": np.maximum(measured - half, 0.01 * measured), "high": measured + half, "phase": angles[0],
        "phase_predicted": angles[1], "coherence": found.coherence[keep],
        "coherence_predicted": found.coherence_predicted[keep],
    }  # fmt: skip


def _gapped(angle: Floats) -> Floats:
    """Degrees with a gap where they wrap."""
    gaps = np.concatenate([[False], np.abs(np.diff(angle)) > 180.0])[: len(angle)]
    return np.where(gaps, np.nan, angle)


def _checks(comparison: Comparison) -> dict[str, Columns]:
    found = residual_checks(comparison.prediction)
    normal = np.linspace(found.edges[0], found.edges[-1], 81)
    return {
        "autocorrelation": {"lag": found.lag, "value": found.autocorrelation},
        "autocorrelation_band": _band(found.lag, found.band),
        "with_force": {"lag": found.lag_force, "value": found.with_force},
        "with_force_band": _band(found.lag_force, found.band_force),
        "histogram": {"left": found.edges[:-1], "right": found.edges[1:], "top": found.counts},
        "normal": {"x": normal, "y": np.exp(-0.5 * normal**2) / math.sqrt(2.0 * math.pi)},
    }


def _band(lag: Floats, level: float) -> Columns:
    """Two horizontal lines."""
    ends = [float(lag[0]), float(lag[-1])]
    return {"lag": [ends, ends], "level": [[level, level], [-level, -level]]}
