"""Units on the axes of a page: scaled so that numbers are easy to read, powers raised without mathtext."""

import re
from dataclasses import dataclass

from study.figures import labels

EASY = (0.1, 1e4)  # largest numbers of an axis that are read without a power of ten
RAISED = str.maketrans("0123456789-/.", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻ᐟ·")


@dataclass(frozen=True)
class Scale:
    """Divisor of the numbers on an axis, and the unit that goes with it."""

    factor: float
    unit: str


def length(unit: str, largest: float) -> Scale:
    """Metres become mm or µm where that is easier to read; other units stay."""
    return Scale(*labels.prefixed(unit, largest))


def rate(unit: str, largest: float) -> Scale:
    """The same for m/s and m/s^2."""
    stem, sign, rest = unit.partition("/")
    factor, shown = labels.prefixed(stem, largest) if stem == "m" and sign else (1.0, stem)
    return Scale(factor, shown + sign + rest)


def power(unit: str, largest: float) -> Scale:
    """A power of 1000 before any unit, where numbers would begin with zeros or fill the axis with digits."""
    if EASY[0] <= largest < EASY[1]:
        return Scale(1.0, unit)
    factor, before = labels.power_of_ten(largest)
    return Scale(factor, before + unit)


def number(value: float, digits: int = 4) -> str:
    """A number as people write it: ``4.897·10⁵`` instead of ``4.897e+05``."""
    text = f"{value:.{digits}g}"
    mantissa, sign, exponent = text.partition("e")
    return f"{mantissa}·10{str(int(exponent)).translate(RAISED)}" if sign else text


def in_text(text: str) -> str:
    """A unit or formula with its powers raised: ``N s^2/m^2`` or ``u**3`` as a label shows it."""
    powers = re.sub(r"(?:\^|\*\*)(-?[0-9]+(?:[./][0-9]+)?)", lambda m: m[1].translate(RAISED), text)
    return powers.replace("*", "·")
