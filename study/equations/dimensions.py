"""Units of coefficients, derived from the formulas that they multiply."""

import ast
import re
from fractions import Fraction

from study.equations import formulas

Dimensions = tuple[Fraction, Fraction]  # powers of length and of time
DIMENSIONLESS: Dimensions = (Fraction(0), Fraction(0))
MASS: Dimensions = (Fraction(1), Fraction(-2))  # of an acceleration, the shape whose coefficient is a mass
OF_NUMBERS = ("sin", "cos", "tan", "exp", "log", "tanh")  # functions of a number alone
VARIABLE_DIMENSIONS: dict[str, Dimensions] = {
    "u": (Fraction(1), Fraction(0)),
    "v": (Fraction(1), Fraction(-1)),
    "t": (Fraction(0), Fraction(1)),
}


def dimensions(text: str, known: dict[str, Dimensions]) -> Dimensions | None:
    """Powers of length and time of a formula; None where its parts do not share them."""
    return _dimensions(formulas.parse(text), VARIABLE_DIMENSIONS | known)


def agrees(text: str, known: dict[str, Dimensions], *, angle: bool = False) -> bool:
    """Whether a formula has a dimension, and every sine, exponential and the like in it is of a number.

    Of any dimension at all where u may be an ``angle``.
    """
    calls = (node for node in ast.walk(formulas.parse(text)) if isinstance(node, ast.Call))
    plain = (call for call in calls if isinstance(call.func, ast.Name) and call.func.id in OF_NUMBERS)
    found = [_dimensions(call.args[0], VARIABLE_DIMENSIONS | known) for call in plain]
    return dimensions(text, known) is not None and all(d == DIMENSIONLESS or (angle and d is not None) for d in found)


def _dimensions(tree: ast.expr, known: dict[str, Dimensions]) -> Dimensions | None:
    match tree:
        case ast.Constant():
            return DIMENSIONLESS
        case ast.Name(id=name):
            return known.get(name, DIMENSIONLESS if name == "pi" else None)
        case ast.UnaryOp(operand=operand):
            return _dimensions(operand, known)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            base, n = _dimensions(left, known), _exponent(right)
            return None if base is None or n is None else (base[0] * n, base[1] * n)
        case ast.BinOp(left=left, op=op, right=right):
            a, b = _dimensions(left, known), _dimensions(right, known)
            if a is None or b is None:
                return None
            if isinstance(op, ast.Mult | ast.Div):
                sign = 1 if isinstance(op, ast.Mult) else -1
                return (a[0] + sign * b[0], a[1] + sign * b[1])
            return a if a == b else None
        case ast.Call(func=ast.Name(id="abs" | "max" | "min"), args=arguments):
            # a bare number, as in max(u, 0), takes any
            units = {_dimensions(a, known) for a in arguments} - {DIMENSIONLESS}
            return DIMENSIONLESS if not units else units.pop() if len(units) == 1 else None
        case ast.Call(func=ast.Name(id="sqrt"), args=[argument]):
            a = _dimensions(argument, known)
            return None if a is None else (a[0] / 2, a[1] / 2)
        case ast.Call(func=ast.Name()):
            return DIMENSIONLESS
        case _:
            return None


def _exponent(tree: ast.expr) -> Fraction | None:
    """A plain number, with or without a sign, as the fraction it was meant to be."""
    match tree:
        case ast.Constant(value=int(n) | float(n)):
            return Fraction(n).limit_denominator(1000)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = _exponent(operand)
            return None if inner is None else -inner
        case _:
            return None


def compose(force: str, length: str, powers: Dimensions | None) -> str:
    """The unit of a coefficient: force over the unit of its shape, as in ``N s^2/m^2``.

    ``powers`` are those of length and time of the shape; None for a formula whose parts differ.
    """
    if powers is None:
        return f"{force} per unit of the formula"
    if (force, length, powers) == ("N", "m", MASS):
        return "kg"
    if force == f"{length}/s^2":  # a force per unit mass: no unit but the powers left, as 1/s^2 of a stiffness
        force, powers = "", (powers[0] - 1, powers[1] + 2)
    own = ((length, powers[0]), ("s", powers[1]))
    over, up = ([unit if abs(p) == 1 else f"{unit}^{abs(p)}" for unit, p in own if p * sign > 0] for sign in (1, -1))
    label = " ".join(filter(None, [force, *up]))
    if not over:
        return label
    return f"{label or '1'}/{over[0]}" if len(over) == 1 else f"{label or '1'}/({' '.join(over)})"


def pretty(text: str) -> str:
    """A unit or formula with powers as Matplotlib's mathtext superscripts."""
    return re.sub(r"\^(-?[0-9]+(?:[./][0-9]+)?)", r"$^{\1}$", text)
