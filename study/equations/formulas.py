"""A user's formula, such as ``u*abs(u) + 0.1*v**3``, turned into nodes of a graph.

The text is parsed by Python's own parser and each part compared with a whitelist: numbers, known names,
``+ - * / **`` and the functions below. Nothing is ever evaluated or executed.
"""

import ast
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from threading import Lock

from study.equations.graph import Graph, Op
from study.support.errors import StudyError

CHARACTERS = 300  # at most
DEEPEST_FORMULA = 40
ONE_AT_A_TIME = Lock()  # Python before 3.13 counts the depth of a tree that it makes for all threads together
LARGEST_EXPONENT = 16.0

FUNCTIONS = {  # with their numbers of arguments; a tangent is made of two others, a spline of many
    "abs": (Op.ABS, 1), "sgn": (Op.SGN, 1), "sign": (Op.SGN, 1), "sin": (Op.SIN, 1), "cos": (Op.COS, 1),
    "tan": (Op.DIV, 1), "exp": (Op.EXP, 1), "log": (Op.LOG, 1), "sqrt": (Op.SQRT, 1), "tanh": (Op.TANH, 1),
    "max": (Op.MAX, 2), "min": (Op.MIN, 2), "spline": (Op.MAX, 5),
}  # fmt: skip
VARIABLES = ("u", "v", "t")  # in a formula these, and pi, are never columns of a record


class ExpressionError(StudyError):
    """A formula that is not of the whitelisted kind."""


@lru_cache(maxsize=1024)
def parse(text: str) -> ast.expr:
    """Check the outer form of a formula and return its syntax tree, which is not to be changed."""
    if len(text) > CHARACTERS:
        raise ExpressionError(f"the expression has {len(text)} characters; at most {CHARACTERS} are read")
    if not text.isascii() or "\x00" in text:
        raise ExpressionError(f"the expression {text!r} has characters outside plain ASCII")
    try:
        with ONE_AT_A_TIME:
            tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise ExpressionError(f"the expression {text!r} is not a formula such as 'u*abs(u) + 0.1*v**3'") from None
    deepest, level = 0, [tree]
    while level:
        deepest += 1
        level = [child for node in level for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]
    if deepest > DEEPEST_FORMULA:
        raise ExpressionError(f"the expression {text!r} is nested more than {DEEPEST_FORMULA} deep")
    return tree


@lru_cache(maxsize=1024)
def names(text: str) -> tuple[str, ...]:
    """The names a formula uses, functions and pi aside, in alphabetical order."""
    tree = parse(text)
    functions = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and id(node) not in functions}
    return tuple(sorted(used - {"pi"}))


def add_formula(graph: Graph, text: str, known: Mapping[str, int]) -> int:
    """Add a formula to a graph; ``known`` has the node of each name it may use. Returns the node of its value."""
    return _Builder(graph, text, known).node(parse(text))


class _Builder:
    def __init__(self, graph: Graph, text: str, known: Mapping[str, int]) -> None:
        self.graph, self.text, self.known = graph, text, known

    def refuse(self, why: str) -> ExpressionError:
        return ExpressionError(f"the expression {self.text!r} {why}")

    def node(self, tree: ast.expr) -> int:
        node = self.translated(tree)
        value = self.graph.constant_value(node)
        if value is not None and not math.isfinite(value):
            raise self.refuse(f"holds {ast.unparse(tree)!r}, which is too large a number")
        return node

    def translated(self, tree: ast.expr) -> int:
        graph = self.graph
        match tree:
            case ast.Constant(value=value):
                return self.number(value)
            case ast.Name(id=name):
                if name not in self.known and name != "pi":
                    raise self.refuse(f"uses the name {name!r}; it may use {', '.join(sorted(self.known))} and pi")
                return self.known[name] if name in self.known else graph.const(math.pi)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return graph.neg(self.node(operand))
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.node(operand)
            case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
                return self.power(base, exponent)
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                return graph.add(self.node(left), self.node(right))
            case ast.BinOp(left=left, op=ast.Sub(), right=right):
                return graph.sub(self.node(left), self.node(right))
            case ast.BinOp(left=left, op=ast.Mult(), right=right):
                return graph.mul(self.node(left), self.node(right))
            case ast.BinOp(left=left, op=ast.Div(), right=right):
                return self.ratio(self.node(left), self.node(right))
            case ast.BinOp():
                raise self.refuse("uses an operator other than + - * / **")
            case ast.Call():
                return self.call(tree)
            case _:
                raise self.refuse(f"holds {ast.unparse(tree)!r}; it may hold numbers, names, + - * / ** and functions")

    def number(self, value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.refuse(f"holds {value!r}, which is not a real number")
        if abs(value) > 1e300 or not math.isfinite(value):
            raise self.refuse(f"holds the number {str(value)[:20]}, outside the range of +-1e300")
        return self.graph.const(float(value))

    def power(self, base: ast.expr, exponent: ast.expr) -> int:
        value = self.graph.constant_value(self.node(exponent))
        if value is None or abs(value) > LARGEST_EXPONENT:
            raise self.refuse(
                f"raises to the power {ast.unparse(exponent)!r}; a power is a number of at most {LARGEST_EXPONENT:g}"
            )
        node = self.node(base)
        number = self.graph.constant_value(node)
        if number is None:
            return self.graph.power(node, value)
        try:
            return self.number(number**value)
        except (OverflowError, ZeroDivisionError):
            return self.number(math.nan)

    def ratio(self, left: int, right: int) -> int:
        x, y = self.graph.constant_value(left), self.graph.constant_value(right)
        if y == 0.0:
            raise self.refuse("divides by zero; expected a divisor that moves, or another number")
        return self.graph.div(left, right) if x is None or y is None else self.graph.const(x / y)

    def call(self, tree: ast.Call) -> int:
        name = tree.func.id if isinstance(tree.func, ast.Name) else ast.unparse(tree.func)
        if name not in FUNCTIONS:
            raise self.refuse(f"calls {name!r}; the functions are {', '.join(sorted(FUNCTIONS))}")
        op, arity = FUNCTIONS[name]
        if len(tree.args) != arity or tree.keywords:
            raise self.refuse(f"calls {name!r} with {len(tree.args)} arguments; it takes {arity}")
        arguments = [self.node(argument) for argument in tree.args]
        if name == "spline":
            return self.spline(arguments)
        if name == "tan":
            return self.graph.div(self.graph.unary(Op.SIN, arguments[0]), self.graph.unary(Op.COS, arguments[0]))
        return self.graph.unary(op, *arguments) if arity == 1 else self.graph.binary(op, *arguments)

    def spline(self, arguments: Sequence[int]) -> int:
        """``spline(s, first, last, count, j)``: cubic B-spline of knot j, of which there are ``count`` from 0 on.

        The knots are equally far apart from ``first`` to ``last``, beyond which it is constant. Those at both ends hold
        those beyond as well, so that a sum of all has no second derivative there (a natural spline), is 1 with
        coefficients of 1, and a line with coefficients on a line.
        """
        graph, (variable, *given) = self.graph, arguments
        known = [graph.constant_value(node) for node in given]
        first, last, count, j = (math.nan if x is None else x for x in known)
        if not (last > first and count >= 2 and 0 <= j < count and count == int(count) and j == int(j)):
            raise self.refuse("has a spline of no knot; expected spline(s, first, last, count, j) with 0 <= j < count")
        scaled = graph.mul(graph.sub(variable, graph.const(first)), graph.const((count - 1.0) / (last - first)))
        scaled = graph.binary(Op.MIN, graph.binary(Op.MAX, scaled, graph.const(0.0)), graph.const(count - 1.0))
        total = self.bump(scaled, j)
        beyond = {0.0: (-1.0, 2.0), 1.0: (-1.0, -1.0)}
        for end, direction in ((0.0, 1.0), (count - 1.0, -1.0)):
            if abs(j - end) in beyond:
                place, weight = beyond[abs(j - end)]
                bump = self.bump(scaled, end + direction * place)
                total = graph.add(total, graph.mul(graph.const(weight), bump))
        return total

    def bump(self, scaled: int, centre: float) -> int:
        """The cubic B-spline about a place, with knots one apart: ``(max(2 - |x|, 0)^3 - 4 max(1 - |x|, 0)^3)/6``."""
        graph, zero = self.graph, self.graph.const(0.0)
        away = graph.unary(Op.ABS, graph.sub(scaled, graph.const(centre)))
        outer, inner = (
            graph.power(graph.binary(Op.MAX, graph.sub(graph.const(reach), away), zero), 3.0) for reach in (2.0, 1.0)
        )
        return graph.mul(graph.sub(outer, graph.mul(graph.const(4.0), inner)), graph.const(1.0 / 6.0))
