"""The one fit of a model to a record: where it starts, open shape parameters, enough steps, local minima, chaos.

Reproduction, comparison, diagnosis and page all fit a model here. A caller says where to start, never how to go on. A
free run of a strongly nonlinear system with somewhat wrong coefficients drifts out of step with the measured motion,
and the sum of squares has local minima there; so every search has several starts, the best is kept, and what none of
them brings to a minimum is begun anew from multiple shooting, within whose segments nothing drifts far.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from study.equations.equations_of_motion import loose_motions
from study.equations.model import Model, ModelTerm
from study.equations.redundancy import repeated_along
from study.equations.terms import LIBRARY, LINEAR
from study.identify.frequency_domain.inputs import input_history, reverse_inputs
from study.identify.frequency_domain.start_of_changes import start_of_changes
from study.identify.frequency_domain.starting_values import linear_start, reverse_start
from study.identify.time_domain import shape_search
from study.identify.time_domain.continuation import NEAR
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.modal_fit import modal_fit, with_modal_term
from study.identify.time_domain.motion_start import from_the_motion
from study.identify.time_domain.no_response import (
    SURE,
    driven_at,
    explains_nothing,
    one_frequency,
    unfit,
    why_no_response,
)
from study.identify.time_domain.part_fit import covariance_of, fit_part, linearise, rough_steps
from study.identify.time_domain.settling import (
    KEPT,
    better_fit,
    continued,
    from_segments,
    of_chaos,
    settled,
)
from study.identify.time_domain.shape_search import Baseline, Start
from study.identify.time_domain.shooting import own_begins
from study.identify.time_domain.stretch_states import resembles_a_motion
from study.identify.time_domain.told_alone import (
    entry_alone,
    fit_alone,
    is_alone,
    model_alone,
    prepared_alone,
    told_back,
)
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS
from study.support.arrays import Floats
from study.support.errors import DivergenceError, StudyError, expect

Values = Mapping[str, float]
TRIED = 15  # free runs of a fit that tries a start
# Of a motion at one frequency: resonances to begin at, over that frequency.
DRIVEN_BELOW, DRIVEN_ABOVE = (4.0, 2.0, 1.4, 1.2, 1.1), (0.9, 0.8, 0.7, 0.5, 0.25)
SAME_MINIMUM = 1e-6  # of a mass: two searches for it end as near without noise
NEARBY_FACTORS = (0.9, 0.95, 1.05, 1.1)  # times a shape parameter, where fits begin beside what a search found


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
    if is_alone(model):
        alone = model_alone(model)
        told = dict(zip(model.values, alone.values, strict=True))
        begun = None if start is None else {told[key]: value for key, value in start.items()}
        return told_back(fit_model(alone, prepared_alone(prepared), begun), model, prepared.outputs)
    if not model.named and "inertia" not in model and prepared.response != FORCE:
        raise StudyError(f"model {model.name!r} has no inertia; a free run needs it")
    _check_own_formulas(model, prepared)
    if start is not None:
        return settled(
            fit_part(model, prepared, model.held_keys, start, steps=rough_steps(model, prepared, start)), prepared
        )
    if model.starts and set(model.starts) == {key for key, value in model.values.items() if value is None}:
        begun = _from_its_starts(model, prepared)
        if begun is not None:
            return _followed(begun, model, prepared)
    changes = tuple(t for t in model.terms if t.term.variation and None in t.coefficients)
    unknown = (*(t for t in model.terms if None in t.parameters and t not in changes), *changes)
    known = replace(model, terms=tuple(t for t in model.terms if t not in unknown))
    short = unknown and not (model.named or changes)  # a short stretch tells of no change along a long one
    look = shape_search.searched_stretch(known, prepared) if short else prepared
    placed = model.named and prepared.response != FORCE
    fit = first_fit(known, look) if placed else _from_nothing(known, look)
    if fit.restarts and not unknown:  # a chaotic system, settled in segments
        return fit
    for entry in unknown:
        fit = with_term(shape_search.baseline(fit, look), entry)
    in_order = tuple(next(t for t in fit.model.terms if t.name == e.name) for e in model.terms)
    ordered = replace(fit.model, terms=in_order)
    return _followed(settled(continued(replace(fit, model=ordered), prepared), prepared), model, prepared)


def _from_its_starts(model: Model, prepared: Prepared) -> FreeRunFit | None:
    """The fit of a model that says where all begins that it leaves open; None where that leads to no minimum.

    What follows the motion and ran out of runs may want no more than finer steps.
    """
    begun = _tried(model, prepared, model.held_keys, model.starts, KEPT)
    if begun is None:
        return None
    lost = resembles_a_motion(begun, prepared.fitted)
    fit = of_chaos(begun, prepared, model.starts, near=True) if lost else begun
    if fit is None and begun.converged:
        fit = begun
    if fit is None or fit.restarts:
        return fit
    again = settled(fit, prepared)
    return again if fit.converged or again.converged else None


def _followed(fit: FreeRunFit, model: Model, prepared: Prepared) -> FreeRunFit:
    """The fit; a linear system is never chaotic: one that needs segments is refused where there is a plain reason."""
    if prepared.free and explains_nothing(fit, prepared):
        raise StudyError(
            f"no free motion of {model.name!r} explains any of {prepared.record.name!r}: as much is left as without "
            "any; expected the record of a decay"
        )
    if model.modal or not all(term.name in LINEAR for term in model.terms):
        return fit
    omega = driven_at(model, prepared)
    if omega and not _tells_mass(fit, omega, prepared):
        raise StudyError(one_frequency(omega, prepared))
    sentence = unfit(model, prepared) if fit.restarts else ""
    if sentence:
        raise StudyError(sentence)
    return fit


def _tells_mass(fit: FreeRunFit, omega: float, prepared: Prepared) -> bool:
    """Whether a transient tells the mass where one frequency drives: from zero, and a fit from beside it comes back.

    The steady motion has the same error for any mass and the stiffness to it; what little is left (rounding, a force
    between its samples) chooses one of them, with a standard error that means nothing.
    """
    # another fit begins a fifth heavier, with the stiffness of the same steady motion, and is to come back
    values = fit.model.numbers()
    heavier = values | {"m": 1.2 * values["m"], "k": values["k"] + (1.2 - 1.0) * values["m"] * omega**2}
    again = _tried(fit.model.with_values(heavier), prepared, fit.held, heavier, KEPT)
    if fit.restarts or again is None or not (fit.converged and again.converged):
        return False
    place = fit.keys.index("m")
    own, other = (f.model.numbers()["m"] for f in (fit, again))
    known = np.sqrt([covariance_of(f, linearise(f, prepared))[place, place] for f in (fit, again)])
    return own > SURE * known[0] and abs(own - other) < SURE * float(np.hypot(*known)) + SAME_MINIMUM * own


def _from_nothing(model: Model, prepared: Prepared) -> FreeRunFit:
    """The fit from the first starts; a nonlinear model that these bring to no minimum is built up term by term.

    A chaotic system loses the motion in any single run, built up or not: it is fitted in segments at once. What follows
    the motion and ran out of runs is no such case.
    """
    fit, reason, starts = None, None, first_starts(model, prepared)
    nonlinear = any(term.name not in LINEAR for term in model.terms)
    first = _each_tried(model, prepared, starts, model.held_keys)
    lost = first and not any(f.converged for f in first) and resembles_a_motion(first[0], prepared.fitted)
    if nonlinear and lost:
        apart = of_chaos(first[0], prepared, starts[-1])
        if apart is not None:
            return apart
    try:
        fit = _best_of(first, model, prepared, model.held_keys)
    except StudyError as error:
        reason = error
    if (fit is None or not fit.converged) and nonlinear:
        fit = better_fit(fit, _built_up(model, prepared))
    if fit is None:
        raise reason or StudyError(why_no_response(model, prepared))
    return fit


def first_starts(model: Model, prepared: Prepared) -> list[dict[str, float]]:
    """Where a fit from nothing begins: the best linear approximation, and the reverse system's solution if any.

    With what the model says of starts; near a mode that the user names by that alone.
    """
    linear = linear_start(model, prepared)
    given = [linear | model.starts] if model.starts or prepared.near else []
    starts = given if prepared.near else [*given, linear, linear | _reversed(model, prepared)]
    omega = driven_at(model, prepared)
    if omega:  # only the transient tells the mass, and a fit begun at another resonance loses step with it
        steady = linear["k"] - linear["m"] * omega**2
        ratios = DRIVEN_BELOW if steady > 0.0 else DRIVEN_ABOVE
        masses = [steady / ((ratio * omega) ** 2 - omega**2) for ratio in ratios]
        starts += [linear | {"m": m, "k": steady + m * omega**2} for m in masses]
    return [{key: value for key, value in start.items() if key not in model.held_keys} for start in starts]


def _built_up(model: Model, prepared: Prepared) -> FreeRunFit | None:
    """The fit of all terms but the last, and the last one added; None where either has no finite response.

    Terms that do nearly the same, as three laws of damping of one decay, lead a fit of all of them astray from afar.
    """
    last = model.terms[-1]
    try:
        fit = fit_model(replace(model, terms=model.terms[:-1]), prepared)
        start = fit.model.numbers() | {key: value or 0.0 for key, value in last.values.items()}
        return best_fit(fit.model.with_term(last), prepared, [start], model.held_keys)
    except StudyError:
        return None


def with_term(base: Baseline, entry: ModelTerm, points: Sequence[Start] = ()) -> FreeRunFit:
    """The fitted model with one term more at its place, the best of fits from several starts.

    These are points of a search over the term's shape parameters beside the fitted model (``points``, if that has been
    made), and the best of them anew, with all coefficients from the reverse system, or beside a linear model where that
    has no solution: it matters where the model without the term was driven to a far corner by its lack.

    Raises
    ------
    StudyError
        If none of them has a finite response.
    """
    if is_alone(base.fit.model):
        alone = replace(base, fit=fit_alone(base.fit), prepared=prepared_alone(base.prepared))
        found = with_term(alone, entry_alone(entry, base.fit.model), points)
        return told_back(found, base.fit.model.with_term(entry), base.prepared.outputs)
    given = {key: value for key, value in entry.values.items() if value is not None}
    fit, prepared = base.fit, base.prepared
    if fit.model.modal:
        return _beside_modes(base, entry, points)
    grown, points = fit.model.with_term(entry), points or shape_search.shape_starts(entry, base)
    in_reverse = base.several and not base.prescribed
    starts = (_from_the_equations if in_reverse else _from_the_free_run)(entry, base, points)
    initial = grown_states(fit, grown) if base.several else None  # which no sensor may show
    try:
        best = best_fit(grown, prepared, [start | given for start in starts], (*fit.held, *given), initial)
    except StudyError:
        missing = ", ".join(key for key, value in entry.values.items() if value is None)
        raise StudyError(
            f"no values of {missing} let {entry.name} follow {prepared.record.name}; give them in the model file"
        ) from None
    return replace(from_the_motion(best, prepared), elsewhere=(*best.elsewhere, *fit.elsewhere))


def _beside_modes(base: Baseline, entry: ModelTerm, points: Sequence[Start]) -> FreeRunFit:
    """The same where modes are fitted anew beside the term: from the best point, or also from beside it."""
    found = points or shape_search.shape_starts(entry, base)
    if not found:
        raise StudyError(f"no modes let {entry.name} follow {base.prepared.record.name}; expected an effect that does")
    best = found[0].parameters
    near = [best] if points or not best else [tuple(factor * x for x in best) for factor in (1.0, *NEARBY_FACTORS)]
    given = {key: value for key, value in entry.values.items() if value is not None}
    shapes = [[x if own is None else own for x, own in zip(p, entry.parameters, strict=True)] for p in near]
    return with_modal_term(base.fit, entry, shapes, base.prepared, tuple(given))


def _from_the_free_run(entry: ModelTerm, base: Baseline, points: Sequence[Start]) -> list[dict[str, float]]:
    """Where fits beside the sensitivities' points begin: at none of the effect, and with all values anew."""
    fit, known = base.fit, base.fit.model.numbers()
    starts = [known | dict.fromkeys(entry.symbols, 0.0) | _shapes(entry, p.parameters) for p in points]
    if points:
        grown = fit.model.with_term(entry)
        anew = _reversed(grown.with_values(starts[0]), base.prepared) or base.linear
        starts.append(starts[0] | {k: v for k, v in anew.items() if k in (*fit.keys, *entry.symbols)})
        if entry.term.variation is not None:
            with suppress(StudyError):
                along = start_of_changes(grown.with_values(starts[0]), entry, base.prepared)
                starts.append(starts[0] | {k: v for k, v in along.items() if k in (*fit.keys, *entry.keys)})
    return starts


def _from_the_equations(entry: ModelTerm, base: Baseline, points: Sequence[Start]) -> list[dict[str, float]]:
    """Where fits beside the reverse system's points begin: at their amounts, and at none of the effect.

    A false step leads that nowhere.
    """
    known, starts = base.fit.model.numbers(), list[dict[str, float]]()
    for point in points[: shape_search.STARTS - 1]:
        amounts = dict(zip(entry.symbols, point.coefficients, strict=True)) | _shapes(entry, point.parameters)
        starts.append(known | amounts | base.reverse.moved(entry, point, shape_search.CUTOFF))
        if point is points[0]:
            starts.append(known | amounts | dict.fromkeys(entry.symbols, 0.0))
    return starts


def grown_states(fit: FreeRunFit, model: Model) -> Floats:
    """The states with which the stretches of a fit begin, for a model with other terms; those of new terms are zero."""
    given = np.atleast_2d(fit.initial)
    motions = given.shape[1] - len(fit.model.states)  # none of a coordinate whose motion is prescribed
    states = np.zeros((len(given), motions + len(model.states)))
    own = {t.name: motions + i for i, t in enumerate(fit.model.states)}
    states[:, :motions] = given[:, :motions]
    for i, entry in enumerate(model.states):
        if entry.name in own:
            states[:, motions + i] = given[:, own[entry.name]]
    return states


def best_fit(
    model: Model, prepared: Prepared, starts: Iterable[Values], held: Sequence[str] | None = None,
    initial: Floats | None = None,
) -> FreeRunFit:  # fmt: skip
    """The best of fits from several starts; the others stay with it (``elsewhere``).

    With open shape parameters each start is first fitted with these held: the misfit along a dead band or a gap has
    kinks and local minima in which a fit of everything at once gets stuck. ``initial`` are the states that fits begin
    with, estimated from the record if left out. A minimum outside of what makes the terms physical is taken only where
    no start leads to one inside.

    Raises
    ------
    StudyError
        If there is no finite response from any start.
    """
    held = model.held_keys if held is None else tuple(held)
    return _best_of(_each_tried(model, prepared, list(starts), held, initial), model, prepared, held)


def _each_tried(
    model: Model, prepared: Prepared, starts: Sequence[Values], held: Sequence[str], initial: Floats | None = None
) -> list[FreeRunFit]:  # fmt: skip
    """Fits from several starts, open shape parameters held, that which leaves least first."""
    kept = (*held, *(key for key in model.values if "." in key and key not in held))
    each = [_tried(model, prepared, kept, start, TRIED, initial) for start in starts]
    nearer = [_halfway(starts[0], start) for start, fit in zip(starts[1:], each[1:], strict=True) if fit is None]
    each += [_tried(model, prepared, kept, start, TRIED, initial) for start in nearer]
    return sorted((fit for fit in each if fit is not None), key=lambda fit: fit.rms)


def _best_of(first: Sequence[FreeRunFit], model: Model, prepared: Prepared, held: Sequence[str]) -> FreeRunFit:
    """The best of fits that tried their starts, brought to its minimum."""
    best = _at_minimum(first[0] if first else None, model, prepared, held)
    inside = next((fit for fit in first if fit.converged and not _unphysical(fit)), None)
    if best is not None and inside is not None and inside is not first[0] and _unphysical(best):
        bound = _at_minimum(inside, model, prepared, held)
        best = best if bound is None or _unphysical(bound) else bound
    if best is None:
        raise StudyError(why_no_response(model, prepared))
    return replace(best, elsewhere=tuple(first[1:]))


def _at_minimum(
    fit: FreeRunFit | None, model: Model, prepared: Prepared, held: Sequence[str]
) -> FreeRunFit | None:  # fmt: skip
    """A fit that tried a start, its shapes freed; from multiple shooting where it came to no minimum."""
    shapes = tuple(key for key in model.values if "." in key and key not in held)
    best = fit
    if best is not None and (shapes or not best.converged):
        best = _freed(best, prepared, held)
    if best is None or not best.converged:
        apart = from_segments(best.model if best else model, prepared, (*held, *shapes))
        if apart is not None and shapes:
            apart = _freed(apart, prepared, held)
        best = better_fit(best, apart)
    return best


def _unphysical(fit: FreeRunFit) -> bool:
    return any(entry.term.physical(fit.model.values) for entry in fit.model.terms)


def _tried(
    model: Model, prepared: Prepared, held: Sequence[str], start: Values, runs: int, initial: Floats | None = None
) -> FreeRunFit | None:  # fmt: skip
    """A fit from one start; None where the model has no finite response there."""
    begun = model.with_values(start)
    try:
        steps = rough_steps(begun, prepared, start)
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


def _reversed(model: Model, prepared: Prepared) -> dict[str, float]:
    """Coefficients from the reverse system; none where it has no solution."""
    try:
        return reverse_start(model, prepared)
    except StudyError:
        return {}


def _shapes(entry: ModelTerm, parameters: Sequence[float]) -> dict[str, float]:
    return dict(zip(entry.keys[len(entry.coefficients) :], parameters, strict=True))


def _check_own_formulas(model: Model, prepared: Prepared) -> None:
    """A user's formula must be a number all along the measured motion, and one that the record tells from others.

    A fit that it stops would be blamed else, or take its time to no end.
    """
    if model.named or all(term.name in LIBRARY for term in model.terms):  # not all of its motions may be measured
        return
    motion = prepared.record.part(*prepared.inner((0, len(prepared.record))))
    known = replace(model, terms=tuple(t for t in model.terms if None not in t.parameters))
    for item in reverse_inputs(known):
        if any(name not in LIBRARY for name in item.terms):
            input_history(item, motion)
    channels = {"u": MOTIONS[0], "v": MOTIONS[1]} | {name: name for name in model.channels}
    along = {name: motion[channel] for name, channel in channels.items()} | {"t": motion.time}
    fault = repeated_along(model, along, prepared.record.name)
    expect(fault is None, f"{fault}")


def first_fit(model: Model, prepared: Prepared) -> FreeRunFit:
    """Fit all that a structure leaves open; what it gives is held.

    From the linear terms alone, and where that diverges or stays far from the motion, with more damping.

    Raises
    ------
    StudyError
        If no fit begins.
    """
    if model.modal:
        return modal_fit(model, prepared)
    linear = linear_start(model, prepared)
    start = {key: linear[key] for key, value in model.values.items() if value is None}
    fits: list[FreeRunFit] = []
    with suppress(DivergenceError):
        fits.append(_begun(model, prepared, start))
    if not fits or (not fits[0].converged and 2.0 * fits[0].rms ** 2 > prepared.spread**2):
        calm = {key: 4.0 * abs(v) if key.startswith("c[") else v for key, v in start.items()}
        try:
            fits.append(_begun(model, prepared, calm))
        except DivergenceError:
            expect(fits, _endless(model, prepared))
    return min(fits, key=lambda fit: fit.rms)


def _begun(model: Model, prepared: Prepared, start: Mapping[str, float]) -> FreeRunFit:
    """A fit from one start; of a decay from rest where its own states let the motion escape from springs far wrong."""
    steps = rough_steps(model, prepared, start)
    try:
        return fit_part(model, prepared, model.held_keys, start, steps=steps)
    except DivergenceError:
        if not prepared.record.stretches:
            raise
        states = 2 * len(model.coordinates) + len(model.states)
        rest = np.zeros((1 + len(own_begins(prepared.record, prepared.plan.fit)), states))
        return fit_part(model, prepared, model.held_keys, start, steps=steps, initial=rest)


def _endless(model: Model, prepared: Prepared) -> str:
    """Why no fit begins."""
    said = f"{model.name!r} has no finite motion under the forces of {prepared.record.name!r}"
    loose = loose_motions(model)
    if not loose:
        return said
    tied = f"nothing ties it down in {loose} of its {len(model.coordinates)} motions, in which it drifts away"
    return f"{said}: {tied}; expected a term between 'ground' and a coordinate, if the structure stands on something"
