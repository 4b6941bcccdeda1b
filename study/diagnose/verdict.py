"""The whole diagnosis: fit, try every candidate, and say what the record bears - no less, no more."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study import fitting, noise_floor
from study.diagnose import candidates, nature, search
from study.diagnose.candidates import Trial
from study.diagnose.ranking import Ranked, rank
from study.diagnose.search import Baseline
from study.fitting import Plan
from study.free_run import prepare
from study.model import Model
from study.noise_floor import Floor
from study.output_error import FreeRunFit
from study.record import Record
from study.terms import Term

Floats = NDArray[np.float64]
MISSING, NOTHING, UNKNOWN = "missing_effect", "nothing_missing", "unknown_effect"
LEVEL = 0.01  # of the p value, all candidates accounted for
SMALLEST_SHARE = 0.01  # of the held-out residual: what a candidate must explain to be worth a term
SIGNIFICANT = 5.0  # standard errors by which structure must stand above the noise floor
NEGLIGIBLE = 2e-3  # of the response: structure below this is at the resolution of integration and calibration
LEFT = 0.10  # of the first structure: what may be left for a candidate to count as the whole explanation
STEADY = 0.25  # relative change of a coefficient with frequency or amplitude that a true term may show
PAIRED = 5  # the best so many candidates are tried together with each other


@dataclass(frozen=True)
class Diagnosis:
    """What is missing.

    Attributes
    ----------
    verdict : str
        ``missing_effect``, ``nothing_missing`` or ``unknown_effect``.
    found : FreeRunFit
        The model as it was given, fitted.
    residual : array, shape (samples to judge,)
        Its held-out residual.
    response_error : float
        Its rms over that of the response.
    floor : Floor
        Noise floor and structure of the held-out residual.
    noise : float
        Noise floor over the rms of the response.
    candidates : tuple of Ranked
        Best first.
    left : float
        Share of the structure that remains after the best explanation.
    pair : tuple of str
        Two effects that explain together what none does alone; empty otherwise.
    families : dict
        For an unknown effect: held-out share that functions of displacement, velocity, ... explain.
    """

    verdict: str
    found: FreeRunFit
    residual: Floats
    response_error: float
    floor: Floor
    noise: float
    candidates: tuple[Ranked, ...]
    left: float
    pair: tuple[str, ...]
    families: dict[str, float]


def diagnose(
    model: Model,
    record: Record,
    how: Plan,
    *,
    held: tuple[str, ...] | None = None,
    extra: Sequence[Term] = (),
    without: Sequence[str] = (),
    progress: Callable[[int], None] | None = None,
) -> Diagnosis:
    """Find the effect that a model lacks.

    Parameters
    ----------
    model : Model
        The equation believed in; given values are held, the rest is fitted.
    record : Record
        Force and response.
    how : Plan
        What is fitted and what is judged.
    held : tuple of str, optional
        Keys that keep their value; all that the model gives, if left out.
    extra : sequence of Term
        The user's own candidates.
    without : sequence of str
        Terms of the library to leave out.
    progress : callable, optional
        Called with the number of candidates done.

    Raises
    ------
    StudyError
        If the model cannot be fitted to the record.
    """
    held = fitting.held_keys(model) if held is None else held
    found = fitting.fit(model, record, how, held)
    residual = fitting.held_out_residual(found, record, how)
    base = search.baseline(found, record, how)
    terms = candidates.candidate_terms(base, extra, without)
    trials = candidates.try_all(terms, base, record, how, held, progress)
    rows = rank(trials, residual, record, how)
    size = float(np.std(record[how.response][how.judge[0] : how.judge[1]]))
    floor = _floor([residual, *(r.residual for r in rows[:3])], record.dt)
    real = _structure(residual, floor, size, record.dt)
    verdict, left, pair = _decide(rows, trials, residual, floor, size, base, record, how, held)
    families = _families(base, record, how) if verdict == UNKNOWN else {}
    return Diagnosis(
        verdict, found, residual, float(np.sqrt(np.mean(residual**2))) / size, real,
        floor / size, tuple(rows), left, pair, families,
    )  # fmt: skip


def _floor(residuals: Sequence[Floats], dt: float) -> float:
    """The lowest noise floor that any of the fits shows."""
    return min(noise_floor.floor(r, dt).noise for r in residuals)


def _structure(residual: Floats, noise: float, size: float, dt: float) -> Floor:
    """Noise floor and excess of a residual; what is negligible against the response is no excess."""
    found = noise_floor.floor(residual, dt)
    del noise
    if found.excess < (NEGLIGIBLE * size) ** 2:
        return Floor(found.noise, 0.0, max(found.excess_error, np.finfo(float).tiny))
    return found


def _decide(
    rows: list[Ranked],
    trials: Sequence[Trial],
    residual: Floats,
    noise: float,
    size: float,
    base: Baseline,
    record: Record,
    how: Plan,
    held: tuple[str, ...],
) -> tuple[str, float, tuple[str, ...]]:
    before = _structure(residual, noise, size, record.dt)
    credible = [r for r in rows if _credible(r)]
    if not credible:
        return (UNKNOWN if before.significance > SIGNIFICANT else NOTHING), 1.0, ()
    left = _left(credible[0].residual, before, noise, size, record.dt)
    if left <= LEFT:
        return MISSING, left, ()
    best, partner = _best_pair(rows, trials, base, record, how, held)
    if best is not None:
        together = _left(best.residual, before, noise, size, record.dt)
        if together <= LEFT * max(left, LEFT) or together <= 0.3 * LEFT:
            return MISSING, together, partner
    if credible[0].unsteadiness <= STEADY:
        return MISSING, left, ()
    return UNKNOWN, left, ()


def _credible(row: Ranked) -> bool:
    return row.p_value < LEVEL and row.gain.explained > SMALLEST_SHARE


def _left(residual: Floats, before: Floor, noise: float, size: float, dt: float) -> float:
    """Share of the first structure that a residual still shows, if it shows any beyond doubt."""
    after = _structure(residual, noise, size, dt)
    if after.significance < SIGNIFICANT or before.excess <= 0.0:
        return 0.0
    return after.excess / before.excess


def _best_pair(
    rows: list[Ranked], trials: Sequence[Trial], base: Baseline, record: Record, how: Plan, held: tuple[str, ...]
) -> tuple[Trial | None, tuple[str, ...]]:
    """The best second candidate beside each of the first few; puts the pair's stronger member first in ``rows``."""
    best: Trial | None = None
    names: tuple[str, ...] = ()
    terms = [t.term for t in trials]
    for row in rows[:PAIRED]:
        again = search.baseline(row.found, record, how)
        left = [t for t in terms if t.name != row.name]
        for trial in candidates.try_all(left, again, record, how, held):
            if best is None or float(np.sum(trial.residual**2)) < float(np.sum(best.residual**2)):
                best, names = trial, (row.name, trial.term.name)
    del base
    return best, names


def _families(base: Baseline, record: Record, how: Plan) -> dict[str, float]:
    run = prepare(
        base.found.model, record, response="velocity", steps_per_sample=how.steps_per_sample, span=how.fit
    )  # fmt: skip
    velocity, _ = run.respond({}, base.found.initial)
    return nature.explained_by(base, velocity, record.dt)
