"""A record of a structure made ready once: which sensors are fitted, which part is fitted and which is judged."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from study.equations.model import Model
from study.records.completion import CompletedRecord, complete, consistent
from study.records.plan import FEWEST
from study.records.record import MOTIONS, Record, Sensor
from study.structure.mass_matrix import check_held_masses
from study.support.arrays import Floats
from study.support.errors import StudyError, expect


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
    cutoff: float | None = None  # hertz: accelerations are integrated above it

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
        return {s.coordinate: self._motion(s.coordinate) for s in self.sensors}

    @cached_property
    def low(self) -> float:
        """Lowest frequency in hertz at which all completed motions are valid."""
        return self._completed.band[0]

    @cached_property
    def edge(self) -> int:
        """Samples at each end that derivatives and integrals leave uncertain; stretches leave these out."""
        return 0 if self.record.stretches else self._completed.edge

    @property
    def whole(self) -> Record:
        """The record that its stretches are of."""
        return self.record.stretches[0].source if self.record.stretches else self.record

    @cached_property
    def _completed(self) -> CompletedRecord:
        return complete(self.whole, self.cutoff)

    def _motion(self, coordinate: str) -> Floats:
        motion = self._completed.record.motion(coordinate)
        cuts = [motion[:, s.first : s.last] for s in self.record.stretches]
        return np.concatenate(cuts, axis=1) if cuts else motion

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
    record: Record,
    model: Model,
    fit: tuple[int, int] | None = None,
    judge: tuple[int, int] | None = None,
    cutoff: float | None = None,
) -> PreparedStructure:
    """Choose sensors and parts: the first half is fitted and the second judged by default.

    Raises
    ------
    StudyError
        If the parts overlap or are too short, nothing measures a coordinate and nothing ties it to another, or the
        masses that are given leave no positive definite mass matrix.
    """
    if not model.measured:  # whose masses nobody lumps
        check_held_masses(model)
    record, converted = consistent(record)
    half = len(record) // 2
    fit, judge = fit or (0, half), judge or (half, len(record))
    for name, (first, last) in (("fit", fit), ("judge", judge)):
        good = 0 <= first < last <= len(record) and last - first >= FEWEST
        expect(good, f"the part to {name}, {first}:{last}, must hold {FEWEST} samples or more of {len(record)}")
    apart = fit[1] <= judge[0] or judge[1] <= fit[0]
    expect(apart, f"the parts to fit {fit[0]}:{fit[1]} and to judge {judge[0]}:{judge[1]} overlap; expected two parts")
    ordered = sorted(record.sensors, key=lambda s: MOTIONS.index(s.motion), reverse=True)
    first_of = {s.coordinate: s for s in ordered}
    sensors = tuple(first_of[c] for c in model.coordinates if c in first_of)
    blind = [c for c in model.coordinates if c not in first_of]
    _check_tied(model, blind)
    lacks = f"no sensor is at {' and '.join(blind)}: the free run has its motion, the reverse system lacks it"
    return PreparedStructure(record, sensors, fit, judge, (*converted, *([lacks] if blind else [])), cutoff)


def _check_tied(model: Model, blind: Sequence[str]) -> None:
    """Refuse a coordinate that nothing measures and nothing ties to what is measured."""
    for name in blind:
        ties = [t for t in model.terms if name in t.place.moving and len(t.place.moving) > 1]
        if not ties:
            raise StudyError(
                f"nothing measures the coordinate {name!r} and nothing ties it to another; expected a column "
                f"{name!r}, or a term between it and a coordinate that is measured"
            )
