"""Is a candidate's coefficient a constant? A true term's is; that of a term which imitates another is not.

Measured in the response, free of the bias that noise on the motion brings: the sensitivity S(t) of the
free run to the coefficient is held against the residual e(t) in bands of frequency and in classes of
amplitude, ``delta = sum(S* e) / sum(S* S)``: by how much the coefficient would have to change there.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft, rfftfreq
from scipy.special import chdtrc

from study.equations.model import ModelTerm
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.support.arrays import Complexes, Floats
from study.support.least_squares import length_or_one
from study.support.thresholds import ALPHA, TOLERANCE

LEAST_ALONE = 1e-6
FREQUENCY_BANDS = 8
AMPLITUDE_CLASSES = 4
BLOCK = 64  # samples: long against a period, short against the swell of the amplitude


@dataclass(frozen=True)
class CoefficientCurve:
    """A coefficient along something."""

    at: Floats  # centre frequency in Hz, or amplitude relative to the mean; shape (n,)
    value: Complexes  # the coefficient there (real along amplitude); shape (n,)
    error: Floats  # standard error of its real part; shape (n,)

    def p_value(self) -> float:
        """Probability of values as different as these if the coefficient were a constant (chi square)."""
        weight = 1.0 / np.maximum(self.error, 1e-300) ** 2
        mean = np.sum(weight * self.value.real) / np.sum(weight)
        return float(chdtrc(max(len(self.value) - 1, 1), np.sum(weight * (self.value.real - mean) ** 2)))

    def spread(self) -> float:
        """Root mean square deviation from the mean that its errors do not account for, relative to it."""
        weight = 1.0 / np.maximum(self.error, 1e-300) ** 2
        mean = np.sum(weight * self.value.real) / np.sum(weight)
        beyond = np.abs(self.value - mean) ** 2 - 2.0 * self.error**2
        share = np.sqrt(max(float(np.sum(weight * beyond) / np.sum(weight)), 0.0))
        return float(share / abs(mean)) if mean != 0.0 else np.inf


def along_frequency(sensitivity: Floats, residual: Floats, coefficient: float, dt: float) -> CoefficientCurve:
    """The coefficient in bands that hold equal shares of the sensitivity's power."""
    taper = np.hanning(len(residual))
    s, e = np.asarray(rfft(sensitivity * taper)), np.asarray(rfft(residual * taper))
    power = np.abs(s) ** 2
    edges = _equal_shares(power, FREQUENCY_BANDS)
    frequency = np.asarray(rfftfreq(len(residual), dt))
    rows = [_band(s[a:b], e[a:b], frequency[a:b]) for a, b in pairwise(edges) if b - a > 3]
    change = np.array([row[1] for row in rows], dtype=np.complex128)
    return CoefficientCurve(
        np.array([row[0] for row in rows]), coefficient + change, np.array([row[2] for row in rows])
    )


def _equal_shares(power: Floats, count: int) -> list[int]:
    """Edges of ``count`` stretches that hold equal shares of a power."""
    total: Floats = np.cumsum(power)
    inner = [int(np.searchsorted(total, float(total[-1]) * k / count)) for k in range(1, count)]
    return [0, *inner, len(power)]


def _band(s: Complexes, e: Complexes, frequency: Floats) -> tuple[float, complex, float]:
    power = float(np.sum(np.abs(s) ** 2))
    change = complex(np.vdot(s, e)) / power
    rest: Complexes = e - change * s
    error = np.sqrt(1.5 * float(np.mean(np.abs(rest) ** 2)) / 2.0 / power)  # 1.5: the taper joins lines
    return float(np.sum(np.abs(s) ** 2 * frequency) / power), change, float(error)


def along_amplitude(sensitivity: Floats, residual: Floats, coefficient: float) -> CoefficientCurve:
    """The coefficient in classes of blocks, from those where the effect is weak to those where it is strong."""
    count = len(residual) // BLOCK
    s = sensitivity[: count * BLOCK].reshape(count, BLOCK)
    e = residual[: count * BLOCK].reshape(count, BLOCK)
    own: Floats = np.sum(s**2, axis=1)
    cross: Floats = np.sum(s * e, axis=1)
    order: NDArray[np.intp] = np.argsort(own)
    edges = _equal_shares(own[order], AMPLITUDE_CLASSES)
    noise = _noise(own, cross)
    at, value, error = list[float](), list[float](), list[float]()
    for a, b in pairwise(edges):
        rows = order[a:b]
        power = float(np.sum(own[rows]))
        if len(rows) < 2 or power == 0.0:  # a stop that is not touched there
            continue
        change = float(np.sum(cross[rows])) / power
        scatter: Floats = cross[rows] - change * own[rows]
        at.append((float(np.mean(own[rows])) / float(np.mean(own))) ** 0.5)
        value.append(coefficient + change)
        error.append(max(float(np.sqrt(np.sum(scatter**2)) / power), float(np.sqrt(noise / power))))
    return CoefficientCurve(np.array(at), np.array(value, dtype=np.complex128), np.array(error))


def _noise(own: Floats, cross: Floats) -> float:
    """Mean square of the residual as all blocks show it: the scatter of a few strong ones may be small by chance."""
    change = float(np.sum(cross)) / float(np.sum(own))
    return float(np.mean((cross - change * own) ** 2 / np.maximum(own, np.finfo(float).tiny)))


def curves(
    fit: FreeRunFit, entry: ModelTerm, dt: float, jacobian: Floats
) -> tuple[CoefficientCurve | None, CoefficientCurve | None]:
    """The coefficient of a term in a fitted model along frequency, at the sensor that sees most of it, and amplitude.

    ``jacobian`` is :func:`linearise` of the fit. Along amplitude all sensors count, one after the other. None where the
    coefficient is zero, or the model's others could do all that it does.
    """
    columns = [fit.keys.index(s) for s in entry.symbols]
    direction = fit.values[columns]
    # a curve's coefficient is its largest change
    size = float(np.max(np.abs(direction)) if entry.term.variation else np.linalg.norm(direction))
    if size == 0.0:
        return None, None
    sensors = len(fit.outputs)
    own = jacobian[:, columns] @ (direction / size)
    others = np.delete(jacobian, columns, axis=1)
    others /= length_or_one(others)
    basis = np.linalg.qr(others)[0]
    alone = own - basis @ (basis.T @ own)
    if np.linalg.norm(alone) <= LEAST_ALONE * np.linalg.norm(own):
        return None, None
    each, left = alone.reshape(-1, sensors).T, fit.residual.reshape(-1, sensors).T
    most = int(np.argmax(np.sum(each**2, axis=1)))
    bands = along_frequency(each[most], left[most], size, dt)
    classes = along_amplitude(each.ravel(), left.ravel(), size)
    # A short record has not lines enough for a band, or not blocks enough for a class.
    return bands if len(bands.at) else None, classes if len(classes.at) else None


def changes(*along: CoefficientCurve | None) -> float:
    """The largest relative change of a coefficient along any of these; nan where it was followed along none."""
    return max((c.spread() for c in along if c is not None), default=math.nan)


def wavers(steady: CoefficientCurve | None, asked: int) -> bool:
    """Whether a coefficient, of so many that are asked for, moves with the amplitude, by more than integration does."""
    return steady is not None and steady.p_value() * asked < ALPHA and steady.spread() > TOLERANCE
