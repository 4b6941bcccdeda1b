"""Faults that one number describes: how the response changes with it, and how a channel is rid of it."""

from collections.abc import Callable

import numpy as np

from study.faults.fault import DELAY, GAIN_CHANGE, HIGH_PASS, OFFSET
from study.faults.imposed import high_passed, shifted
from study.faults.leftover import FittedResidual
from study.records.completion import derivative
from study.records.states import angular_rate
from study.support.arrays import Floats

FIRST = 0.02  # of the motion's own frequency: the cut-off at which a high-pass is first looked for
ADJUSTABLE = (DELAY, GAIN_CHANGE, OFFSET, HIGH_PASS)
Columns = tuple[Floats, Floats]


def unit(fault: str, response_unit: str) -> str:
    """Unit of a fault's value."""
    return {DELAY: "samples", GAIN_CHANGE: "1", HIGH_PASS: "Hz"}.get(fault, response_unit)


def fault_columns(fault: str, left: FittedResidual, value: float = 0.0) -> Columns:
    """Derivative of the response by the fault's value on both parts, shapes (n, k) and (m, k); the first column.

    Others stand for what is not known of the channel at its first sample. ``value`` is what the record has been
    corrected for already.
    """
    fitted, judged = left.predicted
    if fault == OFFSET:
        return _upright(np.ones_like(fitted)), _upright(np.ones_like(judged))
    if fault == GAIN_CHANGE:
        last = max(len(left.prepared.record) - 1, 1)
        places = left.samples
        return _upright(fitted * places[0] / last), _upright(judged * places[1] / last)
    if fault == DELAY:
        dt = left.prepared.dt
        return _along(left, lambda motion: -dt * derivative(motion, dt, 1))
    cutoff = value or FIRST * angular_rate(fitted, left.prepared.dt) / (2.0 * np.pi)
    fall = np.exp(-2.0 * np.pi * cutoff * left.prepared.dt * np.arange(len(fitted)))
    first, second = _along(left, lambda motion: (high_passed(motion, cutoff, left.prepared.dt) - motion) / cutoff)
    return np.column_stack([first, fall]), np.column_stack([second, np.zeros(len(judged))])


def without_fault(fault: str, values: Floats, value: float, dt: float) -> Floats:
    """A channel without the fault, shape (n,)."""
    if fault == OFFSET:
        return values - value
    if fault == GAIN_CHANGE:
        return values / (1.0 + value * np.arange(len(values)) / max(len(values) - 1, 1))
    if fault == DELAY:
        return shifted(values, -value)
    half = np.pi * value * dt
    centred = values - np.mean(values)
    return np.cumsum((1.0 + half) * centred + (half - 1.0) * np.concatenate([[0.0], centred[:-1]]))


def sensible(fault: str, value: float, left: FittedResidual) -> bool:
    """Whether a value is one that the fault can have: a gain stays positive, a cut-off lies below half the rate."""
    if fault == GAIN_CHANGE:
        return -0.9 < value < 9.0
    if fault == HIGH_PASS:
        return 0.0 < value < 0.25 / left.prepared.dt
    if fault == DELAY:
        return abs(value) < 0.05 * len(left.fit.residual)
    return True


def _along(left: FittedResidual, change: Callable[[Floats], Floats]) -> Columns:
    """A linear change of the predicted response, along both parts at once where they follow each other."""
    fitted, judged = left.predicted
    if left.fit.span[1] != left.prepared.plan.judge[0]:
        return _upright(change(fitted)), _upright(change(judged))
    both = change(np.concatenate([fitted, judged]))
    return _upright(both[: len(fitted)]), _upright(both[len(fitted) :])


def _upright(values: Floats) -> Floats:
    return values[:, None]
