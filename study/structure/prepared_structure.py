"""A record of a structure made ready once: which sensors are fitted, which part is fitted and which is judged."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from study.equations.model import Model
from study.records.plan import Span, compared, make_plan
from study.records.prepared import Prepared, prepare_record
from study.records.record import Record, Sensor
from study.records.record_layout import Kind, Layout, laid_out
from study.records.sampling_rate import EDGE, without_spare_samples
from study.structure.mass_matrix import check_held_masses
from study.support.arrays import Floats
from study.support.errors import StudyError

PERIODS = 1.5  # of a decay in a block: over more a wrong stiffness takes it out of step (docs/structures.md)


@dataclass(frozen=True, eq=False)
class PreparedStructure:
    """A record of a structure with what is fitted and judged of it.

    Attributes
    ----------
    record : Record
        In N, m and s.
    sensors : tuple of Sensor
        One motion of each measured coordinate: what free runs are compared with.
    fit, judge : pair of int
        First sample and the one after the last of each part.
    notes : tuple of str
        What was left out, a sentence each.
    """

    record: Record
    sensors: tuple[Sensor, ...]
    fit: tuple[int, int]
    judge: tuple[int, int]
    notes: tuple[str, ...] = ()
    low: float = 0.0  # lowest frequency in hertz at which all completed motions are valid
    edge: int = 0  # samples at each end that derivatives and integrals leave uncertain; stretches leave these out

    @property
    def dt(self) -> float:
        """Sampling interval in seconds."""
        return self.record.dt

    @cached_property
    def measured(self) -> Floats:
        """The sensors that are compared, shape (samples, sensors)."""
        return np.stack([self.record[s] for s in self.sensors], axis=1)

    @cached_property
    def scale(self) -> Floats:
        """Size of each sensor: the standard deviation of its motion in the fitting part, shape (sensors,)."""
        return np.std(self.measured[slice(*self.fit)], axis=0)

    @property
    def anew(self) -> bool:
        """Whether the judged motion has states of its own: of a free decay these are all that is known of it."""
        return bool(self.record.stretches)

    @cached_property
    def complete(self) -> dict[str, Floats]:
        """Displacement, velocity and acceleration of each measured coordinate, shape (3, samples)."""
        return {s.coordinate: self.record.motion(s.coordinate) for s in self.sensors}

    def shortened(self, samples: int) -> "PreparedStructure":
        """The same with no more than so many samples to fit: those that the judging part follows, if it does."""
        first, last = self.fit
        if last - first <= samples:
            return self
        if self.record.stretches:
            return replace(self, fit=(first, max(end for begin, end in self.record.runs(self.fit)
                                                 if begin == first or end - first <= samples)))  # fmt: skip
        return replace(self, fit=(last - samples, last) if self.judge[0] == last else (first, first + samples))


def prepare_structure(
    record: Record, model: Model, fit: Span | None = None, judge: Span | None = None, cutoff: float | None = None
) -> PreparedStructure:  # fmt: skip
    """The parts of a record that are named, or its halves, whatever kind of test it is.

    Raises as :func:`structure_ready`.
    """
    return _made(prepare_record(record, make_plan(record, fit, judge), cutoff), record, model)


def structure_ready(record: Record, model: Model, layout: Layout) -> PreparedStructure:
    """A record laid out for a structure: a decay in stretches that begin anew, a thinned one where it is oversampled.

    Raises
    ------
    StudyError
        As :func:`study.records.record_layout.laid_out`, or if nothing measures a coordinate and nothing ties it to
        another, or the masses that are given leave no positive definite mass matrix.
    """
    prepared = laid_out([record], layout, Kind(unbroken=model.measured, anew=PERIODS))
    return _made(prepared if layout.as_sampled else without_spare_samples(prepared), record, model)


def _made(prepared: Prepared, record: Record, model: Model) -> PreparedStructure:
    if not model.measured:  # whose masses nobody lumps
        check_held_masses(model)
    sensors = prepared.sensors or compared(record)
    seen = {sensor.coordinate for sensor in sensors}
    blind = [coordinate for coordinate in model.coordinates if coordinate not in seen]
    _check_tied(model, blind)
    lacks = f"no sensor is at {' and '.join(blind)}: the free run has its motion, the reverse system lacks it"
    ends = EDGE if prepared.every > 1 and not prepared.record.stretches else 0  # which a filter leaves unsure
    (first, split), (other, last) = prepared.plan.fit, prepared.plan.judge
    inner = len(prepared.record) - ends
    fit, judge = (max(first, ends), min(split, inner)), (max(other, ends), min(last, inner))
    notes = (*prepared.notes, *([lacks] if blind else []))
    return PreparedStructure(prepared.record, sensors, fit, judge, notes, prepared.band[0], prepared.edge)


def _check_tied(model: Model, blind: Sequence[str]) -> None:
    """Refuse a coordinate that nothing measures and nothing ties to what is measured."""
    for name in blind:
        ties = [t for t in model.terms if name in t.place.moving and len(t.place.moving) > 1]
        if not ties:
            raise StudyError(
                f"nothing measures the coordinate {name!r} and nothing ties it to another; expected a column "
                f"{name!r}, or a term between it and a coordinate that is measured"
            )
