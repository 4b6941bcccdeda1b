"""A record made ready once, for everything that fits, predicts, compares or diagnoses."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from study.records.completion import complete
from study.records.outputs import Outputs
from study.records.plan import SHORTEST_PART, Plan, compared_sensors, make_plan
from study.records.record import ALONE, FORCE, Record, Sensor
from study.support.arrays import Bools, Floats

PICTURED = 0.5  # of the motion's size: a stretch that shows less is no picture of the record


@dataclass(frozen=True, eq=False)
class Prepared:
    """A record in consistent units, with all three motions, and the parts of it to fit and to judge.

    The error of the force is limited to the ``band`` in which all motions are valid; that of the response is not.
    """

    record: Record  # forces, displacement, velocity, acceleration and any further channels
    plan: Plan
    band: tuple[float, float]  # lowest and highest frequency in hertz at which all three motions are valid
    edge: int  # samples at each end that derivatives and integrals leave uncertain
    notes: tuple[str, ...] = ()  # what was converted or computed, a sentence each
    low: float = 0.0  # frequency in hertz below which the user wants nothing judged: the cut-off that was given, or 0
    near: float = 0.0  # frequency in hertz near which the user knows the mode that is meant, or 0
    # Samples that say nothing, as clipped ones do, and are neither fitted nor judged: (n, s), or (n,) of all sensors.
    lost: Bools | None = None
    every: int = 1  # how many samples there were to one of this (:mod:`study.records.sampling_rate`)
    as_sampled: "Prepared | None" = None  # the record with all of its samples, where this has fewer
    running_on: "Prepared | None" = None  # with motions that run on, where here they begin anew (``apart``)
    sensors: tuple[Sensor, ...] = ()  # what free runs are held against; the plan's response of a single mass if empty

    @cached_property
    def outputs(self) -> Outputs:
        """What free runs are held against: several sensors in shares of their size, which no part of it changes."""
        sensors = self.sensors or (Sensor(ALONE, self.plan.response),)
        if len(sensors) == 1:
            return Outputs(sensors, (1.0,))
        sizes = np.std(self.record.columns(sensors), axis=0)
        return Outputs(sensors, tuple((1.0 / np.where(sizes > 0.0, sizes, 1.0)).tolist()))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Those that have a sensor which is compared."""
        return tuple(sensor.coordinate for sensor in self.outputs.sensors)

    @cached_property
    def measured(self) -> Floats:
        """What the sensors that are compared show, shape (n, sensors)."""
        return self.outputs.measured(self.record, (0, len(self.record)))

    @cached_property
    def scale(self) -> Floats:
        """Size of each sensor: the standard deviation of its motion in the fitting part, shape (sensors,)."""
        return np.std(self.measured[slice(*self.plan.fit)], axis=0)

    @property
    def response(self) -> str:
        """The measured motion that free runs are compared with."""
        return self.plan.response

    @property
    def dt(self) -> float:
        """Sampling interval in seconds."""
        return self.record.dt

    @property
    def fitted(self) -> Floats:
        """What was measured of the fitting part, stacked; one sensor's has the shape (samples to fit,)."""
        return self.outputs.stacked(self.measured[slice(*self.plan.fit)])

    @property
    def judged(self) -> Floats:
        """What was measured of the judging part, stacked; one sensor's has the shape (samples to judge,)."""
        return self.outputs.stacked(self.measured[slice(*self.plan.judge)])

    @property
    def spread(self) -> float:
        """Standard deviation of what was measured within the fitting part."""
        return float(np.std(self.fitted))

    def samples_in(self, periods: float) -> int:
        """Samples that so many periods of the motion take: those of the frequency that halves the response's power."""
        values = self.fitted.reshape(-1, len(self.outputs))
        lines = np.fft.rfft(values - np.mean(values, axis=0), axis=0)
        power: Floats = np.cumsum(np.sum(np.abs(lines) ** 2, axis=1))
        middle = max(1, int(np.searchsorted(power, 0.5 * float(power[-1]))))
        return math.ceil(periods * len(values) / middle)

    def known(self, values: Floats, span: tuple[int, int]) -> Floats:
        """Stacked values along a span, zero where a sensor's sample is lost, the same shape."""
        if self.lost is None:
            return values
        kept = self.outputs.kept(self.lost[slice(*span)])
        return values * (kept if values.ndim == 1 else kept[:, None])

    def inner(self, span: tuple[int, int]) -> tuple[int, int]:
        """A span without the uncertain samples at the ends of the record."""
        return max(span[0], self.edge), min(span[1], len(self.record) - self.edge)

    def with_fit(self, first: int, last: int) -> "Prepared":
        return replace(self, plan=replace(self.plan, fit=(first, last)))

    @cached_property
    def free(self) -> bool:
        """Whether no force acts at all: the record is of free decays."""
        return self.response != FORCE and self.record.unforced

    def shortened(self, samples: int) -> "Prepared":
        """The same with no more than so many samples to fit: those that the judging part follows, if it does."""
        first, last = self.plan.fit
        if last - first <= samples:
            return self
        if self.record.joints:  # of a stretch that would be cut to a rest of few samples, none
            end = self.record.stretch_of(last - samples)[1]
            return self.with_fit(end if end - (last - samples) < SHORTEST_PART and end < last else last - samples, last)
        return self.with_fit(*((last - samples, last) if self.plan.judge[0] == last else (first, first + samples)))


def limited(prepared: Prepared, samples: int) -> Prepared:
    """The same with no more than so many samples to fit and to judge; itself where it has no more.

    Those where the parts meet; where either is quiet there, as at the end of a sweep, stretches as far from the
    beginning of both parts as shows most of the motion. A force that is repeated has the same frequencies in these.
    """
    first, last = prepared.plan.judge
    shorter = prepared.shortened(samples)
    if last - first <= samples:
        return shorter
    meeting = replace(shorter, plan=replace(shorter.plan, judge=(first, first + samples)))
    if shorter is prepared or _shown(meeting, prepared) > PICTURED:
        return meeting
    begin, length = prepared.plan.fit[0], min(prepared.plan.fit[1] - prepared.plan.fit[0], last - first)
    moved = [
        replace(prepared, plan=replace(prepared.plan, fit=(begin + k, begin + k + samples),
                                       judge=(first + k, first + k + samples)))
        for k in range(0, length - samples + 1, samples // 4)
    ]  # fmt: skip
    return max([meeting, *moved], key=lambda part: _shown(part, prepared))


def _shown(part: Prepared, whole: Prepared) -> float:
    """Size of the motion in a stretch over that in the whole of the same part, the smaller of both parts'."""
    return min(float(np.std(part.fitted)) / whole.spread, float(np.std(part.judged)) / float(np.std(whole.judged)))


def prepare_record(record: Record, plan: Plan | None = None, cutoff: float | None = None) -> Prepared:
    """Convert a record to consistent units, complete its motions, and decide what is fitted and judged.

    Defaults are those of :func:`study.records.plan.make_plan` and :func:`study.records.completion.complete`, whose
    errors it raises.
    """
    completed = complete(record, cutoff)
    plan, low = plan or make_plan(record), cutoff or 0.0
    sensors = () if ALONE in record.coordinates else compared_sensors(record)
    return Prepared(completed.record, plan, completed.band, completed.edge, completed.notes, low, sensors=sensors)


def whole(record: Record, response: str = "displacement") -> Prepared:
    """A record of which all is fitted and nothing judged, as the estimators of the reproduction have it."""
    return prepare_record(record, Plan(response, (0, len(record)), (len(record), len(record))))
