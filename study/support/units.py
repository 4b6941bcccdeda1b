"""Units as people write them: ``m/s²``, ``mm s^-2``, ``kN``, ``g``, ``mV``.

Force, length, time, voltage and current are the base dimensions; a mass is a force over an acceleration, so that
``kg m/s^2`` is a force.
"""

import math
import re
from dataclasses import dataclass
from typing import NamedTuple

from study.support.errors import StudyError, expect
from study.support.yaml_text import excerpt


class Powers(NamedTuple):
    """Of each base dimension."""

    force: int = 0
    length: int = 0
    time: int = 0
    voltage: int = 0
    current: int = 0

    @property
    def uncalibrated(self) -> bool:
        """Whether it is of a signal that stands for another quantity: volts of a sensor, amperes of a motor."""
        return self.voltage == 1 or self.current == 1


A_FORCE, A_LENGTH, A_TIME, A_VOLTAGE = Powers(force=1), Powers(length=1), Powers(time=1), Powers(voltage=1)
VELOCITY, ACCELERATION = Powers(length=1, time=-1), Powers(length=1, time=-2)
STANDARD_GRAVITY = 9.80665  # m/s^2, exact by definition (3rd CGPM, 1901)
POUND_FORCE = 0.45359237 * STANDARD_GRAVITY  # N, exact by definition

BASES: dict[str, tuple[float, Powers]] = {
    "N": (1.0, A_FORCE), "lbf": (POUND_FORCE, A_FORCE), "lb": (POUND_FORCE, A_FORCE),
    "kip": (1000.0 * POUND_FORCE, A_FORCE),
    "kgf": (STANDARD_GRAVITY, A_FORCE), "dyn": (1e-5, A_FORCE), "kg": (1.0, Powers(1, -1, 2)),
    "m": (1.0, A_LENGTH), "in": (0.0254, A_LENGTH), "inch": (0.0254, A_LENGTH), "mil": (0.0254e-3, A_LENGTH),
    "ft": (0.3048, A_LENGTH), "s": (1.0, A_TIME), "sec": (1.0, A_TIME), "min": (60.0, A_TIME), "h": (3600.0, A_TIME),
    "V": (1.0, A_VOLTAGE), "A": (1.0, Powers(current=1)), "Gal": (0.01, ACCELERATION),
    # Angles and strains take the place of a displacement, as moments take that of a force: a record holds no other.
    "rad": (1.0, A_LENGTH), "deg": (math.pi / 180.0, A_LENGTH), "strain": (1.0, A_LENGTH),
    "microstrain": (1e-6, A_LENGTH),
    **dict.fromkeys(("g", "gn", "g_n"), (STANDARD_GRAVITY, ACCELERATION)),
}  # fmt: skip
PREFIXES = {"M": 1e6, "k": 1e3, "d": 1e-1, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9, "p": 1e-12}
PREFIXED = ("N", "m", "s", "V", "A", "g", "gn", "rad")
PLAIN_CHARACTERS = str.maketrans({
    "²": "^2", "³": "^3", "⁻": "^-", "¹": "1", "·": " ", "⋅": " ", "*": " ", "µ": "u", "μ": "u", "−": "-",
    "°": "deg",
})  # fmt: skip
FACTOR = re.compile(r"([A-Za-z_]+)(?:\^?(-?[0-9]))?")
ROLES: dict[str, tuple[Powers, str]] = {
    "force": (A_FORCE, "N, kN, lbf, kgf, V or A"),
    "displacement": (A_LENGTH, "m, mm, cm, um, in, ft, rad, deg or V"),
    "velocity": (VELOCITY, "m/s, mm/s, in/s or V"),
    "acceleration": (ACCELERATION, "m/s^2, mm/s^2, g or V"),
    "time": (A_TIME, "s, ms or us"),
}


@dataclass(frozen=True)
class Unit:
    """A unit that was understood."""

    text: str  # as records, tables and figures write it (``m/s^2``, ``um``)
    factor: float  # how many SI units (N, m, s, V) it is
    powers: Powers


def parse_unit(text: str) -> Unit:
    """Understand a unit; of what is none, a ``StudyError`` names some that are."""
    plain = text.strip().replace("**", "^").translate(PLAIN_CHARACTERS).replace("^-^", "^-")
    plain = re.sub(r"\s*([/^])\s*", r"\1", " ".join(plain.replace("(", " ").replace(")", " ").split()))
    factor, powers = 1.0, Powers()
    for position, group in enumerate(plain.split("/")):
        sign = -1 if position else 1
        for token in group.split() or [""]:
            size, own = (1.0, Powers()) if (token, position) == ("1", 0) else _factor(token, text)
            factor *= size**sign
            powers = Powers(*(p + sign * o for p, o in zip(powers, own, strict=True)))
    if not math.isfinite(factor) or factor <= 0.0:
        raise _unknown(text)
    return Unit(_written(plain), factor, powers)


def _factor(token: str, text: str) -> tuple[float, Powers]:
    parts = FACTOR.fullmatch(token)
    if parts is None:
        raise _unknown(text)
    name, power = parts[1], int(parts[2] or "1")
    prefix, base = (1.0, name) if name in BASES else (PREFIXES.get(name[0], 0.0), name[1:])
    if name not in BASES and not (prefix and base in PREFIXED):
        raise _unknown(text)
    size, powers = BASES[base]
    return (prefix * size) ** power, Powers(*(power * p for p in powers))


def _written(plain: str) -> str:
    """The usual way to write it: powers with a caret, ``s`` for ``sec``."""
    plain = re.sub(r"\bsec(?=\d|\b|\^)", "s", plain)
    plain = re.sub(r"(?<=[A-Za-z])(-?\d)", r"^\1", plain)
    return re.sub(r"/([A-Za-z]+)/\1\b", r"/\1^2", plain)  # m/s/s


def _unknown(text: str) -> StudyError:
    known = (
        f"N, kN, mm and cm, in all {', '.join(BASES)} are known, {', '.join(PREFIXED)} with {', '.join(PREFIXES)} "
        "before them, and products and powers such as mm/s^2"
    )
    return StudyError(f"there is no unit {excerpt(text, 40)!r}; {known}")


def role_unit(role: str, text: str) -> Unit:
    """The unit of a channel such as ``force`` or ``time``, checked against what the channel is.

    Volts are accepted for all but time: an uncalibrated sensor. Amperes are for a force alone: the current of a motor.
    """
    unit = parse_unit(text)
    powers, expected = ROLES[role]
    moment = role == "force" and unit.powers == Powers(force=1, length=1)
    uncalibrated = role != "time" and unit.powers.uncalibrated and (role == "force" or unit.powers.voltage == 1)
    expect(unit.powers == powers or moment or uncalibrated, f"{text!r} is no unit of {role}; expected {expected}")
    return unit


def is_angle(text: str) -> bool:
    """Whether a unit is that of an angle, of its rate or of its acceleration: ``rad``, ``mrad/s``, ``deg``."""
    first = next(iter(text.replace("/", " ").split()), "")
    return first == "deg" or first.endswith("rad")


def is_unit(text: str) -> bool:
    """Whether a text is a unit."""
    try:
        parse_unit(text)
    except StudyError:
        return False
    return True
