"""Numbers as a reader wants them."""

import math
from collections.abc import Sequence

SMALLEST, LARGEST = 1e-50, 1e50  # of a value: no unit makes one beyond, and the square of one beyond may be no number
BEYOND_MEASURE = 1e150  # of what is computed: the square of one beyond may be no number
LAST_DIGITS = 1e-9  # relative: what two numbers that were written, converted or added up may differ by and be one
SAME_RUN = 0.01  # relative: what numbers of two runs of the same code on two machines may differ by
RARE = 0.001  # of chances: nobody needs the digits of a smaller one
ABSURD = 1e4  # a share beyond tells nothing but that there is none


def percent(share: float, form: str = ".3g", error: float | None = None, error_form: str = ".1g") -> str:
    """A share in percent, by Python's format codes: ``percent(0.0123, "+.3g", 0.001)`` is ``+1.23 +- 0.1 %``.

    A standard error that is nothing in its digits is left out.
    """
    if math.isnan(share):
        return "-"  # of nothing
    if abs(share) > ABSURD:
        return f"{'-' if share < 0.0 else ''}over {100.0 * ABSURD:.0f} %"
    if form == ".3g" and abs(share) >= 10.0:  # no exponents
        form = ".0f"
    shown = "0" if error is None else f"{100.0 * error:{error_form}}"
    spread = "" if float(shown) == 0.0 else f" +- {shown}"
    return f"{100.0 * share:{form}}{spread} %"


def digits_between(value: float, width: float) -> int:
    """Significant digits that tell the ends of an interval apart, four at least."""
    if value == 0.0 or not 0.0 < width < math.inf:
        return 4
    return min(max(4, math.ceil(math.log10(abs(value) / width)) + 2), 12)


def in_one_notation(values: Sequence[float], digits: int) -> list[str]:
    """Numbers in so many digits; all without an exponent where one digit more spares it: ``99931`` and ``100070``."""
    shown = [f"{value:.{digits}g}" for value in values]
    spared = [f"{float(text):.{digits + 1}g}" for text in shown]
    mixed = len({"e+" in text for text in shown}) > 1
    return spared if mixed and not any("e+" in text for text in spared) else shown


def by_chance(p_value: float) -> str:
    """A p value in words: in how many records chance alone would do as much."""
    if p_value < RARE:
        return "chance alone would do as much in fewer than 1 of 1000 records"
    of = 1000 if p_value < 0.01 else 100
    return f"chance alone would do as much in about {p_value * of:.0f} of {of} records"


def enumerated(words: Sequence[str]) -> str:
    """Words in a row: ``a``, ``a and b``, ``a, b and c``; empty for none."""
    *first, last = words or [""]
    return f"{', '.join(first)} and {last}" if first else last
