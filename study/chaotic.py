"""Fitting a system in free run that is chaotic, or from starting values that are far off."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.errors import DivergenceError
from study.free_run import prepare
from study.model import Model
from study.output_error import FreeRunFit, fit_free_run
from study.pieces import Pieces, even_restarts, needed_restarts
from study.record import MOTIONS, Record

Floats = NDArray[np.float64]
TIES = (0.3, 1.0, 3.0, 10.0)  # ever tighter, see ``fit_free_run``: each step is small enough to find its way
TIGHT = 30.0  # tied so, pieces know of each other all that the noise lets them
TRIALS, FIRMER = 8, 30  # free runs at each step of the way, and in the last two
GLANCE = 10  # free runs after which a fit of a whole record that has lost the motion is given up
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
    cuts, as most do, the whole record is fitted from there in one free run. Otherwise the pieces are tied
    to one another ever more tightly, until they are one motion that stays beside the measured one (multiple
    shooting; H. G. Bock, 1983). That is done twice: the first time poor coefficients bend some pieces into
    motions of their own; with good ones, held for a while, they begin anew.

    Parameters, result and errors are those of :func:`study.output_error.fit_free_run`; ``initial`` of the
    result has one row a piece.
    """
    whole = span or (0, len(record))
    pieces = Pieces(record, response, whole, even_restarts(record, response, whole), steps_per_sample)
    begun = model.with_values(dict(start or {}))
    loose = _fit(begun, pieces, pieces.first_states(begun), held, 0.0, max_iterations)
    states = np.atleast_2d(loose.initial)
    if not needed_restarts(loose.model, record, states, whole, pieces.restarts, steps_per_sample):
        return fit_free_run(
            loose.model, record, held=held, response=response, steps_per_sample=steps_per_sample,
            span=whole, max_iterations=max_iterations,
        )  # fmt: skip
    near = _tightened(begun, pieces, states, held, TIES)
    again = _tightened(near.model, pieces, pieces.first_states(near.model), tuple(near.model.values), TIES)
    firm = _fit(again.model, pieces, again.initial, held, TIES[-1], FIRMER)
    if not _as_good(firm, loose):
        return loose
    tight = _fit(firm.model, pieces, firm.initial, held, TIGHT, FIRMER)
    # The tighter the ties, the narrower the side valleys in which a search may end; the curvature of one says
    # nothing of the others. The firm fit's covariance covers what the tight one's values scatter by.
    return replace(tight, covariance=firm.covariance) if _as_good(tight, loose) else firm


def fit_record(
    model: Model,
    record: Record,
    *,
    start: Mapping[str, float] | None = None,
    held: Collection[str] = (),
    response: str = "displacement",
    steps_per_sample: int = 4,
    max_iterations: int = 60,
) -> FreeRunFit:
    """Fit a model to a whole record: in one free run where that holds, in pieces where it does not.

    One free run is believed if the fit converges, leaves no part of the motion (a residual that is large and
    smooth), and the fitted system does not magnify a disturbance tenfold anywhere on its way
    (``study.pieces.needed_restarts``, from the exact sensitivities). A system that does loses the record
    however true the model, and its sum of squares is full of side valleys; in pieces it takes half the steps,
    which are many enough for their length. Parameters and result are those of
    :func:`study.output_error.fit_free_run`.

    Raises
    ------
    DivergenceError
        If the model diverges within a period of its start.
    StudyError
        As :func:`study.output_error.fit_free_run`.
    """
    try:
        found = fit_free_run(
            model, record, start=start, held=held, response=response, steps_per_sample=steps_per_sample,
            max_iterations=min(GLANCE, max_iterations),
        )  # fmt: skip
        if not found.converged and max_iterations > GLANCE and not _astray(found, record[response]):
            found = fit_free_run(
                found.model, record, held=held, response=response, steps_per_sample=steps_per_sample,
                max_iterations=max_iterations - GLANCE, initial=found.initial,
            )  # fmt: skip
        if found.converged and not (
            _astray(found, record[response]) or _magnifies(found, record, response, steps_per_sample)
        ):
            return found
    except DivergenceError:
        pass
    return fit_in_pieces(
        model, record, start=start, held=held, response=response, steps_per_sample=max(steps_per_sample // 2, 1),
        max_iterations=max_iterations,
    )  # fmt: skip


def _astray(found: FreeRunFit, measured: Floats) -> bool:
    """Whether a fit ended in a side valley: what it leaves is a good part of the response, and looks like motion."""
    if found.rms < POOR * float(np.std(measured)):
        return False
    neighbours = 1.0 - float(np.mean(np.diff(found.residual) ** 2)) / (2.0 * found.rms**2)
    return neighbours > SMOOTH


def _magnifies(found: FreeRunFit, record: Record, response: str, steps: int) -> bool:
    """Whether disturbances of a fitted free run grow, as those of a chaotic one do."""
    whole = (0, len(record))
    restarts = even_restarts(record, response, whole)
    states = np.zeros((len(restarts) + 1, len(found.initial)))
    for i, motion in enumerate(MOTIONS[:2]):
        run = prepare(found.model, record, response=motion, steps_per_sample=steps)
        states[:, i] = run.respond({}, found.initial)[0][[0, *restarts]]
    return bool(needed_restarts(found.model, record, states, whole, restarts, steps))


def _tightened(
    model: Model, pieces: Pieces, states: Floats, held: Collection[str], ties: Sequence[float]
) -> FreeRunFit:  # fmt: skip
    """The fit with the last of these ties, by way of the ones before."""
    found = _fit(model, pieces, states, held, ties[0], TRIALS)
    for tie in ties[1:]:
        found = _fit(found.model, pieces, found.initial, held, tie, TRIALS)
    return found


def _fit(
    model: Model, pieces: Pieces, states: Floats, held: Collection[str], tie: float, max_iterations: int
) -> FreeRunFit:  # fmt: skip
    return fit_free_run(
        model, pieces.record, held=held, response=pieces.response, steps_per_sample=pieces.steps_per_sample,
        span=pieces.span, restarts=pieces.restarts, max_iterations=max_iterations, initial=states, tie=tie,
    )  # fmt: skip


def _as_good(tied: FreeRunFit, loose: FreeRunFit) -> bool:
    """Whether the misfit of tied pieces is what the loss of their freedom leads one to expect."""
    given_up = np.size(loose.initial)
    cost, before = (float(np.sum(fit.residual**2)) for fit in (tied, loose))
    variance = before / max(len(loose.residual) - len(loose.keys) - given_up, 1)
    return cost - before < variance * (given_up + DEVIATIONS * np.sqrt(2.0 * given_up))
