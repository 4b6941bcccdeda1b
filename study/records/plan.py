"""Which parts of a record are fitted and judged: where it moves, and whether both parts are driven alike."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from study.records.record import FORCE, MOTIONS, Record, Sensor
from study.records.spectra import Segments, autospectrum, segment_length
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.thresholds import ENOUGH

Span = tuple[int, int]
SHORTEST_PART = 64  # samples


@dataclass(frozen=True)
class Plan:
    """Which parts of a record are fitted and judged."""

    response: str  # the measured motion that free runs are compared with
    fit: Span  # first sample and the one after the last; the parts do not overlap
    judge: Span


def make_plan(record: Record, fit: Span | None = None, judge: Span | None = None, measured: str | None = None) -> Plan:
    """Fit the first half and judge the second by default; compare with the first motion that was measured.

    Of a record that rests in one of the halves, those of the stretch that moves (:func:`_halves`).
    """
    sensors = compared_sensors(record, measured)
    given = fit is not None or judge is not None
    half = len(record) // 2
    usual = ((0, half), (half, len(record))) if given or len(record) < 2 * SHORTEST_PART else _halves(record, sensors)
    fit, judge = fit or usual[0], judge or usual[1]
    motion, force = record.columns(sensors), record.columns(record.forces)
    for name, (first, last) in (("fit", fit), ("judge", judge)):
        if not 0 <= first < last <= len(record) or last - first < SHORTEST_PART:
            raise StudyError(
                f"the part to {name}, {first}:{last}, must hold {SHORTEST_PART} samples or more of {len(record)}"
            )
        expect(_moves(motion[first:last]), _still(record, sensors, f"the part to {name}, {first}:{last}"))
    if fit[0] < judge[1] and judge[0] < fit[1]:
        raise StudyError(f"the parts to fit {fit[0]}:{fit[1]} and to judge {judge[0]}:{judge[1]} overlap; expected two")
    if not record.unforced:
        expect(_moves(force[slice(*fit)]), _still(record, record.forces, f"the part to fit, {fit[0]}:{fit[1]}"))
    return Plan(sensors[0].motion, fit, judge)


def compared_sensors(record: Record, wanted: str | None = None) -> tuple[Sensor, ...]:
    """One motion of each coordinate that is measured: the one that is wanted, or the first of them.

    Or the force, where that is wanted: the motion is prescribed then.
    """
    if wanted == FORCE and (forces := tuple(s for c in record.coordinates if (s := Sensor(c, FORCE)) in record)):
        return forces
    found: list[Sensor] = []
    for coordinate in record.coordinates:
        there = [s for m in MOTIONS if (s := Sensor(coordinate, m)) in record]
        usable = [s for s in there if wanted in (None, s.motion)]
        if there and not usable:
            known, where = ", ".join(s.motion for s in there), f" at {coordinate}" if coordinate else ""
            raise StudyError(f"{record.name}: no {wanted} was measured{where}; expected --response {known}")
        found += usable[:1]
    expect(found, f"record {record.name!r} has no displacement, velocity or acceleration")
    return tuple(found)


def _still(record: Record, channels: Sequence[Sensor] | Sequence[str], part: str) -> str:
    first, last = moving(record.columns(channels))
    names = " and ".join(map(str, channels))
    return (
        f"the {names} of {record.name!r} does not move in {part}; it moves in samples {first}:{last}, expected parts "
        "there, by --fit A:B and --judge A:B"
    )


def _moves(values: Floats) -> bool:
    """Whether any of some channels changes at all."""
    return bool(np.any(np.ptp(values, axis=0) > 0.0))


def moving(values: Floats) -> Span:
    """First sample of a motion and the one after the last: what it rests at before and behind is cut off.

    Of one channel, shape (n,), or of several that move together, shape (n, channels). Of the rest behind all: a channel
    that is over jumps to it, and the sample after the jump shows no motion.
    """
    change = np.diff(values, axis=0)
    changes = np.flatnonzero(change if values.ndim == 1 else np.any(change != 0.0, axis=1))
    if not len(changes):
        return 0, 0
    last = int(changes[-1]) + 1
    return int(changes[0]), last if last < len(values) - 1 else len(values)


def _halves(record: Record, sensors: Sequence[Sensor]) -> tuple[Span, Span]:
    """The parts to fit and to judge: the halves of the record, or of the stretch of it that moves.

    Of the stretch where one half has no motion, or the first no force: a hammer's blow with a long rest behind it, a
    trigger long before it, chunks of a file that nothing was written to.
    """
    half, motion, force = len(record) // 2, record.columns(sensors), record.columns(record.forces)
    first, last = 0, len(record)
    if _rests(motion[:half]) or _rests(motion[half:]) or not (record.unforced or _moves(force[:half])):
        start, last = moving(motion)
        first = max(start, moving(force)[0])  # 0 where no force acts
    middle = (first + last) // 2
    return (first, middle), (middle, last)


def _rests(values: Floats) -> bool:
    """Whether channels stay at one value for most of a part, from its beginning or to its end."""
    first, last = moving(values)
    return last - first < 0.5 * len(values)


def driven_apart(record: Record, one: Span, other: Span) -> bool:
    """Whether most of the power in two parts of a record lies at frequencies that the other has not."""
    return shared(record, one, other) < 0.5


def falls_silent(record: Record, sensors: Sequence[Sensor], one: Span, other: Span) -> bool:
    """Whether one of two parts has nearly all the power of every motion: noise is much of what the other shows."""
    first, second = (np.var(record.columns(sensors, span), axis=0) for span in (one, other))
    little = 1.0 - ENOUGH
    return bool(np.all(first < little * second) or np.all(second < little * first))


def shared(record: Record, one: Span, other: Span) -> float:
    """The share of the forces' power that two parts have at the same frequencies, from 0 to 1.

    The overlap of both autospectra, each over its own power: ``sum(min(G_1, G_2))`` (Weitzman, 1970), the mean of those
    of several forces. Stationary forces share nearly all, but for the scatter of their spectra; the halves of one sweep
    hardly anything.
    """
    found: list[float] = []
    for force in (record[name] for name in record.forces):
        parts = [force[slice(*span)] - np.mean(force[slice(*span)]) for span in (one, other)]
        length = segment_length(min(map(len, parts)), held=8, fewest=4)
        densities = [autospectrum(part, record.dt, Segments(length))[1] for part in parts]
        if all(float(np.sum(d)) > 0.0 for d in densities):
            first, second = (d / np.sum(d) for d in densities)
            found.append(float(np.sum(np.minimum(first, second))))
    return float(np.mean(found)) if found else 1.0
