"""The whole diagnosis: try every candidate, and say what the record bears - no less, no more."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from study.compare import dependence
from study.compare.comparison import Comparison, compare
from study.compare.dependence import FamilyGain
from study.compare.prediction import Prediction
from study.compare.varying_coefficients import VaryingCoefficient, varying_coefficients
from study.diagnose import MISSING, NOTHING, PARTLY_KNOWN, SEVERAL, UNKNOWN, candidates, set_search, varying_candidates
from study.diagnose.candidates import FittedCandidate, Progress, with_best_settled
from study.diagnose.credibility import credible
from study.diagnose.held_out import HeldOut, alike, evidence, held_out_of
from study.diagnose.ranked import Ranked
from study.diagnose.ranking import rank
from study.diagnose.set_search import SetSearch, by_power, searched
from study.equations.linear_part import Modes, modes_of
from study.equations.model import ModelTerm
from study.equations.possible_effects import candidate_entries
from study.equations.terms import Term
from study.identify.time_domain import shape_search
from study.identify.time_domain.fit_model import rough_steps
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.motion_start import has_lost_the_motion, seen_everywhere
from study.identify.time_domain.part_fit import fit_part, run_and_slopes, uncertainty
from study.identify.time_domain.promised_changes import PromisedChanges, promised_changes
from study.identify.time_domain.shape_search import Baseline
from study.identify.time_domain.weighted_fit import finished
from study.records.prepared import FORCE, Prepared
from study.support import statistics, work
from study.support.errors import DivergenceError, StudyError
from study.support.thresholds import ALPHA, ENOUGH, GOOD, NEARLY, TOLERANCE, UNSTEADY, K

LONGEST_SEARCH = 16384  # samples: a search uses half of the fitting part if that is more than the least, up to so many
NAMED_FIRST = 0.5  # of what is unexplained: an effect of a component, or of a decay, that explains it is named first
RIVALS = 12  # sets near the best that are compared with it in every detail


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What is missing."""

    verdict: str  # ``missing_effect``, ``missing_effects``, ``partly_known``, ``nothing_missing`` or ``unknown_effect``
    comparison: Comparison  # the model as it was given, with its fit, its error and its noise floor
    candidates: tuple[Ranked, ...]  # single effects, best first
    asked: int  # effects at places
    left: float  # rms of what remains above the noise beside the best explanation, over the rms response
    sets: tuple[Ranked, ...]  # the answer, and all others that the record cannot tell from the best; empty without any
    families: tuple[FamilyGain, ...]  # what functions of displacement, ... explain of what has no name, best first
    ended: str = ""  # why and where a search did not come to its end by itself

    @property
    def answer(self) -> Ranked | None:
        """The effect or the set of effects that is missing, the one that is known in part included."""
        return self.sets[0] if self.verdict in (MISSING, SEVERAL, PARTLY_KNOWN) else None

    @property
    def misses_much(self) -> bool:
        """Whether far more than noise is left, and depends on nothing that the record shows."""
        return self.verdict == UNKNOWN and self.left <= TOLERANCE and _leaves_much(self.comparison.prediction)

    @property
    def changes(self) -> bool:
        """Whether a coefficient changes with what is named."""
        return self.answer is not None and any(entry.term.variation for entry in self.answer.entries)

    @cached_property
    def included(self) -> dict[str, int]:
        """In how many of the sets each effect is, the most frequent first."""
        names = [name for row in self.sets for name in row.names]
        return dict(sorted(((name, names.count(name)) for name in dict.fromkeys(names)), key=lambda item: -item[1]))

    @cached_property
    def alike(self) -> dict[str, tuple[str, ...]]:
        """For each effect of the answer those that may stand in its place for all that this record tells."""
        own = set[str]() if self.answer is None else set(self.answer.names)
        others = [set(row.names) for row in self.sets[1:] if len(row.names) == len(own)]
        return {
            name: tuple(sorted(next(iter(names - own)) for names in others if own - names == {name}))
            for name in (() if self.answer is None else self.answer.names)
        }

    @cached_property
    def varying(self) -> tuple[VaryingCoefficient, ...]:
        """Coefficients that vary with what is missing, or in the model as given where nothing is named."""
        if self.answer is None:
            return self.comparison.varying
        fit, prepared, count = self.answer.fit, self.comparison.prepared, len(self.answer.fit.keys)
        covariance = uncertainty(fit, prepared, *run_and_slopes(fit, prepared))
        return varying_coefficients(fit, covariance[:count, :count], prepared)

    @cached_property
    def modes_after(self) -> Modes | None:
        """Modes with what is missing, with their standard errors; None where no effect is named."""
        if self.answer is None:
            return None
        fit, prepared = self.answer.fit, self.comparison.prepared
        covariance = uncertainty(fit, prepared, *run_and_slopes(fit, prepared))
        return modes_of(fit.model, fit.keys, covariance[: len(fit.keys), : len(fit.keys)])


UNCHANGED = f"{work.ENDED}, before changes were asked for"
Otherwise = Callable[[Diagnosis], bool]  # whether what is left beside what is found has another reason than a change


def diagnose(
    comparison: Comparison,
    *,
    extra: Sequence[Term] = (),
    without: Sequence[str] = (),
    progress: Progress | None = None,
    otherwise: Otherwise | None = None,
) -> Diagnosis:
    """Find the effects that a model lacks, and their places.

    What the comparison's model held is held, the rest is fitted. ``extra`` are the user's own candidates, ``without``
    terms of the library to leave out; ``progress`` is called after each candidate that was fitted. Where ``otherwise``
    says of what is found without a change of a coefficient that what is left beside it has another reason, no change
    is asked for. Where all is done that may be, what is not yet asked is not asked any more, and that is said.
    """
    with work.limited_to(work.most_for(len(comparison.prepared.record))):
        return _diagnosed(comparison, extra, without, progress, otherwise)


def _diagnosed(
    comparison: Comparison, extra: Sequence[Term], without: Sequence[str], progress: Progress | None,
    otherwise: Otherwise | None,
) -> Diagnosis:  # fmt: skip
    """The same, counted."""
    base = search_base(comparison)
    entries = candidate_entries(comparison.fit.model, extra, without, comparison.prepared.record.rotations)
    own, elsewhere = comparison.fit.model.terms, 0
    tried = candidates.try_all(entries, base, progress)
    ended = f"{work.ENDED} at single effects" if work.is_done() else ""
    changes = promised_changes(comparison.fit, comparison.prepared, own)
    if changes is not None and not ended and varying_candidates.first_of_all(tried, changes, comparison):
        other = _changing(changes, comparison, base, tried, entries, progress)
        if other is not None and other.changes:
            return other  # else nothing that is named changes, and the record is judged as it was
        elsewhere = 0 if other is None else len(changes.shares)
        ended = UNCHANGED if other is None and work.is_done() else ""
    del changes  # and the record laid out anew: of a long one it takes as much as all that follows
    if (freed := _freed(comparison, base, tried)) is not None:
        return _diagnosed(freed, extra, without, progress, otherwise)
    found = _diagnosis(comparison, base, tried, entries, progress, elsewhere)
    if ended:
        return replace(found, ended=found.ended or ended)
    more = [] if work.is_done() else _where_none_explains_it(found, base, tried, entries, progress)
    if more:
        tried = [*tried, *more]
        found = _diagnosis(comparison, base, tried, entries, progress, elsewhere)
    if elsewhere or found.verdict == NOTHING or not (named := [*found.sets, *found.candidates][:1]):
        return found
    if named[0].prediction.above_noise <= TOLERANCE:
        return found
    cut_short = replace(found, ended=found.ended or UNCHANGED)
    if work.is_done():
        return cut_short
    # what changes may be the smaller part of what is missing, and seen beside the larger one alone
    changes = promised_changes(named[0].fit, comparison.prepared, own)
    if changes is None or not varying_candidates.explains_more(changes, named[0].names, progress):
        return found
    if otherwise is not None and otherwise(found):
        return found
    if work.is_done():
        return cut_short
    other = _changing(changes, comparison, base, tried, entries, progress, beside=True)
    if other is None:
        return cut_short if work.is_done() else found
    return other if other.changes else replace(found, ended=other.ended)


def _where_none_explains_it(
    found: Diagnosis, base: Baseline, tried: Sequence[FittedCandidate], entries: Sequence[ModelTerm],
    progress: Progress | None,
) -> list[FittedCandidate]:  # fmt: skip
    """The candidates that promised too little, fitted, if one of them leaves less than what was found; else none.

    What sensors see elsewhere promises little of an effect where none is.
    """
    best, comparison = next(iter([*found.sets, *found.candidates]), None), found.comparison
    lumped = base.several and comparison.model.modal is None
    unseen = lumped and not seen_everywhere(comparison.model, comparison.prepared)
    if best is None or not (unseen and _leaves_much(best.prediction)):
        return []
    more = candidates.those_not_tried(entries, tried, base, progress)
    return more if any(c.prediction.error < best.prediction.error and not c.unphysical for c in more) else []


def _changing(
    promised: PromisedChanges, comparison: Comparison, base: Baseline, tried: Sequence[FittedCandidate],
    entries: Sequence[ModelTerm], progress: Progress | None, *, beside: bool = False,
) -> Diagnosis | None:  # fmt: skip
    """The diagnosis with changes that are promised, ``beside`` other effects perhaps.

    None where no model follows, or all is done that may be before the changes themselves are asked for.
    """
    suspect = varying_candidates.suspect(promised, comparison)
    if suspect is None:
        return None
    as_it_was = suspect.comparison is comparison
    base = base if as_it_was else search_base(suspect.comparison)
    others = tried if tried and as_it_was else candidates.try_all(entries, base, progress)
    if work.is_done():
        return None
    changes = varying_candidates.simplest(candidates.try_all(suspect.entries, base, progress))
    every, both = [*others, *changes], [*entries, *suspect.entries]
    diagnosed = partial(_diagnosis, suspect.comparison, base, every, both, progress, beside=beside)
    if not beside:
        return diagnosed()
    grown = diagnosed(from_above=False)  # a change that is there gains when it is added: only then all effects at once
    if not grown.changes or grown.ended:
        return grown
    whole = diagnosed()
    return replace(grown, ended=whole.ended) if whole.ended else whole


def _diagnosis(
    comparison: Comparison, base: Baseline, tried: Sequence[FittedCandidate], entries: Sequence[ModelTerm],
    progress: Progress | None, elsewhere: int = 0, *, beside: bool = False, from_above: bool = True,
) -> Diagnosis:  # fmt: skip
    """The diagnosis by candidates as fitted; ``elsewhere`` more were asked for of the record laid out anew.

    ``beside`` what explains nearly all alone other effects are asked for too; ``from_above`` all at once as well.
    """
    asked = (len(entries) if base.several else len(tried)) + elsewhere
    rows = rank(with_best_settled(tried, comparison.prepared), comparison, asked)
    decision = _decide(rows, tried, entries, base, comparison, asked, progress, beside=beside, from_above=from_above)
    if decision.sets:
        decision = _smooth(decision, comparison, asked)
    families: list[FamilyGain] = []
    if decision.verdict == UNKNOWN:
        families = dependence.families(dependence.unexplained(base))
    elif decision.verdict == PARTLY_KNOWN or (decision.verdict == SEVERAL and decision.left > GOOD):
        families = dependence.families(dependence.left_by(decision.sets[0].fit, comparison.prepared))
    return Diagnosis(
        decision.verdict,
        comparison,
        tuple(decision.rows),
        asked,
        decision.left,
        tuple(decision.sets),
        tuple(families),
        decision.ended,
    )


def _freed(comparison: Comparison, base: Baseline, tried: Sequence[FittedCandidate]) -> Comparison | None:
    """The comparison with the deeper minimum that the model itself has where its best candidate ended; None if none is.

    An effect that only freed the fit of the model from a side valley is not missing.
    """
    best = min(tried, key=lambda c: c.fit.rms, default=None)
    if best is None or comparison.model.modal or comparison.fit.restarts or not base.fit.keys:
        return None
    ended = dict(zip(best.fit.keys, best.fit.values.tolist(), strict=True))
    values = {key: ended[key] for key in base.fit.keys if key in ended}
    try:
        fit = fit_part(base.fit.model, base.prepared, base.fit.held, values, steps=base.fit.steps_per_sample)
        if base.fit.rms - fit.rms <= TOLERANCE * base.prepared.spread:
            return None
        freed = compare(comparison.model, comparison.prepared, fit=finished(fit, comparison.prepared))
    except StudyError:
        return None
    return freed if freed.fit.rms < comparison.fit.rms else None


def search_part(prepared: Prepared) -> Prepared:
    """The record with as much to fit as a search uses: enough to tell candidates apart, and sooner done.

    More where that is a quiet stretch, such as the end of a sweep, which shows less than half of the motion's size.
    """
    if prepared.record.stretches:  # what is loud and what is quiet lie in stretches of their own
        return prepared.shortened(LONGEST_SEARCH)
    first, last = prepared.plan.fit
    wanted = max((last - first) // 2, prepared.samples_in(shape_search.SEARCH_PERIODS))
    look = prepared.shortened(int(np.clip(wanted, shape_search.SEARCH_SAMPLES, LONGEST_SEARCH)))
    return look if look.spread > 0.5 * prepared.spread else prepared.shortened(LONGEST_SEARCH)


def search_base(comparison: Comparison) -> Baseline:
    """The fitted model as candidates are tried beside it: on no more samples, in no more steps, than a search takes."""
    fit, look = comparison.fit, search_part(comparison.prepared)
    try:
        again = fit_part(fit.model, look, fit.held, steps=rough_steps(fit.model, look, {}))
    except DivergenceError:  # stiff: nothing runs with fewer steps
        again = fit_part(fit.model, look, fit.held, steps=fit.steps_per_sample)
    return shape_search.baseline(again, look)


@dataclass(frozen=True, eq=False)
class _Decision:
    verdict: str
    rows: list[Ranked]  # single effects in their final order
    left: float
    sets: list[Ranked]
    ended: str = ""  # why and where a search did not come to its end by itself


def _decide(
    rows: list[Ranked], tried: Sequence[FittedCandidate], entries: Sequence[ModelTerm], base: Baseline,
    comparison: Comparison, asked: int, progress: Progress | None, *, beside: bool, from_above: bool,
    search: SetSearch | None = None,
) -> _Decision:  # fmt: skip
    """One effect that explains everything; else the set that does, as far as the record bears it.

    A ``search`` over sets that was made is not made again.
    """
    prediction, own = comparison.prediction, held_out_of(comparison)
    first = next((r for r in rows if believed(r, prediction, own)), None)
    one, fewer_than = _of_one(first, rows, comparison, asked), None
    if one.verdict == NOTHING:
        return one
    # shapes of the motion see little of what is left in a drifting one: then a second effect is asked for all the same
    if first is not None and one.verdict == MISSING and _nearly_all(first) and not beside:
        changing = any(c.term.variation for c in tried)
        if first.unknowns <= 2 and not ((first.flexible or changing) and one.left > TOLERANCE):
            return one
        # a clock, a memory or a shape of its own imitates what several simple effects leave nothing of
        fewer_than = first.unknowns if one.left <= TOLERANCE else set_search.MOST_EFFECTS + 1
    changed = [row for row in rows if not any(row.fit is c.fit for c in tried)]
    settled = [] if comparison.model.modal else changed  # the modes of a longer record are others
    known = {c.name for c in tried}
    effects = [entry for entry in entries if entry.term.variation is None or entry.name in known]
    search = search or searched(
        base, tried, settled, effects, _leaves_nothing, fewer_than, progress, from_above=from_above
    )
    deeper = [search.tried.get(frozenset(c.names), c) for c in tried]
    if any(c.power - d.power > (TOLERANCE * base.prepared.spread) ** 2 for c, d in zip(tried, deeper, strict=True)):
        ranked = {row.name: row for row in rows}
        again = [ranked[c.name] if d is c else d for c, d in zip(tried, deeper, strict=True)]
        rows = rank(with_best_settled(again, comparison.prepared), comparison, asked)
        return _decide(
            rows, deeper, entries, base, comparison, asked, progress, beside=beside, from_above=from_above,
            search=search,
        )  # fmt: skip
    sets = _ranked_sets(search, rows, comparison, asked)
    unusual = first is not None and one.verdict == UNKNOWN and _unusual_alone(first, one.left, asked)
    if unusual:  # no law forbids it: it is missing, unless a set does as much
        one = replace(one, verdict=MISSING)
    answer = next((r for r in sets if believed(r, prediction, own)), None)
    if answer is None or (one.verdict == MISSING and len(answer.entries) == 1):
        return replace(one, ended=search.ended)
    left = one.left if first is not None and answer.fit is first.fit else _left(answer.fit, answer.prediction)
    whole = answer
    answer, left = _material(answer, left, sets, search, comparison)
    good = [answer, *(r for r in sets if r.name in answer.tied_with)]
    verdict = _verdict_on(good, left, comparison.prepared, asked)
    if verdict == SEVERAL and answer is not whole and not work.is_done():
        near = _as_simple(answer, search, comparison)
        if believed(near[0], prediction, own):
            left = left if near[0].fit is answer.fit else _left(near[0].fit, near[0].prediction)
            answer, good = near[0], [near[0], *(r for r in near if r.name in near[0].tied_with)]
    if verdict == UNKNOWN and first is not None and (unusual or _stands_out(first, comparison.prepared)):
        first_alone = [first] + [r for r in rows if r is not first]
        return replace(one, verdict=MISSING, rows=first_alone, ended=search.ended)
    core = _necessary(good, search, rows, comparison, asked) if verdict == UNKNOWN else None
    if core is not None and believed(core, prediction, own) and not core.wanders(asked):
        verdict, answer, left = PARTLY_KNOWN, core, _left(core.fit, core.prediction)
        good = [core, *(r for r in good if r.name != core.name)]
    if verdict != UNKNOWN:
        alone = len(answer.entries) == 1 and all(r.name != answer.name for r in rows)  # it was offered beside others
        rows = [answer, *rows] if alone else rows
        rows = sorted(rows, key=lambda r: answer.names.index(r.name) if r.name in answer.names else len(rows))
    return _Decision(verdict, rows, left, good, search.ended)


def _smooth(decision: _Decision, comparison: Comparison, asked: int) -> _Decision:
    """A decision whose answer has smooth curves where it was found with lines."""
    answer = decision.sets[0]
    again = varying_candidates.as_smooth(answer, comparison.prepared)
    if again is answer:
        return decision
    again = varying_candidates.without_needless(again, comparison.prepared)
    row = replace(rank([again], comparison, asked)[0], tied_with=answer.tied_with, distance=answer.distance)
    rows, sets = ([row if r is answer else r for r in listed] for listed in (decision.rows, decision.sets))
    return replace(decision, rows=rows, sets=sets)


def _of_one(first: Ranked | None, rows: list[Ranked], comparison: Comparison, asked: int) -> _Decision:
    """What single effects bear: ``first`` is the first that is believed, if any is."""
    if first is None:
        left = _left(comparison.fit, comparison.prediction)
        # what is left along another motion tells nothing
        lost = has_lost_the_motion(comparison.fit, comparison.prepared)
        missing = left > TOLERANCE or lost or _leaves_much(comparison.prediction)
        return _Decision(UNKNOWN if missing else NOTHING, rows, left, [])
    left = _left(first.fit, first.prediction)
    alone = [first, *(r for r in rows if r.name in first.tied_with)]
    if _explains(first, left) and not (first.unphysical or first.wanders(asked)):
        return _Decision(MISSING, [first] + [r for r in rows if r is not first], left, alone)
    return _Decision(UNKNOWN, rows, left, alone)


def _leaves_much(prediction: Prediction) -> bool:
    """Whether more than ten times as much is above the noise as models of real structures leave."""
    return prediction.above_noise > 10.0 * GOOD


def _explains(row: Ranked, left: float) -> bool:
    """Whether an effect or a set explains nearly all, or leaves neither what shapes of the motion see nor much.

    A stiffness that changes periodically leaves what no such shape sees, whatever stands in its place.
    """
    return row.gain.explained >= ENOUGH or (left <= GOOD and not _leaves_much(row.prediction))


def _nearly_all(row: Ranked) -> bool:
    return row.gain.explained >= ENOUGH or row.response_error <= GOOD


def _verdict_on(sets: Sequence[Ranked], left: float, prepared: Prepared, asked: int) -> str:
    """What the first of the sets that the record cannot tell apart bears, beside which so much is left."""
    answer = sets[0]
    explained, one = answer.gain.explained, len(answer.entries) == 1
    if _explains(answer, left) and not answer.wanders(asked):
        return MISSING if one else SEVERAL
    if one and _stands_out(answer, prepared):
        return MISSING
    if answer.unphysical or answer.unsteadiness > UNSTEADY:
        return UNKNOWN
    if explained >= NEARLY and not one:
        return SEVERAL
    necessary = all(set(answer.names) <= set(row.names) for row in sets)
    return PARTLY_KNOWN if explained >= NAMED_FIRST and necessary and not answer.wanders(asked) else UNKNOWN


def _ranked_sets(search: SetSearch, rows: Sequence[Ranked], comparison: Comparison, asked: int) -> list[Ranked]:
    """Sets near the best in their order, settled as they would be if they were added."""
    alone = {row.name: row for row in rows}
    every = sorted(search.tried.values(), key=by_power)
    if not every:  # nothing that was asked for has a finite motion
        return []
    best = every[0]
    near = [c for c in every if statistics.worse(c.prediction.residual, best.prediction.residual) < 2.0 * K][:RIVALS]
    near += [c for names, c in search.tried.items() if c not in near and any(names < set(n.names) for n in near[:3])]
    found = [alone.get(c.name, c) for c in near]
    return rank(with_best_settled(found, comparison.prepared), comparison, asked + len(search.tried))


def _material(
    answer: Ranked, left: float, sets: Sequence[Ranked], search: SetSearch, comparison: Comparison
) -> tuple[Ranked, float]:
    """The set without effects that explain less than is ``left`` beside all, a part of which they imitate; and what is.

    Without those as well that explain no more than models of real structures leave, and next to nothing of what is
    unexplained: the others are missing, whatever is missing besides.
    """
    ranked, unexplained = {frozenset(r.names): r for r in sets}, comparison.prediction.error
    while len(answer.entries) > 1:
        names = frozenset(answer.names)
        smaller = [c for name in names if (c := search.without(names, name)) is not None]
        least = min(smaller, key=lambda c: c.prediction.error, default=None)
        if least is None:
            break
        whole = search.tried.get(names, answer)  # fitted on as much of the record
        explains = math.sqrt(max(least.prediction.error**2 - whole.prediction.error**2, 0.0))
        little = explains <= GOOD and explains**2 <= (1.0 - ENOUGH) * unexplained**2
        # shapes of the motion do not see all that a model leaves: what stands above white noise counts as well
        if explains >= max(left, answer.prediction.above_noise) and not little:
            break
        fewer = ranked.get(frozenset(least.names))
        if fewer is None:
            fewer = rank(with_best_settled([least], comparison.prepared), comparison, len(search.tried))[0]
        answer = fewer
        left = _left(answer.fit, answer.prediction)
    return answer, left


def _as_simple(answer: Ranked, search: SetSearch, comparison: Comparison) -> list[Ranked]:
    """A set that others were taken out of, among those of as many effects and no more unknowns that come near it.

    It was the best beside what was taken out; by itself another may be, or one that the record cannot tell from it.
    """
    own = search.tried.get(frozenset(answer.names), answer)
    near = [
        c
        for c in search.sets(len(answer.names))
        if c.unknowns <= answer.unknowns and not c.unphysical and set(c.names) != set(answer.names)
        and statistics.worse(c.prediction.residual, own.prediction.residual) < K
    ][:RIVALS]  # fmt: skip
    return rank([answer, *with_best_settled(near, comparison.prepared)], comparison, len(search.tried))


def _necessary(
    sets: Sequence[Ranked], search: SetSearch, rows: Sequence[Ranked], comparison: Comparison, asked: int
) -> Ranked | None:
    """What all sets have that the record cannot tell apart, as a set of its own; None where they have nothing alike.

    Beside a force that the library lacks they imitate it in ways of their own, and have what is truly there in common.
    """
    names = frozenset(sets[0].names)
    common = names.intersection(*(row.names for row in sets))
    for name in sorted(names - common) if common else ():
        search.without(names, name)
        names = names - {name}
        if names not in search.tried:
            return None
    core = next((row for row in rows if frozenset(row.names) == common), search.tried.get(common))
    if core is None:
        return None
    row = rank(with_best_settled([core], comparison.prepared), comparison, asked + len(search.tried))[0]
    return row if row.gain.explained >= NEARLY and not row.unphysical else None


def believed(row: Ranked, prediction: Prediction, own: HeldOut) -> bool:
    """Whether an effect is believed, by all samples that neither the model with it nor that without was fitted to.

    Where these are both parts of a decay, the error of the judging part, which every table shows, falls as well.
    """
    if row.idle:
        return False
    without, with_it = evidence(prediction, own), evidence(row.prediction, row.held_out)
    if not alike(without, with_it):
        return credible(prediction, row.prediction, row.effect.interval, row.p_value)
    falls = row.response_error < prediction.error
    return falls and credible(without, with_it, row.effect.interval, row.p_value)


def _stands_out(first: Ranked, prepared: Prepared) -> bool:
    """Whether an effect of a component or of a decaying motion explains most of what is missing.

    Measured ones seldom lack one effect alone: what is left beside the first is asked for when it is added.
    """
    alone = prepared.response == FORCE or prepared.free
    return alone and first.gain.explained > NAMED_FIRST and not first.unphysical


def _unusual_alone(first: Ranked, left: float, asked: int) -> bool:
    """Whether an effect with values that are seldom met leaves nothing."""
    steady = not (first.idle or first.wanders(asked))
    return first.seldom and steady and first.gain.explained >= ENOUGH and left <= TOLERANCE


def _leaves_nothing(candidate: FittedCandidate) -> bool:
    """Whether nothing is left for a further effect: shapes of the motion see nothing, noise alone leaves as much."""
    prediction = candidate.prediction
    return prediction.above_noise <= TOLERANCE and _left(candidate.fit, prediction) <= TOLERANCE


def _left(fit: FreeRunFit, prediction: Prediction) -> float:
    """Rms over that of the response which shapes of the motion, of its past and of time explain of a residual.

    Noise may have any colour; what physics leaves depends on the motion.
    """
    nameless = 0.1 * ALPHA  # what no candidate explains is believed less easily than what one does
    left = dependence.left_by(fit, prediction.prepared)
    of_motion = prediction.error * float(np.sqrt(dependence.significant_share(left, nameless)))
    # shapes tell little in a decay's few loud blocks, or where nothing brings a motion back: there what stands above
    # white noise counts, as no force is there whose noise the motion could have coloured, or not for long
    return max(of_motion, prediction.above_noise) if prediction.prepared.record.stretches else of_motion
