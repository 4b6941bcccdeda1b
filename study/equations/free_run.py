"""A model running free under a measured force, with the exact derivatives of its response.

State and sensitivities are integrated together by the classical Runge-Kutta method. Runge-Kutta applied
to the variational equations gives exactly the derivative of the Runge-Kutta map, so the Jacobian is that
of the numbers which the simulation yields, not of an idealisation of them.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from study.equations import kernels
from study.equations.graph import Op, Program
from study.equations.machine_code import OFTEN, Variation, machine_code
from study.equations.model import Model, forward_graph, named_channels, with_registers
from study.records.interpolation import between_samples
from study.records.record import MOTIONS, Record
from study.support.arrays import Floats
from study.support.errors import DivergenceError, StudyError

SHARED = 4096  # steps from which on two threads share the segments; with fewer, a thread costs more than it saves
REMEMBERED = 4  # channels whose values between the samples are cached
COMPILED = 128  # programs that are cached
SIDE = "side of v"  # the input that stands for sgn v during a step


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
    start : float
        Time of the first sample in seconds.
    samples : int
        Samples in the stretch.
    row : int
        Which motion is the response: its place in ``MOTIONS``.
    cuts : tuple of int
        Samples of the stretch at which the motion begins anew from a state of its own.
    """

    program: Program
    variation: Variation
    keys: tuple[str, ...]
    drive: Floats
    dt: float
    steps: int
    start: float
    samples: int
    row: int
    cuts: tuple[int, ...] = ()

    @property
    def states(self) -> int:
        """Displacement, velocity and the terms' own."""
        return self.variation.states

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
        response : array, shape (samples,)
        jacobian : array, shape (samples, keys + (cuts + 1) free_states)

        Raises
        ------
        DivergenceError
            If the response leaves the range of finite numbers.
        """
        response, own, _ = self.respond_by_segment(values, initial, free_states)
        if not self.cuts:
            return response, own
        keys, bounds = len(self.keys), (0, *self.cuts, self.samples)
        jacobian = np.zeros((self.samples, keys + (len(bounds) - 1) * free_states))
        jacobian[:, :keys] = own[:, :keys]
        for i, (begin, end) in enumerate(pairwise(bounds)):
            jacobian[begin:end, keys + i * free_states : keys + (i + 1) * free_states] = own[begin:end, keys:]
        return response, jacobian

    def respond_by_segment(
        self, values: Mapping[str, float], initial: Sequence[float] | Floats, free_states: int = 0
    ) -> tuple[Floats, Floats, Floats]:
        """As :meth:`respond`, the derivatives by the initial state of each sample's own segment alone.

        Returns
        -------
        response : array, shape (samples,)
        jacobian : array, shape (samples, keys + free_states)
        arrivals : array, shape (cuts, states, 1 + keys + free_states)
            State in which each segment but the last arrives where the next begins, beside its derivatives.
        """
        states, bounds = np.atleast_2d(initial), (0, *self.cuts, self.samples)
        if len(states) != len(bounds) - 1:
            raise StudyError(f"{len(states)} initial states were given; {len(bounds) - 1} segments need one each")
        program = with_registers(self.program, {key: values[key] for key in self.keys})
        first_free = 1 + len(self.keys)
        out = np.empty((self.samples, first_free + free_states))
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
        return out[:, 0], out[:, 1:], state[:-1]

    def passing(self, initial: Mapping[int, Floats]) -> Floats:
        """State at the first sample of each segment, shape (cuts + 1, states), of a motion with fewer restarts.

        ``initial`` gives the state of those segments that begin anew, by their numbers; the first, 0, is one of them.
        """
        bounds = (0, *self.cuts, self.samples)
        states, state = (
            np.empty((len(bounds) - 1, self.states)),
            np.empty((1, self.states, 1)),
        )
        room = np.empty((self.samples, 1))
        for i, segment in enumerate(pairwise(bounds)):
            if i in initial:
                state[0, :, 0] = initial[i]
            states[i] = state[0, :, 0]
            self._integrate(self.program, segment, state, room)
        return states

    def _integrate(self, program: Program, bounds: Sequence[int], states: Floats, out: Floats) -> None:
        """Response and derivatives into ``out``; ``states`` become those at which the next segments begin."""
        code = machine_code(self.variation, out.shape[1], self.samples * self.steps >= OFTEN)
        failed = kernels.integrate_segments(
            code.addresses, program.registers.copy(), self.variation.side, self.start, self.dt,
            self.steps, self.drive, np.array(bounds), states, self.row, out,
        )  # fmt: skip
        if failed >= 0:
            time = self.start + failed * self.dt
            raise DivergenceError(f"the free run diverged at t = {time:.4g} s", time)


def prepare(
    model: Model,
    record: Record,
    keys: Sequence[str] = (),
    *,
    response: str = "displacement",
    steps_per_sample: int = 2,
    span: tuple[int, int] | None = None,
    restarts: Sequence[int] = (),
) -> FreeRun:
    """Make a model ready to run under the force of a record.

    Parameters
    ----------
    model : Model
        Every value known but those of ``keys``.
    record : Record
        Gives the force, and the extra channels which the user's own terms name.
    keys : sequence of str
        The coefficients and shape parameters to differentiate by.
    response : str
        ``displacement``, ``velocity`` or ``acceleration``.
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
    first, last = _checked_span(record, span)
    bounds = (first, *restarts, last)
    if any(b - a < 2 for a, b in pairwise(bounds)):
        raise StudyError(f"the restarts {tuple(restarts)} must rise, and leave two samples between {first} and {last}")
    if response not in MOTIONS:
        raise StudyError(f"there is no response {response!r}; a free run yields {', '.join(MOTIONS)}")
    if steps_per_sample < 1:
        raise StudyError(f"steps_per_sample is {steps_per_sample}; at least 1 is needed")
    channels = named_channels(model, record.extra)
    variation = _differentiated(model, channels, tuple(keys))
    program = with_registers(
        variation.program, {k: v for k, v in model.values.items() if k not in keys and v is not None}
    )
    factor = 2 * steps_per_sample
    part = slice(factor * first, factor * (last - 1) + 1)
    drive = np.column_stack(
        [
            _between(record[name].tobytes(), factor, record.between if name == "force" else "band_limited")[part]
            for name in ("force", *channels)
        ]
    )
    return FreeRun(
        program, variation, tuple(keys), drive, record.dt, steps_per_sample,
        record.start + first * record.dt, last - first, MOTIONS.index(response), tuple(r - first for r in restarts),
    )  # fmt: skip


@lru_cache(maxsize=REMEMBERED)
def _between(values: bytes, factor: int, reading: str) -> Floats:
    """A channel between its samples; a diagnosis makes hundreds of runs under the same force."""
    fine = between_samples(np.frombuffer(values), factor, reading)
    fine.flags.writeable = False
    return fine


def _checked_span(record: Record, span: tuple[int, int] | None) -> tuple[int, int]:
    first, last = span or (0, len(record))
    if not 0 <= first < last - 1 < len(record):
        raise StudyError(
            f"the span {first} to {last} does not lie in the {len(record)} samples of {record.name!r}; "
            "it must begin at 0 or later, end by the last sample and hold two at least"
        )
    return first, last


def _differentiated(model: Model, channels: tuple[str, ...], keys: tuple[str, ...]) -> Variation:
    """Program of slopes and partial derivatives of a model that gives every value but those of the keys."""
    if missing := [key for key, value in model.values.items() if value is None and key not in keys]:
        raise StudyError(f"model {model.name!r} gives no value for {', '.join(missing)}; a free run needs all")
    if unknown := [key for key in keys if key not in model.values]:
        raise StudyError(f"model {model.name!r} has no {', '.join(unknown)}; it has {', '.join(model.values)}")
    return _compiled(model.with_values(dict.fromkeys(model.values)), channels, keys)


@lru_cache(maxsize=COMPILED)
def _compiled(model: Model, channels: tuple[str, ...], keys: tuple[str, ...]) -> Variation:
    """As :func:`_differentiated`, of a model without values: a diagnosis runs each of its models many times."""
    forward = forward_graph(model, channels)
    graph = forward.graph
    by = (*forward.states, *(graph.input(key) for key in keys))
    rows = [[slope, *(graph.derivative(slope, node) for node in by)] for slope in forward.slopes]
    graph.input(SIDE)
    program, side = _with_side(graph.program([node for row in rows for node in row]), graph.program(forward.slopes))
    return Variation(program, program.outputs.reshape(len(rows), 1 + len(by)), side, 1 + len(channels))


def _with_side(program: Program, slopes: Program) -> tuple[Program, int]:
    """The program with sgn v read from a register, if the slopes jump with it, and that register, else -1.

    The integrator sets the register, so that no step runs across the jump.
    """
    sgn_v = np.array([Op.SGN, 1, 1])
    if not np.any(np.all(slopes.code == sgn_v, axis=1)):
        return program, -1
    side = program.inputs[SIDE]
    code = program.code.copy()
    code[np.all(code == sgn_v, axis=1)] = (Op.MAX, side, side)
    return replace(program, code=code), side


def predict(
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
    run = prepare(model, record, response=response, steps_per_sample=steps_per_sample, span=span)
    return run.respond({}, initial)[0]
