"""The equations of motion of a structure as a program for the kernels.

``M a = F - sum over terms of e coefficient d^r/dt^r g(e.u, e.v, t)``, where e is the direction of a term's place: it
acts with its force on one end and with the opposite on the other. The mass matrix M depends on the coefficients alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from study.equations import formulas
from study.equations.graph import Graph, Op, Program
from study.equations.model import Model, ModelTerm, named_channels, unit_force, with_registers
from study.equations.place import Place
from study.support.arrays import Floats, Ints
from study.support.errors import StudyError

COMPILED = 128  # programs that are cached


@dataclass(frozen=True)
class MotionProgram:
    """Accelerations and rates of the terms' own states, with those of their derivatives that are not zero.

    A state of the structure is all displacements, all velocities, then the terms' own states z. Registers begin with
    these displacements and velocities, the time, forces and channels, the states z.

    Attributes
    ----------
    program : Program
        Its held values are in its registers.
    coordinates, channels : int
        Numbers of coordinates, and of columns of the drive: forces, then further channels.
    slopes : int array, shape (coordinates + own states,)
        Registers of the accelerations, then of the own states' rates.
    by_state : int array, shape (links, 3)
        Slope, state and register of each partial derivative by a state.
    by_key : int array, shape (links, 3)
        The same by the keys, counted from zero.
    sides : int array, shape (switches,)
        Registers that stand for the sign of a relative velocity whose jump moves a force: dry friction.
    by_side : int array, shape (switches, coordinates)
        Registers of the derivatives of the accelerations by these.
    directions : array, shape (switches, coordinates)
        Weights of the velocities in each.
    """

    program: Program
    coordinates: int
    channels: int
    slopes: Ints
    by_state: Ints
    by_key: Ints
    sides: Ints
    by_side: Ints
    directions: Floats

    @property
    def states(self) -> int:
        """Displacements, velocities and own states."""
        return self.coordinates + len(self.slopes)


def motion_program(model: Model, available: Sequence[str], keys: Sequence[str] = ()) -> MotionProgram:
    """The program of a structure all of whose values but those of ``keys`` are known.

    ``available`` are the further channels that its formulas may name; those that they do name are in the drive, in
    alphabetical order behind the forces.

    Raises
    ------
    StudyError
        If a value is missing, a key or channel unknown, or the linear part as measured.
    """
    if model.measured:
        raise StudyError(f"model {model.name!r} has 'linear: measured', and no masses to run with; expected inertia")
    if unknown := [key for key in keys if key not in model.values]:
        raise StudyError(f"model {model.name!r} has no {', '.join(unknown)}; it has {', '.join(model.values)}")
    held = {key: value for key, value in model.values.items() if key not in keys}
    if missing := [key for key, value in held.items() if value is None]:
        raise StudyError(f"model {model.name!r} gives no value for {', '.join(missing)}; a free run needs all")
    named_channels(model, available)
    made = _compiled(model.with_values(dict.fromkeys(model.values)), tuple(keys))
    values = {key: value for key, value in held.items() if value is not None}
    return replace(made, program=with_registers(made.program, values))


@lru_cache(maxsize=COMPILED)
def _compiled(model: Model, keys: tuple[str, ...]) -> MotionProgram:
    """The same of a model without values."""
    graph, n = Graph(), len(model.coordinates)
    u, v = ([graph.input(f"{x}:{c}") for c in model.coordinates] for x in "uv")
    time = graph.input("t")
    forces = [graph.input(f"force:{name}") for name, _ in model.forces]
    channels = {name: graph.input(f"channel:{name}") for name in model.channels}
    states = {t.name: graph.input(f"z:{t.name}") for t in model.states}
    values = {key: graph.input(key) for key in model.values}
    builder = Builder(model, graph, (u, v, time), channels, states, values)
    loads = [graph.const(0.0)] * n
    for (_, where), node in zip(model.forces, forces, strict=True):
        i = model.coordinates.index(where)
        loads[i] = graph.add(loads[i], node)
    loads, rates = builder.loads(loads)
    accelerations = _solved(graph, builder.masses(), loads)
    table, directions = _sides(model, graph, builder, [*accelerations, *rates])
    slopes = graph.substituted([*accelerations, *rates], dict(table))
    by_state = links_of(graph, slopes, [*u, *v, *states.values()])
    by_key = links_of(graph, slopes, [values[key] for key in keys])
    pushes = [graph.derivative(a, side) for _, side in table for a in slopes[:n]]
    links = [node for *_, node in (*by_state, *by_key)]
    program = graph.program([*slopes, *links, *pushes, *(side for _, side in table)])
    registers = program.outputs[len(slopes) :]
    return MotionProgram(
        program, n, len(forces) + len(channels), program.outputs[: len(slopes)],
        link_table(by_state, registers), link_table(by_key, registers[len(by_state) :]),
        registers[len(links) + len(pushes) :], registers[len(links) :][: len(pushes)].reshape(-1, n), directions,
    )  # fmt: skip


def links_of(graph: Graph, slopes: Sequence[int], by: Sequence[int]) -> list[tuple[int, int, int]]:
    """Slope, variable and node of each partial derivative that is not zero."""
    found: list[tuple[int, int, int]] = []
    for i, slope in enumerate(slopes):
        for j, variable in enumerate(by):
            node = graph.derivative(slope, variable)
            if graph.constant_value(node) != 0.0:
                found.append((i, j, node))
    return found


def link_table(links: Sequence[tuple[int, int, int]], registers: Ints) -> Ints:
    """Slope, variable and register of each, shape (links, 3)."""
    rows = [(i, j, int(register)) for (i, j, _), register in zip(links, registers, strict=False)]
    return np.array(rows, dtype=np.int64).reshape(-1, 3)


@dataclass(frozen=True)
class Builder:
    """The nodes that the terms of a structure are made of."""

    model: Model
    graph: Graph
    motion: tuple[Sequence[int], Sequence[int], int]  # displacements, velocities, time
    channels: Mapping[str, int]
    states: Mapping[str, int]
    values: Mapping[str, int]

    def along(self, place: Place, nodes: Sequence[int]) -> int:
        """A relative motion, or the sum of what acts at a place's ends."""
        total = self.graph.const(0.0)
        for weight, node in zip(place.direction(self.model.coordinates), nodes, strict=True):
            if weight != 0.0:
                total = (self.graph.add if weight > 0.0 else self.graph.sub)(total, node)
        return total

    def loads(self, loads: Sequence[int]) -> tuple[list[int], list[int]]:
        """What is left of the forces on each coordinate less those of the terms, and the rates of the own states."""
        left, rates = list(loads), list[int]()
        for entry in self.model.terms:
            force, rate = self.force(entry)
            if rate is not None:
                rates.append(rate)
            for i, weight in enumerate(entry.place.direction(self.model.coordinates)):
                if weight != 0.0 and entry.term.name != "inertia":
                    left[i] = (self.graph.sub if weight > 0.0 else self.graph.add)(left[i], force)
        return left, rates

    def force(self, entry: ModelTerm) -> tuple[int, int | None]:
        """Force of a term on the second end of its place, and the rate of its own state."""
        u, v, time = self.motion
        place = entry.place
        names = {"u": self.along(place, u), "v": self.along(place, v), "t": time}
        names |= {n: self.channels[n] for n in entry.term.channels}
        names |= {p.name: self.values[f"{entry.name}.{p.name}"] for p in entry.term.parameters}
        rate = None
        if entry.term.state is not None:
            names["z"] = self.states[entry.name]
            rate = formulas.add_formula(self.graph, entry.term.state, names)
        force = self.graph.const(0.0)
        for component, key in zip(entry.term.components, entry.symbols, strict=True):
            if component.order < 2:
                unit = unit_force(self.graph, component, names, rate)
                force = self.graph.add(force, self.graph.mul(self.values[key], unit))
        return force, rate

    def masses(self) -> list[list[int]]:
        """The mass matrix, rows of nodes."""
        n = len(self.model.coordinates)
        rows = [[self.graph.const(0.0)] * n for _ in range(n)]
        for i, j, weight, key in mass_entries(self.model):
            value = self.values[key]
            rows[i][j] = (self.graph.add if weight > 0.0 else self.graph.sub)(rows[i][j], value)
        return rows


def mass_entries(model: Model) -> list[tuple[int, int, float, str]]:
    """What makes up the mass matrix: row, column, sign and key of each part of an element."""
    found: list[tuple[int, int, float, str]] = []
    for entry in model.terms:
        if entry.term.name != "inertia":
            continue
        place, key = entry.place, entry.symbols[0]
        if place.kind == "couples":
            i, j = (model.coordinates.index(end) for end in place.ends)
            found += [(i, j, 1.0, key), (j, i, 1.0, key)]
            continue
        e = place.direction(model.coordinates)
        at = [i for i, weight in enumerate(e) if weight != 0.0]
        found += [(i, j, e[i] * e[j], key) for i in at for j in at]
    return found


def _solved(graph: Graph, matrix: list[list[int]], right: list[int]) -> list[int]:
    """``M^-1 f`` by elimination, which leaves what is zero alone: a diagonal matrix costs one division a row."""
    n, rows, f = len(right), [list(row) for row in matrix], list(right)
    for k in range(n):
        for i in range(k + 1, n):
            if graph.constant_value(rows[i][k]) == 0.0:
                continue
            ratio = graph.div(rows[i][k], rows[k][k])
            for j in range(k + 1, n):
                rows[i][j] = graph.sub(rows[i][j], graph.mul(ratio, rows[k][j]))
            f[i] = graph.sub(f[i], graph.mul(ratio, f[k]))
    for k in reversed(range(n)):
        for j in range(k + 1, n):
            f[k] = graph.sub(f[k], graph.mul(rows[k][j], f[j]))
        f[k] = graph.div(f[k], rows[k][k])
    return f


def _sides(model: Model, graph: Graph, builder: Builder, slopes: Sequence[int]) -> tuple[list[tuple[int, int]], Floats]:
    """Node of the sign of each relative velocity that a force jumps with, and the input that stands for it."""
    needed = graph.needed(slopes)
    table: list[tuple[int, int]] = []
    rows: list[tuple[float, ...]] = []
    for place in dict.fromkeys(t.place for t in model.terms):
        velocity = builder.along(place, builder.motion[1])
        sgn = next((n for n in needed if graph.nodes[n] == (Op.SGN, velocity, velocity)), None)
        if sgn is not None and all(sgn != known for known, _ in table):
            table.append((sgn, graph.input(f"side:{place.label}")))
            rows.append(place.direction(model.coordinates))
    return table, np.array(rows, dtype=np.float64).reshape(-1, len(model.coordinates))
