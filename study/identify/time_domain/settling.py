"""A fit brought to its minimum on the whole fitting part: enough steps, local minima, chaos."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from study.equations.free_run import needed_steps
from study.equations.model import Model
from study.identify.frequency_domain.starting_values import linear_start
from study.identify.time_domain.free_run_fit import FreeRunFit, released
from study.identify.time_domain.motion_start import from_the_motion, seen_everywhere
from study.identify.time_domain.multiple_shooting import fit_in_segments, is_chaotic
from study.identify.time_domain.part_fit import SEARCH_STEPS, covariance_of, fit_part, integration_shift, run_and_slopes
from study.identify.time_domain.shooting import slowest_rate
from study.identify.time_domain.stretch_states import POOR, is_poor, resembles_a_motion
from study.records.prepared import FORCE, Prepared
from study.support.errors import DivergenceError, StudyError

STRETCH_PERIODS, STRETCH_LIMITS = 50.0, (512, 2048)  # of motion, and samples, where multiple shooting begins
SHIFT = 0.3  # standard errors by which the integration may shift a coefficient ...
SMALL_SHIFT = 0.05  # ... and where samples were left out: leaving them out is to shift nothing
INTEGRATOR_ORDER = 4  # what it shifts falls with this power of the steps
LARGEST_EXCESS = 1e6  # times the shift that would matter: more asks for no more steps than this
MOST_FIT_STEPS = 8  # in a sampling interval, unless the model's own rates ask for more
LOST = 0.5  # of what one free run leaves: where segments leave less, that run has lost the motion
KEPT = 40  # free runs of a fit that is kept


def continued(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit on another part of the record, such as the whole fitting part behind a search, from where it stands."""
    if fit.span == prepared.plan.fit:
        return fit
    again = fit_part(fit.model, prepared, fit.held, steps=fit.steps_per_sample, max_iterations=KEPT)
    return replace(again, elsewhere=fit.elsewhere)


def settled(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit at its minimum with enough steps; in segments where a chaotic system loses the motion in one run."""
    fine = with_enough_steps(fit, prepared)
    if not seen_everywhere(fit.model, prepared):
        return fine
    best = from_the_motion(_settled(fine, prepared), prepared)
    if best.restarts:  # a run that had lost the motion could not tell how many steps are enough
        best = with_enough_steps(best, prepared)
    return replace(best, elsewhere=fit.elsewhere)


def _settled(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    if prepared.response == FORCE or _stands(fit, prepared):
        return fit
    if not is_poor(fit, prepared.fitted) or is_chaotic(fit, prepared):  # what is not poor and does not stand is chaotic
        apart = _in_segments(fit, prepared, fit)
        return apart if apart is not None and (apart.converged or apart.rms < LOST * fit.rms) else fit
    near = from_segments(fit.model, prepared, fit.held, fit.steps_per_sample)
    best = better_fit(fit, near) or fit
    if near is None or _stands(best, prepared) or not is_chaotic(near, prepared):
        return best
    apart = _in_segments(near, prepared, best)  # a fit at wrong values may be regular where the true system is chaotic
    return apart if apart is not None and apart.converged and apart.rms <= best.rms else best


def of_chaos(
    fit: FreeRunFit, prepared: Prepared, start: Mapping[str, float], near: bool = False
) -> FreeRunFit | None:  # fmt: skip
    """The fit of a chaotic system from a start: in segments, or in one run from their values where that stands.

    The many minima of single runs are worth no search then. None for a system that is not chaotic where ``fit``, an
    attempt at one run, stands, and where the search in segments does not converge. ``near`` is that of
    :func:`multiple_shooting.fit_in_segments`.
    """
    if prepared.response == FORCE or not seen_everywhere(fit.model, prepared) or not is_chaotic(fit, prepared):
        return None
    steps = max(MOST_FIT_STEPS, fit.steps_per_sample)  # chaos magnifies the integration's error as any other
    try:
        apart = fit_in_segments(
            fit.model, prepared.record, start=start, held=fit.held, outputs=prepared.outputs, span=prepared.plan.fit,
            steps_per_sample=steps, near=near,
        )  # fmt: skip
        first = np.atleast_2d(apart.initial)[:1]
        once = fit_part(apart.model, prepared, fit.held, steps=steps, initial=first, max_iterations=0)
        if not (apart.restarts and apart.converged):
            return None
        if resembles_a_motion(once, prepared.fitted):
            return apart
        together = fit_part(apart.model, prepared, fit.held, steps=steps, initial=first)
    except DivergenceError:
        return None
    return together if together.converged and not _more_than_states(apart, together) else apart


def _more_than_states(apart: FreeRunFit, fit: FreeRunFit) -> bool:
    """Whether segments leave less than one free run by more than the noise that their own states follow by chance."""
    freedom = 1.0 - len(apart.restarts) * np.size(fit.initial) / len(fit.residual)
    return apart.rms**2 < freedom * fit.rms**2


def _in_segments(fit: FreeRunFit, prepared: Prepared, best: FreeRunFit) -> FreeRunFit | None:
    """Multiple shooting from where a fit stands, made one free run where that stands.

    None where it fails as well, or the best free run so far leaves no more than chance beside so many states.
    """
    try:
        apart = fit_in_segments(
            fit.model, prepared.record, held=fit.held, outputs=prepared.outputs, span=prepared.plan.fit,
            steps_per_sample=fit.steps_per_sample,
        )  # fmt: skip
        together = fit_part(
            apart.model, prepared, fit.held, steps=fit.steps_per_sample, initial=np.atleast_2d(apart.initial)[:1]
        )
    except DivergenceError:
        return None
    if _stands(together, prepared) or (together.converged and not _more_than_states(apart, together)):
        return together
    if best.converged and not _more_than_states(apart, best):
        return None
    return apart if apart.rms <= fit.rms else None  # with a state for each segment, what ends worse is lost


def _stands(fit: FreeRunFit, prepared: Prepared) -> bool:
    """Whether one free run may be believed: at a minimum, and at none of the many that a chaotic system has.

    What leaves next to nothing has no rival; what leaves more may be any of them, and the sharp curvature of one tells
    an error far below the distance to the next.
    """
    if is_poor(fit, prepared.fitted):
        return False
    return fit.rms < POOR * prepared.spread or not is_chaotic(fit, prepared)


def with_enough_steps(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit with so many steps per sample that halving them shifts no coefficient by what its error shows.

    Held ones count too, with the errors that they would have: what the integration does to them is left of the motion.
    Segments are found anew with the steps that they need: the integration's error parts them as a wrong model does.
    """
    most = max(MOST_FIT_STEPS, needed_steps(fit.model, prepared.record, prepared.outputs))
    allowed = SHIFT if prepared.every == 1 else SMALL_SHIFT
    while fit.steps_per_sample < most:
        whole = released(fit)
        coarse, jacobian = run_and_slopes(whole, prepared)
        moved = integration_shift(whole, prepared, coarse, jacobian)
        deviations = np.sqrt(np.diag(covariance_of(whole, jacobian)))
        with np.errstate(over="ignore"):  # where nothing is left, any shift is beyond all measure
            excess = float(np.max(np.abs(moved) / np.maximum(allowed * deviations, np.finfo(float).tiny)))
        if excess <= 1.0:
            break
        times = 2 ** max(1, math.ceil(math.log2(min(excess, LARGEST_EXCESS)) / INTEGRATOR_ORDER))
        steps = min(times * fit.steps_per_sample, most)
        if fit.restarts:
            try:
                finer = fit_in_segments(
                    fit.model, prepared.record, held=fit.held, outputs=prepared.outputs, span=prepared.plan.fit,
                    steps_per_sample=steps,
                )  # fmt: skip
            except DivergenceError:
                break
            if fit.converged and not finer.converged:
                break
            fit = finer
        else:
            fit = fit_part(fit.model, prepared, fit.held, steps=steps, initial=np.atleast_2d(fit.initial))
    return fit


def better_fit(one: FreeRunFit | None, other: FreeRunFit | None) -> FreeRunFit | None:
    """The fit with the smaller residual; of two alike the later one, which knows more errors."""
    if one is None or other is None:
        return one or other
    return other if other.rms <= one.rms else one


def from_segments(
    model: Model, prepared: Prepared, held: Sequence[str], steps: int = SEARCH_STEPS
) -> FreeRunFit | None:
    """A fit that begins where multiple shooting ends; None where the model cannot run even in segments.

    A motion that is prescribed drifts from nothing: there is nothing to cut. Segments begin with states that sensors
    show.
    """
    if prepared.response == FORCE or not seen_everywhere(model, prepared):
        return None
    motions = prepared.measured[slice(*prepared.plan.fit)]
    length = round(STRETCH_PERIODS * 2.0 * np.pi / (slowest_rate(motions, prepared.dt) * prepared.dt))
    stretch = prepared.shortened(int(np.clip(length, *STRETCH_LIMITS)))
    try:
        opened = model.with_values({key: None for key in model.values if key not in held})
        linear = linear_start(opened, prepared)  # a short stretch may hold hardly any motion
        start = {key: value for key, value in linear.items() if key not in held and "." not in key}
        near = fit_in_segments(
            model, prepared.record, start=start, held=held, outputs=prepared.outputs, span=stretch.plan.fit
        )
        again = near.span == prepared.plan.fit and not near.restarts and bool(prepared.record.stretches)
        begin = np.atleast_2d(near.initial) if again else None
        return fit_part(near.model, prepared, held, steps=steps, initial=begin)
    except StudyError:
        return None
