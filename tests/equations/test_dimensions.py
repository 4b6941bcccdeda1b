"""Units worked out from formulas."""

from fractions import Fraction

import pytest

from study.equations.dimensions import VARIABLE_DIMENSIONS, compose, dimensions, pretty

L, T = Fraction(1), Fraction(1)


@pytest.mark.parametrize(
    ("text", "powers"),
    [
        ("1", (0, 0)), ("u", (1, 0)), ("v", (1, -1)), ("t", (0, 1)), ("pi*u", (1, 0)), ("-u", (1, 0)),
        ("u/v", (0, 1)),
        ("u**2*v", (3, -1)), ("u*abs(v)", (2, -1)), ("sgn(v)", (0, 0)), ("u + v*t", (1, 0)), ("max(u, 0)", (1, 0)),
        ("max(0, u)", (1, 0)), ("min(max(u, -u), v*t)", (1, 0)), ("sqrt(u*u)", (1, 0)), ("sin(2*pi*u)*v", (1, -1)),
        ("u**0.5", ("1/2", 0)), ("u**0.3", ("3/10", 0)), ("sqrt(u)", ("1/2", 0)), ("u**-2", (-2, 0)),
        ("u**(-2)", (-2, 0)),
        ("2*u - 0.5*u", (1, 0)), ("exp(-u)*t", (0, 1)), ("v**3", (3, -3)),
    ],
)  # fmt: skip
def test_dimensions(text: str, powers: tuple[int | str, int | str]) -> None:
    assert dimensions(text, {}) == (Fraction(powers[0]), Fraction(powers[1]))


@pytest.mark.parametrize("text", ["u + v", "u + 1", "max(u, v)", "min(v, t)", "other*u", "max(other, u)", "u**other"])
def test_parts_that_do_not_share_a_dimension_have_none(text: str) -> None:
    assert dimensions(text, {}) is None


def test_known_names_extend_the_variables() -> None:
    assert dimensions("z*gap", {"z": VARIABLE_DIMENSIONS["u"], "gap": VARIABLE_DIMENSIONS["u"]}) == (2, 0)


@pytest.mark.parametrize(
    ("powers", "unit"),
    [
        ((0, 0), "N"), ((1, 0), "N/m"), ((3, -1), "N s/m^3"), ((2, -2), "N s^2/m^2"), ((1, -2), "kg"), ((0, 1), "N/s"),
        ((1, 1), "N/(m s)"),
        ((-1, 0), "N m"), ((0, -1), "N s"),
    ],
)  # fmt: skip
def test_compose(powers: tuple[int, int], unit: str) -> None:
    assert compose("N", "m", (Fraction(powers[0]), Fraction(powers[1]))) == unit


def test_compose_without_dimensions() -> None:
    assert compose("kN", "mm", None) == "kN per unit of the formula"


def test_pretty() -> None:
    assert pretty("N s^2/m^2") == "N s$^{2}$/m$^{2}$"
    assert pretty("m^1/2 s^-2") == "m$^{1/2}$ s$^{-2}$"
    assert pretty("N") == "N"
