"""Multiple shooting: fitting a chaotic system in free run, or any system from starting values that are far off."""

from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np

from study.equations.equations_of_motion import has_spring
from study.equations.free_run import needed_steps
from study.equations.model import Model
from study.identify.time_domain.continuation import NEAR, NEGLIGIBLE, fit_segments, lengthen
from study.identify.time_domain.free_run_fit import FreeRunFit, fit_free_run
from study.identify.time_domain.shooting import (
    ShootingSegments,
    even_restarts,
    needed_restarts,
    own_begins,
)
from study.identify.time_domain.stretch_states import LOOSE, with_which_stretches_begin
from study.records.outputs import DISPLACEMENT, Outputs
from study.records.prepared import Prepared
from study.records.record import Record
from study.support.errors import DivergenceError

SOFT, SOFTLY = (0.3, 1.0, 3.0), 5  # continuity weights that lead coefficients near the truth, and free runs with each
FIRM, FIRMLY = 30.0, 12  # continuity weight at which gaps are within the noise of the states, and free runs
TIGHT, TIGHTLY = 100.0, 30  # continuity weight at which the segments are one motion, and free runs
CLEAN = 0.01  # of the response's standard deviation: a residual to which long steps of the integrator may add


def fit_in_segments(
    model: Model,
    record: Record,
    *,
    start: Mapping[str, float] | None = None,
    held: Collection[str] = (),
    outputs: Outputs = DISPLACEMENT,
    steps_per_sample: int = 2,
    span: tuple[int, int] | None = None,
    max_iterations: int = 60,
    near: bool = False,
) -> FreeRunFit:
    """Fit a model in free run when it is chaotic, or the start is far off (H. G. Bock, 1983).

    The record is cut into segments of about a period, each with an initial state of its own: no error grows far within
    them, so the search converges from poor starting values. If the fitted system needs no restarts, as most do, the
    whole record is then fitted in one free run. Otherwise continuation in segment length finds the states, and
    increasing continuity constraints turn all segments into one motion. Where that fails, it is tried again with the
    coefficients of the longest segments that held. ``near`` says that the start is near the minimum: the constraints
    come at once then, and longer segments where they lead to none.

    Parameters, result and errors are those of :func:`free_run_fit.fit_free_run`; ``initial`` of the result has a row
    for each segment.
    """
    whole = span or (0, len(record))
    segments = ShootingSegments(record, outputs, whole, even_restarts(record, outputs, whole), steps_per_sample)
    begun = model.with_values(dict(start or {}))
    rough = replace(segments, steps_per_sample=needed_steps(begun, record, outputs, steps_per_sample))
    runs = min(LOOSE, max_iterations)
    loose = fit_segments(begun, rough, rough.first_states(begun), held, runs)
    if loose.rms < CLEAN * segments.spread:  # errors of long steps would matter
        loose = fit_segments(loose.model, segments, loose.initial, held, runs)
    states = np.atleast_2d(loose.initial)
    apart = own_begins(record, whole)  # stretches are short: a state for each is all that they need
    if apart or not needed_restarts(loose.model, record, states, whole, segments.restarts, steps_per_sample):
        return fit_free_run(
            loose.model, record, held=held, outputs=outputs, steps_per_sample=steps_per_sample,
            span=whole, max_iterations=max_iterations,
            initial=with_which_stretches_begin(segments, states) if apart else "estimate",
        )  # fmt: skip
    if loose.rms < NEGLIGIBLE * segments.spread:  # continuity constraints would fit the errors of the integrator
        return fit_segments(loose.model, segments, states, held, max_iterations)
    soft = fit_segments(begun, rough, states, held, SOFTLY, SOFT[0], NEAR)
    for continuity in SOFT[1:]:
        soft = fit_segments(soft.model, rough, soft.initial, held, SOFTLY, continuity, NEAR)
    if near:
        with suppress(DivergenceError):
            fit = _one_motion(soft, segments, held, loose)
            if fit is not None and fit.converged:
                return fit
    return _continuous(soft, loose, segments, rough, held)


def is_chaotic(fit: FreeRunFit, prepared: Prepared) -> bool:
    """Whether disturbances of a fitted free run grow along the part that it was fitted to.

    They do not where no force depends on the displacement: such a motion drifts, in proportion to time, but two of
    them approach each other or stay as they are.
    """
    if not has_spring(fit.model):
        return False
    record, outputs, span = prepared.record, prepared.outputs, fit.span
    segments = ShootingSegments(record, outputs, span, even_restarts(record, outputs, span), fit.steps_per_sample)
    begins = sorted({*fit.restarts, *own_begins(record, span)})
    states = segments.passing(fit.model, begins, fit.initial)
    return bool(needed_restarts(fit.model, record, states, span, segments.restarts, fit.steps_per_sample))


def _continuous(
    near: FreeRunFit, loose: FreeRunFit, segments: ShootingSegments, rough: ShootingSegments, held: Collection[str]
) -> FreeRunFit:  # fmt: skip
    """One motion if it is found, else the longest segments whose misfit is what that of the loose ones suggests."""
    best = loose
    try:
        for rounds_left in reversed(range(2)):  # attempts at one continuous motion
            longer = lengthen(near, segments, held)
            good = (fit for fit in reversed(longer[1:]) if _as_good(fit, loose, np.size(fit.initial)))
            best = next(good, best)
            fit = _one_motion(longer[-1], segments, held, loose)
            if fit is not None:
                return fit
            if rounds_left:
                near = fit_segments(best.model, rough, rough.first_states(best.model), tuple(best.model.values), SOFTLY)
    except DivergenceError:  # a wrong model may stay finite with the fitted states alone
        pass
    if best is loose:
        best = fit_segments(loose.model, segments, loose.initial, held, SOFTLY)
    count = len(best.restarts) + 1
    return replace(
        best, converged=False, message=f"no single motion follows the record; {count} segments of it were fitted"
    )  # fmt: skip


def _one_motion(
    longer: FreeRunFit, segments: ShootingSegments, held: Collection[str], loose: FreeRunFit
) -> FreeRunFit | None:  # fmt: skip
    """The fit of segments under continuity constraints, from longer segments; None if it ends in a local minimum."""
    states = segments.passing(longer.model, longer.restarts, longer.initial)
    firm = fit_segments(longer.model, segments, states, held, FIRMLY, FIRM, NEAR)
    if not _as_good(firm, loose):
        return None
    tight = fit_segments(firm.model, segments, firm.initial, held, TIGHTLY, TIGHT)
    # The tighter the constraints, the narrower the local minima in which a search may end; the curvature of one says
    # nothing of the others. The firm fit's covariance covers what the tight one's values scatter by.
    return replace(tight, covariance=firm.covariance) if _as_good(tight, loose) else firm


def _as_good(fit: FreeRunFit, loose: FreeRunFit, kept: int = 0) -> bool:
    """Whether the misfit has risen as expected for the loss of all free states but ``kept``."""
    states = np.size(loose.initial)
    given_up = states - kept
    cost, before = (float(np.sum(f.residual**2)) for f in (fit, loose))
    variance = before / max(len(loose.residual) - len(loose.keys) - states, 1)
    # the misfit may exceed what fewer unknowns explain by three standard deviations
    return cost - before < variance * (given_up + 3.0 * np.sqrt(2.0 * given_up))
