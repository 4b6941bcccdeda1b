"""A term taken out of a fitted structure: the rest is fitted again."""

from contextlib import suppress

from study.compare.comparison import Comparison, compare
from study.equations.layout import check
from study.equations.model import Model
from study.equations.place import Place
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part
from study.identify.time_domain.structure_start import first_fit
from study.identify.time_domain.weighted_fit import finished
from study.support.errors import StudyError, expect


def term_at(model: Model, name: str, place: Place | None) -> str:
    """The full name of a structure's term that can be left out, by effect and place; without a place if it is unique.

    Raises
    ------
    StudyError
        If there is no such term, the place is needed to tell it, or the structure cannot be without it.
    """
    own = [
        t.name for t in model.terms
        if t.name == name or (t.term.name == name and (place is None or t.place.path == place.path))
    ]  # fmt: skip
    said = name if place is None else f"{name} {'-'.join(place.ends)}"
    expect(own, f"{said!r} is not in the model; expected one of {', '.join(t.name for t in model.terms)}")
    expect(len(own) == 1, f"{name!r} is in the model at several places, {', '.join(own)}; expected --between or --at")
    check(model.without_term(own[0]))
    return own[0]


def dropped_term(comparison: Comparison, name: str) -> Comparison:
    """The comparison of a structure without one of its terms, all that it does not hold fitted again.

    The fit begins where that with the term ended, and as that of a new structure: the better one stays.

    Raises
    ------
    StudyError
        If the structure without it has no finite motion.
    """
    fit, prepared = comparison.fit, comparison.prepared
    model = fit.model.without_term(name)
    held = tuple(key for key in fit.held if key in model.values)
    fits: list[FreeRunFit] = []
    with suppress(StudyError):
        fits.append(fit_part(model, prepared, held, steps=fit.steps_per_sample))
    given = comparison.model.without_term(name)
    with suppress(StudyError):
        fits.append(first_fit(given, prepared))
    expect(fits, f"{given.name!r} without {name} has no finite motion under the forces of {prepared.record.name!r}")
    best = min(fits, key=lambda f: f.cost)
    return compare(given, prepared, fit=finished(best, prepared))
