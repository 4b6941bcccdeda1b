"""Expressions as a graph without repetition, their exact derivatives, and their programs for the kernels.

Every force in a model is a node here. Equal subexpressions share one node (``u*u`` in ``u**3`` and in
its derivative is computed once), derivatives are exact, and :meth:`Graph.program` turns the nodes into
the instructions that the compiled loops run. No text is ever evaluated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np

from study.support.arrays import Floats, Ints


class Op(IntEnum):
    """Instructions of the kernels; the numbers are those of ``c/program.c``."""

    ADD = 0
    SUB = 1
    MUL = 2
    DIV = 3
    NEG = 4
    ABS = 5
    SGN = 6
    MAX = 7
    MIN = 8
    GT = 9
    SIN = 10
    COS = 11
    EXP = 12
    LOG = 13
    SQRT = 14
    TANH = 15
    POW = 16
    INPUT = 100
    CONST = 101


UNARY = {Op.NEG, Op.ABS, Op.SGN, Op.SIN, Op.COS, Op.EXP, Op.LOG, Op.SQRT, Op.TANH}


@dataclass(frozen=True)
class Program:
    """Straight-line code over one array of registers: instruction i writes register ``first + i``."""

    code: Ints  # (instructions, 3): operation and the registers of its two operands
    registers: Floats  # start values: inputs (to be filled in by the caller), constants, then room for results
    first: int
    inputs: dict[str, int]  # register of each by name
    outputs: Ints  # registers of the results, in the order in which they were asked for

    def with_inputs(self, values: Mapping[str, float]) -> "Program":
        """The program with the values of some inputs in their registers."""
        registers = self.registers.copy()
        for name, value in values.items():
            registers[self.inputs[name]] = value
        return replace(self, registers=registers)


@dataclass
class Graph:
    """A growing set of nodes ``(op, a, b)``, each of which exists once."""

    nodes: list[tuple[Op, int, int]] = field(default_factory=list[tuple[Op, int, int]])
    names: list[str] = field(default_factory=list[str])
    values: list[float] = field(default_factory=list[float])
    _known: dict[tuple[Op, int, int], int] = field(default_factory=dict[tuple[Op, int, int], int])
    _constants: dict[float, int] = field(default_factory=dict[float, int])
    _depends: list[int] = field(default_factory=list[int])  # inputs that each node depends on: one bit each
    _derivatives: dict[tuple[int, int], int] = field(default_factory=dict[tuple[int, int], int])

    def _node(self, op: Op, a: int, b: int) -> int:
        key = (op, a, b)
        known = self._known.get(key)
        if known is None:
            known = self._known[key] = len(self.nodes)
            self.nodes.append(key)
            leaf = op is Op.INPUT or op is Op.CONST
            self._depends.append((op is Op.INPUT) << a if leaf else self._depends[a] | self._depends[b])
        return known

    def input(self, name: str) -> int:
        """Node of a named input (a variable, a coefficient, a shape parameter)."""
        if name not in self.names:
            self.names.append(name)
        return self._node(Op.INPUT, self.names.index(name), 0)

    def const(self, value: float) -> int:
        if value not in self._constants:
            self._constants[value] = self._node(Op.CONST, len(self.values), 0)
            self.values.append(value)
        return self._constants[value]

    def constant_value(self, node: int) -> float | None:
        """The value of a constant node, None for any other."""
        op, a, _ = self.nodes[node]
        return self.values[a] if op is Op.CONST else None

    def add(self, a: int, b: int) -> int:
        x, y = self.constant_value(a), self.constant_value(b)
        if x is not None and y is not None:
            return self.const(x + y)
        if x == 0.0:
            return b
        return a if y == 0.0 else self._node(Op.ADD, min(a, b), max(a, b))

    def sub(self, a: int, b: int) -> int:
        x, y = self.constant_value(a), self.constant_value(b)
        if x is not None and y is not None:
            return self.const(x - y)
        if y == 0.0:
            return a
        return self.neg(b) if x == 0.0 else self._node(Op.SUB, a, b)

    def neg(self, a: int) -> int:
        x = self.constant_value(a)
        return self.const(-x) if x is not None else self._node(Op.NEG, a, a)

    def mul(self, a: int, b: int) -> int:
        x, y = self.constant_value(a), self.constant_value(b)
        if x is not None and y is not None:
            return self.const(x * y)
        if x == 0.0 or y == 0.0:
            return self.const(0.0)
        if x == 1.0:
            return b
        return a if y == 1.0 else self._node(Op.MUL, min(a, b), max(a, b))

    def div(self, a: int, b: int) -> int:
        trivial = self.constant_value(a) == 0.0 or self.constant_value(b) == 1.0
        return a if trivial else self._node(Op.DIV, a, b)

    def unary(self, op: Op, a: int) -> int:
        return self._node(op, a, a)

    def binary(self, op: Op, a: int, b: int) -> int:
        """MAX, MIN, GT (1 where a > b, else 0) or POW."""
        return self._node(op, a, b)

    def power(self, a: int, exponent: float) -> int:
        """a to a constant power; small whole powers become products."""
        if exponent == int(exponent) and abs(exponent) <= 16:
            return self._whole_power(a, int(exponent))
        return self._node(Op.POW, a, self.const(exponent))

    def _whole_power(self, a: int, n: int) -> int:
        if n < 0:
            return self.div(self.const(1.0), self._whole_power(a, -n))
        if n == 0:
            return self.const(1.0)
        half = self._whole_power(a, n // 2)
        square = self.mul(half, half) if n > 1 else self.const(1.0)
        return self.mul(square, a) if n % 2 else square

    def derivative(self, node: int, wrt: int) -> int:
        """The exact partial derivative of a node by an input; that of ``sgn`` is taken as zero."""
        if node == wrt:
            return self.const(1.0)
        if not self._depends[node] & self._depends[wrt]:
            return self.const(0.0)
        key = (node, wrt)
        if key not in self._derivatives:
            self._derivatives[key] = self._differentiate(node, wrt)
        return self._derivatives[key]

    def _differentiate(self, node: int, wrt: int) -> int:
        op, a, b = self.nodes[node]
        if op in (Op.INPUT, Op.CONST, Op.SGN, Op.GT):
            return self.const(0.0)
        da, db = self.derivative(a, wrt), self.derivative(b, wrt)
        if op in UNARY and self.constant_value(da) == 0.0:
            return da
        match op:
            case Op.NEG:
                return self.neg(da)
            case Op.ABS:
                return self.mul(self.unary(Op.SGN, a), da)
            case Op.SIN:
                return self.mul(self.unary(Op.COS, a), da)
            case Op.COS:
                return self.neg(self.mul(self.unary(Op.SIN, a), da))
            case Op.EXP:
                return self.mul(node, da)
            case Op.LOG:
                return self.div(da, a)
            case Op.SQRT:
                return self.div(da, self.mul(self.const(2.0), node))
            case Op.TANH:
                return self.mul(self.sub(self.const(1.0), self.mul(node, node)), da)
            case Op.ADD:
                return self.add(da, db)
            case Op.SUB:
                return self.sub(da, db)
            case Op.MUL:
                return self.add(self.mul(da, b), self.mul(a, db))
            case Op.DIV:
                return self._over(self.sub(da, self.mul(node, db)), b)
            case Op.MAX:
                return self._choose(self.binary(Op.GT, a, b), da, db)
            case Op.MIN:
                return self._choose(self.binary(Op.GT, b, a), da, db)
            case _:  # POW, whose exponent is a constant
                exponent = self.constant_value(b)
                assert exponent is not None, "the parser admits constant exponents only"
                slope = self.mul(self.const(exponent), self.power(a, exponent - 1.0))
                return self.mul(slope, da)

    def _over(self, a: int, b: int) -> int:
        """a / b; a minus goes from a to b, the same to the last bit: slopes of an acceleration share that of a mass."""
        op, positive, _ = self.nodes[a]
        if op is Op.NEG and self.constant_value(b) is None:
            return self.div(positive, self.neg(b))
        return self.div(a, b)

    def _choose(self, gate: int, yes: int, no: int) -> int:
        if yes == no:
            return yes
        return self.add(self.mul(gate, yes), self.mul(self.sub(self.const(1.0), gate), no))

    def substituted(self, outputs: Sequence[int], table: Mapping[int, int]) -> list[int]:
        """The same results with some nodes replaced by others wherever they occur."""
        new = dict(table)
        for n in self.needed(outputs):
            op, a, b = self.nodes[n]
            if n not in new:
                new[n] = n if op in (Op.INPUT, Op.CONST) else self._node(op, new[a], new[b])
        return [new[n] for n in outputs]

    def program(self, outputs: Sequence[int]) -> Program:
        """Instructions that compute ``outputs`` and nothing else, inputs first, then constants."""
        needed, count = self.needed(outputs), len(self.names)
        constants = [n for n in needed if self.nodes[n][0] is Op.CONST]
        first = count + len(constants)
        register = {n: count + i for i, n in enumerate(constants)}
        code: list[tuple[int, int, int]] = []
        for n in needed:
            op, a, b = self.nodes[n]
            if op is Op.INPUT:
                register[n] = a
            elif op is not Op.CONST:
                register[n] = first + len(code)
                code.append((int(op), register[a], register[b]))
        registers = np.zeros(first + len(code))
        registers[count:first] = [self.values[self.nodes[n][1]] for n in constants]
        return Program(
            np.array(code, dtype=np.int64).reshape(-1, 3), registers, first,
            inputs={name: index for index, name in enumerate(self.names)},
            outputs=np.array([register[n] for n in outputs], dtype=np.int64),
        )  # fmt: skip

    def needed(self, outputs: Sequence[int]) -> list[int]:
        """Every node that the outputs depend on, in an order in which each comes after its operands."""
        wanted: set[int] = set()
        todo = list(outputs)
        while todo:
            n = todo.pop()
            op, a, b = self.nodes[n]
            if n not in wanted and op not in (Op.INPUT, Op.CONST):
                todo += [a, b]
            wanted.add(n)
        return sorted(wanted)  # a node is only ever made after its operands
