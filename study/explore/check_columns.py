"""Columns of what shows a test of its kind and of the checks of the residual, for the panels of ``plots``."""

import math

import numpy as np

from study.compare.comparison import Comparison
from study.compare.decay import decays_of
from study.compare.loops import loops
from study.compare.residual_checks import residual_checks
from study.compare.response_functions import response_functions
from study.explore.axis_scales import Columns, Focus, heard
from study.explore.decimate import BUCKETS
from study.records.prepared import FORCE
from study.support.arrays import Floats

NINETY_FIVE = 1.96  # standard errors to each side
DRIVEN, PRESCRIBED, FREE = "driven", "prescribed", "free"


def kind_of(comparison: Comparison) -> str:
    """What those who run such a test look at: response functions, loops too, or frequency and damping by amplitude."""
    prepared = comparison.prepared
    return PRESCRIBED if prepared.response == FORCE else FREE if prepared.free else DRIVEN


def columns(focus: Focus) -> dict[str, Columns]:
    """Those of the sensor that is looked at by the name of their source, in the units of the axes."""
    kind = kind_of(focus.comparison)
    shown = _decay(focus) if kind == FREE else {"frf": _functions(focus, kind)}
    return shown | (_loops(focus) if kind == PRESCRIBED else {}) | _checks(focus)


def _decay(focus: Focus) -> dict[str, Columns]:
    """Frequency and damping ratio in per cent against amplitude; nothing where the decay is too short for them."""
    found = decays_of(focus.comparison, focus.number)
    shown: dict[str, Columns] = {}
    for name, one in (("decay", found and found.measured), ("decay_model", found and found.predicted)):
        rows = np.zeros((5, 0)) if not one else np.array(
            [one.amplitude, one.frequency, one.damping, one.frequency_error, one.damping_error]
        )  # fmt: skip
        at, frequency, damping, *errors = rows[:, np.argsort(rows[0])]
        half = [NINETY_FIVE * e for e in errors]
        shown[name] = {
            "at": at / focus.response.factor, "frequency": frequency, "frequency_low": frequency - half[0],
            "frequency_high": frequency + half[0], "damping": 100.0 * damping,
            "damping_low": 100.0 * (damping - half[1]), "damping_high": 100.0 * (damping + half[1]),
        }  # fmt: skip
    return shown


def _loops(focus: Focus) -> dict[str, Columns]:
    """Force, measured and predicted, beside the motion that was prescribed; and what each cycle takes of energy."""
    seen, found = focus.sensor, loops(focus.comparison, focus.number)
    some = slice(None, None, -(-len(seen.measured) // (2 * BUCKETS)))  # dots: a loop is as well seen in some of them
    along, size = focus.displacement.factor, focus.response.factor
    return {
        "loops": {
            "u": found.displacement[some] / along, "v": found.velocity[some] / focus.velocity.factor,
            "measured": seen.measured[some] / size, "predicted": seen.predicted[some] / size,
        },
        "cycles": {
            "stroke": found.stroke / along, "measured": found.measured / (size * along),
            "predicted": found.predicted / (size * along),
        },
    }  # fmt: skip


def _functions(focus: Focus, kind: str) -> Columns:
    found = response_functions(focus.comparison.prediction, focus.number)
    keep, size = heard(focus.comparison, found.frequency), focus.response.factor
    if kind == PRESCRIBED:
        size /= focus.displacement.factor
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


def _checks(focus: Focus) -> dict[str, Columns]:
    """Autocorrelation and distribution of the residual, and its correlation with the force."""
    found = residual_checks(focus.comparison.prediction, focus.number)
    normal = np.linspace(float(found.edges[0]), float(found.edges[-1]), 81).astype(np.float64)
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
