"""Fitting a system in free run that is chaotic, or from starting values that are far off."""

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.model import Model
from study.output_error import FreeRunFit, fit_free_run
from study.pieces import Pieces, even_restarts, needed_restarts
from study.record import Record

Floats = NDArray[np.float64]
ROUNDS = 4  # times that a fit and the repair of its initial states take turns
DEVIATIONS = 3.0  # by how many standard deviations the misfit may exceed what fewer unknowns explain
FEWEST = 4  # pieces, at least: two are not worth doubling


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

    The record is cut into pieces of a few periods, each from an initial state of its own: no error grows
    far within them, and the search finds its way from poorer starting values. If the fitted system needs no
    cuts, as most do, the whole record is fitted from there in one free run. Otherwise the pieces are
    doubled for as long as the misfit grows by no more than the initial states explain that are given up.

    Parameters, result and errors are those of :func:`study.output_error.fit_free_run`; ``initial`` of the
    result has one row a piece.
    """
    whole = span or (0, len(record))
    pieces = Pieces(record, response, whole, even_restarts(record, response, whole), steps_per_sample)
    begun = model.with_values(dict(start or {}))
    found, pieces = _settled(begun, pieces, pieces.first_states(begun), held, max_iterations)
    states = np.atleast_2d(found.initial)
    if not needed_restarts(found.model, record, states, whole, pieces.restarts, steps_per_sample):
        return fit_free_run(
            found.model, record, held=held, response=response, steps_per_sample=steps_per_sample,
            span=whole, max_iterations=max_iterations,
        )  # fmt: skip
    while len(states) >= FEWEST:
        longer = replace(pieces, restarts=pieces.restarts[1::2])
        trial, longer = _settled(found.model, longer, states[::2], held, max_iterations)
        if not _as_good(trial, found, len(states) - len(longer.restarts) - 1):
            break
        found, pieces, states = trial, longer, np.atleast_2d(trial.initial)
    return found


def _settled(
    model: Model, pieces: Pieces, states: Floats, held: Collection[str], max_iterations: int
) -> tuple[FreeRunFit, Pieces]:
    """Fit, put pieces right that ended in a motion of their own, and fit again until there are none."""
    found = _fit(model, pieces, states, held, max_iterations)
    for _ in range(ROUNDS - 1):
        if not pieces.restarts:
            break
        states = np.atleast_2d(found.initial)
        repaired = pieces.joined(found.model, states)
        if np.array_equal(repaired, states):
            break
        again = _fit(found.model, pieces, repaired, held, max_iterations)
        if again.rms >= found.rms:
            break
        found = again
    return found, pieces


def _fit(model: Model, pieces: Pieces, states: Floats, held: Collection[str], max_iterations: int) -> FreeRunFit:
    return fit_free_run(
        model, pieces.record, held=held, response=pieces.response, steps_per_sample=pieces.steps_per_sample,
        span=pieces.span, restarts=pieces.restarts, max_iterations=max_iterations, initial=states,
    )  # fmt: skip


def _as_good(trial: FreeRunFit, found: FreeRunFit, fewer: int) -> bool:
    """Whether the misfit of a fit with fewer initial states is what their number leads one to expect."""
    unknowns = len(found.keys) + np.size(found.initial)
    cost, before = (float(np.sum(fit.residual**2)) for fit in (trial, found))
    variance = before / max(len(found.residual) - unknowns, 1)
    given_up = fewer * np.atleast_2d(found.initial).shape[1]
    return cost - before < variance * (given_up + DEVIATIONS * np.sqrt(2.0 * given_up))
