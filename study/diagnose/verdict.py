"""The whole diagnosis: try every candidate, and say what the record bears - no less, no more."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from study.compare import dependence
from study.compare.comparison import Comparison
from study.compare.dependence import FamilyGain
from study.compare.prediction import Prediction
from study.diagnose import candidates, pairs
from study.diagnose.candidates import Progress, with_best_settled
from study.diagnose.constancy import changes, curves, wavers
from study.diagnose.credibility import credible
from study.diagnose.held_out import HeldOut, alike, evidence, held_out_of
from study.diagnose.pairs import Pair
from study.diagnose.ranked import Ranked
from study.diagnose.ranking import rank
from study.equations.linear_part import Modes, modes_of
from study.equations.model import free
from study.equations.possible_effects import candidate_entries
from study.equations.terms import Term
from study.identify.time_domain import shape_search
from study.identify.time_domain.fit_model import rough_steps
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.motion_start import has_lost_the_motion
from study.identify.time_domain.part_fit import fit_part, linearise, uncertainty
from study.identify.time_domain.shape_search import Baseline
from study.records.prepared import FORCE, Prepared
from study.support import statistics
from study.support.errors import DivergenceError
from study.support.thresholds import ALPHA, ENOUGH, GOOD, TOLERANCE, UNSTEADY

MISSING, NOTHING, UNKNOWN = "missing_effect", "nothing_missing", "unknown_effect"
SHORT, LONG = 2048, 16384  # samples: it uses half of the fitting part if that is more, within these limits
MOST = 0.5  # of what is unexplained: what an effect of a component, or of a decay, explains that is named first
PAIRED = 3  # the best so many candidates are tried together with every other


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What is missing."""

    verdict: str  # ``missing_effect``, ``nothing_missing`` or ``unknown_effect``
    comparison: Comparison  # the model as it was given, with its fit, its error and its noise floor
    candidates: tuple[Ranked, ...]  # best first
    asked: int  # effects at places
    left: float  # rms of what remains above the noise beside the best explanation, over the rms response
    pair: tuple[str, ...]  # two effects that explain together what none does alone; empty otherwise
    families: tuple[FamilyGain, ...]  # for an unknown effect: what functions of displacement, ... explain, best first

    @cached_property
    def modes_after(self) -> Modes | None:
        """Modes with the first candidate, with their standard errors; None where no effect is named."""
        if self.verdict != MISSING:
            return None
        fit, prepared = self.candidates[0].fit, self.comparison.prepared
        covariance = uncertainty(fit, prepared, linearise(fit, prepared))
        return modes_of(fit.model, fit.keys, covariance[: len(fit.keys), : len(fit.keys)])


def diagnose(
    comparison: Comparison,
    *,
    extra: Sequence[Term] = (),
    without: Sequence[str] = (),
    progress: Progress | None = None,
) -> Diagnosis:
    """Find the effect that a model lacks, and its place.

    What the comparison's model held is held, the rest is fitted. ``extra`` are the user's own candidates, ``without``
    terms of the library to leave out; ``progress`` is called after each candidate that was fitted.
    """
    base = search_base(comparison)
    entries = candidate_entries(comparison.fit.model, extra, without, comparison.prepared.record.rotations)
    tried = candidates.try_all(entries, base, progress)
    asked = len(entries) if base.several else len(tried)
    rows = rank(with_best_settled(tried, comparison.prepared), comparison, asked)
    verdict, rows, left, pair = _decide(rows, base, comparison, asked)
    families = dependence.families(dependence.unexplained(base)) if verdict == UNKNOWN else []
    return Diagnosis(verdict, comparison, tuple(rows), asked, left, pair, tuple(families))


def search_part(prepared: Prepared) -> Prepared:
    """The record with as much to fit as a search uses: enough to tell candidates apart, and sooner done.

    More where that is a quiet stretch, such as the end of a sweep, which shows less than half of the motion's size.
    """
    if prepared.record.stretches:  # what is loud and what is quiet lie in stretches of their own
        return prepared.shortened(LONG)
    first, last = prepared.plan.fit
    wanted = max((last - first) // 2, prepared.samples_in(shape_search.PERIODS))
    look = prepared.shortened(int(np.clip(wanted, SHORT, LONG)))
    return look if look.spread > 0.5 * prepared.spread else prepared.shortened(LONG)


def search_base(comparison: Comparison) -> Baseline:
    """The fitted model as candidates are tried beside it: on no more samples, in no more steps, than a search takes."""
    return _search_base(comparison.fit, search_part(comparison.prepared))


def _search_base(fit: FreeRunFit, look: Prepared) -> Baseline:
    try:
        again = fit_part(fit.model, look, fit.held, steps=rough_steps(fit.model, look, {}))
    except DivergenceError:  # stiff: nothing runs with fewer steps
        again = fit_part(fit.model, look, fit.held, steps=fit.steps_per_sample)
    return shape_search.baseline(again, look)


def _decide(
    rows: list[Ranked], base: Baseline, comparison: Comparison, asked: int
) -> tuple[str, list[Ranked], float, tuple[str, ...]]:
    """Verdict, candidates in their final order, what is left, and the pair that explains it if none does alone."""
    prediction = comparison.prediction
    own = held_out_of(comparison)
    trusted = [r for r in rows if believed(r, prediction, own)]
    if not trusted:
        left = _left(comparison.fit, prediction)
        # what is left along another motion tells nothing
        lost = has_lost_the_motion(comparison.fit, comparison.prepared)
        return (UNKNOWN if left > TOLERANCE or lost else NOTHING), rows, left, ()
    first = trusted[0]
    left = _left(first.fit, first.prediction)
    rows = [first] + [r for r in rows if r is not first]
    if (first.gain.explained >= ENOUGH or left <= GOOD) and not first.wanders(asked):
        return MISSING, rows, left, ()
    slight = first.response_error <= GOOD  # two effects that explain little alone explain little together
    pair = None if slight or base.several else _explaining_pair(rows, base)
    if pair is None:
        return MISSING if _stands_out(first, comparison.prepared) else UNKNOWN, rows, left, ()
    first = next(r for r in rows if r.name == pair.names[0])
    return MISSING, [first] + [r for r in rows if r is not first], _left(pair.fit, pair.prediction), pair.names


def believed(row: Ranked, prediction: Prediction, own: HeldOut) -> bool:
    """Whether an effect is believed, by all samples that neither the model with it nor that without was fitted to.

    Where these are both parts of a decay, the error of the judging part, which every table shows, falls as well.
    """
    without, with_it = evidence(prediction, own), evidence(row.prediction, row.held_out)
    if not alike(without, with_it):
        return credible(prediction, row.prediction, row.interval, row.p_value)
    falls = row.response_error < prediction.error
    return falls and credible(without, with_it, row.interval, row.p_value)


def _stands_out(first: Ranked, prepared: Prepared) -> bool:
    """Whether an effect of a component or of a decaying motion explains most of what is missing.

    Measured ones seldom lack one effect alone: what is left beside the first is asked for when it is added.
    """
    alone = prepared.response == FORCE or prepared.free
    return alone and first.gain.explained > MOST and not first.unphysical


def _explaining_pair(rows: list[Ranked], base: Baseline) -> Pair | None:
    """Two effects that explain together what the first does not alone, or None.

    First the best of those that the reverse system puts first; then the first candidates with every other.
    """
    pair = pairs.best_pair(rows, base)
    if pair is not None and _explains(pair, rows, base.prepared):
        return pair
    for row in rows[:PAIRED]:
        others = [free(r.term, r.entry.place) for r in rows if r.name != row.name]
        seconds = candidates.try_all(others, _search_base(row.fit, base.prepared))
        second = min(seconds, key=lambda c: float(c.prediction.residual @ c.prediction.residual), default=None)
        if second is not None:
            pair = Pair((row.name, second.name), second.fit, second.prediction)
            if _explains(pair, rows, base.prepared):
                return pair
    return None


def _explains(pair: Pair, rows: list[Ranked], prepared: Prepared) -> bool:
    """Whether a pair leaves nothing but noise, does more than the first alone, and neither coefficient moves."""
    prediction = pair.prediction
    more = statistics.gain(rows[0].residual, prediction.residual).p_value * len(rows) < ALPHA
    if not more or _left(pair.fit, prediction) > GOOD:
        return False
    jacobian = linearise(pair.fit, prepared)
    followed = [curves(pair.fit, r.entry, prepared.dt, jacobian) for r in rows if r.name in pair.names]
    if prediction.error <= GOOD:
        return all(changes(*both) <= UNSTEADY for both in followed)
    return not any(wavers(steadiness, len(rows)) for _, steadiness in followed)


def _left(fit: FreeRunFit, prediction: Prediction) -> float:
    """Rms over that of the response which shapes of the motion, of its past and of time explain of a residual.

    Noise may have any colour; what physics leaves depends on the motion.
    """
    nameless = 0.1 * ALPHA  # what no candidate explains is believed less easily than what one does
    left = dependence.left_by(fit, prediction.prepared)
    return prediction.error * float(np.sqrt(dependence.significant_share(left, nameless)))
