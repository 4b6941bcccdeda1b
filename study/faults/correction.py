"""Faults that one number describes, and a record without the faults that were found.

How the response changes with such a number, how a channel is rid of it, and which samples say nothing.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from study.faults.fault import ALL_SENSORS, DELAY, GAIN_CHANGE, HIGH_PASS, OFFSET, Fault
from study.faults.imposed import high_passed, shifted
from study.faults.leftover import Columns, FittedResidual, SensorResidual
from study.identify.time_domain.part_fit import run_of
from study.records.prepared import Prepared, prepare_record
from study.records.states import angular_rate
from study.support.arrays import Bools, Floats

FIRST_CUTOFF = 0.02  # of the motion's own frequency: where a high-pass is first looked for
STIRRED = 0.05  # samples by which a force is moved to see what a delay of it does
ALSO_LOST = 2  # samples on either side of lost ones that a channel which is moved in time loses too


def unit_of(fault: str, response_unit: str) -> str:
    """Unit of a fault's value."""
    return {DELAY: "samples", GAIN_CHANGE: "1", HIGH_PASS: "Hz"}.get(fault, response_unit)


def fault_columns(fault: str, channel: str, left: FittedResidual, value: float = 0.0) -> Columns:
    """Derivative of the responses by the value of a channel's fault on both parts, shapes (n s, k) and (m s, k).

    That is the first column. Others stand for what is not known of the channel at its first sample. ``value`` is what
    the record has been corrected for already.
    """
    if channel == ALL_SENSORS:
        each = [sensor.stacked(sensor.by_late_reading) for sensor in left.sensors]
        return np.sum([first for first, _ in each], axis=0), np.sum([second for _, second in each], axis=0)
    if channel in left.prepared.record.forces and left.prepared.response != channel:
        return _by_late_force(channel, left)
    return left.of(channel).stacked(_own_columns(fault, left.of(channel), value))


def _own_columns(fault: str, left: SensorResidual, value: float) -> Columns:
    """The same of a sensor's own response, shapes (n, k) and (m, k)."""
    fitted, judged = left.predicted
    dt = left.prepared.dt
    if fault == OFFSET:
        return np.ones((len(fitted), 1)), np.ones((len(judged), 1))
    if fault == GAIN_CHANGE:
        last = max(len(left.prepared.record) - 1, 1)
        first, second = left.samples
        return (fitted * first / last)[:, None], (judged * second / last)[:, None]
    if fault == DELAY:
        return left.by_late_reading
    cutoff = value or FIRST_CUTOFF * angular_rate(fitted, dt) / (2.0 * np.pi)
    fall = np.exp(-2.0 * np.pi * cutoff * dt * np.arange(len(fitted)))
    first, second = left.changed(lambda motion: (high_passed(motion, cutoff, dt) - motion) / cutoff)
    return np.column_stack([first, fall]), np.column_stack([second, np.zeros(len(judged))])


def _by_late_force(force: str, left: FittedResidual) -> Columns:
    """Change of the responses with each sample that a force is read late: it acts earlier than the model has it."""
    prepared = left.prepared
    values = prepared.record[force]
    moved: list[Columns] = []
    for late in (-STIRRED, STIRRED):
        record = prepared.record.with_channels({force: shifted(values, late)})
        other = replace(prepared, record=record)
        fitted = run_of(left.fit, other).respond({}, left.fit.initial)[0]
        moved.append((fitted, replace(left.run, prepared=other).motions()))
    outputs = prepared.outputs
    early, later = moved
    first, second = (outputs.stacked(a - b)[:, None] / (2.0 * STIRRED) for a, b in zip(early, later, strict=True))
    return first, second


def sensible(fault: str, value: float, left: FittedResidual) -> bool:
    """Whether a value is one that the fault can have: a gain stays positive, a cut-off lies below half the rate."""
    if fault == GAIN_CHANGE:
        return -0.9 < value < 9.0
    if fault == HIGH_PASS:
        return 0.0 < value < 0.25 / left.prepared.dt
    if fault == DELAY:
        return abs(value) < 0.05 * left.fit.samples
    return True


def corrected(prepared: Prepared, faults: Sequence[Fault]) -> Prepared:
    """The record as it was given, without these faults; itself if there is nothing to correct.

    The faults are undone in the order in which signals pass through instruments, backwards: samples that are lost are
    bridged, what was added is subtracted, then the gain, a coupling and the delay.
    """
    wanted = [fault for fault in faults if fault.corrected]
    if not wanted:
        return prepared
    record, compared = prepared.record, [str(sensor) for sensor in prepared.outputs.sensors]
    channels = {name: c for name, c in record.channels.items() if name not in record.computed}
    lost = np.zeros((len(record), len(compared)), dtype=np.bool_)
    motions = dict.fromkeys((*compared, *map(str, record.sensors)))
    for name in (*motions, *(force for force in record.forces if force not in motions)):
        own = [fault for fault in wanted if fault.channel in (name, *((ALL_SENSORS,) if name in motions else ()))]
        if own:
            channels[name], mask = _without_faults(own, record[name], prepared.dt)
            if name in compared:
                lost[:, compared.index(name)] = mask
    raw = replace(record, channels=channels, computed=frozenset[str]())
    return replace(
        prepare_record(raw, prepared.plan, prepared.low or None), notes=prepared.notes, sensors=prepared.sensors,
        lost=(lost if len(compared) > 1 else lost[:, 0]) if np.any(lost) else None,
    )  # fmt: skip


def _without_faults(faults: Sequence[Fault], values: Floats, dt: float) -> tuple[Floats, Bools]:
    """A channel without its faults, and which of its samples say nothing, shape (n,) each."""
    lost = np.any([np.zeros(len(values), dtype=np.bool_), *(f.lost for f in faults if f.lost is not None)], axis=0)
    values = _bridged(values, lost)
    for fault in faults:
        if fault.waveform is not None and fault.fault != HIGH_PASS:
            values = values - fault.waveform
    for name in (OFFSET, GAIN_CHANGE, HIGH_PASS, DELAY):
        for fault in faults:
            if fault.fault == name:
                values = _without_fault(name, values, fault.value, dt)
                if fault.waveform is not None:
                    values = values - fault.waveform
    late = sum(abs(fault.value) for fault in faults if fault.fault == DELAY)
    if late and np.any(lost):
        lost = np.convolve(lost, np.ones(2 * (int(np.ceil(late)) + ALSO_LOST) + 1), "same") > 0.5
    return values, lost


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
