"""The whole diagnosis: fit, try every candidate, and say what the record bears - no less, no more."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.diagnose import candidates, dependence, pairs
from study.diagnose.pairs import Pair
from study.diagnose.ranking import UNSTEADY, Ranked, changes, curves, rank, wavers
from study.equations.model import Model
from study.equations.terms import Term
from study.identify.time_domain import held_out, shape_search
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.shape_search import Baseline
from study.records import noise_floor
from study.records.plan import Plan, shortened
from study.records.record import Record
from study.support import statistics
from study.support.errors import DivergenceError

Floats = NDArray[np.float64]
MISSING, NOTHING, UNKNOWN = "missing_effect", "nothing_missing", "unknown_effect"
LEVEL = 0.01  # of the p value, all candidates accounted for
SIGNIFICANT = 5.0  # standard errors by which structure must stand above the noise floor
SMALLEST_GAIN = 1e-3  # of the rms response: what a candidate must explain; less is the resolution of integration
NEGLIGIBLE = 2e-3  # of the rms response: structure below this is no evidence that something is missing
LEFT = 0.0075  # of the rms response: structure that may be left beside a candidate which counts as the explanation
FORGIVEN = 0.1  # of the unexplained power: what explains less of a good model's must have a coefficient that stays
ENOUGH = 0.99  # of the unexplained power: what explains so much is missing, whatever is missing besides
LACK = 0.03  # held-out share of a residual that general shapes of the motion must explain to be more than chance
CHANCE = 1e-3  # ... and of the p value of a single one of these shapes, all of them accounted for
SEARCHED = 16384  # samples of the fitting part that the search uses
REFITTED = 6  # ... after which the best so many are fitted on the whole of it
PAIRED = 1  # the best so many candidates are tried together with every other


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
        Its held-out residual; the response itself where its free run does not stay finite.
    response_error : float
        Its rms over that of the response.
    noise : float
        Noise floor over the rms of the response.
    candidates : tuple of Ranked
        Best first.
    left : float
        Rms of the structure that remains beside the best explanation, over the rms response.
    pair : tuple of str
        Two effects that explain together what none does alone; empty otherwise.
    families : dict
        For an unknown effect: held-out share that functions of displacement, velocity, ... explain.
    diverged : bool
        Whether the free run of the model as it was given does not stay finite.
    """

    verdict: str
    found: FreeRunFit
    residual: Floats
    response_error: float
    noise: float
    candidates: tuple[Ranked, ...]
    left: float
    pair: tuple[str, ...]
    families: dict[str, float]
    diverged: bool = False


def diagnose(
    model: Model,
    record: Record,
    how: Plan,
    *,
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
    held = model.held_keys
    found, finer = fit_model(model, record, how)
    if finer != how:  # the candidates are told apart at the plan's own steps, and so is the model without them
        try:
            found = held_out.fit(found.model, record, how, held, found.model.numbers())
        except DivergenceError:  # stiff: nothing runs with fewer steps
            how = finer
    residual, diverged = _held_out(found, record, how)
    short = shortened(how, SEARCHED)
    base = shape_search.baseline(_refitted(found, record, how, short, held), record, short)
    terms = candidates.candidate_terms(base, extra, without)
    trials = candidates.try_all(terms, base, record, short, held, progress)
    if short != how:
        trials.sort(key=lambda t: float(t.residual @ t.residual))
        best = [candidates.refitted(t, record, how, held) for t in trials[:REFITTED]]
        trials = best + trials[REFITTED:]
    rows = rank(trials, residual, record, how)
    size = float(np.std(record[how.response][how.judge[0] : how.judge[1]]))
    noise = _floor([residual, *(r.residual for r in rows[:3])], record.dt)
    verdict, rows, left, pair = _decide(rows, base, residual, size, record, how, held)
    families = (
        dependence.explained_by(dependence.leftover(base.found, base, record, short)) if verdict == UNKNOWN else {}
    )
    return Diagnosis(
        verdict, found, residual, float(np.sqrt(np.mean(residual**2))) / size,
        noise / size, tuple(rows), left, pair, families, diverged,
    )  # fmt: skip


def _held_out(found: FreeRunFit, record: Record, how: Plan) -> tuple[Floats, bool]:
    """Held-out residual; all of the response where the free run does not stay finite: then it predicts nothing."""
    try:
        return held_out.held_out_residual(found, record, how), False
    except DivergenceError:
        measured = record[how.response][slice(*how.judge)]
        return measured - float(np.mean(measured)), True


def _refitted(found: FreeRunFit, record: Record, how: Plan, short: Plan, held: tuple[str, ...]) -> FreeRunFit:
    """The fit on the stretch that the search uses."""
    return found if short == how else held_out.fit(found.model, record, short, held, found.model.numbers())


def _floor(residuals: Sequence[Floats], dt: float) -> float:
    """The lowest noise floor that any of the fits shows."""
    return min(noise_floor.floor(r, dt).noise for r in residuals)


def _decide(
    rows: list[Ranked], base: Baseline, residual: Floats, size: float, record: Record, how: Plan, held: tuple[str, ...]
) -> tuple[str, list[Ranked], float, tuple[str, ...]]:
    """Verdict, candidates in their final order, what is left, and the pair that explains it if none does alone."""
    credible = [r for r in rows if _credible(r, residual, size)]
    if not credible:
        error = float(np.sqrt(np.mean(residual**2))) / size
        left = max(_left(residual, size, record.dt), _lack(base.found, error, record, how))
        return (UNKNOWN if left > NEGLIGIBLE else NOTHING), rows, left, ()
    first = credible[0]
    left = max(_left(first.residual, size, record.dt), _lack(first.found, first.response_error, record, how))
    if first.gain.explained >= ENOUGH or (left <= LEFT and _steady(first)):
        return MISSING, rows, left, ()
    slight = first.response_error <= LEFT  # two effects that explain little alone explain little together
    pair = None if slight else _explaining_pair(rows, base, size, record, how, held)
    if pair is None:
        return UNKNOWN, rows, left, ()
    first = next(r for r in rows if r.name == pair.names[0])
    return MISSING, [first] + [r for r in rows if r is not first], _left(pair.residual, size, record.dt), pair.names


def _steady(row: Ranked) -> bool:
    """Whether the coefficient stays where a true term's would.

    Where the model is as good as models are, its own faults move the coefficient of what is added to it: that is
    forgiven to what explains a good share, and to nothing else.
    """
    if row.response_error > LEFT:
        return not wavers(row.steadiness)
    return row.gain.explained >= FORGIVEN or row.unsteadiness <= UNSTEADY


def _credible(row: Ranked, residual: Floats, size: float) -> bool:
    gained = max(float(np.mean(residual**2) - np.mean(row.residual**2)), 0.0)
    return row.p_value < LEVEL and gained > (SMALLEST_GAIN * size) ** 2


def _left(residual: Floats, size: float, dt: float) -> float:
    """Rms of the structure in a residual over the rms response; zero where noise alone would show as much."""
    found = noise_floor.floor(residual, dt)
    return float(np.sqrt(found.excess)) / size if found.significance > SIGNIFICANT else 0.0


def _explaining_pair(
    rows: list[Ranked], base: Baseline, size: float, record: Record, how: Plan, held: tuple[str, ...]
) -> Pair | None:
    """Two effects that explain together what the first does not alone, or None.

    First the best of those that the reverse system puts first; then the first candidates with every other.
    """
    short = shortened(how, SEARCHED)
    found = pairs.best_pair(rows, base, record, short, held)
    if found is not None and _explains(found, rows, size, record, short):
        return found
    for row in rows[:PAIRED]:
        beside = shape_search.baseline(_refitted(row.found, record, how, short, held), record, short)
        others = [r.term for r in rows if r.name != row.name]
        seconds = candidates.try_all(others, beside, record, short, held)
        second = min(seconds, key=lambda t: float(t.residual @ t.residual), default=None)
        if second is not None:
            found = Pair((row.name, second.term.name), second.found, second.residual)
            if _explains(found, rows, size, record, short):
                return found
    return None


def _explains(pair: Pair, rows: list[Ranked], size: float, record: Record, how: Plan) -> bool:
    """Whether a pair leaves no structure, does more than the first alone, and neither coefficient moves."""
    more = statistics.gain(rows[0].residual, pair.residual).p_value * len(rows) < LEVEL
    if not more or _left(pair.residual, size, record.dt) > LEFT:
        return False
    error = float(np.sqrt(np.mean(pair.residual**2))) / size
    if _lack(pair.found, error, record, how) > LEFT:
        return False
    terms = [r.term for r in rows if r.name in pair.names]
    followed = [curves(pair.found, term, record, how) for term in terms]
    if error <= LEFT:
        return all(changes(*both) <= UNSTEADY for both in followed)
    return not any(wavers(steadiness) for _, steadiness in followed)


def _lack(found: FreeRunFit, error: float, record: Record, how: Plan) -> float:
    """Rms over that of the response which general shapes of the motion and of its past explain of a residual.

    Structure that is as broad as noise is not seen in a spectrum; it still depends on the motion.
    """
    short = shortened(how, len(found.residual))
    left = dependence.leftover(found, shape_search.baseline(found, record, short), record, short)
    shares = dependence.explained_by(left)
    share = max(share for name, share in shares.items() if name != "time")
    return error * float(np.sqrt(max(share if share > LACK else 0.0, dependence.significant(left, CHANCE))))
