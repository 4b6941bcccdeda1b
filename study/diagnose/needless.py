"""Which terms of a model are not needed: the model without one predicts as well, all else fitted again."""

import math
from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.special import chdtri

from study.compare.comparison import Comparison
from study.compare.prediction import Prediction, predict
from study.diagnose.credibility import certain
from study.diagnose.dropping import fitted_without, removal
from study.diagnose.held_out import HeldOutResidual, alike, evidence_of
from study.equations.model import ModelTerm
from study.figures.labels import term_names
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.motion_start import has_lost_the_motion
from study.identify.time_domain.part_fit import covariance_of, linearise
from study.support.arrays import Floats
from study.support.cores import cores
from study.support.numbers import percent
from study.support.statistics import gain

DOUBLED = 1.0  # of the residual's power: a term without which, linearised, so much more is left is needed for certain;
# but where shapes or memories bend, as those of hysteresis do, they may take over what the linearised model cannot


@dataclass(frozen=True, eq=False)
class Needless:
    """A term that the model does as well without."""

    name: str  # of the term
    error_with: float  # held-out error of the response, over its rms, of the model as it is
    error_without: float  # the same without the term, and without those named before it
    p_value: float  # of what the term gains, if it gains nothing; the number of terms asked for accounted for
    fit: FreeRunFit  # the model without it
    prediction: Prediction  # of that

    def sentence(self, any_more: bool = False) -> str:
        """What to tell the engineer; ``any_more`` if a term was added after it."""
        return sentence(term_names(self.name), self.error_with, self.error_without, any_more)


class Unneeded(Protocol):
    """A term that a model does as well without, of whatever kind the model is."""

    @property
    def name(self) -> str:
        """Of the term."""
        ...

    @property
    def error_with(self) -> float:
        """Held-out error of the model as it is."""
        ...

    @property
    def error_without(self) -> float:
        """The same without the term."""
        ...

    @property
    def p_value(self) -> float:
        """Of what the term gains, if it gains nothing."""
        ...

    def sentence(self, any_more: bool = False) -> str:
        """What to tell the engineer."""
        ...


def sentence(words: str, error_with: float, error_without: float, any_more: bool = False) -> str:
    """That a term, by its name in words, is not needed."""
    return (
        f"{words[0].upper()}{words[1:]} is not needed{' any more' if any_more else ''}: without it the error is "
        f"{percent(error_without)}, with it {percent(error_with)}."
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
        names = [n.name for n in alone if n is not first]
        terms = [t for t in terms if t.name in names]
    return tuple(found)


def needless_in_words(found: Sequence[Unneeded], any_more: bool = False, complete: bool = True) -> str:
    """What to tell of all of them; empty if there are none. ``complete`` is false where an effect is missing."""
    said = [n.sentence(any_more) for n in found]
    if found and not complete:
        said.append("That holds while something is missing: ask again when it is added.")
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


def needless_fields(found: Sequence[Unneeded]) -> list[dict[str, Any]]:
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
        jacobian = linearise(self.fit, self.given.prepared)
        covariance = covariance_of(self.fit, jacobian)

        def answer(entry: ModelTerm) -> Needless | None:
            return self._answer(entry, jacobian, covariance, asked)

        with ThreadPoolExecutor(cores()) as pool:
            return [n for n in pool.map(answer, terms) if n is not None]

    def _answer(self, entry: ModelTerm, jacobian: Floats, covariance: Floats, asked: int) -> Needless | None:
        """The model without a term, if it does as well; None where the term is needed."""
        sized = self._relative_interval(entry, covariance)
        gone = removal(self.fit, entry.name, jacobian)
        plain = all(not t.parameters and t.term.state is None for t in self.fit.model.terms)
        lost, left = float(gone.lost @ gone.lost), float(self.fit.residual @ self.fit.residual)
        if plain and sized[0] > 0.0 and lost > DOUBLED * left:
            return None
        for fit in fitted_without(self.fit, entry.name, self.given.prepared, gone.start):
            without = predict(fit, self.given.prepared)
            left_then, *models = self._evidence(fit, without, not entry.term.tuned)
            chances = [min(1.0, asked * gain(left_then.residual, m.residual).p_value) for m in models]
            if not any(certain(left_then, m, sized, chance) for m, chance in zip(models, chances, strict=True)):
                return Needless(entry.name, self.prediction.error, without.error, chances[0], fit, without)
            if fit.converged:
                break
        return None

    def _evidence(self, fit: FreeRunFit, without: Prediction, both: bool) -> list[HeldOutResidual]:
        """What a model without a term leaves, this one and the one that was given; of both parts if all have them.

        A frequency was picked by the fitting part's own chance, which bears no witness of it then.
        """
        models = (fit, without), (self.fit, self.prediction), (self.given.fit, self.given.prediction)
        found = [evidence_of(*model, both) for model in models]
        return found if all(alike(found[0], e) for e in found) else [evidence_of(*model, False) for model in models]

    def _relative_interval(self, entry: ModelTerm, covariance: Floats) -> tuple[float, float]:
        """95 % interval of the size of a term's coefficients, over that size (:func:`relative_interval`)."""
        place = [self.fit.keys.index(symbol) for symbol in entry.term.symbols]
        return relative_interval(self.fit.values[place], covariance[np.ix_(place, place)])


def relative_interval(size: Floats, covariance: Floats) -> tuple[float, float]:
    """95 % interval of the size of coefficients, over that size: without zero where they are not zero.

    That of one coefficient is the usual one. Several are zero together where their joint statistic (Wald, 1943) is one
    of chance; what shape parameters leave open of them is in their covariance.
    """
    statistic = float(size @ np.linalg.pinv(covariance, hermitian=True) @ size)
    quantile = float(np.asarray(chdtri(len(size), 0.05)))
    half = math.sqrt(quantile / statistic) if statistic > 0.0 else math.inf
    return 1.0 - half, 1.0 + half
