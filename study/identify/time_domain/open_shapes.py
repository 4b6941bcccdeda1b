"""Shape parameters that a model leaves open: where a fit of them begins.

Each point of a search over them (``shape_search``: the width of a dead band, a gap, a relaxation time or the
frequency of a stiffness) is fitted to a part of the record. One free run tells points apart best, unless the
system is chaotic: then it ends in a side valley at every point, while the misfit in pieces of a period falls
smoothly towards the truth.
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.equations.model import Model, ModelTerm
from study.equations.substeps import needed_steps
from study.identify.time_domain import held_out, shape_search
from study.identify.time_domain.continuation import fit_pieces
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.multiple_shooting import astray, magnifies
from study.identify.time_domain.shape_search import Baseline
from study.identify.time_domain.shooting import Pieces, even_restarts
from study.records.plan import Plan, make_plan, shortened, with_steps
from study.records.record import Record
from study.support.errors import DivergenceError, StudyError

Floats = NDArray[np.float64]
SEARCHED = 2048  # samples, at most: a start needs no more
SHORT, LONG = 15, 40  # free runs of a fit with the shape held, and of one with it open
FEW = 5  # ... in pieces, which find their way sooner


def shape_keys(model: Model) -> tuple[str, ...]:
    """Keys of the shape parameters that a model gives."""
    keys = [key for entry in model.terms for key in entry.keys[len(entry.coefficients) :]]
    return tuple(key for key in keys if model.values[key] is not None)


def with_starting_shapes(model: Model, record: Record) -> Model:
    """The model with starting values for shape parameters that it leaves open, and for its coefficients.

    A model that leaves none open is returned as it is.

    Raises
    ------
    StudyError
        If a term's shape parameters cannot be found in the record.
    """
    unknown = tuple(t for t in model.terms if None in t.parameters)
    if not unknown:
        return model
    how = shortened(make_plan(record), SEARCHED)
    known = replace(model, terms=tuple(t for t in model.terms if t not in unknown))
    values = held_out.linear_start(known, record, how)
    begun = known.with_values({key: value for key, value in values.items() if key not in shape_keys(known)})
    if not any(t.term.state for t in unknown):  # of which some points of a search have a short memory
        how = with_steps(how, needed_steps(begun, record, how.response, how.steps_per_sample).rough)
    for entry in unknown:
        before = held_out.fit(known, record, how, shape_keys(known), values, SHORT)
        base = shape_search.baseline(before, record, how)
        found = _in_one_run(base, entry, record, how) or _in_pieces(base, entry, record, how)
        if found is None:
            names = ", ".join(p.name for p, v in zip(entry.term.parameters, entry.parameters, strict=True) if v is None)
            raise StudyError(f"{record.name!r} does not show {names} of {entry.name}; give it in the model")
        known, values = found.model, dict(zip(found.keys, found.values.tolist(), strict=True))
    return model.with_values(known.values)


def _in_one_run(base: Baseline, entry: ModelTerm, record: Record, how: Plan) -> FreeRunFit | None:
    """The model with a term, fitted in one free run from the best points of a search; None where that goes astray."""
    model = base.found.model.with_term(entry)
    given, own = shape_keys(model), entry.keys[len(entry.coefficients) :]
    values = {key: value for key, value in base.found.model.values.items() if value is not None}
    measured, best = record[how.response][slice(*how.fit)], None
    for point in shape_search.starts(entry.term, base, record, how):
        begun = model.with_values(values | dict(zip(entry.keys, point.coefficients + point.parameters, strict=True)))
        found = _fitted(begun.with_values(_given(entry)), record, how, (*given, *own), SHORT)
        if found is None:
            continue
        if not found.converged and magnifies(found, record, how.response, how.steps_per_sample, how.fit):
            return None
        best = found if best is None or found.rms < best.rms else best
    found = best and (_fitted(best.model, record, how, given, LONG) or best)
    return None if found is None or astray(found, measured) else found


def _fitted(model: Model, record: Record, how: Plan, held: tuple[str, ...], runs: int) -> FreeRunFit | None:
    values = {key: value for key, value in model.values.items() if value is not None}
    try:
        return held_out.fit(model, record, how, held, values, runs)
    except DivergenceError:
        return None


def _in_pieces(base: Baseline, entry: ModelTerm, record: Record, how: Plan) -> FreeRunFit | None:
    """The same in pieces of a period, from every point of the search; None where there is no finite response."""
    model = base.found.model.with_term(entry)
    given, own = shape_keys(model), entry.keys[len(entry.coefficients) :]
    restarts = even_restarts(record, how.response, how.fit)
    pieces = Pieces(record, how.response, how.fit, restarts, how.steps_per_sample)
    start = held_out.linear_start(model, record, how)
    begun = model.with_values({key: value for key, value in start.items() if "." not in key})
    best, states = None, None
    for point in shape_search.grid(entry.term, base, record, how):
        shaped = begun.with_values(dict(zip(own, point, strict=True)) | _given(entry))
        states = pieces.first_states(shaped) if states is None else states
        found = _fitted_pieces(shaped, pieces, states, (*given, *own))
        states = states if found is None else found.initial
        if found is not None and (best is None or found.rms < best.rms):
            best = found
    return best and (_fitted_pieces(best.model, pieces, best.initial, given) or best)


def _fitted_pieces(model: Model, pieces: Pieces, states: Floats, held: Collection[str]) -> FreeRunFit | None:
    try:
        return fit_pieces(model, pieces, states, held, FEW)
    except DivergenceError:
        return None


def _given(entry: ModelTerm) -> dict[str, float | None]:
    """Shape parameters of a term that are known."""
    return {key: value for key, value in entry.values.items() if "." in key and value is not None}
