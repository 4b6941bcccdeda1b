"""A structure whose linear part is a sum of modes, with forces of terms between the points that are measured.

``q'' + G q' + W q = p``, ``p = phi_F F - sum over terms of (e.phi) coefficient d^r/dt^r g(e.u, e.v, t)`` and
``u = phi^T q``: any structure with symmetric mass, damping and stiffness matrices, of which some modes are kept. W is
diagonal, the squares of the natural frequencies; G is the symmetric matrix of modal damping. By reciprocity a mode is
felt and driven at a point alike: a sensor where a force acts makes the coefficients of the terms known in newtons.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from study.equations.graph import Graph
from study.equations.model import Model, named_channels
from study.equations.place import Place
from study.structure.equations_of_motion import Builder, MotionProgram, link_table, links_of


@dataclass(frozen=True)
class ModalKeys:
    """Names of the numbers of a linear part with so many modes; modes count from 1.

    Attributes
    ----------
    points : tuple of str
        Coordinates with a sensor or a force, and the ends of terms.
    modes : int
        How many.
    """

    points: tuple[str, ...]
    modes: int

    @property
    def stiffness(self) -> tuple[str, ...]:
        """Squares of the natural angular frequencies, ``w2[1]``."""
        return tuple(f"w2[{r}]" for r in range(1, self.modes + 1))

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Rows and columns of the damping matrix, counted from zero."""
        return tuple((r, s) for r in range(self.modes) for s in range(r, self.modes))

    @property
    def damping(self) -> tuple[str, ...]:
        """Elements of the modal damping matrix, ``g[1,2]``."""
        return tuple(f"g[{r + 1},{s + 1}]" for r, s in self.pairs)

    @property
    def coupling(self) -> tuple[str, ...]:
        """Those off its diagonal."""
        return tuple(key for (r, s), key in zip(self.pairs, self.damping, strict=True) if r != s)

    def shape(self, point: str) -> tuple[str, ...]:
        """Amplitudes of the modes at a point, ``phi[tip,1]``."""
        return tuple(f"phi[{point},{r}]" for r in range(1, self.modes + 1))

    @property
    def all(self) -> tuple[str, ...]:
        """Every name."""
        return (*self.stiffness, *self.damping, *(key for point in self.points for key in self.shape(point)))


class _ModalBuilder(Builder):
    """Relative motions are sums over the modes."""

    def along(self, place: Place, nodes: Sequence[int]) -> int:
        return self._sum(place.direction(self.model.coordinates), nodes)

    def _sum(self, direction: Sequence[float], nodes: Sequence[int]) -> int:
        total = self.graph.const(0.0)
        for r, node in enumerate(nodes):
            total = self.graph.add(total, self.graph.mul(self.weight(direction, r), node))
        return total

    def weight(self, direction: Sequence[float], r: int) -> int:
        """Amplitude of a mode along a direction."""
        total = self.graph.const(0.0)
        for name, weight in zip(self.model.coordinates, direction, strict=True):
            if weight != 0.0:
                node = self.values[f"phi[{name},{r + 1}]"]
                total = (self.graph.add if weight > 0.0 else self.graph.sub)(total, node)
        return total


def modal_program(
    model: Model, modal: ModalKeys, keys: Sequence[str], available: Sequence[str] = ()
) -> MotionProgram:  # fmt: skip
    """The program of a structure by modes: displacements of its state are the modal ones.

    ``keys`` are those of the model and of ``modal`` to differentiate by; registers hold the values of all.
    """
    named_channels(model, available)
    graph, n = Graph(), modal.modes
    q, rate = ([graph.input(f"{x}:{r}") for r in range(n)] for x in "qp")
    time = graph.input("t")
    forces = [graph.input(f"force:{name}") for name, _ in model.forces]
    channels = {name: graph.input(f"channel:{name}") for name in model.channels}
    states = {t.name: graph.input(f"z:{t.name}") for t in model.states}
    values = {key: graph.input(key) for key in (*model.values, *modal.all)}
    builder = _ModalBuilder(model, graph, (q, rate, time), channels, states, values)
    loads = _linear(graph, values, modal, q, rate)
    for (_, where), force in zip(model.forces, forces, strict=True):
        for r, key in enumerate(modal.shape(where)):
            loads[r] = graph.add(loads[r], graph.mul(values[key], force))
    rates = list[int]()
    for entry in model.terms:
        force, own = builder.force(entry)
        rates += [] if own is None else [own]
        for r in range(n):
            weight = builder.weight(entry.place.direction(model.coordinates), r)
            loads[r] = graph.sub(loads[r], graph.mul(weight, force))
    slopes = [*loads, *rates]
    by_state = links_of(graph, slopes, [*q, *rate, *states.values()])
    by_key = links_of(graph, slopes, [values[key] for key in keys])
    program = graph.program([*slopes, *(node for *_, node in (*by_state, *by_key))])
    registers = program.outputs[len(slopes) :]
    return MotionProgram(
        program, n, len(forces) + len(channels), program.outputs[: len(slopes)], link_table(by_state, registers),
        link_table(by_key, registers[len(by_state) :]), np.zeros(0, np.int64), np.zeros((0, n), np.int64),
        np.zeros((0, n)),
    )  # fmt: skip


def _linear(
    graph: Graph, values: dict[str, int], modal: ModalKeys, q: Sequence[int], rate: Sequence[int]
) -> list[int]:  # fmt: skip
    """Minus the forces of stiffness and damping on each mode."""
    loads = [graph.sub(graph.const(0.0), graph.mul(values[key], q[r])) for r, key in enumerate(modal.stiffness)]
    for (r, s), key in zip(modal.pairs, modal.damping, strict=True):
        loads[r] = graph.sub(loads[r], graph.mul(values[key], rate[s]))
        if r != s:
            loads[s] = graph.sub(loads[s], graph.mul(values[key], rate[r]))
    return loads
