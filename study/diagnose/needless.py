"""Which terms of a model are not needed: the model without one predicts as well, all else fitted again."""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import chdtri

from study.compare.comparison import Comparison
from study.compare.prediction import Prediction, predict
from study.diagnose.credibility import certain
from study.diagnose.dropping import changing, fitted_without, removal
from study.diagnose.held_out import HeldOut, evidence, held_out, held_out_of, held_out_test
from study.equations.model import ModelTerm
from study.equations.place import place_in_words
from study.figures.labels import term_names
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.motion_start import has_lost_the_motion
from study.identify.time_domain.part_fit import covariance_of, linearise
from study.identify.time_domain.weighted_fit import noise_left
from study.support.arrays import Floats
from study.support.cores import side_by_side
from study.support.numbers import percent

DOUBLED = 1.0  # of the residual's power: a term without which, linearised, so much more is left is needed for certain;
# but where shapes or memories bend, as those of hysteresis do, they may take over what the linearised model cannot


@dataclass(frozen=True, eq=False)
class Needless:
    """A term that the model does as well without."""

    entry: ModelTerm  # the effect and its place
    error_with: float  # held-out error of the response, over its rms, of the model as it is
    error_without: float  # the same without the term, and without those named before it
    p_value: float  # of what the term gains, if it gains nothing; the number of terms asked for accounted for
    fit: FreeRunFit  # the model without it
    prediction: Prediction  # of that

    @property
    def name(self) -> str:
        """Effect, and place where that has a name."""
        return self.entry.name

    def sentence(self, any_more: bool = False) -> str:
        """What to tell the engineer; ``any_more`` if a term was added after it."""
        words = term_names(self.entry.term.name)
        words += f" {place_in_words(self.entry.place)}" if self.entry.place.label else ""
        return (
            f"{words[0].upper()}{words[1:]} is not needed{' any more' if any_more else ''}: without it the error is "
            f"{percent(self.error_without)}, with it {percent(self.error_with)}."
        )


def needless(comparison: Comparison, besides: Collection[str] = ()) -> tuple[Needless, ...]:
    """The terms that a fitted model does not need, the one whose loss costs least first.

    A term is needed where the model with it is better for certain than the model without it (:func:`certain`), which is
    fitted again. Each one named is not needed where those before it are gone as well: of two terms of which either
    does the work of both, one is named.

    Parameters
    ----------
    comparison : Comparison
        The model fitted to a record. Inertia, and terms of which the user gives a value, are not asked for.
    besides : collection of str
        Further terms that are not asked for.

    Returns
    -------
    tuple of Needless
        Empty where the response error judges nothing: the free run does not stay finite or has lost the motion, or the
        system is chaotic.
    """
    keys = comparison.fit.keys  # a term that another estimator than the fit in free run found has none there
    besides = {*besides, *changing(comparison.model)}
    terms: list[ModelTerm] = [
        t for t in comparison.model.terms if is_open(t) and t.name not in besides and set(t.keys) <= set(keys)
    ]
    if has_lost_the_motion(comparison.fit, comparison.prepared):
        return ()
    stage, asked = _Stage(comparison.fit, comparison.prediction, comparison), len(terms)
    found: list[Needless] = []
    while terms and len(stage.fit.model.terms) > 2 and not (stage.prediction.diverged or stage.fit.restarts):
        alone = stage.each_alone(terms, asked)
        if not alone:
            break
        first = min(alone, key=lambda n: n.error_without)
        found.append(first)
        stage = _Stage(first.fit, first.prediction, comparison)
        terms = [n.entry for n in alone if n is not first]
    return tuple(found)


def needless_in_words(found: Sequence[Needless], any_more: bool = False, complete: bool = True) -> str:
    """What to tell of all of them; empty if there are none. ``complete`` is false where an effect is missing."""
    said = [n.sentence(any_more) for n in found]
    if found and not complete:
        said.append("Ask again once the missing effect is added.")
    return " ".join(said)


def of_records(names: Sequence[str], found: Sequence[Sequence[Needless]], any_more: bool = False) -> str:
    """What to tell of the terms that none of several records needs, and how to take one out; empty if there are none.

    What one record does not show another may need.
    """
    first, *others = found
    common = [n.name for n in first if all(any(n.name == o.name for o in row) for row in others)]
    if not common:
        return ""
    several = len(names) > 1
    said = [
        (f"{name}: " if several else "") + needless_in_words([n for n in row if n.name in common], any_more)
        for name, row in zip(names, found, strict=True)
    ]
    return " ".join([*said, "'study drop' takes a term out."])


def needless_fields(found: Sequence[Needless]) -> list[dict[str, Any]]:
    """The same for files, the one whose loss costs least first."""
    return [
        {"term": n.name, "error_with": n.error_with, "error_without": n.error_without, "p_value": n.p_value,
         "says": n.sentence()} for n in found
    ]  # fmt: skip


def is_open(entry: ModelTerm) -> bool:
    """Whether a term may be asked for: the user holds nothing of it."""
    return entry.term.name != "inertia" and all(value is None for value in entry.values.values())


@dataclass(frozen=True, eq=False)
class _Stage:
    """A model on its way to fewer terms."""

    fit: FreeRunFit
    prediction: Prediction
    given: Comparison  # of the model with all its terms

    def each_alone(self, terms: Sequence[ModelTerm], asked: int) -> list[Needless]:
        """Those of the terms that this model does not need, each for itself, of so many that were asked for."""
        prepared = self.given.prepared
        jacobian = linearise(self.fit, prepared)
        covariance = covariance_of(self.fit, jacobian)
        own = held_out(self.fit, self.prediction, jacobian, prepared)
        models = [(self.prediction, own)]
        if self.fit is not self.given.fit:
            models.append((self.given.prediction, held_out_of(self.given)))

        def answer(entry: ModelTerm) -> Needless | None:
            return self._answer(entry, jacobian, covariance, models, asked)

        return [n for n in side_by_side(answer, terms) if n is not None]

    def _answer(
        self, entry: ModelTerm, jacobian: Floats, covariance: Floats, models: Sequence[tuple[Prediction, HeldOut]],
        asked: int,
    ) -> Needless | None:  # fmt: skip
        """The model without a term, if it does as well as this one and the one given; None where it is needed."""
        place = [self.fit.keys.index(symbol) for symbol in entry.symbols]
        sized = relative_interval(self.fit.values[place], covariance[np.ix_(place, place)])
        gone, left = removal(self.fit, entry.name, jacobian), self.fit.whitened(self.fit.residual)
        plain = all(not t.parameters and t.term.state is None for t in self.fit.model.terms)
        if plain and sized[0] > 0.0 and float(gone.lost @ gone.lost) > DOUBLED * float(left @ left):
            return None
        prepared = self.given.prepared
        noise = noise_left(self.fit.residual, len(self.fit.outputs))
        for fit in fitted_without(self.fit, entry.name, prepared, gone.start):
            without = predict(fit, prepared)
            test = held_out_test(fit, without, noise)
            both = not entry.term.tuned and all(len(held.fitted) == len(test.before.fitted) for _, held in models)
            before = evidence(without, test.before, both)
            after = [evidence(prediction, held, both) for prediction, held in models]
            chances = [min(1.0, asked * test.p_value(held, entry.term.tuned)) for _, held in models]
            if not any(certain(before, model, sized, p) for model, p in zip(after, chances, strict=True)):
                return Needless(entry, self.prediction.error, without.error, chances[0], fit, without)
            if fit.converged:
                break
        return None


def relative_interval(size: Floats, covariance: Floats) -> tuple[float, float]:
    """95 % interval of the size of coefficients, over that size: without zero where they are not zero.

    That of one coefficient is the usual one. Several are zero together where their joint statistic (Wald, 1943) is one
    of chance; what shape parameters leave open of them is in their covariance.
    """
    statistic = float(size @ np.linalg.pinv(covariance, hermitian=True) @ size)
    quantile = float(np.asarray(chdtri(len(size), 0.05)))
    half = math.sqrt(quantile / statistic) if statistic > 0.0 else math.inf
    return 1.0 - half, 1.0 + half
