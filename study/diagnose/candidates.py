"""One candidate: the model with it, fitted on one part of the record and judged on the other."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study import fitting
from study.diagnose import search
from study.diagnose.search import Baseline
from study.errors import StudyError
from study.fitting import Plan
from study.model import free
from study.output_error import FreeRunFit
from study.record import Record
from study.terms import LIBRARY, Term

Floats = NDArray[np.float64]
THREADS = 2
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
    with ThreadPoolExecutor(THREADS) as pool:
        for count, trial in enumerate(pool.map(lambda term: attempt(term, base, record, how, held), terms), start=1):
            if trial is not None:
                done.append(trial)
            if progress is not None:
                progress(count)
    return done


def attempt(term: Term, base: Baseline, record: Record, how: Plan, held: tuple[str, ...]) -> Trial | None:
    """The best of the fits that start from the search's best points; None where none has a finite response."""
    best: FreeRunFit | None = None
    model = base.found.model.with_term(free(term))
    for values in _starts(term, base, record, how):
        try:
            found = fitting.fit(model, record, how, held, values)
        except StudyError:
            continue
        if best is None or found.rms < best.rms:
            best = found
    if best is None:
        return None
    try:
        return Trial(term, best, fitting.held_out_residual(best, record, how))
    except StudyError:
        return None


def _starts(term: Term, base: Baseline, record: Record, how: Plan) -> list[dict[str, float]]:
    """Where fits begin: the search's best points beside the fitted model, and the best one beside a linear model.

    The second kind matters where the model without the candidate was driven to a far corner by its lack.
    """
    fitted = dict(zip(base.found.keys, (float(v) for v in base.found.values), strict=True))
    points = search.starts(term, base, record, how)
    keys = free(term).keys
    begins = [fitted | dict(zip(keys, p.coefficients + p.parameters, strict=True)) for p in points]
    if points:
        anew = {k: v for k, v in base.linear.items() if k in fitted and "." not in k}
        still = dict(zip(keys, (0.0,) * len(term.components) + points[0].parameters, strict=True))
        begins.append(fitted | anew | still)
    return begins
