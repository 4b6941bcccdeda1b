"""Shape parameters of a user's own formula: ``friction(vs)`` with ``tanh(v/vs)`` has the velocity ``vs``.

What a parameter is follows from the formula, which must have a dimension with it: ``v/vs`` is a number, so ``vs`` is a
velocity, and is looked for among the velocities of the motion.
"""

import re
from collections.abc import Sequence
from itertools import product

from study.equations import dimensions, formulas
from study.equations.term import QUANTITIES, Search, ShapeParameter
from study.support.errors import StudyError, expect
from study.support.yaml_text import shown

HEADED = re.compile(r"([^()]*)(?:\(([^()]*)\))?")
RESERVED = (*formulas.VARIABLES, "pi", "z", "term", "force", "value", "values", "start", "at", "between", "couples")
SEARCHES = {  # where a parameter of each quantity is looked for along the motion
    "velocity": Search("shares of the velocity", (0.03, 0.1, 0.3, 0.7, 1.5)),
    "length": Search("quantiles of |u|", (0.1, 0.3, 0.5, 0.7, 0.9)),
    "1/length": Search("per amplitude", (0.3, 1.0, 3.0, 10.0)),
    "time": Search("times of the motion", (0.1, 0.3, 1.0, 3.0, 10.0)),
    "frequency": Search("lines of the residual", (-0.35, 0.0, 0.35)),
    "number": Search("numbers", (0.1, 0.3, 1.0, 3.0, 10.0)),
}


def name_and_parameters(heading: str) -> tuple[str, tuple[str, ...]]:
    """``friction(vs, a)`` as the name of a term and those of its parameters; most have none.

    Raises
    ------
    StudyError
        If it is not of this form.
    """
    found = HEADED.fullmatch(heading)
    if found is None:
        raise StudyError(f"{shown(heading)} is no name of a term; expected one such as 'bracket' or 'friction(vs)'")
    listed = [] if found[2] is None else [name.strip() for name in found[2].split(",")]
    return found[1], tuple(listed)


def parameters_of(names: Sequence[str], formula: str) -> tuple[ShapeParameter, ...]:
    """The parameters of a formula with their quantities, each above zero.

    Raises
    ------
    StudyError
        If one is not in the formula, has a name that means something else, or cannot be told what it is.
    """
    used = formulas.names(formula)
    for name in names:
        expect(name.isidentifier() and name.isascii(), f"{name!r} is no name of a parameter; expected one such as 'vs'")
        taken = name in RESERVED or name in formulas.FUNCTIONS
        expect(not taken, f"the parameter {name!r} has a name that means something else; expected one such as 'vs'")
        expect(names.count(name) == 1, f"the parameter {name!r} is listed twice; expected once")
        expect(name in used, f"the formula {formula!r} lacks its parameter {name!r}; it uses {', '.join(used)}")
    # the search tries all combinations of their values
    expect(len(names) <= 3, f"{len(names)} parameters are listed; at most 3 are searched together")
    channels = dict.fromkeys(set(used) - set(names) - set(formulas.VARIABLES), dimensions.DIMENSIONLESS)
    possible = [dict(zip(names, quantities, strict=True)) for quantities in product(SEARCHES, repeat=len(names))]
    for angle in (False, True):  # a sine of u, where that is an angle, is not of a number
        for quantity in possible:
            known = channels | {name: QUANTITIES[q] for name, q in quantity.items()}
            if dimensions.agrees(formula, known, angle=angle):
                return tuple(ShapeParameter(n, q, f"{q} {n}", SEARCHES[q], (0.1, 1.0)) for n, q in quantity.items())
    raise StudyError(
        f"the formula {formula!r} does not tell what {' and '.join(names)} is; expected what it is divided by, added "
        "to or multiplied with to make it a velocity, a length, one over a length, a time, a frequency or a number"
    )
