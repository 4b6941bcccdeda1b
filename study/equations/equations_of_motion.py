"""The equations of motion of a model as nodes of a graph.

``M a = F - sum over terms of e coefficient d^r/dt^r g(e.u, e.v, t)``, where e is the direction of a term's place: it
acts with its force on one end and with the opposite on the other. The mass matrix M depends on the coefficients alone.

Coordinates are where sensors, forces and terms are; degrees of freedom q are what is integrated: ``u = T q``. A
coordinate with inertia is a degree of freedom of its own; the motion of one without is prescribed, and what is observed
of it is the force that this takes. With a modal linear part the columns of T are modes, and
``q'' + G q' + W q = T^T (F - sum over terms)``.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache

import numpy as np

from study.equations import formulas
from study.equations.graph import Graph, Program
from study.equations.modal_part import ModalPart
from study.equations.model import Model, ModelTerm
from study.equations.place import GROUND, Place
from study.equations.term import Component, Term
from study.records.record import MOTIONS, Sensor


class Equations:
    """Nodes of the equations of motion; inputs are the time, what drives, the states, and every key."""

    def __init__(self, model: Model, accelerated: bool = False) -> None:
        graph = self.graph = Graph()
        self.model, modal = model, model.modal
        self.free = () if modal else model.inertial
        self.prescribed = () if modal else tuple(c for c in model.coordinates if c not in self.free)
        forces = [(name, where) for name, where in model.forces if where not in self.prescribed]
        driven, moving = set(self.prescribed), set(self.free)
        for entry in model.terms:  # a mass that is tied to a prescribed motion, or friction that may hold one
            jumps = entry.term.name == "inertia" or any("sgn" in c.shape for c in entry.term.components)
            accelerated |= jumps and bool(driven & set(entry.place.moving)) and bool(moving & set(entry.place.moving))
        moved = [(c, m) for c in self.prescribed for m in (MOTIONS if accelerated else MOTIONS[:2])]
        self.drive = (*(name for name, _ in forces), *(str(Sensor(c, m)) for c, m in moved), *model.channels)
        self.time = graph.input("t")
        drive = [graph.input(f"drive:{name}") for name in self.drive]
        self.forces = [(where, node) for (_, where), node in zip(forces, drive, strict=False)]
        self.moved = dict(zip(moved, drive[len(forces) :], strict=False))
        self.channels = dict(zip(model.channels, drive[len(forces) + len(moved) :], strict=True))
        names = modal.stiffness if modal else self.free
        self.motion = tuple([graph.input(f"{x}:{name}") for name in names] for x in "uv")
        self.memory = {t.name: graph.input(f"z:{t.name}") for t in model.states}
        self.values = {key: graph.input(key) for key in model.values}

    @property
    def dofs(self) -> int:
        return len(self.motion[0])

    @property
    def states(self) -> list[int]:
        """Displacements and velocities of the degrees of freedom, then the terms' own states."""
        return [*self.motion[0], *self.motion[1], *self.memory.values()]

    def at(self, coordinate: str, order: int) -> int:
        """Displacement, velocity or acceleration (``order`` 2) of a coordinate."""
        if coordinate in self.prescribed:
            return self.moved[coordinate, MOTIONS[order]]
        nodes = self.motion[order] if order < 2 else self.slopes[: self.dofs]
        if self.model.modal is None:
            return nodes[self.free.index(coordinate)]
        total = self.graph.const(0.0)
        for key, node in zip(self.model.modal.shape(coordinate), nodes, strict=True):
            total = self.graph.add(total, self.graph.mul(self.values[key], node))
        return total

    def along(self, place: Place, order: int, only: Sequence[str] | None = None) -> int:
        """Relative motion of a place, or what some of the coordinates have in it."""
        total = self.graph.const(0.0)
        weights = zip(self.model.coordinates, place.direction(self.model.coordinates), strict=True)
        for coordinate, weight in sorted(weights, key=lambda pair: -pair[1]):
            if weight != 0.0 and (only is None or coordinate in only):
                total = (self.graph.add if weight > 0.0 else self.graph.sub)(total, self.at(coordinate, order))
        return total

    @cached_property
    def _terms(self) -> tuple[dict[str, int], dict[str, int], list[int]]:
        """What all terms act with against each coordinate's motion, and along it; the rates of their own states."""
        none, rates = self.graph.const(0.0), list[int]()
        against, along = (dict.fromkeys(self.model.coordinates, none) for _ in range(2))
        for entry in self.model.terms:
            forces, rate = self.unit_forces(entry)
            rates += [] if rate is None else [rate]
            direction = entry.place.direction(self.model.coordinates)
            for key, unit in forces:
                force = self.graph.mul(self.values[key], unit)
                for coordinate, weight in zip(self.model.coordinates, direction, strict=True):
                    if weight != 0.0:
                        acting = against if weight > 0.0 else along
                        acting[coordinate] = self.graph.add(acting[coordinate], force)
        return against, along, rates

    def unit_forces(self, entry: ModelTerm) -> tuple[list[tuple[str, int]], int | None]:
        """Force of each component of a term with a unit coefficient, and the rate of the term's own state."""
        names = {name: self.channels[name] for name in entry.term.channels}
        names |= {p.name: self.values[f"{entry.name}.{p.name}"] for p in entry.term.parameters}
        rate, pairs = None, list[tuple[str, int]]()
        if entry.term.name == "inertia":
            return pairs, rate
        names |= {"u": self.along(entry.place, 0), "v": self.along(entry.place, 1), "t": self.time}
        if entry.term.state is not None:
            names["z"] = self.memory[entry.name]
            rate = formulas.add_formula(self.graph, entry.term.state, names)
        for component, key in zip(entry.term.components, entry.symbols, strict=True):
            if component.order < 2:
                pairs.append((key, unit_force(self.graph, component, names, rate)))
        return pairs, rate

    def reaction(self, coordinate: str) -> int:
        """Force that a prescribed motion of a coordinate takes."""
        against, along, _ = self._terms
        total = self.graph.sub(against[coordinate], along[coordinate])
        for i, j, weight, key in mass_entries(self.model):
            if self.model.coordinates[i] == coordinate:
                inertia = self.graph.mul(self.values[key], self.at(self.model.coordinates[j], 2))
                total = (self.graph.add if weight > 0.0 else self.graph.sub)(total, inertia)
        return total

    @cached_property
    def slopes(self) -> list[int]:
        """Of the velocities of the degrees of freedom, then of the terms' own states."""
        graph, (against, loads, rates) = self.graph, self._terms
        loads = dict(loads)
        for where, node in self.forces:
            if where != GROUND:
                loads[where] = graph.add(loads[where], node)
                continue
            for i, _, weight, key in mass_entries(self.model):  # it moves, and inertia stays behind
                coordinate, inertia = self.model.coordinates[i], graph.mul(self.values[key], node)
                loads[coordinate] = (graph.sub if weight > 0.0 else graph.add)(loads[coordinate], inertia)
        loads = {c: graph.sub(load, against[c]) for c, load in loads.items()}  # summed first, subtracted once
        if self.model.modal is not None:
            return [*self._modal(self.model.modal, loads), *rates]
        n, right = len(self.free), [loads[c] for c in self.free]
        matrix = [[graph.const(0.0)] * n for _ in range(n)]
        for i, j, weight, key in mass_entries(self.model):
            row, column = (self.model.coordinates[k] for k in (i, j))
            add = graph.add if weight > 0.0 else graph.sub
            if row in self.free and column in self.free:
                k, m = self.free.index(row), self.free.index(column)
                matrix[k][m] = add(matrix[k][m], self.values[key])
            elif row in self.free:
                k, inertia = self.free.index(row), graph.mul(self.values[key], self.at(column, 2))
                right[k] = (graph.sub if weight > 0.0 else graph.add)(right[k], inertia)
        return [*_solved(graph, matrix, right), *rates]

    def _modal(self, modal: ModalPart, loads: dict[str, int]) -> list[int]:
        """Accelerations of the modes."""
        graph, (q, rate) = self.graph, self.motion
        totals = [graph.const(0.0)] * modal.count
        for coordinate, load in loads.items():
            if graph.constant_value(load) != 0.0:
                for r, key in enumerate(modal.shape(coordinate)):
                    totals[r] = graph.add(totals[r], graph.mul(self.values[key], load))
        for r, key in enumerate(modal.stiffness):
            totals[r] = graph.sub(totals[r], graph.mul(self.values[key], q[r]))
        for (r, s), key in zip(modal.pairs, modal.damping, strict=True):
            totals[r] = graph.sub(totals[r], graph.mul(self.values[key], rate[s]))
            if r != s:
                totals[s] = graph.sub(totals[s], graph.mul(self.values[key], rate[r]))
        return totals


def unit_force(graph: Graph, component: Component, names: Mapping[str, int], rate: int | None) -> int:
    """Force of a component with a unit coefficient: its shape, or the shape's derivative by the chain rule."""
    shape = formulas.add_formula(graph, component.shape, names)
    if component.order == 1:
        total = graph.mul(graph.derivative(shape, names["u"]), names["v"])
        total = graph.add(total, graph.derivative(shape, names["t"]))
        if rate is not None:
            total = graph.add(total, graph.mul(graph.derivative(shape, names["z"]), rate))
        shape = total
    return graph.mul(graph.const(component.factor), shape)


def acceleration_program(model: Model, keys: Sequence[str] = ()) -> Program:
    """Accelerations by coordinate of a model whose values are all known, each beside its derivatives by some keys.

    Inputs are ``u:floor1`` and ``v:floor1``, ``t``, ``drive:shaker`` of forces and channels, ``z:relaxation[floor1]``;
    a single mass has the motions ``u:`` and ``v:``.
    """
    made = Equations(model)
    by = [made.values[key] for key in keys]
    rows = [[slope, *(made.graph.derivative(slope, key) for key in by)] for slope in made.slopes[: made.dofs]]
    return made.graph.program([node for row in rows for node in row]).with_inputs(model.numbers())


def loose_motions(model: Model) -> int:
    """In how many of its motions no force at rest depends on where a model is, so that nothing ties it down.

    What a term remembers of the motion ties nothing: it gives way.
    """
    ties = [np.array(entry.place.direction(model.coordinates)) for entry in model.terms if _ties(entry.term)]
    return len(model.coordinates) - (int(np.linalg.matrix_rank(np.stack(ties))) if ties else 0)


def has_spring(model: Model) -> bool:
    """Whether anything brings a model back, or pushes it away."""
    return loose_motions(model) < len(model.coordinates)


@lru_cache(maxsize=256)
def _ties(term: Term) -> bool:
    """Whether the force of a term at rest depends on the displacement, and not so that it repeats itself further on."""
    graph = Graph()
    if term.repeats:
        return False
    names = {n: graph.input(n) for n in ("u", "t", "z", *term.channels, *(p.name for p in term.parameters))}
    names["v"] = graph.const(0.0)
    rate = formulas.add_formula(graph, term.state, names) if term.state is not None else None
    units = [unit_force(graph, c, names, rate) for c in term.components if c.order < 2]
    return any(graph.constant_value(graph.derivative(unit, names["u"])) != 0.0 for unit in units)


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
