"""Tests that a rig could be put to: what drives it or where it is let go, how loudly, in which band, for how long.

All are made from the test that the record is of: what drove it there can drive it again, within limits of the user's.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from study.equations.linear_part import acting, matrices
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.records.completion import derivative
from study.records.driven_by_motion import BASE_MOVES
from study.records.excitation import Excitation, force
from study.records.interpolation import between_samples, largest_between
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, OF_THE_GROUND, Record, Sensor
from study.records.states import starting_states
from study.support.arrays import Floats
from study.support.errors import StudyError, expect

AS_WAS, MULTISINE, SWEEP, BLOW = "as was", "multisine", "sweep", "blows"
LET_GO, PRELOADED = "release", "static preload"
Band = tuple[float, float]


@dataclass(frozen=True)
class Limits:
    """What a test may not exceed, in the units of the record."""

    force: float  # largest absolute value of any force, or of the acceleration of a moving base
    displacement: float  # largest absolute displacement of any coordinate
    length: float  # in seconds

    def __post_init__(self) -> None:
        for name, value in (("force", self.force), ("displacement", self.displacement), ("length", self.length)):
            expect(value > 0.0, f"the largest {name} of a test is {value:g}; expected a number above zero")


@dataclass(frozen=True, eq=False)
class Design:
    """A test."""

    kind: str  # one of ``AS_WAS``, ``MULTISINE``, ``SWEEP``, ``BLOW``, ``LET_GO`` and ``PRELOADED``
    place: str  # name of its band
    band: Band  # lowest and highest frequency in hertz
    level: float  # largest force, or stroke, over that of the record; of a release the displacement it begins with
    record: Record  # what drives it: forces, or the motion of a component
    begin: Floats  # displacements, then velocities of all coordinates at the first sample

    @property
    def length(self) -> float:
        """In seconds."""
        return len(self.record) * self.record.dt

    @property
    def effort(self) -> tuple[bool, float, float]:
        """By which tests are ordered: those that need no other rig first, then by length, then by level."""
        return self.kind in (LET_GO, PRELOADED), self.length, self.level


@dataclass(frozen=True, eq=False)
class PresentTest:
    """The test that a record is of, and what others are made from it."""

    source: Record  # the longest record that it is of, at the sampling rate of the fit
    drivers: tuple[str, ...]  # forces, or the displacement of a component; none where it was let go
    peaks: Floats  # largest absolute value of each driver, shape (drivers,)
    bands: Mapping[str, Band]  # in hertz, by name
    resonance: float  # in hertz: where the response has most of its power
    deflection: Floats  # state that it can be let go from, shape (2 coordinates,); empty where it cannot
    coordinates: int
    based: bool  # whether the base moves, whose acceleration stands for the force
    every: int  # samples of the record, and of what drives a test, to one of the fit
    scale: float  # force of the fit over what drives: minus the mass, where its base's acceleration drives a single one

    def signals(self, record: Record) -> Floats:
        """What drives a test in its own unit, a base's acceleration and no force, shape (n, drivers)."""
        return record.columns(self.drivers) / self.scale

    def largest(self, record: Record) -> float:
        """Largest absolute value of that, at the rate at which it is written."""
        return largest_between(self.signals(record), self.every)

    @property
    def reached(self) -> float:
        """Largest absolute value of what drove the record; zero where it was let go."""
        return float(np.max(self.peaks, initial=0.0)) / abs(self.scale)

    @property
    def unit(self) -> str:
        """Of what drives; empty where it was let go."""
        if self.based:
            return f"{self.source.force_and_length[1]}/s^2"
        return self.source.unit(self.drivers[0]) if self.drivers else ""

    @property
    def driven_by(self) -> str:
        """What is limited of it, in a word."""
        return "stroke" if self.prescribed else "acceleration" if self.based else "force"

    @property
    def prescribed(self) -> bool:
        """Whether its motion is what drives, and the force what is predicted."""
        strokes = {str(Sensor(c, MOTIONS[0])) for c in self.source.coordinates}
        return bool(self.drivers) and strokes.issuperset(self.drivers)

    @property
    def kinds(self) -> tuple[tuple[str, str], ...]:
        """Kinds of tests that can be made of it, each with the name of its band."""
        if not self.drivers:
            return ((LET_GO, AS_WAS),)
        waves = (MULTISINE,) if self.prescribed else (MULTISINE, SWEEP)
        found = [(AS_WAS, AS_WAS), *((wave, band) for band in self.bands for wave in waves)]
        if len(self.deflection):
            found += [(BLOW, AS_WAS), (LET_GO, AS_WAS), (PRELOADED, AS_WAS), (PRELOADED, "about resonance")]
        return tuple(found)

    def design(self, kind: str, place: str, samples: int, level: float) -> Design:
        """A test of a kind in a band, of so many samples; of what was measured no more than there is."""
        samples = min(samples, len(self.source)) if kind == AS_WAS else samples
        waves = np.zeros((samples, len(self.drivers)))
        for i in range(len(self.drivers)):
            waves[:, i] = self._wave(kind, place, samples, i)
        begin = np.zeros(2 * self.coordinates)
        if kind == LET_GO:
            begin = level * self.deflection
        if kind == PRELOADED:
            waves, begin = 0.5 + 0.5 * waves, 0.5 * level * self.deflection
        own = {d: level * peak * wave for d, peak, wave in zip(self.drivers, self.peaks, waves.T, strict=True)}
        for coordinate in self.source.coordinates if self.prescribed else ():
            u, *rates = (str(Sensor(coordinate, motion)) for motion in MOTIONS)
            own |= {name: derivative(own[u], self.source.dt, order) for order, name in enumerate(rates, start=1)}
        channels = {name: np.zeros(samples) for name in self.source.forces} | own
        if kind == AS_WAS:
            channels |= {name: self.source[name][:samples] for name in self.source.extra}
        record = replace(self.source, channels=channels, name=kind, period=None, computed=frozenset())
        return Design(kind, place, self.bands.get(place, (0.0, 0.0)), level, record, begin)

    def _wave(self, kind: str, place: str, samples: int, number: int) -> Floats:
        """What a driver does, of unit peak, shape (n,)."""
        dt, band = self.source.dt, self.bands[place]
        match kind:
            case _ if kind == LET_GO:
                return np.zeros(samples)
            case _ if kind == AS_WAS or (kind == PRELOADED and place == AS_WAS):
                values = np.resize(self.source[self.drivers[number]], samples)
                return (values - self.prescribed * np.mean(values)) / self.peaks[number]
            case _ if kind == SWEEP:
                wave = force(Excitation("swept_sine", start_frequency=band[0], stop_frequency=band[1]), samples, dt, 1)
            case _ if kind == BLOW:
                wave = _blows(samples, dt, self.resonance)
            case _:  # of some draws of phases that with the least peak
                noise = Excitation("random_phase_multisine", start_frequency=band[0], stop_frequency=band[1])
                drawn = (force(noise, samples, dt, 16 * number + seed) for seed in range(8))
                wave = min(drawn, key=lambda values: float(np.max(np.abs(values))))
        return wave / float(np.max(np.abs(between_samples(wave, 8))))  # the limit holds between the samples as well


def _blows(samples: int, dt: float, resonance: float) -> Floats:
    """Half sines of a quarter of a period, with some ten periods between them, shape (n,)."""
    time, width, every = dt * np.arange(samples), 0.25 / resonance, 10.37 / resonance
    since = np.mod(time - 0.5 / resonance, every)
    return np.where((since < width) & (time > 0.5 / resonance), np.sin(np.pi * since / width), 0.0)


def present_test(prepared: Prepared, fit: FreeRunFit) -> PresentTest:
    """The test that a prepared record is of; ``fit`` is one of its models."""
    record = prepared.record
    sources = list({id(s.source): s.source for s in record.stretches}.values()) or [record]
    source, prescribed = max(sources, key=len), prepared.response == FORCE
    forces = () if prepared.free else tuple(f for f in record.forces if f in source)
    drivers = tuple(str(Sensor(c, MOTIONS[0])) for c in record.coordinates) if prescribed else forces
    centred = [s.columns(drivers) - prescribed * np.mean(s.columns(drivers), axis=0) for s in sources]
    peaks = np.array([max(largest_between(s[:, [i]], prepared.every) for s in centred) for i in range(len(drivers))])
    seen = source.columns(prepared.outputs.sensors)
    power, shown = _power(source.columns(drivers) if drivers else seen), _power(seen)
    spacing, share = 1.0 / (len(source) * source.dt), np.cumsum(power) / np.sum(power)
    low, high = (spacing * max(1, int(np.searchsorted(share, edge))) for edge in (0.02, 0.98))
    high, f = max(high, 2.0 * low), spacing * max(1, int(np.argmax(shown)))
    bands = {
        AS_WAS: (low, high), "lower half": (low, 0.5 * (low + high)), "upper half": (0.5 * (low + high), high),
        "about resonance": (0.7 * f, 1.4 * f), "low": (0.05 * f, 0.5 * f),
    }  # fmt: skip
    most = 0.4 / source.dt
    bands = {name: (a, min(b, most)) for name, (a, b) in bands.items() if a < 0.8 * most}
    expect(
        bool(drivers) or prescribed or bool(record.forces),
        f"{record.name}: a release of a structure is not planned; expected a record with a force, or of a single mass",
    )
    based = OF_THE_GROUND in record.forces or any(note.startswith(BASE_MOVES) for note in prepared.notes)
    # the way in takes the mass that the model gives as known, and one where it gives none
    scale = -(fit.model.values.get("m") or 1.0) if based and drivers == (FORCE,) else 1.0
    deflection = np.zeros(0) if based else _deflection(prepared, fit, drivers, peaks)  # nothing pulls at it on a table
    expect(
        bool(drivers) or bool(np.any(deflection)),
        f"{record.name}: no displacement or velocity tells from where it was let go; expected one to plan a release",
    )
    return PresentTest(
        source, drivers, peaks, bands, f, deflection, len(fit.model.coordinates), based, prepared.every, scale
    )


def _power(values: Floats) -> Floats:
    """Power by line of channels, each in shares of its own and smoothed over some lines, shape (lines,)."""
    lines = np.abs(np.fft.rfft(values - np.mean(values, axis=0), axis=0)) ** 2
    total = np.sum(lines, axis=0)
    power: Floats = np.sum(lines / np.where(total > 0.0, total, 1.0), axis=1)
    return np.asarray(np.convolve(power, np.ones(9), "same"), dtype=np.float64)


def _deflection(prepared: Prepared, fit: FreeRunFit, drivers: tuple[str, ...], peaks: Floats) -> Floats:
    """Of a decay the state that it began with; else what its largest forces hold, by the linear springs."""
    model, record = fit.model, prepared.record
    if prepared.response == FORCE or model.modal:
        return np.zeros(0)
    if prepared.free:
        source, first = (record.stretches[0].source, record.stretches[0].first) if record.stretches else (record, 0)
        return starting_states(source, prepared.outputs, (first,), coordinates=model.coordinates)[0]
    stiffness = matrices(model, {key: value or 0.0 for key, value in model.values.items()})[0]
    if float(np.min(np.linalg.eigvalsh(stiffness))) <= 0.0:
        return np.zeros(0)
    largest = np.array([dict(zip(drivers, peaks.tolist(), strict=True)).get(name, 0.0) for name, _ in model.forces])
    held = np.asarray(np.linalg.solve(stiffness, acting(model) @ largest), dtype=np.float64)
    return np.concatenate([held, np.zeros(len(stiffness))])


def possible_designs(
    present: PresentTest, limits: Limits, reached: Callable[[Design], float], shares: tuple[float, ...]
) -> Iterator[Design]:
    """Tests within the limits, each kind as loud as it may be, and in ``shares`` of that, down to the record's level.

    ``reached`` gives what a test reaches of the limits of motion, and of a component's force, over these: one at most,
    whatever the truth, or infinite where it does not stay finite.
    """
    samples = int(limits.length / present.source.dt)
    for kind, place in present.kinds:
        make = partial(present.design, kind, place, samples)
        try:
            loudest = _loudest(make, present, limits, reached)
        except StudyError:  # a band without a line, a channel that only the record has
            continue
        levels = [share * loudest for share in shares if share > 0.3 or share * loudest >= 1.0]
        if kind == present.kinds[0][0] and reached(make(1.0)) <= 1.0 and _driven_within(make(1.0), present, limits):
            levels.append(1.0)
        # less than a hundredth of what the record reached drowns
        yield from (make(level) for level in levels if level >= 0.01)


def _driven_within(design: Design, present: PresentTest, limits: Limits) -> bool:
    """Whether the forces of a test are within their limit; where no force drives it, they are."""
    return present.prescribed or present.largest(design.record) <= limits.force


def _loudest(
    make: Callable[[float], Design], present: PresentTest, limits: Limits, reached: Callable[[Design], float]
) -> float:
    """The largest level of a kind of test within the limits, about; zero if none is found."""
    if present.drivers:
        level = (limits.displacement if present.prescribed else limits.force) / present.reached
    else:
        share = reached(make(1.0))
        level = 1.0 / share if 0.0 < share < np.inf else 1.0
    above = np.inf
    for _ in range(12):
        share = reached(make(level))
        if share <= 1.0:
            middle = 0.5 * (level + above)
            return middle if np.isfinite(above) and reached(make(middle)) <= 1.0 else level
        above, level = level, level * max(0.95 / share, 0.5)
    return 0.0
