"""States with which the stretches of a record begin, where its own first samples tell them too badly.

A spring that hardens turns the error of a first amplitude into a wrong frequency, and the motion is out of step before
a stretch ends: there a fit of its state ends in another minimum. Within segments of a period nothing drifts that far,
so their states, each by itself, are found first (multiple shooting).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from study.identify.time_domain.continuation import fit_segments
from study.identify.time_domain.free_run_fit import FreeRunFit, fit_free_run
from study.identify.time_domain.shooting import ShootingSegments, even_restarts, needed_restarts, own_begins
from study.records.prepared import FORCE, Prepared
from study.support.arrays import Floats
from study.support.errors import DivergenceError

LOOSE = 12  # free runs of a fit whose segments are independent
POOR = 0.05  # of the response's standard deviation: a residual that may hide a motion
SMOOTH = 0.5  # correlation of neighbouring samples of a residual; white noise has none


def states_along(fit: FreeRunFit, prepared: Prepared, span: tuple[int, int]) -> Floats:
    """States with which a fitted model follows a span best, shape (states,) or (stretches, states).

    Raises
    ------
    DivergenceError
        If the free run leaves the range of finite numbers.
    """
    plain = _held(fit, prepared, span, "estimate")
    outputs = prepared.outputs
    measured = outputs.stacked(outputs.measured(prepared.record, span))
    drifts = fit.model.modal is None and prepared.response != FORCE  # of modes no sensor shows where segments begin
    if not drifts or not own_begins(prepared.record, span) or not is_poor(plain, measured):
        return plain.initial
    segments = ShootingSegments(
        prepared.record, outputs, span, even_restarts(prepared.record, outputs, span), fit.steps_per_sample
    )
    try:
        first = segments.first_states(fit.model)
        loose = fit_segments(fit.model, segments, first, tuple(fit.model.values), LOOSE)
        again = _held(fit, prepared, span, with_which_stretches_begin(segments, np.atleast_2d(loose.initial)))
    except DivergenceError:
        return plain.initial
    return again.initial if again.rms < plain.rms else plain.initial


def states_of_segments(
    fit: FreeRunFit, prepared: Prepared, span: tuple[int, int]
) -> tuple[Floats, tuple[int, ...]]:  # fmt: skip
    """States with which a chaotic model follows a span best, and the samples where its memory ends and others begin.

    Within a segment a disturbance grows no further than one may (:func:`shooting.needed_restarts`).

    Raises
    ------
    DivergenceError
        If the free run leaves the range of finite numbers.
    """
    record, outputs, steps, held = prepared.record, prepared.outputs, fit.steps_per_sample, tuple(fit.model.values)
    short = ShootingSegments(record, outputs, span, even_restarts(record, outputs, span), steps)
    loose = fit_segments(fit.model, short, short.first_states(fit.model), held, LOOSE)
    begins = [span[0], *short.restarts]
    kept = needed_restarts(fit.model, record, np.atleast_2d(loose.initial), span, short.restarts, steps)
    while list(short.restarts) != list(kept):  # by little each time, or the fit of a long one ends in another minimum
        spare = [b for b in short.restarts if b not in kept][::2]
        fewer = tuple(b for b in short.restarts if b not in spare)
        own = np.atleast_2d(loose.initial)[[begins.index(b) for b in (span[0], *fewer)]]
        short, begins = replace(short, restarts=fewer), [span[0], *fewer]
        loose = fit_segments(fit.model, short, own, held, LOOSE)
    return loose.initial, kept


def with_which_stretches_begin(segments: ShootingSegments, states: Floats) -> Floats:
    """Of the states of segments those with which a span, and each stretch in it, begins, shape (stretches, states)."""
    begins: Sequence[int] = (segments.span[0], *segments.restarts)
    own = (segments.span[0], *own_begins(segments.record, segments.span))
    return states[[begins.index(b) for b in own]]


def is_poor(fit: FreeRunFit, measured: Floats) -> bool:
    """Whether a fit has not converged, or only to a local minimum: its residual is large and smooth, like a motion.

    ``measured`` is the stacked motion that it was fitted to.
    """
    return not fit.converged or resembles_a_motion(fit, measured)


def resembles_a_motion(fit: FreeRunFit, measured: Floats) -> bool:
    """Whether what a fit leaves is large and smooth."""
    return fit.rms >= POOR * float(np.std(measured)) and is_smooth(fit.residual, len(fit.outputs))


def is_smooth(residual: Floats, sensors: int = 1) -> bool:
    """Whether neighbouring samples of a stacked residual are as much alike as those of a motion."""
    change = residual[sensors:] - residual[:-sensors]
    return 1.0 - float(np.mean(change**2)) / (2.0 * float(np.mean(residual**2))) > SMOOTH


def _held(fit: FreeRunFit, prepared: Prepared, span: tuple[int, int], initial: str | Floats) -> FreeRunFit:
    """The model with all coefficients held: its states alone are fitted."""
    return fit_free_run(
        fit.model, prepared.record, held=tuple(fit.model.values), outputs=prepared.outputs,
        steps_per_sample=fit.steps_per_sample, span=span, lost=prepared.lost, initial=initial,
    )  # fmt: skip
