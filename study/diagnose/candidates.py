"""One candidate: the model with it, fitted on one part of the record and judged on the other."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study.compare.prediction import Prediction, predict
from study.equations.model import ModelTerm, free
from study.equations.terms import Term, effects_but
from study.identify.time_domain.fit_model import with_term
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.shape_search import Baseline
from study.identify.time_domain.weighted_fit import finished
from study.records.prepared import FORCE, Prepared
from study.support.cores import side_by_side
from study.support.errors import StudyError

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FittedCandidate:
    """A candidate as fitted."""

    term: Term  # the effect
    fit: FreeRunFit  # the model with it, fitted on the fitting part
    prediction: Prediction  # its free run along the judging part

    @property
    def unphysical(self) -> bool:
        """Whether it is fitted outside of what makes it physical."""
        return bool(self.term.physical(self.fit.model.values))


def candidate_terms(base: Baseline, extra: Sequence[Term] = (), without: Sequence[str] = ()) -> list[Term]:
    """The library's terms and the user's own that are not in the model already."""
    return [t for t in effects_but(base.fit.model, extra) if t.name not in without]


def try_all(
    terms: Sequence[Term], base: Baseline, prepared: Prepared, progress: Callable[[int], None] | None = None
) -> list[FittedCandidate]:
    """Fit and judge every candidate; those that cannot be fitted are left out."""
    done: list[FittedCandidate] = []

    def fitted(term: Term) -> FittedCandidate | None:
        return attempt(term, base, prepared)

    for count, candidate in enumerate(side_by_side(fitted, terms, lambda term: term.effort), start=1):
        if candidate is not None:
            done.append(candidate)
        if progress is not None:
            progress(count)
    return done


def attempt(term: Term, base: Baseline, prepared: Prepared) -> FittedCandidate | None:
    """The model with a candidate as a search fits it; None where it has no finite response."""
    found = _attempt(free(term), base, prepared)
    plainer = _plainer(term) if prepared.response == FORCE and (found is None or found.unphysical) else None
    return found if plainer is None else _attempt(plainer, base, prepared) or found


def _attempt(entry: ModelTerm, base: Baseline, prepared: Prepared) -> FittedCandidate | None:
    try:
        return judged_candidate(entry.term, with_term(base.fit, entry, base, prepared), prepared)
    except StudyError:
        return None


def _plainer(term: Term) -> ModelTerm | None:
    """A term whose roundness along a loop is held at zero, as Dahl's friction is; None where it has no such parameter.

    A prescribed stroke that slips nearly all the time tells little of it, and a fit may leave what is physical.
    """
    fixed = tuple(0.0 if p.relative and p.signed else None for p in term.parameters)
    return replace(free(term), parameters=fixed) if any(value == 0.0 for value in fixed) else None


def judged_candidate(term: Term, fit: FreeRunFit, prepared: Prepared) -> FittedCandidate | None:
    """A fitted candidate with its prediction; None where its free run does not stay finite."""
    prediction = predict(fit, prepared)
    return None if prediction.diverged else FittedCandidate(term, fit, prediction)


def all_settled(candidates: Sequence[FittedCandidate], prepared: Prepared) -> list[FittedCandidate]:
    """Candidates fitted to the whole fitting part and with enough steps, as they would be if they were added."""

    def settle(candidate: FittedCandidate) -> FittedCandidate:
        try:
            fit = finished(candidate.fit, prepared)
            return judged_candidate(candidate.term, fit, prepared) or candidate
        except StudyError:
            return candidate

    return list(side_by_side(settle, candidates, lambda candidate: candidate.term.effort))
