"""A term taken out of a fitted model: the rest is fitted again, from where it takes over what the term did."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from study.compare.comparison import Comparison, compare
from study.equations.layout import check
from study.equations.model import Model
from study.equations.place import Place
from study.identify.frequency_domain.starting_values import reverse_start
from study.identify.time_domain.continuation import NEAR
from study.identify.time_domain.fit_model import best_fit, fit_model, grown_states
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, linearise
from study.identify.time_domain.weighted_fit import finished
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.least_squares import least_squares

RUNS_WITHOUT = 15  # a term: free runs of a fit that asks what a model would be


@dataclass(frozen=True, eq=False)
class Removal:
    """What the derivatives of a fitted model's response tell of it without one term; n samples.

    The term's response, linearised, is ``J_b b`` with its coefficients b; the others take over what they can of it, by
    least squares.
    """

    start: dict[str, float]  # the other values with what they take over: where a fit without the term begins
    lost: Floats  # what they cannot take over of the response, weighted as it was fitted, shape (n,)


def removal(fit: FreeRunFit, name: str, jacobian: Floats) -> Removal:
    """The linearised removal of a term; ``jacobian`` is that of :func:`study.identify.time_domain.part_fit.linearise`.

    A term's own shape parameters mean nothing once it is gone: they are no others.
    """
    entry = next(t for t in fit.model.terms if t.name == name)
    gone = [fit.keys.index(key) for key in entry.keys if key in fit.keys]
    own = [i for i in gone if fit.keys[i] in entry.symbols]
    columns = fit.whitened(jacobian)
    response = columns[:, own] @ fit.values[own]
    others = np.delete(columns, gone, axis=1)
    taken = least_squares(others, response, 1e-12)
    kept = [i for i in range(len(fit.keys)) if i not in gone]
    moved = {fit.keys[i]: float(fit.values[i] + shift) for i, shift in zip(kept, taken, strict=False)}
    return Removal(moved, response - others @ taken)


def fitted_without(fit: FreeRunFit, name: str, prepared: Prepared, start: dict[str, float]) -> Iterator[FreeRunFit]:
    """The model without a term, fitted from one start after the other; none where it has no finite response from any.

    These are the start given, the values as they are, and those of the reverse system: one that has taken over nothing
    may run out of step with the measured motion, one that has taken over too much may not run at all. None either where
    a structure is none without the term.
    """
    model = fit.model.without_term(name)
    if model.named:
        try:
            check(model)
        except StudyError:
            return
    states = grown_states(fit, model)[: 1 if fit.restarts else None]
    held = tuple(key for key in fit.held if key in model.values)
    for begin in _starts(model, prepared, start, held):
        try:
            yield fit_part(
                model, prepared, held, begin, steps=fit.steps_per_sample, max_iterations=RUNS_WITHOUT, initial=states,
                offset=NEAR, noise=fit.noise,
            )  # fmt: skip
        except StudyError:
            continue


def compared_without(comparison: Comparison, name: str) -> Comparison:
    """The comparison of the model without one of its terms, all that it does not hold fitted again.

    Of a fit of everything at once, by which terms are asked whether they are needed, and one that holds shape
    parameters at first, that which leaves less: either may end in a local minimum where the other does not.

    Raises
    ------
    StudyError
        If the term is not in the model or cannot be left out, or the model without it has no finite response.
    """
    check_can_go(comparison.model, name)
    fit, prepared = comparison.fit, comparison.prepared
    model, given = fit.model.without_term(name), comparison.model.without_term(name)
    held = tuple(key for key in fit.held if key in model.values)
    begin = removal(fit, name, linearise(fit, prepared)).start if fit.keys and not fit.restarts else {}
    if len(held) == len(model.values) or model.modal:  # without the term a record may ask for other modes
        return compare(given, prepared)
    fits = list(fitted_without(replace(fit, noise=()), name, prepared, begin))  # weighted anew where it ends
    with suppress(StudyError):
        fits.append(best_fit(model, prepared, _starts(model, prepared, begin, held), held))
    if model.named or not fits:
        fits.append(fit_model(given, prepared))
    return compare(given, prepared, fit=finished(min(fits, key=lambda f: f.cost), prepared))


def term_at(model: Model, name: str, place: Place | None = None) -> str:
    """The full name of a term that can be left out, by effect and place; without a place if it is unique.

    Raises
    ------
    StudyError
        If there is no such term, the place is needed to tell it, or the model cannot be without it.
    """
    own = [
        t.name for t in model.terms
        if t.name == name or (t.term.name == name and (place is None or t.place.path == place.path))
    ]  # fmt: skip
    said = name if place is None else f"{name} {'-'.join(place.ends)}"
    if model.named:
        expect(own, f"{said!r} is not in the model; expected one of {', '.join(t.name for t in model.terms)}")
    several = f"{name!r} is in the model at several places, {', '.join(own)}; expected --between or --at"
    expect(len(own) < 2, several)
    check_can_go(model, own[0] if own else name)
    return own[0]


def changing(model: Model) -> dict[str, str]:
    """Terms whose coefficients change in a model, which cannot be without them, and the terms that say how."""
    return {t.term.variation.of.name + t.place.suffix: t.name for t in model.terms if t.term.variation}


def check_no_change(model: Model, name: str) -> None:
    """Refuse a term whose coefficient changes in the model."""
    change = changing(model).get(name)
    expect(change is None, f"{change} says how {name} changes; expected that to be dropped first")


def check_can_go(model: Model, name: str) -> None:
    """Refuse what is not in the model, inertia, what changes in it, and a term without which nothing is left."""
    check_no_change(model, name)
    names = [t.name for t in model.terms if t.term.name != "inertia"]
    if not model.named:
        expect(name != "inertia", "inertia cannot be dropped; a free run needs a mass, expected another term")
    expect(
        name in names or (model.named and name in model),
        f"{name!r} is not in the model; expected {' or '.join(names) or 'a model with more terms'}",
    )
    if model.named:
        check(model.without_term(name))
        return
    expect(len(names) > 1, f"{name} is the only term beside inertia; expected a model that keeps another one")


def _starts(
    model: Model, prepared: Prepared, start: dict[str, float], held: Sequence[str]
) -> Iterator[dict[str, float]]:  # fmt: skip
    """Where a fit of the model begins; its values are those of the fit with the term."""
    known = model.numbers()
    if start:
        yield known | start
    yield known
    if not model.named:  # the reverse system of a structure starts its linear terms alone
        with suppress(StudyError):
            anew = reverse_start(model, prepared)
            yield known | {key: value for key, value in anew.items() if key in known and key not in held}
