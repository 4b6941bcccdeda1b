"""Which terms of a structure are not needed: it predicts as well without one, all else fitted again.

As for a single coordinate (``diagnose.needless``), with the test by which a candidate would be called missing.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from study.compare.comparison import Comparison
from study.compare.prediction import Prediction, predict
from study.diagnose.credibility import certain
from study.diagnose.needless import DOUBLED, is_open, relative_interval, sentence
from study.equations.layout import check
from study.equations.model import ModelTerm
from study.equations.place import place_in_words
from study.figures.labels import term_names
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, linearise, uncertainty
from study.identify.time_domain.placed_search import grown_states
from study.identify.time_domain.weighted_fit import noise_left
from study.records.prepared import Prepared
from study.structure.placed_ranking import held_out_parts, held_out_test
from study.support.arrays import Floats
from study.support.cores import cores
from study.support.errors import StudyError
from study.support.least_squares import least_squares

RUNS = 15  # free runs of a fit that asks what a structure would be without a term


@dataclass(frozen=True, eq=False)
class PlacedNeedless:
    """A term at a place that the structure does as well without."""

    entry: ModelTerm
    error_with: float  # held-out error of the motions, of the model as it is
    error_without: float  # the same without the term, and without those named before it
    p_value: float  # of what the term gains, if it gains nothing; the number of terms asked for accounted for
    fit: FreeRunFit  # the model without it
    prediction: Prediction  # of that

    @property
    def name(self) -> str:
        """Effect and place."""
        return self.entry.name

    def sentence(self, any_more: bool = False) -> str:
        """What to tell the engineer; ``any_more`` if a term was added after it."""
        words = term_names(self.entry.term.name)
        words += f" {place_in_words(self.entry.place)}" if self.entry.place else ""
        return sentence(words, self.error_with, self.error_without, any_more)


def placed_needless(comparison: Comparison) -> tuple[PlacedNeedless, ...]:
    """The terms that a fitted structure does not need, the one whose loss costs least first.

    Each one named is not needed where those before it are gone as well. Inertia, terms of which the user gives a value,
    and those without which the structure is none are not asked for.
    """
    fit, prediction, prepared = comparison.fit, comparison.prediction, comparison.prepared
    terms = [t for t in comparison.model.terms if is_open(t) and set(t.keys) <= set(fit.keys)]
    asked = len(terms)
    found: list[PlacedNeedless] = []
    while terms and not prediction.diverged:
        alone = _each_alone(terms, fit, prediction, prepared, asked)
        if not alone:
            break
        found.append(min(alone, key=lambda n: n.error_without))
        fit, prediction = found[-1].fit, found[-1].prediction
        terms = [n.entry for n in alone if n is not found[-1]]
    return tuple(found)


def _each_alone(
    terms: Sequence[ModelTerm], fit: FreeRunFit, prediction: Prediction, prepared: Prepared,
    asked: int,
) -> list[PlacedNeedless]:  # fmt: skip
    """Those of the terms that this model does not need, each for itself, of so many that were asked for."""
    jacobian = linearise(fit, prepared)
    covariance = uncertainty(fit, prepared, jacobian)
    parts = held_out_parts(fit, prediction, jacobian, prepared.plan.fit)

    def answer(entry: ModelTerm) -> PlacedNeedless | None:
        start, lost = _removal(fit, entry, jacobian)
        own = [fit.keys.index(symbol) for symbol in entry.symbols]
        sized = relative_interval(fit.values[own], covariance[np.ix_(own, own)])
        residual = fit.whitened(fit.residual)
        plain = all(not t.term.parameters and t.term.state is None for t in fit.model.terms)
        if plain and sized[0] > 0.0 and float(lost @ lost) > DOUBLED * float(residual @ residual):
            return None
        rest = _without(fit, entry, start, prepared)
        if rest is None:
            return None
        without = predict(rest, prepared)
        noise = noise_left(fit.residual, len(fit.outputs))
        chance = held_out_test(rest, without, noise).p_value(parts, bool(entry.term.parameters))
        if without.diverged or certain(without, prediction, sized, min(1.0, asked * chance)):
            return None
        return PlacedNeedless(entry, prediction.error, without.error, min(1.0, asked * chance), rest, without)

    with ThreadPoolExecutor(cores()) as pool:
        return [n for n in pool.map(answer, terms) if n is not None]


def _removal(fit: FreeRunFit, entry: ModelTerm, jacobian: Floats) -> tuple[dict[str, float], Floats]:
    """The other values with what they take over of a term's motion, linearised, and what they cannot take over."""
    columns = fit.whitened(jacobian)
    gone = [fit.keys.index(key) for key in entry.keys if key in fit.keys]
    own = [i for i in gone if fit.keys[i] in entry.symbols]
    response = columns[:, own] @ fit.values[own]
    others = np.delete(columns, gone, axis=1)
    taken = least_squares(others, response, 1e-12)
    kept = [i for i in range(len(fit.keys)) if i not in gone]
    moved = {fit.keys[i]: float(fit.values[i] + shift) for i, shift in zip(kept, taken, strict=False)}
    return moved, response - others @ taken


def _without(fit: FreeRunFit, entry: ModelTerm, start: dict[str, float], prepared: Prepared) -> FreeRunFit | None:
    """The structure without a term, fitted from the better of two starts; None where it is none, or runs from none."""
    model = fit.model.without_term(entry.name)
    try:
        check(model)
    except StudyError:
        return None
    held = tuple(key for key in fit.held if key in model.values)
    fits: list[FreeRunFit] = []
    for begin in (start, {}):
        try:
            fits.append(
                fit_part(
                    model, prepared, held, begin, steps=fit.steps_per_sample, initial=grown_states(fit, model),
                    noise=fit.noise, max_iterations=RUNS,
                )
            )  # fmt: skip
        except StudyError:
            continue
        if fits[-1].converged:
            break
    return min(fits, key=lambda f: f.cost, default=None)
