"""A model running free under a measured force, with the exact derivatives of its response.

State and sensitivities are integrated together by the classical Runge-Kutta method. Runge-Kutta applied
to the variational equations gives exactly the derivative of the Runge-Kutta map, so the Jacobian is that
of the numbers which the simulation yields, not of an idealisation of them.
"""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from study.equations import kernels
from study.equations.drive import FORCE, along_motions
from study.equations.graph import Program
from study.equations.model import Model, named_channels, with_registers
from study.equations.variation import Variation, differentiated
from study.records.record import ALONE, MOTIONS, Record, Sensor
from study.support.arrays import Floats, Ints
from study.support.errors import DivergenceError, StudyError

SHARED = 4096  # steps from which on two threads share the segments; with fewer, a thread costs more than it saves


@dataclass(frozen=True)
class FreeRun:
    """A model and a stretch of a record, made ready to run as often as a fit needs.

    Attributes
    ----------
    program : Program
        Slopes of the states, then their partial derivatives; held values are in its registers.
    variation : Variation
        Where in the program slopes and partial derivatives lie.
    keys : tuple of str
        The coefficients and shape parameters to differentiate by.
    drive : array, shape (2 steps (samples - 1) + 3, 1 + channels)
        Force, and the channels that the model's formulas name, at every half step.
    dt : float
        Sampling interval in seconds.
    steps : int
        Steps in each sampling interval.
    starts : tuple of (int, float)
        Samples at which motions begin anew, and their times in seconds.
    samples : int
        Samples in the stretch.
    places : int array, shape (samples,), optional
        Where the samples lie along the motions, which run on between stretches; all that they run along if left out.
    row : int
        Which motion is the response: its place in ``MOTIONS``.
    cuts : tuple of int
        Samples of the stretch at which the motion begins anew from a state of its own.
    motion : array, shape (samples,), optional
        The response where it is a motion that is prescribed (``known``).
    known : bool
        Whether the motion is prescribed and the force is what is predicted: the model has no inertia. ``drive`` then
        begins with displacement and velocity, and only the terms' own states are integrated.
    """

    program: Program
    variation: Variation
    keys: tuple[str, ...]
    drive: Floats
    dt: float
    steps: int
    starts: tuple[tuple[int, float], ...]
    samples: int
    row: int
    cuts: tuple[int, ...] = ()
    motion: Floats | None = None
    known: bool = False
    places: Ints | None = None

    @property
    def moving(self) -> int:
        """How many of them are displacement and velocity."""
        return 0 if self.known else 2

    def time(self, sample: int) -> float:
        """Time of a sample along the motions in seconds."""
        begin, start = self.starts[bisect_right(self.starts, sample, key=lambda s: s[0]) - 1]
        return start + (sample - begin) * self.dt

    @property
    def length(self) -> int:
        """Samples that the motions run along."""
        return len(self.drive) // (2 * self.steps) if self.places is not None else self.samples

    def along(self, bounds: Sequence[int]) -> list[int]:
        """Where samples of the stretch, and its end, lie along the motions."""
        if self.places is None:
            return list(bounds)
        return [int(self.places[b]) if b < self.samples else self.length for b in bounds]

    @property
    def states(self) -> int:
        """How many states it has: displacement, velocity and the terms' own, or these alone."""
        return len(self.variation.slots) - 1 if self.known else self.variation.states

    def respond(
        self, values: Mapping[str, float], initial: Sequence[float] | Floats, free_states: int = 0
    ) -> tuple[Floats, Floats]:
        """Response and its derivatives.

        Parameters
        ----------
        values : mapping of float
            Value of each key.
        initial : array, shape (states,) or (cuts + 1, states)
            Displacement, velocity and, if given, the terms' own states at the first sample, and at each cut.
        free_states : int
            How many of the initial states to differentiate by, after the keys.

        Returns
        -------
        response : array, shape (samples, sensors)
        jacobian : array, shape (samples, sensors, keys + (cuts + 1) free_states)

        Raises
        ------
        DivergenceError
            If the response leaves the range of finite numbers.
        """
        response, own, _ = self.respond_by_segment(values, initial, free_states)
        if not self.cuts:
            return response, own
        keys, bounds = len(self.keys), (0, *self.cuts, self.samples)
        jacobian = np.zeros((*own.shape[:2], keys + (len(bounds) - 1) * free_states))
        jacobian[:, :, :keys] = own[:, :, :keys]
        for i, (begin, end) in enumerate(pairwise(bounds)):
            jacobian[begin:end, :, keys + i * free_states : keys + (i + 1) * free_states] = own[begin:end, :, keys:]
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
        states, bounds = np.atleast_2d(initial), (0, *self.cuts, self.samples)
        if len(states) != len(bounds) - 1:
            raise StudyError(f"{len(states)} initial states were given; {len(bounds) - 1} segments need one each")
        program = with_registers(self.program, {key: values[key] for key in self.keys})
        first_free = 1 + len(self.keys)
        out = np.empty((self.length, first_free + free_states))
        state = np.zeros((len(states), self.states, out.shape[1]))  # one array for all segments is faster
        state[:, : states.shape[1], 0] = states
        state[:, range(free_states), range(first_free, out.shape[1])] = 1.0
        if len(states) == 1 or self.samples * self.steps < SHARED:
            self._integrate(program, bounds, state, out)
        else:
            half = 1 + int(np.argmin(np.abs(np.array(bounds[1:-1]) - self.samples / 2)))  # segments differ in length
            with ThreadPoolExecutor(1) as beside:
                other = beside.submit(self._integrate, program, bounds[half:], state[half:], out)
                self._integrate(program, bounds[: half + 1], state[:half], out)
                other.result()
        if self.places is not None:
            out = out[self.places]
        if self.motion is not None:
            return self.motion[:, None], np.zeros_like(out[:, None, 1:]), state[:-1]
        return out[:, None, 0], out[:, None, 1:], state[:-1]

    def passing(self, initial: Mapping[int, Floats]) -> Floats:
        """State at the first sample of each segment, shape (cuts + 1, states), of a motion with fewer restarts.

        ``initial`` gives the state of those segments that begin anew, by their numbers; the first, 0, is one of them.
        """
        bounds = (0, *self.cuts, self.samples)
        states, state = np.empty((len(bounds) - 1, self.states)), np.empty((1, self.states, 1))
        room = np.empty((self.length, 1))
        for i, segment in enumerate(pairwise(bounds)):
            if i in initial:
                state[0, :, 0] = initial[i]
            states[i] = state[0, :, 0]
            self._integrate(self.program, segment, state, room)
        return states

    def _integrate(self, program: Program, cuts: Sequence[int], states: Floats, out: Floats) -> None:
        """Response and derivatives into ``out``; ``states`` become those at which the next segments begin."""
        bounds = self.along(cuts)
        starts = np.array([self.time(begin) for begin in bounds[:-1]])
        if self.known:
            failed = kernels.integrate_known(
                program.code, program.first, program.registers.copy(), self.variation.slots, starts, self.dt,
                self.steps, self.drive, np.array(bounds), states, out,
            )  # fmt: skip
        else:
            failed = kernels.integrate_segments(
                program.code, len(program.inputs), program.first, program.registers.copy(), self.variation.slots,
                self.variation.side, starts, self.dt, self.steps, self.drive, np.array(bounds), states, self.row, out,
            )  # fmt: skip
        if failed >= 0:
            time = self.time(failed)
            raise DivergenceError(f"the free run diverged at t = {time:.4g} s", time)


def prepare(
    model: Model,
    record: Record,
    keys: Sequence[str] = (),
    *,
    sensors: Sequence[Sensor] = (Sensor(ALONE, "displacement"),),
    steps_per_sample: int = 2,
    span: tuple[int, int] | None = None,
    restarts: Sequence[int] = (),
) -> FreeRun:
    """Make a model ready to run under the force of a record; one without inertia, along its motion.

    Where the record is strung together of stretches, the motion begins anew at each.

    Parameters
    ----------
    model : Model
        Every value known but those of ``keys``.
    record : Record
        Gives the force, and the extra channels which the user's own terms name.
    keys : sequence of str
        The coefficients and shape parameters to differentiate by.
    sensors : sequence of Sensor
        The motions that are wanted; ``force`` of a model without inertia.
    steps_per_sample : int
        Runge-Kutta steps in each sampling interval.
    span : pair of int, optional
        First sample, and the one after the last; the whole record if left out.
    restarts : sequence of int
        Samples of the record, within the span, at which the motion begins anew (``shooting``).

    Raises
    ------
    StudyError
        If a value, a channel, the span or a restart is invalid.
    """
    (response,) = (sensor.motion for sensor in sensors)
    first, last = _checked_span(record, span)
    cuts = tuple(sorted({*restarts, *(b for b in record.begins if first < b < last)}))
    if list(restarts) != sorted(set(restarts)) or any(b - a < 2 for a, b in pairwise((first, *cuts, last))):
        raise StudyError(f"the restarts {tuple(restarts)} must rise, and leave two samples between {first} and {last}")
    known = "inertia" not in model
    if response not in MOTIONS and not (known and response == FORCE):
        raise StudyError(f"there is no response {response!r}; a free run yields {', '.join(MOTIONS)}")
    if steps_per_sample < 1:
        raise StudyError(f"steps_per_sample is {steps_per_sample}; at least 1 is needed")
    channels = named_channels(model, record.extra)
    variation = differentiated(model, channels, tuple(keys))
    program = with_registers(
        variation.program, {k: v for k, v in model.values.items() if k not in keys and v is not None}
    )
    factor = 2 * steps_per_sample
    driving = (*MOTIONS[:2], *channels) if known else (FORCE, *channels)
    drive, starts, places = along_motions(record, (first, last), driving, factor)
    row = MOTIONS.index(response) if response in MOTIONS else len(MOTIONS)
    motion = record[response][first:last] if known and response in MOTIONS else None
    return FreeRun(
        program, variation, tuple(keys), drive, record.dt, steps_per_sample, starts, last - first, row,
        tuple(c - first for c in cuts), motion, known, places,
    )  # fmt: skip


def _checked_span(record: Record, span: tuple[int, int] | None) -> tuple[int, int]:
    first, last = span or (0, len(record))
    if not 0 <= first < last - 1 < len(record):
        raise StudyError(
            f"the span {first} to {last} does not lie in the {len(record)} samples of {record.name!r}; "
            "it must begin at 0 or later, end by the last sample and hold two at least"
        )
    return first, last


def predict_response(
    model: Model,
    record: Record,
    *,
    response: str = "displacement",
    steps_per_sample: int = 2,
    span: tuple[int, int] | None = None,
    initial: Sequence[float] = (0.0, 0.0),
) -> Floats:
    """Response of a complete model in free run, shape (samples of the span,); arguments as for :func:`prepare`.

    ``initial`` has displacement, velocity and, if given, the terms' own states at the first sample of the span.
    """
    model.numbers()
    run = prepare(model, record, sensors=(Sensor(ALONE, response),), steps_per_sample=steps_per_sample, span=span)
    return run.respond({}, initial)[0][:, 0]
