"""Where a free run has to begin anew, because its system magnifies every disturbance.

In a chaotic system (the report's Dead-Band system is one for long stretches) any error grows until the free
run has nothing to do with the measured motion, however true the model. Segments that are short against that
growth, each with an initial state of its own, keep the fit well posed (multiple shooting; H. G. Bock, 1983).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from study.equations.free_run import FreeRun, prepare
from study.equations.model import Model
from study.records.outputs import Outputs
from study.records.record import MOTIONS, Record, Sensor
from study.records.states import REACH, angular_rate, starting_states
from study.support.arrays import Floats
from study.support.errors import DivergenceError

GROWTH = 10.0  # factor by which a disturbance may be magnified within a segment
SEGMENT_PERIODS = 1.0  # of the motion, with which a search from afar begins
REACHES = (0.07, 0.15, REACH, 0.3)  # widths of smoothing, in periods, that are tried for the first states


def even_restarts(record: Record, outputs: Outputs, span: tuple[int, int]) -> tuple[int, ...]:
    """Restarts that cut a span into segments of ``SEGMENT_PERIODS`` of the motion, and where a stretch begins in it."""
    first, last = span
    rate = slowest_rate(outputs.measured(record, span), record.dt)
    begins = own_begins(record, span)
    restarts = list[int]()
    for begin, end in pairwise((first, *begins, last)):
        count = max(1, round((end - begin) * record.dt * rate / (2.0 * np.pi * SEGMENT_PERIODS)))
        restarts += [int(r) for r in np.linspace(begin, end, count + 1).round()[1:]]
    return tuple(restarts[:-1])


def slowest_rate(motions: Floats, dt: float) -> float:
    """Angular frequency in rad/s of the slowest of some motions, shape (n, motions)."""
    return min(angular_rate(motion, dt) for motion in motions.T)


def own_begins(record: Record, span: tuple[int, int]) -> tuple[int, ...]:
    """Samples within a span at which a stretch of the record begins, its first aside."""
    return tuple(b for b in record.begins if span[0] < b < span[1])


def needed_restarts(
    model: Model, record: Record, states: Floats, span: tuple[int, int], restarts: Sequence[int], steps_per_sample: int
) -> tuple[int, ...]:  # fmt: skip
    """Which restarts of a fitted model have to stay, given the state at the beginning of each segment.

    The derivative of the state at a segment's end by that at its beginning is taken from a free run; products
    of them say how a disturbance at any restart grows until any later one. Displacements and velocities are
    counted in what is independent of the motion, so that a linear system without damping has growth one.
    """
    if not restarts:  # a motion of a single period or less
        return ()
    sensors = [Sensor(coordinate, "displacement") for coordinate in model.inertial]
    run = prepare(model, record, sensors=sensors, steps_per_sample=steps_per_sample, span=span, restarts=restarts)
    motion, _, arrivals = run.respond_by_segment({}, states, run.moving)
    counted = [_independent(x) for x in (motion - np.mean(motion, axis=0), np.diff(motion, axis=0) / record.dt)]
    unit = block_diag(*counted)
    weighted = np.linalg.inv(unit) @ arrivals[:, : run.moving, 1:] @ unit
    kept: list[int] = []
    nothing = np.empty((0, *weighted.shape[1:]))
    grown = nothing  # from each restart that matters to where the present segment ends
    own = own_begins(record, span)
    alone = _largest(weighted)  # of each segment: most are all that there is to look at
    for begin, through, size in zip((span[0], *restarts[:-1]), weighted, alone, strict=True):
        if begin in own:  # nothing from before reaches a motion that begins anew
            grown = nothing
        if not len(grown) and size <= 1.0:  # shrinks, and nothing from before is left to grow
            continue
        grown = through @ grown
        sizes: Floats = np.append(_largest(grown), size)
        grown = np.concatenate([grown, through[np.newaxis]])
        if np.max(sizes) > GROWTH and len(grown) > 1:
            kept.append(begin)
            grown, sizes = grown[-1:], sizes[-1:]
        grown = grown[sizes > 1.0]  # what has shrunk can grow no further than what begins here will
    return tuple(kept)


def _largest(matrices: Floats) -> Floats:
    """By how much each matrix magnifies at most, shape (matrices,)."""
    return np.asarray(np.linalg.svd(matrices, compute_uv=False), dtype=np.float64)[:, 0]


def _independent(motions: Floats) -> Floats:
    """Motions, shape (n, motions), as multiples of independent ones of unit size: their mixture, (motions, motions).

    The modes of a linear structure stay apart, whatever the size of each.
    """
    size, vectors = np.linalg.eigh(motions.T @ motions / len(motions))
    least = np.finfo(float).eps * max(float(size[-1]), np.finfo(float).tiny)
    return np.asarray(vectors * np.sqrt(np.maximum(size, least)), dtype=np.float64)


@dataclass(frozen=True)
class ShootingSegments:
    """A span of a record cut into segments, each run from an initial state of its own.

    Attributes
    ----------
    record : Record
        Force and response.
    outputs : Outputs
        The measured motions that are compared.
    span : pair of int
        First sample, and the one after the last.
    restarts : tuple of int
        Samples of the record at which the segments after the first begin.
    steps_per_sample : int
        Runge-Kutta steps in each sampling interval.
    """

    record: Record
    outputs: Outputs
    span: tuple[int, int]
    restarts: tuple[int, ...]
    steps_per_sample: int

    @property
    def spread(self) -> float:
        """Standard deviation of the measured motion within the span."""
        return float(np.std(self._measured))

    @property
    def _measured(self) -> Floats:
        return self.outputs.stacked(self.outputs.measured(self.record, self.span))

    def _run(self, model: Model) -> FreeRun:
        return prepare(
            model, self.record, sensors=self.outputs.sensors, steps_per_sample=self.steps_per_sample,
            span=self.span, restarts=self.restarts,
        )  # fmt: skip

    def misfits(self, model: Model, states: Floats) -> Floats:
        """Sum of squares of the residual of each segment, shape (segments,)."""
        residual = self._measured - self.outputs.stacked(self._run(model).respond_by_segment({}, states)[0])
        firsts = [0, *(len(self.outputs) * (r - self.span[0]) for r in self.restarts)]
        return np.add.reduceat(residual**2, firsts)

    def passing(self, model: Model, restarts: Sequence[int], states: Floats) -> Floats:
        """State at the beginning of each segment, of a motion with fewer restarts, shape (segments, states).

        ``states`` are those of its first sample and of its ``restarts``, which are among this span's own.
        """
        begins = (self.span[0], *self.restarts)
        numbers = [begins.index(r) for r in (self.span[0], *restarts)]
        return self._run(model).passing(dict(zip(numbers, np.atleast_2d(states), strict=True)))

    def first_states(self, model: Model) -> Floats:
        """Initial states as the record shows them, smoothed as widely as fits each segment best, or not at all.

        Shape (segments, states). A width with which the model diverges is left out.
        """
        begins = (self.span[0], *self.restarts)
        count = 2 * len(model.inertial)
        best, least = np.zeros((len(begins), count + len(model.states))), np.full(len(begins), np.inf)
        for moving in self._shown(begins, model.inertial):
            states = np.zeros_like(best)
            states[:, :count] = moving
            try:
                misfits = self.misfits(model, states)
            except DivergenceError:
                continue
            best = np.where((misfits < least)[:, None], states, best)
            least = np.minimum(misfits, least)
        return best

    def _shown(self, begins: Sequence[int], coordinates: Sequence[str]) -> list[Floats]:
        """Displacements and velocities at these samples, smoothed more and more widely; at last as they stand there."""
        shown = [starting_states(self.record, self.outputs, begins, reach, coordinates) for reach in REACHES]
        names = [str(Sensor(coordinate, motion)) for motion in MOTIONS[:2] for coordinate in coordinates]
        if set(names) <= set(self.record.channels):
            shown.append(np.stack([self.record[name][list(begins)] for name in names], axis=1))
        return shown
