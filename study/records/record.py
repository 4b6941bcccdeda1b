"""A record: what was measured or simulated, with its units."""

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import accumulate
from pathlib import Path

import numpy as np

from study.support.arrays import Floats

ALONE = ""  # the only coordinate of a single mass has no name, so that its channels are called as their motions are
MOTIONS = ("displacement", "velocity", "acceleration")
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
        """Number of samples."""
        return self.last - self.first

    @property
    def time(self) -> Floats:
        """Time of each sample in seconds, shape (n,)."""
        return self.source.time[self.first : self.last]


@dataclass(frozen=True, eq=False)  # arrays have no single truth value: a record equals itself alone
class Record:
    """Evenly sampled channels.

    Attributes
    ----------
    dt : float
        Sampling interval in seconds.
    channels : dict of float64 arrays, shape (n,)
        ``force`` and at least one of ``displacement, velocity, acceleration``; any further ones.
    units : dict of str
        Unit of each channel; SI by default.
    name : str
        What it is called in tables and file names.
    start : float
        Time of the first sample in seconds.
    period : int, optional
        Samples in one period, where the excitation is periodic.
    stretches : tuple of Stretch
        What it is strung together of; empty for a record of its own.
    changed : set of str
        Channels that are no longer those of its stretches.
    between : str
        What the force does between its samples: one of ``interpolation.READINGS``.
    """

    dt: float
    channels: Mapping[str, Floats]
    units: Mapping[str, str] = field(default_factory=lambda: dict(SI_UNITS))
    name: str = "record"
    start: float = 0.0
    period: int | None = None
    stretches: tuple[Stretch, ...] = ()
    changed: frozenset[str] = frozenset()
    between: str = "band_limited"

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.channels["force"])

    def __getitem__(self, channel: str) -> Floats:
        """One channel."""
        return self.channels[channel]

    def __contains__(self, channel: str) -> bool:
        """Whether the record has this channel."""
        return channel in self.channels

    @property
    def time(self) -> Floats:
        """Time of each sample in seconds, shape (n,)."""
        if self.stretches:
            return np.concatenate([stretch.time for stretch in self.stretches])
        return self.start + self.dt * np.arange(len(self), dtype=np.float64)

    @property
    def begins(self) -> tuple[int, ...]:
        """Samples at which the motion begins anew, the first aside."""
        pairs = zip(self.joints, self.stretches[1:], strict=True)
        return tuple(joint for joint, stretch in pairs if not stretch.continues)

    @property
    def joints(self) -> tuple[int, ...]:
        """Samples at which its stretches begin, the first aside."""
        return tuple(accumulate(len(stretch) for stretch in self.stretches[:-1]))

    def stretch_of(self, sample: int) -> tuple[int, int]:
        """First sample of the stretch that holds this one, and the one after its last."""
        bounds = (0, *self.joints, len(self))
        place = bisect_right(bounds, sample, hi=len(bounds) - 1)
        return bounds[place - 1], bounds[place]

    @property
    def extra(self) -> tuple[str, ...]:
        """Names of channels beside force and motion."""
        return tuple(c for c in self.channels if c != "force" and c not in MOTIONS)

    def part(self, first: int, last: int) -> "Record":
        """Samples ``first`` to ``last`` (exclusive), with the time they were taken at."""
        channels = {name: values[first:last] for name, values in self.channels.items()}
        start = self.start + first * self.dt
        return replace(self, channels=channels, start=start, stretches=self._stretches(first, last))

    def _stretches(self, first: int, last: int) -> tuple[Stretch, ...]:
        """The stretches, or parts of them, that samples ``first`` to ``last`` come from."""
        kept: list[Stretch] = []
        for begin, stretch in zip((0, *self.joints), self.stretches, strict=False):
            low, high = max(first - begin, 0), min(last - begin, len(stretch))
            if high > low:
                going_on = stretch.continues and bool(kept)
                kept.append(Stretch(stretch.source, stretch.first + low, stretch.first + high, going_on))
        return tuple(kept)

    def with_channels(self, channels: Mapping[str, Floats]) -> "Record":
        """The same record with channels replaced or added."""
        changed = self.changed.union(channels) if self.stretches else self.changed
        return replace(self, channels={**self.channels, **channels}, changed=changed)


def write_csv(record: Record, path: Path) -> None:
    """Write time and channels with all digits of a double; units other than SI follow the names."""
    import pandas as pd  # half a second, which records in memory are spared

    named = {heading(name, record.units.get(name, "")): values for name, values in record.channels.items()}
    columns: dict[str, Floats] = {"time": record.time, **named}
    pd.DataFrame(columns).to_csv(path, index=False, float_format="%.17g", lineterminator="\n")


def heading(channel: str, unit: str) -> str:
    """A column's heading: the channel's name, and its unit if that is not the SI one."""
    return channel if unit in ("", SI_UNITS.get(channel, "")) else f"{channel} [{unit}]"


def read_csv(path: Path) -> Record:
    """Read what :func:`write_csv` wrote of a record in SI units. ``readers`` reads all others."""
    import pandas as pd

    table = pd.read_csv(path)  # from pandas 3.1 on, the default parser returns exactly the doubles that were written
    time = table["time"].to_numpy(dtype=np.float64)
    dt = round(float(time[-1] - time[0]) / (len(time) - 1), 15)
    channels = {str(c): table[c].to_numpy(dtype=np.float64) for c in table.columns if c != "time"}
    return Record(dt=dt, channels=channels, name=path.parent.name, start=float(time[0]))
