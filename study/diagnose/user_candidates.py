"""Candidates that the user brings: formulas on the command line."""

from collections.abc import Sequence

from study.equations.terms import Term, custom
from study.support.errors import StudyError


def own_candidates(given: Sequence[str]) -> list[Term]:
    """``NAME=FORMULA`` as terms; a ``StudyError`` if one is not of this form, or its formula is refused."""
    terms: list[Term] = []
    for text in given:
        name, sign, formula = text.partition("=")
        if not sign:
            raise StudyError(f"{text!r} is no candidate; expected NAME=FORMULA such as 'bracket=u*abs(u)'")
        terms.append(custom(name.strip(), formula.strip()))
    return terms
