"""Changes of a model's coefficients as candidates: which are worth a fit, beside which others, and in which shape.

A curve that is fitted to one half of a record says nothing of the other. So where changes are promised the record is
laid out anew, every other block judged, and all candidates are asked there, nonlinear ones as rivals.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.compare.comparison import Comparison, compare
from study.compare.prediction import Prediction, predict
from study.diagnose.candidates import FittedCandidate, Progress, judged_candidate
from study.equations.laid_variations import laid_entry
from study.equations.model import ModelTerm, free
from study.equations.variation import ALONG_TIME, Shape, varying
from study.identify.time_domain.fit_model import with_term
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, rough_steps
from study.identify.time_domain.promised_changes import PromisedChanges
from study.identify.time_domain.shape_search import baseline
from study.identify.time_domain.smoothness import with_curve
from study.identify.time_domain.weighted_fit import finished
from study.records.prepared import FORCE, Prepared
from study.support import statistics
from study.support.cores import side_by_side
from study.support.errors import StudyError
from study.support.numbers import percent
from study.support.thresholds import ALPHA, PROMISING, TOLERANCE, K

LAID_ANEW = "every other block is judged, as a coefficient changes along the record"  # by which the note is known


@dataclass(frozen=True, eq=False)
class Suspect:
    """Changes of coefficients that are worth a fit, and the comparison beside which they are asked for."""

    comparison: Comparison  # the same model, judged in every other block
    entries: list[ModelTerm]  # in each shape that is asked for


def first_of_all(tried: Sequence[FittedCandidate], changes: PromisedChanges, comparison: Comparison) -> bool:
    """Whether a coefficient that changes promises more than the best other effect, fitted to both parts, explains."""
    power = float(np.mean(np.concatenate([comparison.fit.residual, comparison.prediction.residual]) ** 2))
    least = min((c.power for c in tried if not c.unphysical), default=power)
    return power > 0.0 and changes.together >= 1.0 - least / power


def explains_more(changes: PromisedChanges, effects: Sequence[str], progress: Progress | None = None) -> bool:
    """Whether a promised change, fitted, leaves less than the model with these effects alone, or does for one of them.

    What the sensitivities promise of what others leave is seldom kept, and costs a search of its own where it is.
    """
    prepared, fit, entries = changes.prepared, changes.fit, list(changes.shares)
    most, doing = len(entries) + len(effects), "coefficients that vary"
    whole = predict(fit, prepared)
    for count, found in enumerate(side_by_side(lambda entry: _with(fit, entry, prepared), entries), start=1):
        if progress is not None:
            progress(count, most, doing)
        if found is None:
            continue
        gain = statistics.gain(whole.residual, found.residual)
        less = whole.error**2 - found.error**2 > TOLERANCE**2
        if less and gain.p_value * len(entries) < ALPHA:
            return True

    def stands_for(name: str) -> bool:
        model = fit.model.without_term(name)
        held = [key for key in fit.held if key in model.values]
        try:
            fewer = fit_part(model, prepared, held, steps=fit.steps_per_sample)
        except StudyError:
            return False
        found = _with(fewer, entries[0], prepared)
        return found is not None and statistics.worse(found.residual, whole.residual) < K

    for count, stands in enumerate(side_by_side(stands_for, effects), start=len(entries) + 1):
        if progress is not None:
            progress(count, most, doing)
        if stands:
            return True
    return False


def _with(fit: FreeRunFit, entry: ModelTerm, prepared: Prepared) -> Prediction | None:
    try:
        found = predict(with_term(baseline(fit, prepared), entry), prepared)
    except StudyError:
        return None
    return None if found.diverged else found


def suspect(changes: PromisedChanges, comparison: Comparison) -> Suspect | None:
    """The changes that are worth a fit; None where the model does not follow the record laid out so.

    With what something changes the sensitivities tell: with time, or which channel. Where it is much, the coefficient
    that promises most need not be the one that changes, so all are fitted that promise anything with that. In a
    component test, where directions may follow channels of their own, each channel that promises anything is asked.
    """
    prepared, fit = changes.prepared, comparison.fit
    worth = {
        e.term.variation.along
        for e, share in changes.shares.items()
        if e.term.variation and share >= PROMISING * changes.most
    }
    if prepared.response == FORCE:
        worth |= {e.term.variation.along for e in changes.shares if e.term.variation} - {ALONG_TIME}
    chosen = [e for e in changes.shares if e.term.variation and e.term.variation.along in worth]
    try:
        if prepared is not comparison.prepared:
            rough = fit_part(fit.model, prepared, fit.held, steps=rough_steps(fit.model, prepared, {}))
            elsewhere = percent(comparison.prediction.error)
            comparison = compare(comparison.model, prepared, fit=finished(rough, prepared))
            said = f"{LAID_ANEW}; where 'study compare' judges, the model leaves {elsewhere}"
            comparison = replace(comparison, notes=(*comparison.notes, said))
        return Suspect(comparison, [shaped for entry in chosen for shaped in _shapes(entry, prepared)])
    except StudyError:
        return None


def _shapes(entry: ModelTerm, prepared: Prepared) -> list[ModelTerm]:
    """A curve, and the simpler shapes that the same coefficient may change in."""
    variation = entry.term.variation
    if variation is None:
        return [entry]
    simpler: tuple[Shape, ...] = ("line", "step") if variation.along == ALONG_TIME else ("line",)
    others = [varying(replace(variation, shape=shape, knots=(), lasts=None)) for shape in simpler]
    return [entry, *(laid_entry(free(term, entry.place), prepared) for term in others)]


def as_smooth(candidate: FittedCandidate, prepared: Prepared) -> FittedCandidate:
    """A candidate whose even changes are fitted as curves, as smooth as the record asks for.

    That a line leaves no more than a curve does not say that nothing bends: its band would be too narrow.
    """
    model, entries = candidate.fit.model, list[ModelTerm]()
    for entry in candidate.entries:
        variation = entry.term.variation
        if variation is not None and variation.shape == "line":
            line = next(e for e in model.terms if e.name == entry.name)
            curve = varying(replace(variation, shape="curve", knots=()))
            entry = laid_entry(free(curve, entry.place), prepared)
            if entry.term.variation is not None:
                model = with_curve(model, line, entry.term.variation)
        entries.append(entry)
    if model is candidate.fit.model:
        return candidate
    try:
        held = [key for key in candidate.fit.held if key in model.values]
        fit = fit_part(model, prepared, held, steps=candidate.fit.steps_per_sample)
        return judged_candidate(tuple(entries), finished(fit, prepared), prepared) or candidate
    except StudyError:
        return candidate


def without_needless(smooth: FittedCandidate, prepared: Prepared) -> FittedCandidate:
    """A set whose changes bend by now, without the effects that stood for what its lines could not."""
    for entry in (e for e in smooth.entries if e.term.variation is None):
        model = smooth.fit.model.without_term(entry.name)
        held, steps = [key for key in smooth.fit.held if key in model.values], smooth.fit.steps_per_sample
        try:
            fit = finished(fit_part(model, prepared, held, steps=steps), prepared)
        except StudyError:
            continue
        fewer = judged_candidate(tuple(e for e in smooth.entries if e is not entry), fit, prepared)
        if fewer and statistics.worse(fewer.prediction.residual, smooth.prediction.residual) < K:
            smooth = fewer
    return smooth


def simplest(tried: Sequence[FittedCandidate]) -> list[FittedCandidate]:
    """Of the shapes in which one coefficient may change, the simplest that leaves no more than the best does."""
    groups: dict[tuple[object, ...], list[FittedCandidate]] = {}
    for candidate in tried:
        variation = candidate.term.variation
        if variation is not None:
            key = (variation.of.name, variation.along, variation.side, candidate.entry.place)
            groups.setdefault(key, []).append(candidate)
    found = list[FittedCandidate]()
    for group in groups.values():
        best = min(group, key=lambda c: c.prediction.error)
        level = [c for c in group if _level(c, best) and not any(_beaten(c, other) for other in group)]
        found.append(min(level, key=lambda c: c.unknowns))
    return found


def _beaten(one: FittedCandidate, other: FittedCandidate) -> bool:
    """Whether another with no more unknowns leaves less."""
    return other.unknowns <= one.unknowns and other.prediction.error < one.prediction.error


def _level(one: FittedCandidate, best: FittedCandidate) -> bool:
    """Whether a candidate leaves no more than the best, but for chance and the numbers' own error."""
    return one.predicts_as(best) or statistics.worse(one.prediction.residual, best.prediction.residual) < K
