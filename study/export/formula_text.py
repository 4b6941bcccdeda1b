"""Nodes of a graph as text of a language: what has a name is called by it, what is used twice gets one."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from study.equations.graph import Graph, Op

SUM, SIGN, PRODUCT, POWER, ATOM = range(5)  # how strongly the parts of a text hold together


@dataclass(frozen=True)
class Language:
    """How a language writes what is more than + - * /."""

    power: str
    functions: Mapping[Op, str]  # with {0} and {1} for the operands


PYTHON = Language("**", {
    Op.ABS: "np.abs({0})", Op.SGN: "np.sign({0})", Op.MAX: "np.maximum({0}, {1})", Op.MIN: "np.minimum({0}, {1})",
    Op.GT: "np.where({0} > {1}, 1.0, 0.0)", Op.SIN: "np.sin({0})", Op.COS: "np.cos({0})", Op.EXP: "np.exp({0})",
    Op.LOG: "np.log({0})", Op.SQRT: "np.sqrt({0})", Op.TANH: "np.tanh({0})",
})  # fmt: skip
MODELICA = Language("^", {
    Op.ABS: "abs({0})", Op.SGN: "sign({0})", Op.MAX: "max({0}, {1})", Op.MIN: "min({0}, {1})",
    Op.GT: "(if {0} > {1} then 1.0 else 0.0)", Op.SIN: "sin({0})", Op.COS: "cos({0})", Op.EXP: "exp({0})",
    Op.LOG: "log({0})", Op.SQRT: "sqrt({0})", Op.TANH: "tanh({0})",
})  # fmt: skip


@dataclass
class FormulaText:
    """Assignments in an order in which each comes after what it needs, and the texts of results."""

    graph: Graph
    language: Language
    names: Mapping[int, str]  # of inputs, which are there, and of nodes that are to be assigned
    given: frozenset[int]  # those that are there
    shared: dict[int, str] = field(default_factory=dict[int, str])  # what is used more than once

    def lines(self, outputs: Sequence[int]) -> Iterator[tuple[str, str]]:
        """Name and text of each assignment that the outputs need."""
        needed = self.graph.needed(outputs)
        uses = Counter(operand for n in needed for operand in set(self._operands(n)))
        taken = set(self.names.values())
        for n in needed:
            if n in self.given or self.graph.nodes[n][0] in (Op.INPUT, Op.CONST):
                continue
            name = self.names.get(n)
            if name is None and uses[n] > 1 and self._factors(n) is None:
                numbers = iter(range(1, len(needed) + 1))
                name = next(f"x{i}" for i in numbers if f"x{i}" not in taken)
                self.shared[n] = name
            if name is not None:
                taken.add(name)
                yield name, self._whole(n)

    def __getitem__(self, node: int) -> str:
        return self._of(node)[0]

    def _operands(self, n: int) -> tuple[int, ...]:
        """Nodes that the text of this one names: of a power the base."""
        op, a, b = self.graph.nodes[n]
        if op in (Op.INPUT, Op.CONST):
            return ()
        if (power := self._factors(n)) is not None:
            return (power[0],)
        return (a, b)

    def _factors(self, n: int) -> tuple[int, int] | None:
        """Base and exponent of a product of one node with itself, which is written as a power."""
        op, a, b = self.graph.nodes[n]
        if op is not Op.MUL or n in self.names:
            return None
        (base, p), (other, q) = (self._factors(x) or (x, 1) for x in (a, b))
        return (base, p + q) if base == other else None

    def _of(self, n: int) -> tuple[str, int]:
        """FormulaText of a node where it is used, and how strongly it holds together."""
        name = self.names.get(n) or self.shared.get(n)
        return (name, ATOM) if name is not None else self._formula(n)

    def _whole(self, n: int) -> str:
        return self._formula(n)[0]

    def _within(self, n: int, least: int) -> str:
        text, strength = self._of(n)
        return text if strength >= least else f"({text})"

    def _formula(self, n: int) -> tuple[str, int]:
        op, a, b = self.graph.nodes[n]
        if op is Op.CONST:
            value = self.graph.values[a]
            return repr(value), ATOM if value >= 0.0 else SIGN
        if (power := self._factors(n)) is not None:
            return f"{self._within(power[0], ATOM)}{self.language.power}{power[1]}", POWER
        match op:
            case Op.ADD if a == b:
                return f"2.0 * {self._within(a, POWER)}", PRODUCT
            case Op.ADD:
                return f"{self._within(a, SUM)} + {self._within(b, PRODUCT)}", SUM
            case Op.SUB:
                return f"{self._within(a, SUM)} - {self._within(b, PRODUCT)}", SUM
            case Op.MUL:
                return f"{self._within(a, PRODUCT)} * {self._within(b, POWER)}", PRODUCT
            case Op.DIV:
                return f"{self._within(a, PRODUCT)} / {self._within(b, POWER)}", PRODUCT
            case Op.NEG:
                return f"-{self._within(a, PRODUCT)}", SIGN
            case Op.POW:
                return f"{self._within(a, ATOM)}{self.language.power}{self._within(b, ATOM)}", POWER
            case _:
                return self.language.functions[op].format(self[a], self[b]), ATOM
