"""Units as people write them in headers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from study.support.errors import StudyError
from study.support.units import parse_unit, role_unit


@pytest.mark.parametrize(
    ("text", "written", "factor"),
    [
        ("N", "N", 1.0), ("kN", "kN", 1e3), ("MN", "MN", 1e6), ("lbf", "lbf", 4.4482216152605),
        ("kg m/s^2", "kg m/s^2", 1.0),
        ("mm", "mm", 1e-3), ("µm", "um", 1e-6), ("cm", "cm", 1e-2), ("in", "in", 0.0254), ("ft", "ft", 0.3048),
        ("m/s²", "m/s^2", 1.0), ("m/s2", "m/s^2", 1.0), ("m/s/s", "m/s^2", 1.0), ("mm s^-2", "mm s^-2", 1e-3),
        ("m·s⁻²", "m s^-2", 1.0), ("m/sec^2", "m/s^2", 1.0), ("g", "g", 9.80665),
        ("mV", "mV", 1e-3), ("ms", "ms", 1e-3),
    ],
)  # fmt: skip
def test_units(text: str, written: str, factor: float) -> None:
    unit = parse_unit(text)
    assert unit.text == written
    assert unit.factor == pytest.approx(factor, rel=1e-12)
    assert parse_unit(unit.text) == unit


@pytest.mark.parametrize(
    "text", ["", "x", "banana", "m/", "m^^2", "m/0", "N" * 999, "^", "m^99", "%", "m/s^", "furlong"]
)
def test_nonsense_units(text: str) -> None:
    with pytest.raises(StudyError, match=r"there is no unit .* N, kN, mm and cm, .* kgf, .* inch, .* deg, "):
        parse_unit(text)


@pytest.mark.parametrize(
    ("role", "text"), [("force", "mm"), ("displacement", "g"), ("acceleration", "m/s"), ("time", "V")]
)
def test_units_of_something_else(role: str, text: str) -> None:
    with pytest.raises(StudyError, match=f"'{text}' is no unit of {role}"):
        role_unit(role, text)


@given(st.text(max_size=12))
def test_any_text_is_a_unit_or_one_sentence(text: str) -> None:
    try:
        unit = parse_unit(text)
    except StudyError:
        return
    assert np.isfinite(unit.factor)
    assert parse_unit(unit.text).powers == unit.powers
