"""Units on the axes of a page: scaled so that numbers are easy to read, powers raised without mathtext."""

import math
import re
from dataclasses import dataclass

from study.figures import labels
from study.support.errors import StudyError
from study.support.numbers import percent
from study.support.units import A_FORCE, A_LENGTH, role_unit

EASY = (0.1, 1e4)  # largest numbers of an axis that are read without a power of ten
EXPONENT = re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?)e([+-]?\d+)")
LONG_NUMBER = re.compile(r"(?<![\w.])(\d{6,})(\.\d+)?(?![\w]|\.\d| samples)")
KNOWN = 1e4  # times its error: a value that is larger
PLAIN_POWERS = (-3, 5)  # of ten: from the first on, and below the last, none is written
NO_BREAK = "\u00a0"
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


def motion(unit: str, largest: float) -> Scale:
    """The scale of any motion, and of what is predicted in its place; angles take a power of 1000."""
    if unit.startswith("rad"):
        return power(unit, largest)
    return rate(unit, largest) if "/" in unit else length(unit, largest)


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
    if sign and 0 < int(exponent) < 5:  # 200, not 2·10²: rounded as the digits say
        return f"{float(text):.0f}"
    return f"{mantissa}·10{str(int(exponent)).translate(RAISED)}" if sign else text


def in_percent(part: float) -> str:
    """A share in per cent, which no line breaks before its sign: ``3.68·10⁻⁵ %``."""
    return in_sentence(percent(part)).replace(" ", NO_BREAK)


def with_error(value: float, half: float) -> tuple[str, str]:
    """A value to the second digit of half its interval, and that: ``("5.74·10⁶", "0.16·10⁶")``.

    A value that is known to more digits than a reader compares is shown to six.
    """
    if not (math.isfinite(value) and math.isfinite(half) and half > 0.0):
        return number(value, 5), number(half, 2)
    largest = max(abs(value), half)
    if largest > KNOWN * half:
        return number(value, 6), number(half, 2)
    power = math.floor(math.log10(largest))
    power = power if power >= PLAIN_POWERS[1] or power < PLAIN_POWERS[0] else 0
    last = math.floor(math.log10(half)) - 1 - power  # the decimal of the error's second digit
    shown = (f"{round(x / 10.0**power, -last) + 0.0:.{max(0, -last)}f}" for x in (value, half))
    behind = f"·10{str(power).translate(RAISED)}" if power else ""
    first, second = (text + behind for text in shown)
    return first, second


def in_sentence(text: str) -> str:
    """A sentence of the command line in the page's format: powers raised, ``±`` for ``+-``, no exponents.

    Nor more than five digits before the point, but for what is counted.
    """
    plain = re.sub(EXPONENT, lambda m: f"{m[1]}·10{str(int(m[2])).translate(RAISED)}", text)
    plain = re.sub(LONG_NUMBER, _in_powers, plain)
    return re.sub(r"\^(-?[0-9]+)", lambda m: m[1].translate(RAISED), plain.replace("+-", "±"))


def _in_powers(found: re.Match[str]) -> str:
    """A long number with its digits behind the point: ``2.000013·10⁷`` for 20000130."""
    whole, fraction = found[1], found[2] or ""
    digits = (whole[1:] + fraction[1:]).rstrip("0")
    return f"{whole[0]}{'.' if digits else ''}{digits}·10{str(len(whole) - 1).translate(RAISED)}"


def mass(unit: str) -> Scale:
    """Divisor of a coefficient of inertia and the unit that it is shown in: kilograms, also for ``kN s^2/mm``."""
    wanted = re.fullmatch(r"(\S+) s\^2/(\S+)", unit)
    if wanted is None:
        return Scale(1.0, unit)
    try:
        force, length = role_unit("force", wanted[1]), role_unit("displacement", wanted[2])
    except StudyError:  # counts
        return Scale(1.0, unit)
    if (force.powers, length.powers) != (A_FORCE, A_LENGTH):  # volts
        return Scale(1.0, unit)
    return Scale(length.factor / force.factor, "kg")


def in_text(text: str) -> str:
    """A unit or formula with its powers raised: ``N s^2/m^2`` or ``u**3`` as a label shows it."""
    powers = re.sub(r"(?:\^|\*\*)(-?[0-9]+(?:[./][0-9]+)?)", lambda m: m[1].translate(RAISED), text)
    return powers.replace("*", "·")
