"""The program of a model's slopes and of their exact partial derivatives, which a free run integrates together."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from study.equations.graph import Op, Program
from study.equations.model import Model, forward_graph
from study.support.arrays import Ints
from study.support.errors import StudyError

CACHED = 128  # programs
SIDE = "side of v"  # the input that stands for sgn v during a step


@dataclass(frozen=True, eq=False)
class Variation:
    """A program of slopes and their partial derivatives, and where its results lie; compared by identity.

    Attributes
    ----------
    program : Program
        Slopes of the states, then their partial derivatives.
    slots : int array, shape (states - 1, 1 + states + keys)
        Registers of each slope (but velocity), of its partial derivatives by the states and by the keys.
    side : int
        Register that stands for sgn v, -1 if no force of the model jumps with it.
    channels : int
        Channels of the drive, the force among them.
    """

    program: Program
    slots: Ints
    side: int
    channels: int

    @property
    def states(self) -> int:
        """Displacement, velocity and the terms' own."""
        return len(self.slots) + 1


def differentiated(model: Model, channels: tuple[str, ...], keys: tuple[str, ...]) -> Variation:
    """Program of slopes and partial derivatives of a model that gives every value but those of the keys."""
    if missing := [key for key, value in model.values.items() if value is None and key not in keys]:
        raise StudyError(f"model {model.name!r} gives no value for {', '.join(missing)}; a free run needs all")
    if unknown := [key for key in keys if key not in model.values]:
        raise StudyError(f"model {model.name!r} has no {', '.join(unknown)}; it has {', '.join(model.values)}")
    return _program(model.with_values(dict.fromkeys(model.values)), channels, keys)


@lru_cache(maxsize=CACHED)
def _program(model: Model, channels: tuple[str, ...], keys: tuple[str, ...]) -> Variation:
    """As :func:`differentiated`, of a model without values: a diagnosis runs each of its models many times."""
    forward = forward_graph(model, channels)
    graph, known = forward.graph, "inertia" not in model
    by = (*(forward.states[2:] if known else forward.states), *(graph.input(key) for key in keys))
    rows = [[slope, *(graph.derivative(slope, node) for node in by)] for slope in forward.slopes]
    if known:
        program = graph.program([node for row in rows for node in row])
        return Variation(program, program.outputs.reshape(len(rows), 1 + len(by)), -1, len(channels))
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
