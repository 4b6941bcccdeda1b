"""Words on the axes: formulas as mathtext, units of frequency response functions, scaled units."""

import ast
import math
from typing import TYPE_CHECKING

from study.equations import dimensions, formulas, terms

if TYPE_CHECKING:
    import pandas as pd

SHOWN_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
SHAPE_UNITS = {"length": "m", "1/length": "1/m", "time": "s", "frequency": "Hz", "velocity": "m/s"}
FREE_SHAPE = "miso_free_shape"  # the estimator that finds shape parameters too
MOST_DIGITS = 6
LOOSE_OPERATORS = (ast.Add, ast.Sub)  # whose operands a product must put in brackets


def formula(text: str) -> str:
    r"""A shape such as ``u*cos(2*pi*f_m*t)`` as Matplotlib mathtext, such as ``$u\,\cos(2\,\pi\,f_{m}\,t)$``."""
    return f"${_math(formulas.parse(text))}$"


def _math(tree: ast.expr) -> str:
    match tree:
        case ast.Constant(value=value):
            return f"{value:g}" if isinstance(value, int | float) else str(value)
        case ast.Name(id=name):
            return _symbol(name)
        case ast.UnaryOp(op=op, operand=operand):
            return f"{'-' if isinstance(op, ast.USub) else ''}{_bracketed(operand)}"
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            base = _math(left) if isinstance(left, ast.Name | ast.Call) else f"({_math(left)})"
            return f"{base}^{{{_math(right)}}}"
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return rf"{_bracketed(left)}\,{_bracketed(right)}"
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return f"{_bracketed(left)}/{_bracketed(right, ast.Mult, ast.Div)}"
        case ast.BinOp(left=left, op=ast.Sub(), right=right):
            return f"{_math(left)} - {_bracketed(right)}"
        case ast.BinOp(left=left, right=right):
            return f"{_math(left)} + {_math(right)}"
        case ast.Call(func=ast.Name(id="abs"), args=[argument]):
            return f"|{_math(argument)}|"
        case ast.Call(func=ast.Name(id=name), args=arguments):
            inside = r",\,".join(_math(a) for a in arguments)
            return rf"\mathrm{{{name}}}({inside})"
        case _:
            return ast.unparse(tree)


def _symbol(name: str) -> str:
    if name == "pi":
        return r"\pi"
    stem, _, index = name.partition("_")
    word = stem if len(stem) == 1 else rf"\mathrm{{{stem}}}"
    return f"{word}_{{{index.replace('_', ',')}}}" if index else word


def _bracketed(tree: ast.expr, *more: type[ast.operator]) -> str:
    inner = _math(tree)
    return f"({inner})" if isinstance(tree, ast.BinOp) and isinstance(tree.op, (*LOOSE_OPERATORS, *more)) else inner


def response_unit(shape: str, force: str = "N", length: str = "m") -> str:
    """Unit of A_j, the force over an input's shape: ``N/m^3`` for ``u**3``."""
    known = {p.name: terms.QUANTITIES[p.quantity] for t in terms.LIBRARY.values() for p in t.parameters}
    try:
        powers = dimensions.dimensions(shape, known)
    except formulas.ExpressionError:
        powers = None
    return dimensions.compose(force, length, powers)


def power_of_ten(largest: float) -> tuple[float, str]:
    """A power of 1000 to divide an axis by, and what to write before its unit, as in ``10^6 N/m^3``."""
    if not largest > 0.0 or not math.isfinite(largest):
        return 1.0, ""
    exponent = 3 * math.floor(math.log10(largest) / 3.0)
    return (1.0, "") if exponent == 0 else (10.0**exponent, f"10^{exponent} ")


def prefixed(unit: str, largest: float) -> tuple[float, str]:
    """Divisor and unit in which values up to ``largest`` are easy to read: metres become mm.

    Units other than the metre are left alone: a user's record may be in volts or counts.
    """
    if unit != "m" or not largest > 0.0:
        return 1.0, unit
    scale, prefix = next((p for p in SHOWN_PREFIXES if largest >= p[0]), SHOWN_PREFIXES[-1])
    return scale, prefix + unit


def quantity(value: float, unit: str) -> str:
    """A value with its unit, three digits: ``6.64 mm``."""
    factor, shown = prefixed(unit, abs(value))
    return f"{value / factor:.3g} {dimensions.pretty(shown)}"


def estimated(parameters: "pd.DataFrame") -> str:
    """Shape parameters in a case's ``parameters.csv``: ``u_g = 2.5002 ± 0.0011 mm (given 2.5)``; empty if none.

    An error that the six decimals shown do not reach is left out.
    """
    units_of = {p.name: SHAPE_UNITS[p.quantity] for term in terms.LIBRARY.values() for p in term.parameters}
    own = parameters[parameters["estimator"] == FREE_SHAPE]
    texts: list[str] = []
    for _, row in own[own["parameter"].isin(list(units_of))].iterrows():
        value, error = float(row["estimate"]), float(row["standard_error"])
        factor, unit = prefixed(units_of[str(row["parameter"])], abs(value))
        digits = MOST_DIGITS if error == 0.0 else min(max(0, -math.floor(math.log10(error / factor))), MOST_DIGITS)
        symbol = _symbol(str(row["parameter"]))
        shown = f"{value / factor:.{digits}f}"
        shown = shown.rstrip("0").rstrip(".") if digits == MOST_DIGITS else shown  # zeros beside an error say something
        stated = f"${symbol}$ = {shown}"
        within = f" ± {error / factor:.{digits}f}" if digits < MOST_DIGITS else ""
        texts.append(f"{stated}{within} {dimensions.pretty(unit)} (given {float(row['true']) / factor:g})")
    return ", ".join(texts)


def term_names(text: str) -> str:
    """Names of terms or systems in words: ``van_der_pol_damping`` becomes ``Van der Pol damping``."""
    words = text.replace("_", " ")
    for name in ("Van der Pol", "Coulomb", "Stribeck", "Duffing", "Mathieu"):
        words = words.replace(name.lower(), name)
    for joined in ("one-sided", "load-dependent"):
        words = words.replace(joined.replace("-", " "), joined)
    return words
