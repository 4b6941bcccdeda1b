"""The one fit of a model to a record: where it starts, open shape parameters, enough steps, local minima, chaos.

Reproduction, comparison, diagnosis and page all fit a model here. A caller says where to start, never how to go on. A
free run of a strongly nonlinear system with somewhat wrong coefficients drifts out of step with the measured motion,
and the sum of squares has local minima there; so every search has several starts, the best is kept, and what none of
them brings to a minimum is begun anew from multiple shooting, within whose segments nothing drifts far.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.equations.model import Model, ModelTerm
from study.equations.substeps import needed_steps
from study.equations.terms import LIBRARY
from study.identify.frequency_domain.inputs import history, reverse_inputs
from study.identify.frequency_domain.starting_values import linear_start, reverse_start
from study.identify.time_domain import shape_search
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.multiple_shooting import POOR, fit_in_segments, is_chaotic, is_poor
from study.identify.time_domain.part_fit import STEPS, fit_part, linearise, run_of
from study.identify.time_domain.shape_search import Baseline
from study.records.prepared import Prepared
from study.records.states import angular_rate
from study.support.errors import DivergenceError, StudyError
from study.support.least_squares import least_squares
from study.support.statistics import clustered_covariance

Floats = NDArray[np.float64]
Values = Mapping[str, float]
PERIODS = 50.0  # of the motion, in the stretch that multiple shooting starts a search from
SHORTEST, LONGEST = 512, 2048  # samples in that stretch
TRIED, KEPT = 15, 40  # free runs of a fit that tries a start, and of one that is kept
NEAR = 0.01  # standard errors: as near a minimum as the fit of a search has to come
SHIFT = 0.3  # standard errors by which the integration may shift a coefficient
ORDER = 4  # of the integrator: what it shifts falls with this power of the steps
FAR = 1e6  # times the shift that would matter: more asks for no more steps than this
MOST_STEPS = 8  # in a sampling interval, unless the model's own rates ask for more


def fit_model(model: Model, prepared: Prepared, start: Values | None = None) -> FreeRunFit:
    """Fit all that a model leaves open; what it gives is held.

    Parameters
    ----------
    model : Model
        Shape parameters that it leaves open are searched for.
    prepared : Prepared
        The record and the part of it to fit.
    start : mapping of float, optional
        A value for everything that is left open: the fit begins there and nothing is searched for.

    Returns
    -------
    FreeRunFit
        With so many steps that the integration shifts no coefficient by what its error shows. In segments
        (``restarts``) where the fitted system is chaotic.

    Raises
    ------
    StudyError
        If the model cannot be fitted.
    """
    if "inertia" not in model:
        raise StudyError(f"model {model.name!r} has no inertia; a free run needs it")
    _check_own_formulas(model, prepared)
    if start is not None:
        return settled(
            fit_part(model, prepared, model.held_keys, start, steps=_rough(model, prepared, start)), prepared
        )
    unknown = tuple(t for t in model.terms if None in t.parameters)
    known = replace(model, terms=tuple(t for t in model.terms if t not in unknown))
    look = shape_search.stretch(known, prepared) if unknown else prepared
    fit = best_fit(known, look, first_starts(known, look))
    for entry in unknown:
        fit = with_term(fit, entry, shape_search.baseline(fit, look), look)
    ordered = replace(model, terms=tuple(next(t for t in fit.model.terms if t.name == e.name) for e in model.terms))
    return settled(continued(replace(fit, model=ordered), prepared), prepared)


def first_starts(model: Model, prepared: Prepared) -> list[dict[str, float]]:
    """Where a fit from nothing begins: the best linear approximation, and the reverse system's solution if any."""
    linear = linear_start(model, prepared)
    starts = [linear, linear | _reversed(model, prepared)]
    return [{key: value for key, value in start.items() if key not in model.held_keys} for start in starts]


def with_term(fit: FreeRunFit, entry: ModelTerm, base: Baseline, prepared: Prepared) -> FreeRunFit:
    """The fitted model with one term more, the best of fits from several starts.

    These are points of a search over the term's shape parameters beside the fitted model, and the best of them anew,
    with all coefficients from the reverse system, or beside a linear model where that has no solution: it matters where
    the model without the term was driven to a far corner by its lack.

    Raises
    ------
    StudyError
        If none of them has a finite response.
    """
    given = {key: value for key, value in entry.values.items() if value is not None}
    known = fit.model.numbers()
    grown = fit.model.with_term(entry)
    points = shape_search.starts(entry.term, base, prepared)
    starts = [known | dict.fromkeys(entry.term.symbols, 0.0) | _shapes(entry, p.parameters) | given for p in points]
    if points:
        anew = _reversed(grown.with_values(starts[0]), prepared) or base.linear
        starts.append(starts[0] | {k: v for k, v in anew.items() if k in (*fit.keys, *entry.term.symbols)} | given)
    try:
        return best_fit(grown, prepared, starts, (*fit.held, *given))
    except StudyError:
        missing = ", ".join(key for key, value in entry.values.items() if value is None)
        raise StudyError(
            f"no values of {missing} let {entry.name} follow {prepared.record.name}; give them in the model file"
        ) from None


def best_fit(
    model: Model, prepared: Prepared, starts: Iterable[Values], held: Sequence[str] | None = None
) -> FreeRunFit:  # fmt: skip
    """The best of fits from several starts.

    With open shape parameters each start is first fitted with these held: the misfit along a dead band or a gap has
    kinks and local minima in which a fit of everything at once gets stuck.

    Raises
    ------
    StudyError
        If there is no finite response from any start.
    """
    held = model.held_keys if held is None else tuple(held)
    shapes = tuple(key for key in model.values if "." in key and key not in held)
    begun = list(starts)
    first = [_tried(model, prepared, (*held, *shapes), start, TRIED) for start in begun]
    nearer = [_halfway(begun[0], start) for start, fit in zip(begun[1:], first[1:], strict=True) if fit is None]
    first += [_tried(model, prepared, (*held, *shapes), start, TRIED) for start in nearer]
    best = min((fit for fit in first if fit is not None), key=lambda fit: fit.rms, default=None)
    if best is not None and (shapes or not best.converged):
        best = _freed(best, prepared, held)
    if best is None or not best.converged:
        apart = _from_segments(best.model if best else model, prepared, (*held, *shapes))
        if apart is not None and shapes:
            apart = _freed(apart, prepared, held)
        best = _better(best, apart)
    if best is None:
        raise StudyError(f"{model.name!r} has no finite response to the force of {prepared.record.name!r}")
    return best


def continued(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit on another part of the record, such as the whole fitting part behind a search, from where it stands."""
    if fit.span == prepared.plan.fit:
        return fit
    return fit_part(fit.model, prepared, fit.held, steps=fit.steps_per_sample, max_iterations=KEPT)


def settled(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit at its minimum with enough steps; in segments where a chaotic system loses the motion in one run."""
    fit = with_enough_steps(fit, prepared)
    if _stands(fit, prepared):
        return fit
    best = begin = fit
    if not is_chaotic(fit, prepared):  # which a fit at wrong values may not, where the true system does
        near = _from_segments(fit.model, prepared, fit.held, fit.steps_per_sample)
        best = _better(fit, near) or fit
        if near is None or _stands(best, prepared) or not is_chaotic(near, prepared):
            return best
        begin = near
    try:
        apart = fit_in_segments(
            begin.model, prepared.record, held=fit.held, response=prepared.response, span=prepared.plan.fit,
            steps_per_sample=fit.steps_per_sample,
        )  # fmt: skip
        together = fit_part(
            apart.model, prepared, fit.held, steps=fit.steps_per_sample, initial=np.atleast_2d(apart.initial)[:1]
        )
    except DivergenceError:  # where segments fail as well, the one free run is what there is
        return best
    if _stands(together, prepared):
        return together
    if apart.rms > best.rms:  # with a state for each segment besides, no fit ends worse: it is lost
        return best
    return apart if apart.converged or (begin is fit and is_poor(fit, prepared.fitted)) else best


def _stands(fit: FreeRunFit, prepared: Prepared) -> bool:
    """Whether one free run may be believed: at a minimum, and at none of the many that a chaotic system has.

    What leaves next to nothing has no rival; what leaves more may be any of them, and the sharp curvature of one tells
    an error far below the distance to the next.
    """
    if is_poor(fit, prepared.fitted):
        return False
    return fit.rms < POOR * prepared.spread or not is_chaotic(fit, prepared)


def with_enough_steps(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit with so many steps per sample that halving them shifts no coefficient by what its error shows."""
    most = max(MOST_STEPS, needed_steps(fit.model, prepared.record, prepared.response).rough)
    while fit.keys and fit.steps_per_sample < most:
        jacobian = linearise(fit, prepared)
        coarse, fine = (run_of(fit, prepared, finer=n).respond({}, fit.initial)[0] for n in (1, 2))
        moved = least_squares(jacobian, np.subtract(coarse, fine), 1e-12)
        deviations = np.sqrt(np.diag(clustered_covariance(jacobian, fit.residual)))
        with np.errstate(over="ignore"):  # where nothing is left, any shift is beyond all measure
            excess = float(np.max(np.abs(moved) / np.maximum(SHIFT * deviations, np.finfo(float).tiny)))
        if excess <= 1.0:
            break
        times = 2 ** max(1, math.ceil(math.log2(min(excess, FAR)) / ORDER))
        fit = fit_part(
            fit.model, prepared, fit.held, steps=min(times * fit.steps_per_sample, most),
            initial=np.atleast_2d(fit.initial),
        )  # fmt: skip
    return fit


def _rough(model: Model, prepared: Prepared, start: Values) -> int:
    """Steps of a search's runs: those of every search, or more where the model's own rates ask for them."""
    return max(STEPS, needed_steps(model.with_values(start), prepared.record, prepared.response).rough)


def _tried(
    model: Model, prepared: Prepared, held: Sequence[str], start: Values, runs: int, initial: Floats | None = None
) -> FreeRunFit | None:  # fmt: skip
    """A fit from one start; None where the model has no finite response there."""
    begun = model.with_values(start)
    try:
        steps = _rough(begun, prepared, start)
        return fit_part(begun, prepared, held, steps=steps, max_iterations=runs, initial=initial, offset=NEAR)
    except StudyError:
        return None


def _halfway(safe: Values, start: Values) -> dict[str, float]:
    """Where to begin if the motion runs away from a start, as it does from springs that soften a little too much."""
    return {key: value if "." in key else 0.5 * (value + safe.get(key, value)) for key, value in start.items()}


def _freed(fit: FreeRunFit, prepared: Prepared, held: Sequence[str]) -> FreeRunFit | None:
    """A fit with all free that is not held, from where one stands that held more: its state too, or it could be worse.

    Whoever took the other then, for its smaller residual, would hold what the model leaves open.
    """
    return _tried(fit.model, prepared, held, fit.model.numbers(), KEPT, np.atleast_2d(fit.initial))


def _better(one: FreeRunFit | None, other: FreeRunFit | None) -> FreeRunFit | None:
    """The fit with the smaller residual; of two alike the later one, which knows more errors."""
    if one is None or other is None:
        return one or other
    return other if other.rms <= one.rms else one


def _from_segments(model: Model, prepared: Prepared, held: Sequence[str], steps: int = STEPS) -> FreeRunFit | None:
    """A fit that begins where multiple shooting ends; None where the model cannot run even in segments."""
    length = round(PERIODS * 2.0 * np.pi / (angular_rate(prepared.fitted, prepared.dt) * prepared.dt))
    stretch = prepared.shortened(int(np.clip(length, SHORTEST, LONGEST)))
    try:
        linear = linear_start(model, prepared)  # a short stretch may hold hardly any motion
        start = {key: value for key, value in linear.items() if key not in held and "." not in key}
        near = fit_in_segments(
            model, prepared.record, start=start, held=held, response=prepared.response, span=stretch.plan.fit
        )
        return fit_part(near.model, prepared, held, steps=steps)
    except StudyError:
        return None


def _reversed(model: Model, prepared: Prepared) -> dict[str, float]:
    """Coefficients from the reverse system; none where it has no solution."""
    try:
        return reverse_start(model, prepared)
    except StudyError:
        return {}


def _shapes(entry: ModelTerm, parameters: Sequence[float]) -> dict[str, float]:
    return dict(zip(entry.keys[len(entry.coefficients) :], parameters, strict=True))


def _check_own_formulas(model: Model, prepared: Prepared) -> None:
    """A user's formula must be a number all along the measured motion: a fit that it stops would be blamed else."""
    if all(term.name in LIBRARY for term in model.terms):
        return
    motion = prepared.record.part(*prepared.inner((0, len(prepared.record))))
    known = replace(model, terms=tuple(t for t in model.terms if None not in t.parameters))
    for item in reverse_inputs(known):
        if any(name not in LIBRARY for name in item.terms):
            history(item, motion)
