"""Columns of what shows a test of its kind and of the checks of the residual, for the panels of ``check_plots``."""

import math

import numpy as np

from study.compare.comparison import Comparison
from study.compare.decay import decays_of
from study.compare.loops import loops
from study.compare.residual_checks import OwnChecks, ResidualChecks, residual_checks
from study.compare.response_functions import response_functions
from study.explore.axis_scales import Columns, Floats, Scales, heard
from study.explore.decimate import BUCKETS
from study.records.prepared import FORCE, Prepared

NINETY_FIVE = 1.96  # standard errors to each side
DRIVEN, PRESCRIBED, FREE = "driven", "prescribed", "free"


def kind_of(prepared: Prepared) -> str:
    """What those who run such a test look at: response functions, loops too, or frequency and damping by amplitude."""
    return PRESCRIBED if prepared.response == FORCE else FREE if prepared.free else DRIVEN


def columns(comparison: Comparison, scales: Scales) -> dict[str, Columns]:
    """By the name of their source, in the units of the axes."""
    kind = kind_of(comparison.prepared)
    shown = _decay(comparison, scales) if kind == FREE else {"frf": _functions(comparison, scales)}
    return shown | (_loops(comparison, scales) if kind == PRESCRIBED else {}) | _checks(comparison)


def _decay(comparison: Comparison, scales: Scales) -> dict[str, Columns]:
    """Frequency and damping ratio in per cent against amplitude; nothing where the decay is too short for them."""
    found = decays_of(comparison)
    shown: dict[str, Columns] = {}
    for name, one in (("decay", found and found.measured), ("decay_model", found and found.predicted)):
        rows = np.zeros((5, 0)) if not one else np.array(
            [one.amplitude, one.frequency, one.damping, one.frequency_error, one.damping_error]
        )  # fmt: skip
        at, frequency, damping, *errors = rows[:, np.argsort(rows[0])]
        half = [NINETY_FIVE * e for e in errors]
        shown[name] = {
            "at": at / scales.response.factor, "frequency": frequency, "frequency_low": frequency - half[0],
            "frequency_high": frequency + half[0], "damping": 100.0 * damping,
            "damping_low": 100.0 * (damping - half[1]), "damping_high": 100.0 * (damping + half[1]),
        }  # fmt: skip
    return shown


def _loops(comparison: Comparison, scales: Scales) -> dict[str, Columns]:
    """Force, measured and predicted, beside the motion that was prescribed; and what each cycle takes of energy."""
    prediction, prepared = comparison.prediction.of(0), comparison.prepared
    part = prepared.record.part(*prepared.plan.judge)
    some = slice(None, None, -(-len(part) // (2 * BUCKETS)))  # dots: a loop is as well seen in every second of them
    found = loops(comparison.prediction)
    energy = scales.response.factor * scales.displacement.factor
    return {
        "loops": {
            "u": part["displacement"][some] / scales.displacement.factor,
            "v": part["velocity"][some] / scales.velocity.factor,
            "measured": prediction.measured[some] / scales.response.factor,
            "predicted": prediction.predicted[some] / scales.response.factor,
        },
        "cycles": {
            "stroke": found.stroke / scales.displacement.factor, "measured": found.measured / energy,
            "predicted": found.predicted / energy,
        },
    }  # fmt: skip


def _functions(comparison: Comparison, scales: Scales) -> Columns:
    found = response_functions(comparison.prediction)
    keep, size = heard(comparison, found.frequency), scales.response.factor
    if kind_of(comparison.prepared) == PRESCRIBED:
        size /= scales.displacement.factor
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
    return by_itself(found) | {
        "with_force": {"lag": found.lag_force, "value": found.with_force},
        "with_force_band": _band(found.lag_force, found.band_force),
    }


def by_itself(found: OwnChecks | ResidualChecks) -> dict[str, Columns]:
    """Autocorrelation and distribution of a residual, by the name of their source."""
    normal = np.linspace(float(found.edges[0]), float(found.edges[-1]), 81).astype(np.float64)
    return {
        "autocorrelation": {"lag": found.lag, "value": found.autocorrelation},
        "autocorrelation_band": _band(found.lag, found.band),
        "histogram": {"left": found.edges[:-1], "right": found.edges[1:], "top": found.counts},
        "normal": {"x": normal, "y": np.exp(-0.5 * normal**2) / math.sqrt(2.0 * math.pi)},
    }


def _band(lag: Floats, level: float) -> Columns:
    """Two horizontal lines."""
    ends = [float(lag[0]), float(lag[-1])]
    return {"lag": [ends, ends], "level": [[level, level], [-level, -level]]}
