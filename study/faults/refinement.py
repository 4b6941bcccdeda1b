"""The value of a fault that one number describes, found together with the model's own coefficients."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.faults import adjustable
from study.faults.correction import corrected
from study.faults.drift import slow_part
from study.faults.fault import DELAY, HIGH_PASS, HUM, Fault
from study.faults.hum import hum
from study.faults.leftover import FittedResidual, amounts_on_both, leftover
from study.faults.physics import refitted
from study.records.prepared import Prepared
from study.support import statistics
from study.support.thresholds import TOLERANCE

STEPS = 8  # of Gauss and Newton
FAR_APART = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)  # samples
NEAR = 0.05  # standard errors: as near the value as the search has to come


@dataclass(frozen=True, eq=False)
class Refined:
    """A fault with its value, and what the model leaves of the record that is corrected for it."""

    fault: Fault
    left: FittedResidual


def refined(
    name: str, given: Prepared, faults: Sequence[Fault], left: FittedResidual, value: float = 0.0
) -> Refined | None:  # fmt: skip
    """Search a fault's value by correcting the record, fitting the model again and correcting what is left of it.

    ``faults`` are those that ``left`` is corrected for already, besides this one with ``value``. None where the search
    leaves what is sensible, or the model does not run.
    """
    if name == HUM:
        line = hum(left, 1)
        return None if line is None else _corrected(line, given, faults, left)
    before = left
    if name == DELAY and value == 0.0:
        value, left = _coarse(given, faults, left)
    for _ in range(STEPS):
        amounts, covariance = amounts_on_both(left, adjustable.fault_columns(name, left, value))
        step, error = float(amounts[0]), math.sqrt(max(float(covariance[0, 0]), 0.0))
        value += step
        if not adjustable.sensible(name, value, left):
            return None
        response = given.response
        unit = adjustable.unit(name, given.record.units.get(response, ""))
        one = _corrected(Fault(name, response, value, error, unit), given, faults, left)
        if one is None:
            return None
        left = one.left
        if abs(step) <= NEAR * error:
            break
    if relative_power(left) >= relative_power(before):
        return None
    explained = statistics.gain(before.residual[1], left.residual[1]).explained
    found = one.fault  # pyright: ignore[reportPossiblyUnboundVariable]
    error = math.hypot(found.error, TOLERANCE * found.value)  # the model and its integration are no nearer than that
    return Refined(replace(found, explained=explained, error=error), left)


def _coarse(given: Prepared, faults: Sequence[Fault], left: FittedResidual) -> tuple[float, FittedResidual]:
    """Where the search for a delay begins: at zero, or at the best of some whole samples if it is more than a part.

    A model that is fitted to a record late by a good part of a period finds a minimum of its own.
    """
    step = float(amounts_on_both(left, adjustable.fault_columns(DELAY, left))[0][0])
    best = 0.0, left
    for late in FAR_APART if abs(step) > 0.5 else ():
        tried = _left(given, (*faults, Fault(DELAY, given.response, late)), left)
        if tried is not None and relative_power(tried) < relative_power(best[1]):
            best = late, tried
    return best


def relative_power(left: FittedResidual) -> float:
    """Power of what is left over that of the response: a correction of the gain scales both."""
    measured = left.prepared.fitted, left.prepared.judged
    return sum(float(np.sum(r**2)) / float(np.sum(m**2)) for r, m in zip(left.residual, measured, strict=True))


def _corrected(fault: Fault, given: Prepared, faults: Sequence[Fault], left: FittedResidual) -> Refined | None:
    """A fault of this value, and what the model leaves when it is corrected."""
    again = _left(given, (*faults, fault), left)
    if again is None or fault.fault != HIGH_PASS:
        return None if again is None else Refined(fault, again)
    # What a coupling has taken away below its cut-off cannot come back: only noise would.
    length = len(given.record) * given.dt
    slow = slow_part(again, int(np.ceil(2.0 * fault.value * length)))
    whole = replace(fault, waveform=slow + float(np.mean(np.concatenate(again.residual))))
    final = _left(given, (*faults, whole), again)
    return None if final is None else Refined(whole, final)


def _left(given: Prepared, faults: Sequence[Fault], left: FittedResidual) -> FittedResidual | None:
    prepared = corrected(given, faults)
    fit = refitted(left.fit, prepared)
    return None if fit is None else leftover(fit, prepared)
