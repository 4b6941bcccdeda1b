"""What was measured on a structure: forces, and motions at some of its coordinates."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from study.records.record import SI_UNITS, Sensor, Stretch
from study.support.arrays import Floats


@dataclass(frozen=True, eq=False)
class StructureRecord:
    """Evenly sampled forces and motions of a structure; n samples.

    Attributes
    ----------
    dt : float
        Sampling interval in seconds.
    forces : mapping of arrays, shape (n,)
        By the names that the model gives them.
    motions : mapping of arrays, shape (n,)
        By sensor.
    extra : mapping of arrays, shape (n,)
        Further channels, for formulas to name.
    units : mapping of str
        Of ``force``, and of ``displacement, velocity, acceleration``.
    name : str
        What it is called in tables and file names.
    start : float
        Time of the first sample in seconds.
    rotations : frozenset of str
        Coordinates that were measured as angles: their forces are moments.
    stretches : tuple of Stretch
        What it is strung together of, each a motion from a state of its own; empty for a record of its own.
    whole : StructureRecord, optional
        The record that the stretches are of.
    """

    dt: float
    forces: Mapping[str, Floats]
    motions: Mapping[Sensor, Floats]
    extra: Mapping[str, Floats] = field(default_factory=dict[str, Floats])
    units: Mapping[str, str] = field(default_factory=lambda: dict(SI_UNITS))
    name: str = "record"
    start: float = 0.0
    rotations: frozenset[str] = frozenset()
    stretches: tuple[Stretch, ...] = ()
    whole: "StructureRecord | None" = None

    def __len__(self) -> int:
        """Number of samples."""
        return len(next(iter((*self.motions.values(), *self.forces.values()))))

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """The measured motions."""
        return tuple(self.motions)

    @property
    def time(self) -> Floats:
        """Time of each sample in seconds, shape (n,)."""
        if self.stretches:
            return np.concatenate([stretch.time for stretch in self.stretches])
        return self.start + self.dt * np.arange(len(self), dtype=np.float64)

    @property
    def joints(self) -> tuple[int, ...]:
        """Samples at which its stretches begin, the first aside."""
        return tuple(itertools.accumulate(len(stretch) for stretch in self.stretches[:-1]))

    def runs(self, span: tuple[int, int]) -> tuple[tuple[int, int], ...]:
        """The parts of a span along each of which the motion goes on without a break: first sample, and last + 1."""
        bounds = (span[0], *(joint for joint in self.joints if span[0] < joint < span[1]), span[1])
        return tuple(itertools.pairwise(bounds))

    def run_of(self, sample: int) -> tuple[int, int]:
        """First sample of the stretch that holds this one, and the one after its last."""
        return next(run for run in self.runs((0, len(self))) if run[0] <= sample < run[1])

    @property
    def measured(self) -> Floats:
        """All sensors, shape (sensors, n)."""
        return np.stack([self.motions[s] for s in self.sensors])

    def with_motions(self, motions: Mapping[Sensor, Floats]) -> "StructureRecord":
        """The same forces with other motions."""
        return replace(self, motions=motions)


def write_structure_csv(record: StructureRecord, path: Path) -> None:
    """Write time, forces and motions with all digits of a double, in columns such as ``floor1 acceleration``."""
    import pandas as pd  # half a second, which records in memory are spared

    columns = {"time": record.time, **record.forces, **{str(s): x for s, x in record.motions.items()}, **record.extra}
    pd.DataFrame(columns).to_csv(path, index=False, float_format="%.17g", lineterminator="\n")
