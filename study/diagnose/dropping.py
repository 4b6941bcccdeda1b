"""A term taken out of a fitted model: the rest is fitted again, from where it takes over what the term did."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from study.compare.comparison import Comparison, compare
from study.equations.model import Model
from study.identify.frequency_domain.starting_values import reverse_start
from study.identify.time_domain.fit_model import NEAR, best_fit
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, linearise
from study.identify.time_domain.weighted_fit import finished
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.least_squares import least_squares

RUNS = 15  # free runs of a fit that asks what a model would be without a term


@dataclass(frozen=True, eq=False)
class Removal:
    """What the derivatives of a fitted model's response tell of it without one term; n samples.

    The term's response, linearised, is ``J_b b`` with its coefficients b; the others take over what they can of it, by
    least squares.
    """

    start: dict[str, float]  # the other values with what they take over: where a fit without the term begins
    lost: Floats  # what they cannot take over of the response, shape (n,)


def removal(fit: FreeRunFit, name: str, jacobian: Floats) -> Removal:
    """The linearised removal of a term; ``jacobian`` is that of :func:`study.identify.time_domain.part_fit.linearise`.

    A term's own shape parameters mean nothing once it is gone: they are no others.
    """
    term = next(t.term for t in fit.model.terms if t.name == name)
    gone = [fit.keys.index(key) for key in term.keys if key in fit.keys]
    own = [i for i in gone if fit.keys[i] in term.symbols]
    response = jacobian[:, own] @ fit.values[own]
    others = np.delete(jacobian, gone, axis=1)
    taken = least_squares(others, response, 1e-12)
    kept = [i for i in range(len(fit.keys)) if i not in gone]
    moved = {fit.keys[i]: float(fit.values[i] + shift) for i, shift in zip(kept, taken, strict=False)}
    return Removal(moved, response - others @ taken)


def fitted_without(fit: FreeRunFit, name: str, prepared: Prepared, start: dict[str, float]) -> Iterator[FreeRunFit]:
    """The model without a term, fitted from one start after the other; none where it has no finite response from any.

    These are the start given, the values as they are, and those of the reverse system: one that has taken over nothing
    may run out of step with the measured motion, one that has taken over too much may not run at all.
    """
    model, states = fit.model.without_term(name), _states(fit, name)
    held = tuple(key for key in fit.held if key in model.values)
    for begin in _starts(model, prepared, start, held):
        try:
            yield fit_part(
                model, prepared, held, begin, steps=fit.steps_per_sample, max_iterations=RUNS, initial=states,
                offset=NEAR, noise=fit.noise,
            )  # fmt: skip
        except StudyError:
            continue


def compared_without(comparison: Comparison, name: str) -> Comparison:
    """The comparison of the model without one of its terms, all that it does not hold fitted again.

    Raises
    ------
    StudyError
        If the term is not in the model or cannot be left out, or the model without it has no finite response.
    """
    check_can_go(comparison.model, name)
    fit, prepared = comparison.fit, comparison.prepared
    model = fit.model.without_term(name)
    held = tuple(key for key in fit.held if key in model.values)
    begin = removal(fit, name, linearise(fit, prepared)).start if fit.keys and not fit.restarts else {}
    if len(held) == len(model.values):
        return compare(comparison.model.without_term(name), prepared)
    again = best_fit(model, prepared, _starts(model, prepared, begin, held), held)
    return compare(comparison.model.without_term(name), prepared, fit=finished(again, prepared))


def check_can_go(model: Model, name: str) -> None:
    """Refuse a term that is not in the model, inertia, and the only term beside it."""
    names = [t.name for t in model.terms if t.name != "inertia"]
    expect(name != "inertia", "inertia cannot be dropped; a free run needs a mass, expected another term")
    expect(name in names, f"{name!r} is not in the model; expected {' or '.join(names) or 'a model with more terms'}")
    expect(len(names) > 1, f"{name} is the only term beside inertia; expected a model that keeps another one")


def _starts(
    model: Model, prepared: Prepared, start: dict[str, float], held: Sequence[str]
) -> Iterator[dict[str, float]]:  # fmt: skip
    """Where a fit of the model begins; its values are those of the fit with the term."""
    known = model.numbers()
    if start:
        yield known | start
    yield known
    with suppress(StudyError):
        anew = reverse_start(model, prepared)
        yield known | {key: value for key, value in anew.items() if key in known and key not in held}


def _states(fit: FreeRunFit, name: str) -> Floats:
    """The initial states of a fit without that of a term, shape (1, states), or a row for each stretch."""
    initial = np.atleast_2d(fit.initial)[: 1 if fit.restarts else None]
    own = [t.name for t in fit.model.states]
    names = [*[""] * (initial.shape[1] - len(own)), *own]
    return initial[:, [i for i, other in enumerate(names) if other != name]]
