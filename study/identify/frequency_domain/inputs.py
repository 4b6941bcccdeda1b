"""From a model and a record to the inputs of the reverse system (the report's Figure 14).

Components with the same shape are one input: u carries stiffness, damping and mass, u^3 carries the
cubic stiffness and Van der Pol's damping. The output is always the force. In a structure each coordinate's equation is
such a system; its inputs are shapes of the relative motions at the places of its terms.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from study.equations import formulas
from study.equations.graph import Graph, Program
from study.equations.model import Model, ModelTerm
from study.equations.place import ALONE, HERE, Place
from study.records.interpolation import between_samples_kept, in_columns
from study.records.record import MOTIONS, Record
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError
from study.support.numbers import BEYOND_MEASURE
from study.support.recent import Recent

INERTIA = 2  # order of its time derivative
STATE_STEPS = 4  # Runge-Kutta steps a sample for a term's own state ...
MOST_STATE_STEPS = 64  # ... and at most
AGREED = 0.01  # of a state's rms: what other steps may change
# Between samples: a search, of thousands of samples, asks for states with many shape parameters along one motion.
_ALONG_MOTIONS = Recent(largest=1 << 23)


@dataclass(frozen=True)
class Part:
    """A coefficient's place in an input's frequency response function: ``coefficient * factor * (j 2 pi f)^order``."""

    symbol: str
    order: int
    factor: float


@dataclass(frozen=True)
class Input:
    """One input of the reverse system."""

    shape: str  # formula of its time history g(u, v, t)
    parts: tuple[Part, ...]  # what its frequency response function A(f) is the sum of
    terms: tuple[str, ...]  # names of the terms it carries
    parameters: tuple[tuple[str, float], ...]  # shape parameters in the formula
    state: str | None = None  # dz/dt, where the shape is a state z with a memory
    direction: tuple[float, ...] = ()  # weights of the coordinates in the motion u of the shape
    joined: tuple[tuple[float, "Input"], ...] = ()  # so much of others that it is the sum of; then it has no formula

    @property
    def linear(self) -> bool:
        """Whether it is the motion itself."""
        return self.shape == "u"

    def powers(self, frequency: Floats) -> Complexes:
        """``factor (j 2 pi f)^order`` of each part, shape (lines, parts)."""
        omega = 2j * np.pi * frequency
        return np.stack([p.factor * omega**p.order for p in self.parts], axis=1).astype(np.complex128)

    def response(self, frequency: Floats, values: dict[str, float]) -> Complexes:
        """The exact A(f) for coefficients of these values, shape (lines,)."""
        return self.powers(frequency) @ np.array([values.get(p.symbol, 0.0) for p in self.parts])


def symbols_of(inputs: Sequence[Input]) -> tuple[str, ...]:
    """Names of the coefficients of all inputs, in their order."""
    return tuple(part.symbol for item in inputs for part in item.parts)


def reverse_inputs(model: Model, coordinate: str = ALONE) -> tuple[Input, ...]:
    """Inputs of one coordinate's equation of motion, in the order in which its terms first need them.

    Coefficients go by the keys of the whole structure: one that stands in two equations has one name, and what acts
    there with the opposite sign has the factor -1.
    """
    i = model.coordinates.index(coordinate)
    acting: list[tuple[ModelTerm, tuple[float, ...], float]] = []
    for entry in model.terms:
        place = entry.place
        if coordinate not in place.ends:
            continue
        if place.kind == "couples":
            other = place.ends[1 - place.ends.index(coordinate)]
            acting.append((entry, tuple(float(c == other) for c in model.coordinates), 1.0))
        else:
            direction = place.direction(model.coordinates)
            acting.append((entry, direction, direction[i]))
    return _collected(acting)


def _collected(acting: Iterable[tuple[ModelTerm, tuple[float, ...], float]]) -> tuple[Input, ...]:
    """Inputs of terms that act on a coordinate, each with the direction of its motion and the sign of its force."""
    inputs: dict[tuple[object, ...], Input] = {}
    for entry, direction, sign in acting:
        parameters = _known_parameters(entry)
        for component, symbol in zip(entry.term.components, entry.symbols, strict=True):
            state = entry.term.state if component.shape == "z" else None
            motion, weight = direction, sign
            if component.shape == "u" and sign < 0.0:  # -u of the opposite motion: one input with all linear terms
                motion, weight = tuple(0.0 - w for w in direction), 1.0
            key = (component.shape, parameters, state, motion)
            known = inputs.get(key, Input(component.shape, (), (), parameters, state, motion))
            part = Part(symbol, component.order, weight * component.factor)
            terms = tuple(dict.fromkeys((*known.terms, entry.name)))
            inputs[key] = replace(known, parts=(*known.parts, part), terms=terms)
    return tuple(inputs.values())


def with_known_changes(inputs: Sequence[Input], model: Model) -> tuple[Input, ...]:
    """Inputs with each change of a coefficient as one, of the shape that was found in free run.

    A curve of many knots would ask for more averages than most records have. Its coefficient is that of its largest
    change, and what it has of the others is known.
    """
    values, found = model.numbers(), list(inputs)
    for entry in (e for e in model.terms if e.term.variation is not None and len(e.symbols) > 1):
        own = [item for item in found if {part.symbol for part in item.parts} <= set(entry.symbols)]
        amounts = [sum(values[p.symbol] * p.factor for p in item.parts) for item in own]
        most = max(range(len(own)), key=lambda i: abs(amounts[i]))
        shares = (x / amounts[most] if amounts[most] else float(i == most) for i, x in enumerate(amounts))
        one = replace(own[most], joined=tuple(zip(shares, own, strict=True)))
        found = [one if item is own[most] else item for item in found if item is own[most] or item not in own]
    return tuple(found)


def without_inertia(inputs: Sequence[Input]) -> tuple[Input, ...]:
    """The inputs without the mass: where no force acts, its inertia force is what the others have to balance."""
    rest = (replace(i, parts=tuple(p for p in i.parts if p.order < INERTIA)) for i in inputs)
    return tuple(i for i in rest if i.parts)


def _known_parameters(entry: ModelTerm) -> tuple[tuple[str, float], ...]:
    pairs: list[tuple[str, float]] = []
    for parameter, value in zip(entry.term.parameters, entry.parameters, strict=True):
        if value is None:
            raise StudyError(f"{entry.name} has no value for {parameter.name}; it must be given or estimated first")
        pairs.append((parameter.name, value))
    return tuple(pairs)


def histories(inputs: Sequence[Input], record: Record) -> list[Floats]:
    """Time history of each input, each of shape (n,)."""
    return [record["displacement"] if i.shape == "u" else input_history(i, record) for i in inputs]


def input_history(item: Input, record: Record) -> Floats:
    """g(u, v, t) of one input along a record, shape (n,); a state begins at zero."""
    if item.joined:
        return np.asarray(sum(share * input_history(part, record) for share, part in item.joined), dtype=np.float64)
    from study.equations import kernels  # slow to load; who counts inputs or checks settings needs none
    from study.equations.motion_program import memory_program

    formula = item.shape if item.state is None else item.state
    own = (*dict(item.parameters), *(("z",) if item.state is not None else ()))  # without a state, z is a channel
    wanted = [n for n in formulas.names(formula) if n not in own]
    data = dict(zip(wanted, _columns(wanted, formula, record), strict=True))
    if item.state is not None and record.joints:  # each stretch begins at zero, as a record does
        bounds = pairwise((0, *record.joints, len(record)))
        return np.concatenate([input_history(item, _alone(record.part(a, b))) for a, b in bounds])
    if item.state is None:
        program = _program(formula, (*wanted, *own)).with_inputs(dict(item.parameters))
        return _finite(kernels.evaluate(program, data, len(record))[:, 0], item, record)
    memory = memory_program(formula, dict(item.parameters), [name for name in wanted if name != "t"])

    def integrated(steps: int) -> Floats:
        fine = [between_samples_kept(_ALONG_MOTIONS, data[name], 2 * steps) for name in memory.drive]
        drive = in_columns(fine, 2 * steps * len(record))
        states, out = np.zeros((1, 1, 1)), np.full((len(record), 1, 1), np.nan)
        start, bounds = np.array([record.time[0]]), np.array([0, len(record)])
        kernels.integrate(memory, start, record.dt, steps, drive, bounds, states, out)
        return out[:, 0, 0]

    return _finite(_settled(integrated), item, record)


@lru_cache
def _program(formula: str, given: tuple[str, ...]) -> Program:
    """What computes a formula from inputs of these names."""
    graph = Graph()
    known = {name: graph.input(name) for name in given}
    return graph.program([formulas.add_formula(graph, formula, known)])


def _settled(integrated: Callable[[int], Floats]) -> Floats:
    """A term's state, in so many steps a sample that four times as many hardly change it.

    Loops that close sharply, and motion that is fast beside the sampling, ask for more; steps that are too long for a
    short memory make a state that grows without end, and may yet be finite.
    """
    states, steps = integrated(STATE_STEPS), STATE_STEPS
    while steps < MOST_STATE_STEPS:
        steps *= 4
        coarse, states = states, integrated(steps)
        with np.errstate(all="ignore"):
            if np.sum((states - coarse) ** 2) <= AGREED**2 * np.sum(states**2):  # false where one is not finite
                return coarse
    return states


def _alone(part: Record) -> Record:
    """One stretch as a record of its own."""
    return replace(part, stretches=(), start=float(part.time[0]))


def _finite(values: Floats, item: Input, record: Record) -> Floats:
    with np.errstate(invalid="ignore"):
        bad = np.flatnonzero(~(np.abs(values) < BEYOND_MEASURE))
    if bad.size:
        formula, time = item.shape if item.state is None else item.state, record.time[bad[0]]
        raise StudyError(
            f"the formula {formula!r} has no finite value at t = {time:.6g} s of {record.name}; "
            "expected a formula that has one all along the motion"
        )
    return values


def _columns(wanted: Sequence[str], formula: str, record: Record) -> list[Floats]:
    """Motion, time and channels that a formula names; u, v and t are no channels, even where one is called so."""
    motion = {"u": "displacement", "v": "velocity"}
    columns: list[Floats] = []
    for name in wanted:
        channel = motion.get(name, name)
        if name != "t" and channel not in (record if name in motion else record.extra):
            beside = "" if name in motion else " beside force and motion"
            raise StudyError(
                f"the formula {formula!r} needs the channel {channel!r}, which {record.name} lacks{beside}; "
                f"expected one that it has, or {channel!r} named as a parameter to be fitted, as vs is in "
                "'friction(vs)=tanh(v/vs)'"
            )
        columns.append(record.time if name == "t" else record[channel])
    return columns


def along(direction: Sequence[float], model: Model, record: Record) -> Record:
    """A relative motion of a completed record as that of a single mass, with the channels that formulas may name."""
    total = np.zeros((len(MOTIONS), len(record)))
    for coordinate, weight in zip(model.coordinates, direction, strict=True):
        if weight != 0.0:
            total += weight * record.motion(coordinate)
    return record.relative(total)


def placed_inputs(entry: ModelTerm) -> tuple[Input, ...]:
    """The shapes of a term, whatever its place; its shape parameters are known."""
    return reverse_inputs(Model("alone", (replace(entry, place=HERE),)))


def relative_record(place: Place, model: Model, motion: Floats, dt: float) -> Record:
    """Relative motion at a place as a record of a single coordinate; ``motion`` as :func:`corrected_motion` has it."""
    e = np.array(place.direction(model.coordinates))
    displacement, velocity = (np.asarray(x @ e, dtype=np.float64) for x in motion[:2])
    return Record(dt, {"force": np.zeros(len(displacement)), "displacement": displacement, "velocity": velocity})
