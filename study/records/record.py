"""A record: what was measured or simulated, with its units."""

import csv
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate, pairwise
from pathlib import Path

import numpy as np

from study.records import MOTIONS
from study.records.number_table import number_table
from study.support.arrays import Floats
from study.support.csv_text import csv_bytes
from study.support.units import is_angle

ALONE = ""  # the only coordinate of a single mass has no name, so that its channels are called as their motions are
OF_THE_GROUND = "base_acceleration"  # stands for a force where the base of a structure moves
FORCE = "force"  # on a single mass; what is predicted where the motion is prescribed
SI_UNITS = {"time": "s", "force": "N", "displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}


@dataclass(frozen=True, order=True)
class Sensor:
    """A measured motion of a coordinate."""

    coordinate: str
    motion: str  # one of MOTIONS

    def __str__(self) -> str:
        """As channels are called: ``floor1 acceleration``, or ``acceleration`` of a single mass."""
        return f"{self.coordinate} {self.motion}".lstrip()


@dataclass(frozen=True, eq=False)
class Stretch:
    """Samples ``first`` to ``last`` (exclusive) of a record, along which the motion goes on without a break.

    It ``continues`` where it comes after the stretch before it in the same record, and a motion runs through what lies
    between them; else the motion begins anew.
    """

    source: "Record"
    first: int
    last: int
    continues: bool = False

    def __len__(self) -> int:
        return self.last - self.first

    @property
    def time(self) -> Floats:
        """Time of each sample in seconds, shape (n,)."""
        return self.source.time[self.first : self.last]


@dataclass(frozen=True, eq=False)  # arrays have no single truth value: a record equals itself alone
class Record:
    """Evenly sampled forces and motions of one or more coordinates; n samples."""

    dt: float  # seconds between samples
    channels: Mapping[str, Floats]  # (n,) each: forces, motions by sensor ("floor1 acceleration"), further ones
    units: Mapping[str, str] = field(default_factory=lambda: dict(SI_UNITS))  # of each channel
    name: str = "record"  # in tables and names of files
    start: float = 0.0  # time of the first sample in seconds
    period: int | None = None  # samples in one period, where the excitation is periodic
    stretches: tuple[Stretch, ...] = ()  # what it is strung together of; empty for a record of its own
    changed: frozenset[str] = frozenset()  # channels that are no longer those of its stretches
    between: str = "band_limited"  # what a force does between its samples: one of ``interpolation.BETWEEN_SAMPLES``
    coordinates: tuple[str, ...] = (ALONE,)  # whose motions its channels may be
    forces: tuple[str, ...] = ("force",)  # which channels are forces
    remarks: tuple[str, ...] = ()  # what its reader noticed, a sentence each: units that nobody gave, rest, junk
    computed: frozenset[str] = frozenset()  # motions that were not measured but computed from those that were

    def __len__(self) -> int:
        return len(next(iter(self.channels.values())))

    def __getitem__(self, channel: str | Sensor) -> Floats:
        return self.channels[str(channel)]

    def __contains__(self, channel: str | Sensor) -> bool:
        return str(channel) in self.channels

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """The motions that were measured, in the order of its channels."""
        known = {str(s := Sensor(c, m)): s for c in self.coordinates for m in MOTIONS}
        return tuple(known[name] for name in self.channels if name in known and name not in self.computed)

    @property
    def motions(self) -> dict[Sensor, Floats]:
        """The motions that were measured, by sensor; shape (n,) each."""
        return {sensor: self[sensor] for sensor in self.sensors}

    def motion(self, coordinate: str) -> Floats:
        """Displacement, velocity and acceleration of a coordinate of a completed record, shape (3, n)."""
        return np.stack([self[Sensor(coordinate, motion)] for motion in MOTIONS])

    def columns(self, channels: Sequence[Sensor] | Sequence[str], span: tuple[int, int] | None = None) -> Floats:
        """Channels side by side, all along or along a span, shape (n, channels)."""
        first, last = span or (0, len(self))
        values = [self[channel][first:last] for channel in channels]
        return np.stack(values, axis=1) if values else np.zeros((last - first, 0))

    @property
    def rotations(self) -> frozenset[str]:
        """The coordinates that turn: those whose motion is in an angle."""
        return frozenset(s.coordinate for s in self.sensors if is_angle(self.unit(s)))

    @property
    def unforced(self) -> bool:
        """Whether no force acts along it: it is of free decays."""
        return not any(np.any(self[force]) for force in self.forces)

    def unit(self, channel: str | Sensor) -> str:
        """Unit of a channel: the SI one where nobody says, none of a further channel then."""
        return self.units.get(str(channel)) or self.usual_unit(channel)

    def reading(self, channel: str) -> str:
        """What a channel does between its samples: a motion is band-limited."""
        return self.between if channel in self.forces else "band_limited"

    def usual_unit(self, channel: str | Sensor) -> str:
        """The SI unit of a force or a motion; empty for a further channel."""
        if channel in self.forces:
            return SI_UNITS["force"]
        found = (m for c in self.coordinates for m in MOTIONS if str(Sensor(c, m)) == str(channel))
        return next((SI_UNITS[motion] for motion in found), "")

    @property
    def force_and_length(self) -> tuple[str, str]:
        """Units of force and length in the equations of motion of coordinates that do not turn."""
        forces = (self.unit(f) for f in self.forces if " " not in self.unit(f) and f != OF_THE_GROUND)  # else a moment
        lengths = (self.units.get(str(Sensor(c, MOTIONS[0])), "") for c in self.coordinates if c not in self.rotations)
        length = next(filter(None, lengths), SI_UNITS["displacement"])
        usual = SI_UNITS["force"] if length == SI_UNITS["displacement"] else f"kg {length}/s^2"
        return next(forces, usual if OF_THE_GROUND in self.forces else SI_UNITS["force"]), length

    @property
    def time(self) -> Floats:
        """Time of each sample in seconds, shape (n,)."""
        if self.stretches:
            return np.concatenate([stretch.time for stretch in self.stretches])
        return self.start + self.dt * np.arange(len(self), dtype=np.float64)

    @cached_property
    def begins(self) -> tuple[int, ...]:
        """Samples at which the motion begins anew, the first aside."""
        pairs = zip(self.joints, self.stretches[1:], strict=True)
        return tuple(joint for joint, stretch in pairs if not stretch.continues)

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """Samples at which its stretches begin, the first aside."""
        return tuple(accumulate(len(stretch) for stretch in self.stretches[:-1]))

    def stretch_of(self, sample: int) -> tuple[int, int]:
        """First sample of the stretch that holds this one, and the one after its last."""
        bounds = (0, *self.joints, len(self))
        place = bisect_right(bounds, sample, hi=len(bounds) - 1)
        return bounds[place - 1], bounds[place]

    def runs(self, span: tuple[int, int]) -> tuple[tuple[int, int], ...]:
        """The parts of a span that lie in one stretch each: first sample, and last + 1."""
        bounds = (span[0], *(joint for joint in self.joints if span[0] < joint < span[1]), span[1])
        return tuple(pairwise(bounds))

    @property
    def extra(self) -> tuple[str, ...]:
        """Names of channels beside forces and motions."""
        known = {*self.forces, *self.computed, *map(str, self.sensors)}
        return tuple(c for c in self.channels if c not in known)

    def part(self, first: int, last: int) -> "Record":
        """Samples ``first`` to ``last`` (exclusive), with the time they were taken at."""
        channels = {name: values[first:last] for name, values in self.channels.items()}
        kept: list[Stretch] = []
        for begin, stretch in zip((0, *self.joints), self.stretches, strict=False):
            low, high = max(first - begin, 0), min(last - begin, len(stretch))
            if high > low:
                going_on = stretch.continues and bool(kept)
                kept.append(Stretch(stretch.source, stretch.first + low, stretch.first + high, going_on))
        return replace(self, channels=channels, start=self.start + first * self.dt, stretches=tuple(kept))

    def with_motions(self, motions: Mapping[Sensor, Floats]) -> "Record":
        """The same with these motions in place of its own."""
        own = {*self.computed, *map(str, self.sensors)}
        kept = {name: values for name, values in self.channels.items() if name not in own}
        return replace(self, channels=kept | {str(s): values for s, values in motions.items()}, computed=frozenset())

    def relative(self, motion: Floats, span: tuple[int, int] | None = None) -> "Record":
        """A motion along the record, rows displacement and so on of shape (n,), as the record of a single mass.

        With the channels that formulas may name. ``motion`` may be that of a ``span`` alone.
        """
        first, last = span or (0, len(self))
        further = {name: self[name][first:last] for name in self.extra}
        channels = {"force": np.zeros(last - first), **dict(zip(MOTIONS, motion, strict=False)), **further}
        stretches = self.stretches if span is None else ()
        return Record(self.dt, channels, name=self.name, start=self.start + first * self.dt, stretches=stretches)

    def with_channels(self, channels: Mapping[str, Floats]) -> "Record":
        changed = self.changed.union(channels) if self.stretches else self.changed
        return replace(self, channels={**self.channels, **channels}, changed=changed)


def record_of(
    dt: float, forces: Mapping[str, Floats], motions: Mapping[Sensor, Floats],
    extra: Mapping[str, Floats] | None = None, name: str = "record", start: float = 0.0,
) -> Record:  # fmt: skip
    """A record in SI units of forces by name and motions by sensor."""
    channels = {**forces, **{str(sensor): values for sensor, values in motions.items()}, **(extra or {})}
    units = dict.fromkeys(forces, SI_UNITS["force"]) | {str(s): SI_UNITS[s.motion] for s in motions}
    coordinates = tuple(dict.fromkeys(sensor.coordinate for sensor in motions))
    return Record(dt, channels, units, name, start, coordinates=coordinates, forces=tuple(forces))


def write_csv(record: Record, path: Path) -> None:
    """Write time and channels with all digits of a double; units other than SI follow the names."""
    columns: dict[str, Floats] = {"time": record.time}
    for channel, values in record.channels.items():
        unit = record.units.get(channel, "")
        columns[channel if unit in ("", record.usual_unit(channel)) else f"{channel} [{unit}]"] = values
    path.write_bytes(csv_bytes(columns, "%.17g"))


def read_csv(path: Path) -> Record:
    """Read what :func:`write_csv` wrote of a record in SI units. ``readers`` reads all others."""
    head, _, body = path.read_bytes().partition(b"\n")
    names = next(csv.reader([head.decode()]))
    time, *values = np.ascontiguousarray(number_table(body, ",").T)
    dt = round(float(time[-1] - time[0]) / (len(time) - 1), 15)
    channels = dict(zip(names[1:], values, strict=True))
    return Record(dt=dt, channels=channels, name=path.parent.name, start=float(time[0]))
