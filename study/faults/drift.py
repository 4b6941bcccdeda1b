"""Drift: what is left at the slowest lines of a record, above those beside them.

A force that is missing acts on the structure at all frequencies below its resonance alike; an instrument that drifts
adds its own at the slowest.
"""

import numpy as np
from scipy.fft import dct, idct
from scipy.special import fdtrc

from study.faults.fault import DRIFT, Fault
from study.faults.leftover import FittedResidual
from study.records.prepared import FORCE, Prepared
from study.support.arrays import Floats
from study.support.thresholds import ALPHA, TOLERANCE

SLOWEST, BESIDE = 8, 32  # cosines, of half a period each more than the one before, that are held against the next
FEWEST = 256  # samples that show both


def drift(left: FittedResidual, asked: int) -> Fault | None:
    """A drift of the response, None where the slowest lines hold no more than those beside them.

    The F test of both groups of lines, of which a smooth spectrum makes independent numbers of one variance.
    """
    places, residual = _in_time(left)
    found = _slow_lines(residual, asked)
    if found is None:
        return None
    count, noise = found
    lines = np.asarray(dct(residual, norm="ortho"), dtype=np.float64)
    power = max(float(np.sum(lines[1 : count + 1] ** 2)) - count * noise, 0.0) / len(residual)
    if power <= (TOLERANCE * left.size) ** 2:
        return None
    waveform = slow_part(left, count)
    shown = waveform[places.astype(np.int64)]
    explained = 1.0 - float(np.sum((residual - shown) ** 2) / np.sum(residual**2))
    error = float(np.sqrt(noise / len(residual)))
    unit = left.prepared.record.units.get(left.prepared.response, "")
    return Fault(DRIFT, left.prepared.response, float(np.sqrt(power)), error, unit, explained, waveform)


def slow_response(prepared: Prepared, asked: int) -> Fault | None:
    """The slowest lines of the response itself, where they hold more than those beside them and the force's do not.

    A drift larger than the motion takes the coefficients with it: a mass almost without a spring follows any ramp. What
    is said of it here, the mean included, is no more than where a fit that does not follow it may begin.
    """
    spans = prepared.plan.fit, prepared.plan.judge
    places = np.unique(np.concatenate([np.arange(*span) for span in spans])).astype(np.float64)
    values, force = (prepared.record[name][places.astype(np.int64)] for name in (prepared.response, FORCE))
    if _slow_lines(values, asked) is None or _slow_lines(force, asked) is not None:
        return None
    waveform = _slow(places, values, SLOWEST, len(prepared.record)) + np.mean(values)
    return Fault(DRIFT, prepared.response, float(np.std(waveform)), waveform=waveform)


def mean_response(prepared: Prepared) -> Fault:
    """The mean of the response, where a fit that cannot follow it may begin; as a drift that stays the same."""
    mean = float(np.mean(np.concatenate([prepared.fitted, prepared.judged])))
    return Fault(DRIFT, prepared.response, mean, waveform=np.full(len(prepared.record), mean))


def _slow_lines(values: Floats, asked: int) -> tuple[int, float] | None:
    """How many of the slowest lines stand above the next, and the mean power of these; None without any."""
    if len(values) < FEWEST:
        return None
    lines = np.asarray(dct(values, norm="ortho"), dtype=np.float64)
    if _p_value(lines, 1, SLOWEST, BESIDE) * asked >= ALPHA:
        return None
    count = _extent(lines, ALPHA)
    return count, float(np.mean(lines[count + 1 : 3 * count + SLOWEST + 1] ** 2))


def slow_part(left: FittedResidual, count: int) -> Floats:
    """The ``count`` slowest cosines of a residual along the whole record, without their mean, shape (n,)."""
    return _slow(*_in_time(left), count, len(left.prepared.record))


def _slow(places: Floats, values: Floats, count: int, length: int) -> Floats:
    """The slowest cosines of values at these places; a straight line bridges what lies between the parts."""
    first, last = int(places[0]), int(places[-1])
    lines = np.asarray(dct(np.interp(np.arange(first, last + 1), places, values), norm="ortho"), dtype=np.float64)
    lines[0], lines[count + 1 :] = 0.0, 0.0
    return np.pad(np.asarray(idct(lines, norm="ortho"), dtype=np.float64), (first, length - 1 - last), "edge")


def _in_time(left: FittedResidual) -> tuple[Floats, Floats]:
    """Places and residual of both parts in the order of time."""
    places, residual = np.concatenate(left.samples), np.concatenate(left.residual)
    order = np.argsort(places)
    return places[order], residual[order]


def _p_value(lines: Floats, first: int, last: int, beside: int) -> float:
    """Of the mean power of lines ``first`` to ``last`` over that of the ``beside`` after them."""
    own, next_to = lines[first : last + 1] ** 2, lines[last + 1 : last + 1 + beside] ** 2
    level = float(np.mean(next_to))
    return float(fdtrc(len(own), len(next_to), float(np.mean(own)) / level)) if level > 0.0 else 1.0


def _extent(lines: Floats, level: float) -> int:
    """Lines that the drift reaches: doubled while their faster half stands above those after it."""
    count = SLOWEST
    while 4 * count < len(lines) // 8 and _p_value(lines, count // 2 + 1, count, 2 * count) < level:
        count *= 2
    return count
