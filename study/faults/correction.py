"""A record without the faults that were found: the channel as it would have been, and which samples say nothing."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.faults.adjustable import without_fault
from study.faults.fault import DELAY, GAIN_CHANGE, HIGH_PASS, OFFSET, Fault
from study.records.prepared import Prepared, prepare_record
from study.records.record import MOTIONS, Record
from study.support.arrays import Floats

BESIDE = 2  # samples on either side of lost ones that a channel which is moved in time loses too


def corrected(prepared: Prepared, faults: Sequence[Fault]) -> Prepared:
    """The record as it was given, without these faults; itself if there is nothing to correct.

    The faults are undone in the order in which signals pass through instruments, backwards: samples that are lost are
    bridged, what was added is subtracted, then the gain, a coupling and the delay.
    """
    wanted = [fault for fault in faults if fault.corrected]
    if not wanted:
        return prepared
    response, lost = prepared.response, _lost(wanted)
    values = prepared.record[response]
    values = values if lost is None else bridged(values, lost)
    for fault in wanted:
        if fault.waveform is not None and fault.fault != HIGH_PASS:
            values = values - fault.waveform
    for name in (OFFSET, GAIN_CHANGE, HIGH_PASS, DELAY):
        for fault in wanted:
            if fault.fault == name:
                values = without_fault(name, values, fault.value, prepared.dt)
                if fault.waveform is not None:
                    values = values - fault.waveform
    late = sum(abs(fault.value) for fault in wanted if fault.fault == DELAY)
    if late and lost is not None:
        lost = _wider(lost, int(np.ceil(late)) + BESIDE)
    return replace(_with_response(prepared, values), lost=lost)


def _lost(faults: Sequence[Fault]) -> NDArray[np.bool_] | None:
    """Samples that any fault spoils."""
    masks = [fault.lost for fault in faults if fault.lost is not None]
    return np.any(masks, axis=0) if masks else None


def _wider(lost: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    return np.convolve(lost, np.ones(2 * reach + 1), "same") > 0.5


def bridged(values: Floats, lost: NDArray[np.bool_]) -> Floats:
    """A channel with a cubic through the neighbours where samples are lost, shape (n,).

    It is for what is computed from the channel beside a free run; no free run is held against these samples.
    """
    from scipy.interpolate import CubicSpline

    known = np.flatnonzero(~lost)
    if len(known) < 4 or not np.any(lost):
        return values
    filled = values.copy()
    inside = np.flatnonzero(lost)
    limits = float(np.min(values[known])), float(np.max(values[known]))
    reach = limits[1] - limits[0]
    spline = np.asarray(CubicSpline(known, values[known])(inside), dtype=np.float64)
    filled[inside] = np.clip(spline, limits[0] - 0.5 * reach, limits[1] + 0.5 * reach)
    return filled


def _with_response(prepared: Prepared, values: Floats) -> Prepared:
    """The record with another measured response, and the motions that follow from it."""
    record = prepared.record
    computed = [m for m in MOTIONS if m in prepared.record.computed]
    channels = {name: c for name, c in record.channels.items() if name not in computed}
    raw = Record(
        record.dt, {**channels, prepared.response: values}, record.units, record.name, record.start, record.period
    )
    again = prepare_record(raw, prepared.plan, prepared.low or None)
    return replace(again, notes=prepared.notes)
