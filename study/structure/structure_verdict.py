"""The whole diagnosis of a structure: which effect is missing, and where it sits."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from study.compare.comparison import Comparison, compare
from study.compare.leftover_by_place import FamilyGain, family_gains
from study.compare.prediction import Prediction
from study.diagnose.credibility import credible
from study.diagnose.verdict import MISSING, MOST, NOTHING, UNKNOWN
from study.equations.linear_part import Modes, modes_of
from study.equations.model import ModelTerm
from study.equations.term import Term
from study.identify.time_domain.part_fit import fit_part, linearise, uncertainty
from study.identify.time_domain.placed_search import PlacedBaseline, placed_baseline, with_placed_term
from study.identify.time_domain.weighted_fit import finished
from study.structure.placed_candidates import (
    candidate_entries,
    elsewhere,
    one_side,
    screened,
    try_placed,
    with_best_placed_settled,
    worth_fitting,
)
from study.structure.placed_ranking import PlacedRanked, rank_placed
from study.support.thresholds import ALPHA, ENOUGH, GOOD, TOLERANCE

SHORT, LONG = 2048, 8192  # samples: a search uses half of the fitting part, within these limits
NAMELESS = 0.1 * ALPHA  # what no candidate explains is believed less easily than what one does


@dataclass(frozen=True, eq=False)
class StructureDiagnosis:
    """What is missing from a structure."""

    verdict: str  # ``missing_effect``, ``nothing_missing`` or ``unknown_effect``
    comparison: Comparison  # the structure as it was given
    candidates: tuple[PlacedRanked, ...]  # best first
    asked: int  # effects times places
    left: float  # rms of what remains above the noise beside the best explanation, over the rms response
    families: tuple[FamilyGain, ...]  # for an unknown effect: what general shapes at each place explain, best first

    @cached_property
    def modes_after(self) -> Modes | None:
        """Modes with the first candidate, with their standard errors; None where no effect is named."""
        if self.verdict != MISSING:
            return None
        fit, prepared = self.candidates[0].fit, self.comparison.prepared
        covariance = uncertainty(fit, prepared, linearise(fit, prepared))
        return modes_of(fit.model, fit.keys, covariance[: len(fit.keys), : len(fit.keys)])


def diagnose_structure(
    comparison: Comparison,
    extra: Sequence[Term] = (),
    without: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
) -> StructureDiagnosis:
    """Find the effect that a structure lacks, and its place.

    ``extra`` are the user's own candidates, ``without`` terms of the library to leave out; ``progress`` is called with
    each candidate that was fitted.
    """
    base = placed_search_base(comparison)
    entries = candidate_entries(comparison.fit.model, extra, without)
    report: Callable[[str], None] = progress or (lambda _: None)
    ordered = screened(entries, base)
    tried = try_placed(worth_fitting(ordered), base, report)
    tried = one_side([*tried, *try_placed(elsewhere(tried, ordered), base, report)])
    settled_ones = with_best_placed_settled(tried, comparison.prepared)
    rows = rank_placed(settled_ones, comparison.fit, comparison.prediction, len(entries))
    return _decide(rows, comparison, len(entries))


def placed_search_base(comparison: Comparison) -> PlacedBaseline:
    """The fitted structure as candidates are tried beside it, on no more samples than a search takes."""
    prepared, fit = comparison.prepared, comparison.fit
    first, last = prepared.plan.fit
    loud_and_quiet = bool(prepared.record.stretches)
    wanted = LONG if loud_and_quiet else int(np.clip((last - first) // 2, SHORT, LONG))
    look = prepared.shortened(wanted)
    begins = fit.span == look.plan.fit if look.record.stretches else fit.first == look.plan.fit[0]
    initial = np.atleast_2d(fit.initial) if begins else None
    again = fit_part(fit.model, look, fit.held, steps=fit.steps_per_sample, initial=initial)
    return placed_baseline(again, look)


def added_term(comparison: Comparison, entry: ModelTerm) -> Comparison:
    """The comparison of the structure with a term more, fitted as a diagnosis fits that candidate.

    Raises
    ------
    StudyError
        If the structure with it has no finite motion.
    """
    base = placed_search_base(comparison)
    fit = with_placed_term(base.fit, entry, base.prepared, base)
    model = comparison.model.with_term(entry)
    return compare(model, comparison.prepared, fit=finished(fit, comparison.prepared))


def _decide(rows: list[PlacedRanked], comparison: Comparison, asked: int) -> StructureDiagnosis:
    prediction = comparison.prediction
    believed = [r for r in rows if credible(prediction, r.prediction, r.interval, r.p_value)]
    if not believed:
        families = comparison.leftovers
        left = _left(prediction, families)
        hopeless = prediction.error >= 1.0  # worse than to predict no motion at all, whatever it depends on
        verdict = UNKNOWN if hopeless or left > TOLERANCE else NOTHING
        return StructureDiagnosis(verdict, comparison, tuple(rows), asked, left, _ordered(families))
    first = believed[0]
    families = tuple(family_gains(first.fit, first.prediction))
    left = _left(first.prediction, families)
    rows = [first] + [r for r in rows if r is not first]
    enough = (first.gain.explained >= ENOUGH or left <= GOOD) and not first.wanders(asked)
    verdict = MISSING if enough or _stands_out(first) else UNKNOWN
    if verdict == UNKNOWN:
        families = comparison.leftovers
    return StructureDiagnosis(verdict, comparison, tuple(rows), asked, left, _ordered(families))


def _stands_out(first: PlacedRanked) -> bool:
    """Whether an effect explains most of what a decay's motion lacks, as for a single mass.

    Measured ones seldom lack one effect alone: what is left beside the first is asked for when it is added.
    """
    return bool(first.prediction.prepared.record.stretches) and first.gain.explained > MOST and not first.unphysical


def _left(prediction: Prediction, families: Sequence[FamilyGain]) -> float:
    """Rms over that of the response which general shapes explain of a residual, and not by chance.

    Of a free decay all that stands above the noise: where its run has lost the motion, shapes along it explain nothing.
    """
    found = [f.gain.explained for f in families if f.gain.p_value * len(families) < NAMELESS]
    left = prediction.error * float(np.sqrt(max((0.0, *found))))
    return max(left, prediction.above_noise) if prediction.prepared.free else left


def _ordered(families: Sequence[FamilyGain]) -> tuple[FamilyGain, ...]:
    return tuple(sorted(families, key=lambda f: -f.gain.explained))
