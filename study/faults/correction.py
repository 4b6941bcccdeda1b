"""Faults that one number describes, and a record without the faults that were found.

How the response changes with such a number, how a channel is rid of it, and which samples say nothing.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from study.faults.fault import DELAY, GAIN_CHANGE, HIGH_PASS, OFFSET, Fault
from study.faults.imposed import high_passed, shifted
from study.faults.leftover import Columns, FittedResidual
from study.records.completion import derivative
from study.records.prepared import Prepared, prepare_record
from study.records.record import Record
from study.records.states import angular_rate
from study.support.arrays import Bools, Floats

FIRST = 0.02  # of the motion's own frequency: the cut-off at which a high-pass is first looked for
BESIDE = 2  # samples on either side of lost ones that a channel which is moved in time loses too


def unit_of(fault: str, response_unit: str) -> str:
    """Unit of a fault's value."""
    return {DELAY: "samples", GAIN_CHANGE: "1", HIGH_PASS: "Hz"}.get(fault, response_unit)


def fault_columns(fault: str, left: FittedResidual, value: float = 0.0) -> Columns:
    """Derivative of the response by the fault's value on both parts, shapes (n, k) and (m, k); the first column.

    Others stand for what is not known of the channel at its first sample. ``value`` is what the record has been
    corrected for already.
    """
    fitted, judged = left.predicted
    dt = left.prepared.dt
    if fault == OFFSET:
        return np.ones((len(fitted), 1)), np.ones((len(judged), 1))
    if fault == GAIN_CHANGE:
        last = max(len(left.prepared.record) - 1, 1)
        first, second = left.samples
        return (fitted * first / last)[:, None], (judged * second / last)[:, None]
    if fault == DELAY:
        return _along(left, lambda motion: -dt * derivative(motion, dt, 1))
    cutoff = value or FIRST * angular_rate(fitted, dt) / (2.0 * np.pi)
    fall = np.exp(-2.0 * np.pi * cutoff * dt * np.arange(len(fitted)))
    first, second = _along(left, lambda motion: (high_passed(motion, cutoff, dt) - motion) / cutoff)
    return np.column_stack([first, fall]), np.column_stack([second, np.zeros(len(judged))])


def _along(left: FittedResidual, change: Callable[[Floats], Floats]) -> Columns:
    """A linear change of the predicted response, along both parts at once where they follow each other."""
    fitted, judged = left.predicted
    if left.spans[0][1] != left.spans[1][0]:
        return change(fitted)[:, None], change(judged)[:, None]
    both = change(np.concatenate([fitted, judged]))[:, None]
    return both[: len(fitted)], both[len(fitted) :]


def sensible(fault: str, value: float, left: FittedResidual) -> bool:
    """Whether a value is one that the fault can have: a gain stays positive, a cut-off lies below half the rate."""
    if fault == GAIN_CHANGE:
        return -0.9 < value < 9.0
    if fault == HIGH_PASS:
        return 0.0 < value < 0.25 / left.prepared.dt
    if fault == DELAY:
        return abs(value) < 0.05 * len(left.residual[0])
    return True


def corrected(prepared: Prepared, faults: Sequence[Fault]) -> Prepared:
    """The record as it was given, without these faults; itself if there is nothing to correct.

    The faults are undone in the order in which signals pass through instruments, backwards: samples that are lost are
    bridged, what was added is subtracted, then the gain, a coupling and the delay.
    """
    wanted = [fault for fault in faults if fault.corrected]
    if not wanted:
        return prepared
    record, response = prepared.record, prepared.response
    masks = [fault.lost for fault in wanted if fault.lost is not None]
    lost = np.any(masks, axis=0) if masks else None
    values = record[response] if lost is None else _bridged(record[response], lost)
    for fault in wanted:
        if fault.waveform is not None and fault.fault != HIGH_PASS:
            values = values - fault.waveform
    for name in (OFFSET, GAIN_CHANGE, HIGH_PASS, DELAY):
        for fault in wanted:
            if fault.fault == name:
                values = _without_fault(name, values, fault.value, prepared.dt)
                if fault.waveform is not None:
                    values = values - fault.waveform
    late = sum(abs(fault.value) for fault in wanted if fault.fault == DELAY)
    if late and lost is not None:
        lost = np.convolve(lost, np.ones(2 * (int(np.ceil(late)) + BESIDE) + 1), "same") > 0.5
    channels = {name: c for name, c in record.channels.items() if name not in record.computed}
    raw = Record(record.dt, {**channels, response: values}, record.units, record.name, record.start, record.period)
    return replace(prepare_record(raw, prepared.plan, prepared.low or None), notes=prepared.notes, lost=lost)


def _without_fault(fault: str, values: Floats, value: float, dt: float) -> Floats:
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


def _bridged(values: Floats, lost: Bools) -> Floats:
    """A channel with a cubic through the neighbours where samples are lost, shape (n,).

    It is for what is computed from the channel beside a free run; no free run is held against these samples.
    """
    from scipy.interpolate import CubicSpline

    known = np.flatnonzero(~lost)
    if len(known) < 4 or not np.any(lost):
        return values
    filled = values.copy()
    inside = np.flatnonzero(lost)
    low, high = float(np.min(values[known])), float(np.max(values[known]))
    reach = high - low
    spline = np.asarray(CubicSpline(known, values[known])(inside), dtype=np.float64)
    filled[inside] = np.clip(spline, low - 0.5 * reach, high + 0.5 * reach)
    return filled
