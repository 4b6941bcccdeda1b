"""Models running free under measured forces, with the exact derivatives of what is observed.

State and sensitivities are integrated together by the classical Runge-Kutta method. Runge-Kutta applied
to the variational equations gives exactly the derivative of the Runge-Kutta map, so the Jacobian is that
of the numbers which the simulation yields, not of an idealisation of them.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from threading import local

import numpy as np

from study.equations import kernels
from study.equations.model import Model, named_channels
from study.equations.motion_program import MotionProgram, motion_program
from study.records.interpolation import between_runs, between_samples_kept, in_columns, runs_of
from study.records.outputs import DISPLACEMENT, Outputs
from study.records.record import ALONE, MOTIONS, Record, Sensor
from study.records.states import angular_rate, starting_states
from study.support import work
from study.support.arrays import Floats, Ints
from study.support.cores import two_at_once
from study.support.errors import DivergenceError, StudyError, expect
from study.support.recent import Recent

SHARED = 4096  # steps from which on two threads share the segments; with fewer, a thread costs more than it saves
ROUGH = 0.5  # largest step times the fastest rate
FINE = 0.125  # largest step times the median rate: a short time of fast rates asks for no smaller steps
LOWEST_BOUND, HIGHEST_BOUND = 4, 32  # steps a sample between which the median rate sets the bound
Drive = tuple[Floats, tuple[tuple[int, float], ...], Ints | None]


@dataclass(frozen=True)
class FreeRun:
    """A model and a stretch of a record, made ready to run as often as a fit needs."""

    motion: MotionProgram  # held values are in its registers
    keys: tuple[str, ...]  # coefficients and shape parameters to differentiate by
    drive: Floats  # what drives at every half step, (2 steps samples or more, channels)
    dt: float  # sampling interval in seconds
    steps: int  # in each sampling interval
    starts: tuple[tuple[int, float], ...]  # samples at which motions begin anew, and their times in seconds
    samples: int  # in the stretch
    cuts: tuple[int, ...] = ()  # samples of the stretch at which the motion begins anew from a state of its own
    places: Ints | None = None  # where samples lie along motions that run on between stretches; all of them if left out

    @property
    def states(self) -> int:
        """How many states a motion has: displacements, velocities, and the terms' own."""
        return self.motion.states

    @property
    def moving(self) -> int:
        """How many of them are displacements and velocities."""
        return 2 * self.motion.dofs

    @property
    def start(self) -> float:
        """Time of the first sample in seconds."""
        return self.starts[0][1]

    def times(self, samples: Ints) -> Floats:
        """Times of samples along the motions in seconds, shape (samples,)."""
        begins, starts = np.array([s[0] for s in self.starts]), np.array([s[1] for s in self.starts])
        of = np.searchsorted(begins, samples, side="right") - 1
        return np.asarray(starts[of] + (samples - begins[of]) * self.dt, dtype=np.float64)

    @property
    def length(self) -> int:
        """Samples that the motions run along."""
        return len(self.drive) // (2 * self.steps) if self.places is not None else self.samples

    def along(self, bounds: Sequence[int]) -> list[int]:
        """Where samples of the stretch, and its end, lie along the motions."""
        if self.places is None:
            return list(bounds)
        return [int(self.places[b]) if b < self.samples else self.length for b in bounds]

    def respond(
        self, values: Mapping[str, float], initial: Sequence[float] | Floats, free_states: int = 0
    ) -> tuple[Floats, Floats]:
        """What is observed and its derivatives.

        Parameters
        ----------
        values : mapping of float
            Value of each key.
        initial : array, shape (states,) or (cuts + 1, states)
            Displacements, velocities and the terms' own states at the first sample, and at each cut, which may follow
            each other in one row; what is left out is zero.
        free_states : int
            How many of the initial states to differentiate by, after the keys.

        Returns
        -------
        response : array, shape (samples, sensors)
        jacobian : array, shape (samples, sensors, keys + (cuts + 1) free_states)

        A motion that leaves the range of finite numbers raises a ``DivergenceError``.
        """
        response, own, _ = self.respond_by_segment(values, initial, free_states)
        if not self.cuts:
            return response, own
        keys, bounds = len(self.keys), (0, *self.cuts, self.samples)
        jacobian = np.zeros((*response.shape, keys + (len(bounds) - 1) * free_states))
        jacobian[..., :keys] = own[..., :keys]
        for i, (begin, end) in enumerate(pairwise(bounds)):
            first = keys + i * free_states
            jacobian[begin:end, :, first : first + free_states] = own[begin:end, :, keys:]
        return response, jacobian

    def respond_by_segment(
        self, values: Mapping[str, float], initial: Sequence[float] | Floats, free_states: int = 0
    ) -> tuple[Floats, Floats, Floats]:
        """As :meth:`respond`, the derivatives by the initial state of each sample's own segment alone.

        Returns
        -------
        response : array, shape (samples, sensors)
        jacobian : array, shape (samples, sensors, keys + free_states)
        arrivals : array, shape (cuts, states, 1 + keys + free_states)
            State in which each segment but the last arrives where the next begins, beside its derivatives.
        """
        out, arrivals = self._columns(values, initial, 1 + len(self.keys) + free_states)
        return out[:, :, 0], out[:, :, 1:], arrivals

    def move_by_segment(
        self, values: Mapping[str, float], initial: Sequence[float] | Floats
    ) -> tuple[Floats, Floats]:  # fmt: skip
        """Response and arrivals of :meth:`respond_by_segment`, to the last bit, without derivatives: (cuts, states)."""
        out, arrivals = self._columns(values, initial, 1)
        return out[:, :, 0], arrivals[:, :, 0]

    def _columns(
        self, values: Mapping[str, float], initial: Sequence[float] | Floats, columns: int
    ) -> tuple[Floats, Floats]:
        """What is observed and the arrivals, in so many columns: the value, derivatives by keys, by initial states."""
        bounds = (0, *self.cuts, self.samples)
        states = np.atleast_2d(initial)
        if np.ndim(initial) == 1 and states.size == self.states * (len(bounds) - 1):
            states = states.reshape(len(bounds) - 1, self.states)
        if len(states) != len(bounds) - 1:
            raise StudyError(f"{len(states)} initial states were given; {len(bounds) - 1} segments need one each")
        program = self.motion.program.with_inputs({key: values[key] for key in self.keys})
        motion = replace(self.motion, program=program)
        first_free = 1 + len(self.keys)
        state = np.zeros((len(states), self.states, columns))  # one array for all segments is faster
        state[:, : states.shape[1], 0] = states
        state[:, range(columns - first_free), range(first_free, columns)] = 1.0
        out, state = self._run(motion, bounds, state)
        if self.places is not None:
            out = out[self.places]
        return out, state[:-1]

    def _run(self, motion: MotionProgram, bounds: tuple[int, ...], state: Floats) -> tuple[Floats, Floats]:
        """What is observed along all of the motions, and the states in which they arrive.

        A fit ends where one of its last runs was, and what is asked of it first is that run again: a thread keeps its
        latest.
        """
        same = (motion.program.registers.tobytes(), motion.observed.tobytes(), state.tobytes(), state.shape)
        where = (id(motion.program.code), self.drive.__array_interface__["data"], self.drive.shape, self.drive.strides)
        key = (*where, *same, self.dt, self.steps, self.starts, bounds)
        for run in _LATEST.runs:
            if run.key == key:
                work.add(run.operations)
                return run.out.copy(), run.arrived.copy()
        out = np.empty((self.length, len(motion.observed), state.shape[2]))
        if len(state) == 1 or self.samples * self.steps < SHARED:
            operations = self._integrate(motion, bounds, state, out)
        else:
            half = 1 + int(np.argmin(np.abs(np.array(bounds[1:-1]) - self.samples / 2)))  # segments differ in length
            operations = sum(two_at_once(
                lambda: self._integrate(motion, bounds[half:], state[half:], out),
                lambda: self._integrate(motion, bounds[: half + 1], state[:half], out),
            ))  # fmt: skip
        _LATEST.keep(_Run(key, (motion.program.code, self.drive), out, state, operations))
        return out, state

    def passing(self, initial: Mapping[int, Floats]) -> Floats:
        """State at the first sample of each segment, shape (cuts + 1, states), of a motion with fewer restarts.

        ``initial`` gives the state of those segments that begin anew, by their numbers; the first, 0, is one of them.
        """
        firsts, anew = np.array((0, *self.cuts)), sorted(initial)
        motion = replace(self.motion, observed=np.arange(self.states))  # a row of a program is a state before all else
        state = np.stack([np.asarray(initial[i], dtype=np.float64) for i in anew])[:, :, np.newaxis]
        out, _ = self._run(motion, (*firsts[anew].tolist(), self.samples), state)
        return out[self.along(firsts.tolist()), :, 0]

    def _integrate(self, motion: MotionProgram, cuts: Sequence[int], states: Floats, out: Floats) -> int:
        """What is observed, and derivatives, into ``out``; ``states`` become those at which the next segments begin.

        Returns how many operations it took.
        """
        bounds = np.array(self.along(cuts), dtype=np.int64)
        starts = self.times(bounds[:-1])
        method = kernels.Method.SUMMED if motion.dofs else kernels.Method.ONE_BY_ONE  # as before, to the last bit
        failed, operations = kernels.integrate(
            motion, starts, self.dt, self.steps, self.drive, bounds, states, out, method
        )
        if failed >= 0:
            time = float(self.times(np.array([failed]))[0])
            raise DivergenceError(f"the free run diverged at t = {time:.4g} s", time)
        return operations


@dataclass(frozen=True)
class _Run:
    """A run that a thread keeps; what it is told by the place of is held, so that nothing else comes to lie there."""

    key: tuple[object, ...]
    held: tuple[Ints, Floats]
    out: Floats
    arrived: Floats
    operations: int


class _Latest(local):
    """The latest runs of each thread, but no long ones."""

    def __init__(self) -> None:
        self.runs: deque[_Run] = deque(maxlen=4)

    def keep(self, run: _Run) -> None:
        """Keep a run, whose arrays stay their owner's; with it stays all of what drives, of which it may be a part."""
        drive = run.held[1]
        if run.out.nbytes + (drive if drive.base is None else drive.base).nbytes <= 1 << 23:
            self.runs.appendleft(replace(run, out=run.out.copy(), arrived=run.arrived.copy()))


_LATEST = _Latest()


def prepare(
    model: Model,
    record: Record,
    keys: Sequence[str] = (),
    *,
    sensors: Sequence[Sensor] = (Sensor(ALONE, MOTIONS[0]),),
    steps_per_sample: int = 2,
    span: tuple[int, int] | None = None,
    restarts: Sequence[int] = (),
) -> FreeRun:
    """Make a model ready to run under the forces of a record; coordinates without inertia, along their motion.

    Where the record is strung together of stretches, the motion begins anew at each.

    Parameters
    ----------
    model : Model
        Every value known but those of ``keys``.
    record : Record
        Gives forces, motions that are prescribed, and the extra channels which the user's own terms name.
    keys : sequence of str
        The coefficients and shape parameters to differentiate by.
    sensors : sequence of Sensor
        What is observed: motions, or the force on a coordinate whose motion is prescribed.
    steps_per_sample : int
        Runge-Kutta steps in each sampling interval.
    span : pair of int, optional
        First sample, and the one after the last; the whole record if left out.
    restarts : sequence of int
        Samples of the record, within the span, at which the motion begins anew (``shooting``).
    """
    first, last = span or (0, len(record))
    if not 0 <= first < last - 1 < len(record):
        raise StudyError(
            f"the span {first} to {last} does not lie in the {len(record)} samples of {record.name!r}; "
            "it must begin at 0 or later, end by the last sample and hold two at least"
        )
    cuts = tuple(sorted({*restarts, *(b for b in record.begins if first < b < last)}))
    if list(restarts) != sorted(set(restarts)) or any(b - a < 2 for a, b in pairwise((first, *cuts, last))):
        raise StudyError(f"the restarts {tuple(restarts)} must rise, and leave two samples between {first} and {last}")
    expect(steps_per_sample >= 1, f"steps_per_sample is {steps_per_sample}; at least 1 is needed")
    named_channels(model, record.extra)
    motion = motion_program(model, keys, sensors)
    lacking = ", ".join(name for name in motion.drive if name not in record)
    expect(not lacking, f"record {record.name!r} has no channel {lacking}; expected {', '.join(motion.drive)}")
    drive, starts, places = along_motions(record, (first, last), motion.drive, 2 * steps_per_sample)
    return FreeRun(
        motion, tuple(keys), drive, record.dt, steps_per_sample, starts, last - first, tuple(c - first for c in cuts),
        places,
    )  # fmt: skip


def along_motions(record: Record, span: tuple[int, int], driving: tuple[str, ...], factor: int) -> Drive:
    """What drives the motions of a span, where these begin and when, and where its samples lie along them.

    The motions begin with the first sample of the span, and anew at each stretch of a record that is strung together.

    Parameters
    ----------
    record : Record
        Has the channels.
    span : pair of int
        First sample, and the one after the last.
    driving : tuple of str
        The channels.
    factor : int
        Intervals into which each sampling interval is divided.

    Returns
    -------
    drive : array, shape (factor (samples - 1) + 1, channels)
    starts : tuple of (int, float)
        Samples at which motions begin, and their times in seconds.
    places : int array, shape (samples,), or None
        Where the samples of the span lie along the motions; None where these are no more than the span.
    """
    if record.stretches:
        return _along_stretches(record, span, driving, factor)
    first, last = span
    columns = [_kept(record[name], factor, record.reading(name), span) for name in driving]
    drive = in_columns(columns, factor * (last - first))
    return drive, ((0, record.start + first * record.dt),), None


def _along_stretches(record: Record, span: tuple[int, int], driving: tuple[str, ...], factor: int) -> Drive:
    """As :func:`along_motions`, of a record that is strung together."""

    def made() -> Drive:
        part = record.part(*span)
        runs, places = runs_of(part)
        starts, begin = list[tuple[int, float]](), 0
        for run in runs:
            starts.append((begin, float(run.source.time[run.first])))
            begin += len(run)
        columns = [between_runs(part, name, factor, _kept) for name in driving]
        drive = in_columns(columns, factor * begin)
        drive.flags.writeable = False
        return drive, tuple(starts), places

    size = 8 * (len(record) * len(record.channels) + (span[1] - span[0]) * (1 + factor * len(driving)))
    return _MOTIONS.get((record, span, driving, factor), size, made)


def _kept(values: Floats, factor: int, reading: str, span: tuple[int, int] | None = None) -> Floats:
    """A channel between its samples; a diagnosis makes hundreds of runs under the same force."""
    return between_samples_kept(_FORCES, values, factor, reading, span)


_FORCES, _MOTIONS = Recent(), Recent(largest=1 << 25)  # of a long record the second is put together in no time


def predict_response(
    model: Model,
    record: Record,
    *,
    response: str = "displacement",
    steps_per_sample: int = 2,
    span: tuple[int, int] | None = None,
    initial: Sequence[float] = (0.0, 0.0),
) -> Floats:
    """Response of a complete model of a single mass in free run, shape (samples of the span,); as :func:`prepare`.

    ``initial`` has displacement, velocity and, if given, the terms' own states at the first sample of the span.
    """
    model.numbers()
    sensors = (Sensor(ALONE, response),)
    run = prepare(model, record, sensors=sensors, steps_per_sample=steps_per_sample, span=span)
    return run.respond({}, initial)[0][:, 0]


def needed_steps(
    model: Model, record: Record, outputs: Outputs = DISPLACEMENT, most: int | None = None
) -> int:  # fmt: skip
    """Steps in each sampling interval with which a search may begin, the values of the model all known.

    ``most`` are taken at most; the median rate bounds them if it is left out. A Runge-Kutta step h of an oscillation of
    rate w shifts its phase by ``(h w)^5 / 120`` and grows without end above ``h w = 2.8``, which heavy damping or a
    short memory reaches though the motion is slow. So rates are the largest eigenvalues of the equation of motion,
    linearised along the motion.
    """
    rates = _rates(model, record, outputs)
    if not np.all(np.isfinite(rates)):
        return most or LOWEST_BOUND
    most = most or int(np.clip(np.ceil(np.median(rates) * record.dt / FINE), LOWEST_BOUND, HIGHEST_BOUND))
    motions = outputs.measured(record, (0, len(record)))
    fastest = max(float(np.max(rates)), *(angular_rate(motion, record.dt) for motion in motions.T))
    return int(np.clip(np.ceil(fastest * record.dt / ROUGH), 1, most))


def _rates(model: Model, record: Record, outputs: Outputs) -> Floats:
    """Magnitude of the largest eigenvalue at each point, in rad/s, shape (points,)."""
    run = prepare(model, record, sensors=(), steps_per_sample=1)
    samples = np.unique(np.linspace(0, len(record) - 1, 64).astype(np.int64))
    motion, n = run.motion, run.motion.dofs
    if run.states == 0:
        return np.zeros(1)
    names = list(motion.program.inputs)  # the time, what drives, displacements and velocities
    moved = names[1 + len(motion.drive) :][: 2 * n]
    states = starting_states(record, outputs, samples.tolist(), coordinates=[name[2:] for name in moved[:n]])
    drive = run.drive[2 * np.array(run.along(samples.tolist()))]
    columns = dict(zip(names[1:], drive.T, strict=False)) | dict(zip(moved, states.T, strict=True))
    return rates_at(motion, columns | {"t": record.time[samples]}, len(samples))


def rates_at(motion: MotionProgram, columns: Mapping[str, Floats], samples: int) -> Floats:
    """Magnitude of the largest eigenvalue of a motion linearised at each sample, in rad/s, shape (samples,).

    ``columns`` has time, what drives, and states by their names in the program, shape (samples,) each; infinite where
    the equations are not finite.
    """
    n, states = motion.dofs, motion.states
    partial = replace(motion.program, outputs=motion.slots[: states - n, 1 : 1 + states].ravel())
    with np.errstate(all="ignore"):
        slopes = kernels.evaluate(partial, columns, samples)
    if not np.all(np.isfinite(slopes)):
        return np.full(samples, np.inf)
    jacobian = np.zeros((samples, states, states))
    jacobian[:, np.arange(n), np.arange(n, 2 * n)] = 1.0
    jacobian[:, n:] = slopes.reshape(samples, -1, states)
    return np.asarray(np.max(np.abs(np.linalg.eigvals(jacobian)), axis=1, initial=0.0), dtype=np.float64)
