"""Fitting a system in free run that is chaotic, or from starting values that are far off."""

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.equations.model import Model
from study.equations.substeps import needed_steps
from study.identify.time_domain.continuation import NEAR, NEGLIGIBLE, fit_pieces, joined
from study.identify.time_domain.free_run_fit import FreeRunFit, fit_free_run
from study.identify.time_domain.shooting import Pieces, even_restarts, needed_restarts
from study.records.prepared import Prepared
from study.records.record import Record
from study.support.errors import DivergenceError

Floats = NDArray[np.float64]
ROUNDS = 2  # times that pieces are joined and tied, at most
LOOSE = 12  # free runs that pieces which know nothing of each other are given at first
SOFT, SOFTLY = (0.3, 1.0, 3.0), 5  # ties that lead coefficients near the truth (see ``fit_free_run``); runs with each
FIRM, FIRMLY = 30.0, 12  # tied so, pieces know of each other most of what the noise lets them
TIGHT, TIGHTLY = 100.0, 30  # tied so, they are one motion
CLEAN = 0.01  # of the response's standard deviation: a residual to which long steps of the integrator may add
POOR = 0.05  # of the response's standard deviation: a residual that may hide a motion
SMOOTH = 0.5  # correlation of neighbouring samples of a residual; white noise has none
DEVIATIONS = 3.0  # by how many standard deviations the misfit may exceed what fewer unknowns explain


def fit_in_pieces(
    model: Model,
    record: Record,
    *,
    start: Mapping[str, float] | None = None,
    held: Collection[str] = (),
    response: str = "displacement",
    steps_per_sample: int = 2,
    span: tuple[int, int] | None = None,
    max_iterations: int = 60,
) -> FreeRunFit:
    """Fit a model in free run when it is chaotic, or the start is far off.

    The record is cut into pieces of about a period, each from an initial state of its own: no error grows
    far within them, and the search finds its way from poor starting values. If the fitted system needs no
    cuts, as most do, the whole record is fitted from there in one free run. Otherwise neighbours are joined
    (``continuation``), and the motion that this yields is tied together at all its pieces until it is one
    that stays beside the measured one (multiple shooting; H. G. Bock, 1983): joining finds the right valley
    for the states, ties its floor. Where that fails, pieces begin anew, with the coefficients of the longest that held.

    Parameters, result and errors are those of :func:`free_run_fit.fit_free_run`; ``initial`` of the
    result has one row a piece.
    """
    whole = span or (0, len(record))
    pieces = Pieces(record, response, whole, even_restarts(record, response, whole), steps_per_sample)
    begun = model.with_values(dict(start or {}))
    rough = replace(pieces, steps_per_sample=needed_steps(begun, record, response, steps_per_sample).rough)
    runs = min(LOOSE, max_iterations)
    loose = fit_pieces(begun, rough, rough.first_states(begun), held, runs)
    if loose.rms < CLEAN * pieces.spread:  # long steps would show
        loose = fit_pieces(loose.model, pieces, loose.initial, held, runs)
    states = np.atleast_2d(loose.initial)
    if not needed_restarts(loose.model, record, states, whole, pieces.restarts, steps_per_sample):
        return fit_free_run(
            loose.model, record, held=held, response=response, steps_per_sample=steps_per_sample,
            span=whole, max_iterations=max_iterations,
        )  # fmt: skip
    if loose.rms < NEGLIGIBLE * pieces.spread:
        return fit_pieces(loose.model, pieces, states, held, max_iterations)  # ties would believe the integrator more
    near = fit_pieces(begun, rough, states, held, SOFTLY, SOFT[0], NEAR)
    for tie in SOFT[1:]:
        near = fit_pieces(near.model, rough, near.initial, held, SOFTLY, tie, NEAR)
    return _joined_and_tied(near, loose, pieces, rough, held)


def lost(fit: FreeRunFit, measured: Floats) -> bool:
    """Whether a fit is at no minimum, or at a local one: what it leaves is much of the response, and looks like motion.

    ``measured`` is the response that it was fitted to.
    """
    if not fit.converged:
        return True
    if fit.rms < POOR * float(np.std(measured)):
        return False
    neighbours = 1.0 - float(np.mean(np.diff(fit.residual) ** 2)) / (2.0 * fit.rms**2)
    return neighbours > SMOOTH


def magnifies(fit: FreeRunFit, prepared: Prepared) -> bool:
    """Whether disturbances of a fitted free run grow on the way that it was fitted to, as those of a chaotic one do."""
    record, response, first = prepared.record, prepared.response, prepared.plan.fit[0]
    span = (first, first + len(fit.residual))
    pieces = Pieces(record, response, span, even_restarts(record, response, span), fit.steps_per_sample)
    states = pieces.passing(fit.model, fit.restarts, fit.initial)
    return bool(needed_restarts(fit.model, record, states, span, pieces.restarts, fit.steps_per_sample))


def _joined_and_tied(
    near: FreeRunFit, loose: FreeRunFit, pieces: Pieces, rough: Pieces, held: Collection[str]
) -> FreeRunFit:  # fmt: skip
    """One motion if it is found, else the longest pieces that leave no more than the loose ones lead one to expect."""
    best = loose
    try:
        for rounds_left in reversed(range(ROUNDS)):
            longer = joined(near, pieces, held)
            good = (fit for fit in reversed(longer[1:]) if _as_good(fit, loose, np.size(fit.initial)))
            best = next(good, best)
            found = _one_motion(longer[-1], pieces, held, loose)
            if found is not None:
                return found
            if rounds_left:
                near = fit_pieces(best.model, rough, rough.first_states(best.model), tuple(best.model.values), SOFTLY)
    except DivergenceError:  # a wrong model may bear the states of the fit alone
        pass
    if best is loose:
        best = fit_pieces(loose.model, pieces, loose.initial, held, SOFTLY)
    count = len(best.restarts) + 1
    return replace(
        best, converged=False, message=f"no single motion follows the record; {count} pieces of it were fitted"
    )  # fmt: skip


def _one_motion(longer: FreeRunFit, pieces: Pieces, held: Collection[str], loose: FreeRunFit) -> FreeRunFit | None:
    """The fit of pieces tied together, from longer pieces; None if it ends in a side valley."""
    states = pieces.passing(longer.model, longer.restarts, longer.initial)
    firm = fit_pieces(longer.model, pieces, states, held, FIRMLY, FIRM, NEAR)
    if not _as_good(firm, loose):
        return None
    tight = fit_pieces(firm.model, pieces, firm.initial, held, TIGHTLY, TIGHT)
    # The tighter the ties, the narrower the side valleys in which a search may end; the curvature of one says
    # nothing of the others. The firm fit's covariance covers what the tight one's values scatter by.
    return replace(tight, covariance=firm.covariance) if _as_good(tight, loose) else firm


def _as_good(found: FreeRunFit, loose: FreeRunFit, left: int = 0) -> bool:
    """Whether the misfit is what the loss of all free states but those ``left`` leads one to expect."""
    states = np.size(loose.initial)
    given_up = states - left
    cost, before = (float(np.sum(fit.residual**2)) for fit in (found, loose))
    variance = before / max(len(loose.residual) - len(loose.keys) - states, 1)
    return cost - before < variance * (given_up + DEVIATIONS * np.sqrt(2.0 * given_up))
