"""One candidate: the model with it, fitted on one part of the record and judged on the other."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.equations.model import Model, free
from study.equations.terms import LIBRARY, Term
from study.identify.frequency_domain.starting_values import reverse_start
from study.identify.time_domain import held_out, shape_search
from study.identify.time_domain.fit_model import from_pieces
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.shape_search import Baseline
from study.records.plan import Plan
from study.records.record import Record
from study.support.errors import StudyError

Floats = NDArray[np.float64]
THREADS = 2
SHORT, LONG = 15, 40  # free runs of a fit that tries a start, and of one that is kept
ASTRAY = 0.3  # of the rms response: what a fit leaves that lost the motion
NEVER_CANDIDATES = ("inertia",)


@dataclass(frozen=True)
class Trial:
    """A candidate as fitted.

    Attributes
    ----------
    term : Term
        The candidate.
    found : FreeRunFit
        The model with it, fitted on the fitting part.
    residual : array, shape (samples to judge,)
        Measured minus predicted response on the judging part.
    """

    term: Term
    found: FreeRunFit
    residual: Floats


def candidate_terms(base: Baseline, extra: Sequence[Term] = (), without: Sequence[str] = ()) -> list[Term]:
    """The library's terms and the user's own that are not in the model already."""
    known = [t for t in LIBRARY.values() if t.name not in NEVER_CANDIDATES]
    return [t for t in (*known, *extra) if t.name not in base.found.model and t.name not in without]


def try_all(
    terms: Sequence[Term],
    base: Baseline,
    record: Record,
    how: Plan,
    held: tuple[str, ...],
    progress: Callable[[int], None] | None = None,
) -> list[Trial]:
    """Fit and judge every candidate; those that cannot be fitted are left out."""
    done: list[Trial] = []

    def one(term: Term) -> Trial | None:
        return attempt(term, base, record, how, held)

    with ThreadPoolExecutor(THREADS) as pool:
        for count, trial in enumerate(pool.map(one, terms), start=1):
            if trial is not None:
                done.append(trial)
            if progress is not None:
                progress(count)
    return done


def attempt(term: Term, base: Baseline, record: Record, how: Plan, held: tuple[str, ...]) -> Trial | None:
    """The model with a candidate, fitted from several starts; None where none has a finite response.

    With shape parameters, each start is first fitted with these held: the misfit along a dead band or a
    gap has kinks and side valleys in which a fit of everything at once gets stuck.
    """
    model = base.found.model.with_term(free(term))
    keys = free(term).keys[len(term.components) :]
    best: FreeRunFit | None = None
    for values in _starts(term, base, record, how):
        limit = SHORT if keys else LONG
        best = _better(best, _fit(model.with_values(values), record, how, (*held, *keys), values, limit))
    size = float(np.std(record[how.response][slice(*how.fit)]))
    if best is None or (not best.converged and best.rms > ASTRAY * size):
        best = _better(best, _from_pieces(best.model if best else model, record, how, (*held, *keys)))
    if best is not None and (keys or not best.converged):
        values = {key: v for key, v in best.model.values.items() if v is not None}
        best = _better(best, _fit(best.model, record, how, held, values, LONG))
    if best is None:
        return None
    try:
        return Trial(term, best, held_out.held_out_residual(best, record, how))
    except StudyError:
        return None


def _better(one: FreeRunFit | None, other: FreeRunFit | None) -> FreeRunFit | None:
    """The fit with the smaller residual; of two alike the later one, which knows more errors."""
    if one is None or other is None:
        return one or other
    return other if other.rms <= one.rms else one


def _fit(
    model: Model, record: Record, how: Plan, held: tuple[str, ...], values: dict[str, float], limit: int
) -> FreeRunFit | None:
    try:
        return held_out.fit(model, record, how, held, values, limit)
    except StudyError:
        return None


def _from_pieces(model: Model, record: Record, how: Plan, held: tuple[str, ...]) -> FreeRunFit | None:
    """A start that knows no side valleys, for what all others got stuck in."""
    try:
        return from_pieces(model, record, how, held)
    except StudyError:
        return None


def _starts(term: Term, base: Baseline, record: Record, how: Plan) -> list[dict[str, float]]:
    """Where fits begin: points of the search beside the fitted model, and the best one of them anew.

    Anew is with all coefficients from the reverse system, or beside a linear model where it has no solution.
    That matters where the model without the candidate was driven to a far corner by its lack.
    """
    fitted = {key: v for key, v in base.found.model.values.items() if v is not None}
    points = shape_search.starts(term, base, record, how)
    keys, zero = free(term).keys, (0.0,) * len(term.components)
    begins = [fitted | dict(zip(keys, zero + p.parameters, strict=True)) for p in points]
    if points:
        still = dict(zip(keys, zero + points[0].parameters, strict=True))
        grown = base.found.model.with_term(free(term)).with_values(fitted | still)
        anew = _reversed(grown, record, how) or base.linear
        begins.append(fitted | still | {k: v for k, v in anew.items() if k in (*base.found.keys, *term.symbols)})
    return begins


def _reversed(model: Model, record: Record, how: Plan) -> dict[str, float]:
    """Coefficients from the reverse system; none where it has no solution, or one that cannot run."""
    try:
        found = reverse_start(model, record, how)
    except StudyError:
        return {}
    return found if found["m"] > 0.0 else {}


def refitted(trial: Trial, record: Record, how: Plan, held: tuple[str, ...]) -> Trial:
    """The same candidate fitted on more of the record, from where it stands."""
    values = {key: v for key, v in trial.found.model.values.items() if v is not None}
    found = _fit(trial.found.model, record, how, held, values, LONG)
    if found is None:
        return trial
    try:
        return Trial(trial.term, found, held_out.held_out_residual(found, record, how))
    except StudyError:
        return trial
