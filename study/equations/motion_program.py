"""The program of a model's equations of motion and of their exact partial derivatives, which a free run integrates."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import count

import numpy as np

from study.equations import formulas
from study.equations.equations_of_motion import Equations
from study.equations.graph import Graph, Op, Program
from study.equations.model import Model, check_modes
from study.equations.place import Place
from study.records.record import FORCE, MOTIONS, Sensor
from study.support.arrays import Floats, Ints
from study.support.errors import StudyError, expect


@dataclass(frozen=True, eq=False)
class MotionProgram:
    """Slopes of the states and what is observed, with their partial derivatives; compared by identity.

    The states are displacements and velocities of the degrees of freedom, then the terms' own. Registers begin with the
    time, what drives, and the states.
    """

    program: Program  # held values are in its registers
    drive: tuple[str, ...]  # what drives: forces, motions that are prescribed, further channels
    dofs: int  # degrees of freedom
    states: int
    slots: Ints  # registers of rows and of their derivatives by states and by keys, (rows, 1 + states + keys); rows are
    # the slopes of velocities and of the terms' own states, then what is computed of what is observed
    split: int  # instructions from here on are of what is observed alone
    observed: Ints  # a row of the states; those of ``slots`` are counted on from there
    sides: Ints  # registers that stand for the sign of a relative velocity whose jump moves a force: dry friction
    by_side: Ints  # registers of the derivatives by these, (sides, rows)
    directions: Floats  # weights of the degrees of freedom in each, (sides, dofs)
    shifts: Ints  # registers of what is prescribed of its displacement, velocity and acceleration, or -1; (sides, 3)


def motion_program(
    model: Model,
    keys: Sequence[str],
    observed: Sequence[Sensor],
    *,
    switching: bool = True,
) -> MotionProgram:
    """The program of a model all of whose values but those of ``keys`` are known.

    ``observed`` are motions of its coordinates, or the force on one whose motion is prescribed. Without ``switching``
    dry friction jumps within a step.
    """
    check_modes(model)
    values = model.values
    if missing := [key for key, value in values.items() if value is None and key not in keys]:
        raise StudyError(f"model {model.name!r} gives no value for {', '.join(missing)}; a free run needs all")
    if unknown := [key for key in keys if key not in values]:
        raise StudyError(f"model {model.name!r} has no {', '.join(unknown)}; it has {', '.join(values)}")
    open_model = model.with_values(dict.fromkeys(model.values))
    made = _compiled(open_model, tuple(keys), tuple(observed), switching)
    known = {key: value for key, value in values.items() if key not in keys and value is not None}
    return replace(made, program=made.program.with_inputs(known))


@lru_cache(maxsize=1024)
def _compiled(model: Model, keys: tuple[str, ...], observed: tuple[Sensor, ...], switching: bool) -> MotionProgram:
    """The same of a model without values: a diagnosis runs each of its models many times."""
    made = Equations(model, any(sensor.motion == MOTIONS[2] for sensor in observed))
    graph, states = made.graph, made.states
    jumps = _jumps(made) if switching and model.modal is None else []
    table = {sign: side for sign, side, _ in jumps}
    slopes = graph.substituted(made.slopes, table)
    where = [_row(made, sensor) for sensor in observed]
    computed = [_node(made, sensor) for sensor, row in zip(observed, where, strict=True) if row is None]
    computed = graph.substituted(computed, table)
    by = [*states, *(made.values[key] for key in keys)]
    rows = [[node, *(graph.derivative(node, x) for x in by)] for node in (*slopes, *computed)]
    for row in rows[: len(slopes)]:  # a step writes a state's own register before it has read all of its slopes
        row[:] = [graph.binary(Op.MAX, node, node) if node in states else node for node in row]
    by_side = [[graph.derivative(node, side) for node in (*slopes, *computed)] for side in table.values()]
    moved = [made.along(place, order, made.prescribed) for *_, place in jumps for order in _orders(made, place)]
    outputs = [*(node for row in (*rows, *by_side) for node in row), *moved, *table.values()]
    program = graph.program(outputs)
    stepping = [node for row in (*rows[: len(slopes)], *(own[: len(slopes)] for own in by_side)) for node in row]
    last = max(graph.needed([*stepping, *moved]), default=-1)
    split = sum(1 for node in graph.needed(outputs) if node <= last and graph.nodes[node][0] < Op.INPUT)
    ends = np.cumsum([len(rows) * (1 + len(by)), len(jumps) * len(rows), len(moved)])
    slots, sides_of_rows, moving, sides = np.split(program.outputs, ends)
    shifts = np.full((len(jumps), 3), -1, dtype=np.int64)
    shifts[[len(_orders(made, place)) > 0 for *_, place in jumps]] = moving.reshape(-1, 3)
    computing = count(len(states) + len(slopes))
    return MotionProgram(
        program, made.drive, made.dofs, len(states), slots.reshape(len(rows), 1 + len(by)), split,
        np.array([next(computing) if row is None else row for row in where], dtype=np.int64), sides,
        sides_of_rows.reshape(len(jumps), len(rows)),
        np.array([place.direction(made.free) for *_, place in jumps], dtype=np.float64).reshape(len(jumps), made.dofs),
        shifts,
    )  # fmt: skip


def memory_program(rate: str, parameters: Mapping[str, float], driven: Sequence[str]) -> MotionProgram:
    """The program of one state z by the formula of its rate, along what the formula names beside it and the time."""
    graph, none = Graph(), np.zeros((0, 0), np.int64)
    known = {name: graph.input(name) for name in ("t", *driven, "z", *parameters)}
    program = graph.program([formulas.add_formula(graph, rate, known)]).with_inputs(parameters)
    return MotionProgram(
        program, tuple(driven), 0, 1, program.outputs[None], len(program.code), np.array([0]), none, none,
        np.zeros((0, 0)), none,
    )  # fmt: skip


def _row(made: Equations, sensor: Sensor) -> int | None:
    """Row of a motion that is a state or a slope of its own, None of what is computed."""
    if sensor.coordinate not in made.model.coordinates:
        known = ", ".join(made.model.coordinates)
        raise StudyError(f"{sensor.coordinate!r} is no coordinate of the model; expected one of {known}")
    if sensor.coordinate not in made.free or sensor.motion not in MOTIONS:
        return None
    order, i = MOTIONS.index(sensor.motion), made.free.index(sensor.coordinate)
    return order * made.dofs + i if order < 2 else len(made.states) + i


def _node(made: Equations, sensor: Sensor) -> int:
    """Node of what is computed."""
    if sensor.motion == FORCE and sensor.coordinate in made.prescribed:
        return made.reaction(sensor.coordinate)
    expect(sensor.motion in MOTIONS, f"there is no response {str(sensor)!r}; a free run yields {', '.join(MOTIONS)}")
    return made.at(sensor.coordinate, MOTIONS.index(sensor.motion))


def jumping_signs(made: Equations) -> dict[int, Place]:
    """Sign of each relative velocity that a force jumps with, and where it is: dry friction, which may stick there."""
    graph, found = made.graph, dict[int, Place]()
    needed = set(graph.needed(made.slopes))
    for place in dict.fromkeys(entry.place for entry in made.model.terms if entry.place.kind != "couples"):
        sign = graph.unary(Op.SGN, made.along(place, 1))
        if sign in needed:
            found.setdefault(sign, place)
    return found


def places_with_friction(model: Model) -> int:
    """Of how many places dry friction cuts the steps."""
    return len(jumping_signs(Equations(model))) if model.modal is None else 0


def _jumps(made: Equations) -> list[tuple[int, int, Place]]:
    """The same with the input that stands for each sign."""
    signs = jumping_signs(made).items()
    return [(sign, made.graph.input(f"side:{place.label}"), place) for sign, place in signs]


def _orders(made: Equations, place: Place) -> range:
    """Displacement, velocity and acceleration where an end of a place has a prescribed motion."""
    return range(3 if set(place.moving) & set(made.prescribed) else 0)
