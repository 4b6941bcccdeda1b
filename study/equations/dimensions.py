"""Units of coefficients, derived from the formulas that they multiply."""

import ast
import re
from fractions import Fraction

from study.equations import formulas

Dimensions = tuple[Fraction, Fraction]  # powers of length and of time
NONE: Dimensions = (Fraction(0), Fraction(0))
MASS: Dimensions = (Fraction(1), Fraction(-2))  # of an acceleration, the shape whose coefficient is a mass
VARIABLES: dict[str, Dimensions] = {
    "u": (Fraction(1), Fraction(0)),
    "v": (Fraction(1), Fraction(-1)),
    "t": (Fraction(0), Fraction(1)),
}


def dimensions(text: str, known: dict[str, Dimensions]) -> Dimensions | None:
    """Powers of length and time of a formula; None where its parts do not share them."""
    return _dimensions(formulas.parse(text), VARIABLES | known)


def _dimensions(tree: ast.expr, known: dict[str, Dimensions]) -> Dimensions | None:
    match tree:
        case ast.Constant():
            return NONE
        case ast.Name(id=name):
            return known.get(name, NONE if name == "pi" else None)
        case ast.UnaryOp(operand=operand):
            return _dimensions(operand, known)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            base, n = _dimensions(left, known), _exponent(right)
            return None if base is None or n is None else (base[0] * n, base[1] * n)
        case ast.BinOp(left=left, op=op, right=right):
            return _combine(op, _dimensions(left, known), _dimensions(right, known))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return _function(name, [_dimensions(a, known) for a in arguments])
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


def _combine(op: ast.operator, a: Dimensions | None, b: Dimensions | None) -> Dimensions | None:
    if a is None or b is None:
        return None
    if isinstance(op, ast.Mult):
        return (a[0] + b[0], a[1] + b[1])
    if isinstance(op, ast.Div):
        return (a[0] - b[0], a[1] - b[1])
    return a if a == b else None


def _function(name: str, arguments: list[Dimensions | None]) -> Dimensions | None:
    if name in ("abs", "max", "min"):
        units = set(arguments) - {NONE}  # a bare number, as in max(u, 0), takes the other's unit
        return NONE if not units else units.pop() if len(units) == 1 else None
    if name == "sqrt":
        a = arguments[0]
        return None if a is None else (a[0] / 2, a[1] / 2)
    return NONE


def compose(force: str, length: str, powers: Dimensions | None) -> str:
    """The unit of a coefficient: force over the unit of its shape, as in ``N s^2/m^2``.

    ``powers`` are those of length and time of the shape; None for a formula whose parts differ.
    """
    if powers is None:
        return f"{force} per unit of the formula"
    if (force, length, powers) == ("N", "m", MASS):
        return "kg"
    if force == f"{length}/s^2":  # a force per unit mass
        return _of_an_acceleration(length, powers)
    over = [_power(unit, p) for unit, p in ((length, powers[0]), ("s", powers[1])) if p > 0]
    up = [_power(unit, -p) for unit, p in ((length, powers[0]), ("s", powers[1])) if p < 0]
    label = " ".join([force, *up])
    if not over:
        return label
    return f"{label}/{over[0]}" if len(over) == 1 else f"{label}/({' '.join(over)})"


def _of_an_acceleration(length: str, powers: Dimensions) -> str:
    """The unit of a coefficient per unit mass, as ``1/s^2`` of a stiffness; none of the mass itself."""
    own = ((length, 1 - powers[0]), ("s", -2 - powers[1]))
    up, over = ([_power(unit, abs(p)) for unit, p in own if p * sign > 0] for sign in (1, -1))
    if not over:
        return " ".join(up)
    below = over[0] if len(over) == 1 else f"({' '.join(over)})"
    return f"{' '.join(up) or '1'}/{below}"


def _power(unit: str, power: Fraction) -> str:
    return unit if power == 1 else f"{unit}^{power}"


def pretty(text: str) -> str:
    """A unit or formula with powers as Matplotlib's mathtext superscripts."""
    return re.sub(r"\^(-?[0-9]+(?:[./][0-9]+)?)", r"$^{\1}$", text)
