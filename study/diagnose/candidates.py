"""Candidates: effects at places, each fitted beside a model on one part of the record and judged on the other.

Where few are asked for, as of a single mass, all are fitted. A structure has many places: there the reverse system says
at which of them which effects are worth a fit (``shape_search``).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from study.compare.prediction import Prediction, predict
from study.equations.model import ModelTerm, free
from study.equations.term import Term
from study.identify.time_domain.fit_model import with_term
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.motion_range import idle_effects
from study.identify.time_domain.shape_search import Baseline, Screened, Start, starts_of
from study.identify.time_domain.smoothness import with_all_knots
from study.identify.time_domain.weighted_fit import finished
from study.records.prepared import FORCE, Prepared
from study.support import work
from study.support.cores import side_by_side
from study.support.errors import StudyError
from study.support.thresholds import PROMISING, TOLERANCE

MOST_PROMISING = 12  # of many, whatever they are: fitted in free run ...
AT_EACH_PLACE = 2  # ... with so many at each place that explain ``PROMISING`` of what the best explains ...
OF_EACH_EFFECT = 1  # ... and each effect where it explains most: the motion that it is judged by may lack its own part
Progress = Callable[[int, int, str], None]  # called with how many were fitted, of how many, and what: "sets of 3"
ROUNDED = math.sqrt(float(np.finfo(float).eps))  # of the response: rounding leaves no minimum told more closely
SETTLED = 4  # of the candidates, the best: fitted on the whole fitting part and with enough steps


@dataclass(frozen=True, eq=False)
class FittedCandidate:
    """An effect that a model may lack, or a set of effects, as fitted beside it."""

    entries: tuple[ModelTerm, ...]  # the effects and their places
    fit: FreeRunFit  # the model with them, fitted on the fitting part
    prediction: Prediction  # its free run along the judging part
    settled: bool = field(default=False, kw_only=True)  # fitted as it would be if it were added

    @property
    def names(self) -> tuple[str, ...]:
        """Of each effect, with its place where that has a name."""
        return tuple(entry.name for entry in self.entries)

    @property
    def name(self) -> str:
        """The same in one piece."""
        return " + ".join(self.names)

    @property
    def entry(self) -> ModelTerm:
        """The effect, or the first of a set, and its place."""
        return self.entries[0]

    @property
    def term(self) -> Term:
        """The effect, or the first of a set."""
        return self.entry.term

    @property
    def unknowns(self) -> int:
        """Coefficients and shape parameters: a clock, a memory or a shape of its own counts as what it is."""
        return sum(map(unknowns_of, self.entries))

    @property
    def flexible(self) -> bool:
        """Whether an effect has a clock, a memory or a shape of its own."""
        return self.unknowns > len(self.entries)

    @property
    def power(self) -> float:
        """Mean square of what it leaves on both parts."""
        return float(np.mean(np.concatenate([self.fit.residual, self.prediction.residual]) ** 2))

    @property
    def numerical(self) -> float:
        """Rms error of the integration itself; of a force that takes none, that of finding a least sum of squares."""
        prediction = self.prediction
        own = prediction.numerical * np.array(prediction.prepared.outputs.weights)
        size = float(np.std(prediction.above(prediction.prepared.judged)))
        return max(float(np.sqrt(np.mean(own**2))), ROUNDED * size)

    def predicts_as(self, other: "FittedCandidate") -> bool:
        """Whether both are forms of one equation: their predictions differ by no more than the numbers' own error.

        And by practically nothing: too few steps for a stiff effect make it nobody's equal.
        """
        apart = float(np.sqrt(np.mean((self.prediction.residual - other.prediction.residual) ** 2)))
        size = float(np.std(self.prediction.above(self.prediction.prepared.judged)))
        return self is other or apart <= min(math.hypot(self.numerical, other.numerical), TOLERANCE * size)

    @cached_property
    def unphysical(self) -> str:
        """Why it is no physical effect as fitted, or does not act as itself; empty if neither is so."""
        return self._broken(seldom=True) or idle_effects(self.fit, self.entries, self.prediction.prepared)

    @property
    def seldom(self) -> bool:
        """Whether nothing speaks against its values but that such effects are few."""
        return bool(self._broken(seldom=True)) and not self._broken(seldom=False)

    def _broken(self, *, seldom: bool) -> str:
        values = self.fit.model.values
        return next((why for e in self.entries if (why := e.term.physical(_own(e, values), seldom=seldom))), "")


def unknowns_of(entry: ModelTerm) -> int:
    """Coefficients and shape parameters of one effect; more than one of a flexible one.

    A curve counts as the four that it is searched with: its smoothness leaves it little more.
    """
    most = len(entry.term.components) if entry.term.variation is None else 4
    return min(len(entry.term.components), most) + len(entry.term.parameters)


def _own(entry: ModelTerm, values: Mapping[str, float | None]) -> dict[str, float | None]:
    return {own: values.get(key) for own, key in zip(entry.term.keys, entry.keys, strict=True)}


def try_all(entries: Sequence[ModelTerm], base: Baseline, progress: Progress | None = None) -> list[FittedCandidate]:
    """Fit and judge every candidate that is worth it; those that cannot be fitted are left out.

    Of two sides of a place the better stays.
    """
    if base.several:
        ordered = screened(entries, base)
        chosen = worth_fitting(ordered)
    else:  # every one, the most promising first: the search may end among them
        ordered = chosen = sorted(_screened(entries, base), key=lambda item: -item.share)
    tried = list[FittedCandidate]()
    for first in range(0, len(chosen), MOST_PROMISING):
        if first == 0 or not work.is_done():
            tried += _fitted(chosen[first : first + MOST_PROMISING], base, progress, first, len(chosen))
    if not base.several:
        names = [entry.name for entry in entries]
        return sorted(tried, key=lambda candidate: names.index(candidate.entry.name))
    if not work.is_done():
        others = elsewhere(tried, ordered)
        tried += _fitted(others, base, progress, len(chosen), len(chosen) + len(others))
    return _one_side(tried)


def screened(entries: Sequence[ModelTerm], base: Baseline) -> list[Screened]:
    """Candidates with the points that explain most, the most promising first; those that explain nothing left out."""
    tried = (item for item in _screened(entries, base) if item.points and item.share > 0.0)
    return sorted(tried, key=lambda item: -item.share)


def _screened(entries: Sequence[ModelTerm], base: Baseline) -> list[Screened]:
    return [Screened(e, tuple(points)) for e, points in zip(entries, starts_of(entries, base), strict=True)]


def worth_fitting(ordered: Sequence[Screened]) -> list[Screened]:
    """Those worth a fit in free run: the first of all, of each place and of each effect."""
    best = ordered[0].share if ordered else 0.0
    places: dict[frozenset[str], int] = {}
    effects: dict[str, int] = {}
    chosen: list[Screened] = []
    for rank, item in enumerate(ordered):
        path, effect = item.entry.place.path, item.entry.term.name
        near = places.get(path, 0) < AT_EACH_PLACE and item.share >= PROMISING * best
        if rank < MOST_PROMISING or near or effects.get(effect, 0) < OF_EACH_EFFECT:
            chosen.append(item)
            places[path] = places.get(path, 0) + 1
            effects[effect] = effects.get(effect, 0) + 1
    return chosen


def elsewhere(tried: Sequence[FittedCandidate], ordered: Sequence[Screened]) -> list[Screened]:
    """The best effect at the places where it was not tried and explains a share like that where it was.

    Two places that the sensors cannot tell apart explain alike: a place is believed only if the others were tried.
    """
    if not tried:
        return []
    best = min(tried, key=_worse).entry.term.name
    done = {c.name for c in tried}
    share = max(item.share for item in ordered if item.entry.term.name == best)
    return [
        item for item in ordered
        if item.entry.term.name == best and item.entry.name not in done and item.share >= PROMISING * share
    ]  # fmt: skip


def those_not_tried(
    entries: Sequence[ModelTerm], tried: Sequence[FittedCandidate], base: Baseline, progress: Progress | None = None
) -> list[FittedCandidate]:
    """Fit and judge every candidate that promised too little; of two sides of a place the better stays."""
    done = {c.entry.effect for c in tried}
    left = [entry for entry in entries if entry.effect not in done]
    more = screened(left, base)
    return _one_side(_fitted(more, base, progress, len(tried), len(tried) + len(more)))


def _worse(candidate: FittedCandidate) -> tuple[bool, float]:
    return bool(candidate.unphysical), candidate.prediction.error


def _one_side(candidates: Sequence[FittedCandidate]) -> list[FittedCandidate]:
    best: dict[tuple[str, frozenset[str]], FittedCandidate] = {}
    for candidate in sorted(candidates, key=_worse):
        best.setdefault(candidate.entry.effect, candidate)
    return list(best.values())


def _fitted(
    chosen: Sequence[Screened], base: Baseline, progress: Progress | None, before: int, total: int
) -> list[FittedCandidate]:
    done: list[FittedCandidate] = []

    def fitted(item: Screened) -> FittedCandidate | None:
        return attempt(item.entry, base, item.points)

    found = side_by_side(fitted, chosen, lambda item: item.entry.term.effort)
    for count, candidate in enumerate(found, start=before + 1):
        if candidate is not None:
            done.append(candidate)
        if progress is not None:
            progress(count, total, "single effects")
    return done


def attempt(entry: ModelTerm, base: Baseline, points: Sequence[Start] = ()) -> FittedCandidate | None:
    """The model with a candidate as a search fits it; None where it has no finite response."""
    found = _attempt(entry, base, points)
    component = base.prepared.response == FORCE
    plainer = _plainer(entry) if component and (found is None or found.unphysical) else None
    return found if plainer is None else _attempt(plainer, base) or found


def _attempt(entry: ModelTerm, base: Baseline, points: Sequence[Start] = ()) -> FittedCandidate | None:
    try:
        return judged_candidate((entry,), with_term(base, entry, points), base.prepared)
    except StudyError:
        return None


def _plainer(entry: ModelTerm) -> ModelTerm | None:
    """A term whose roundness along a loop is held at zero, as Dahl's friction is; None where it has no such parameter.

    A prescribed stroke that slips nearly all the time tells little of it, and a fit may leave what is physical.
    """
    fixed = tuple(0.0 if p.relative and p.signed else None for p in entry.term.parameters)
    return replace(entry, parameters=fixed) if any(value == 0.0 for value in fixed) else None


def judged_candidate(
    entries: tuple[ModelTerm, ...], fit: FreeRunFit, prepared: Prepared
) -> FittedCandidate | None:  # fmt: skip
    """A fitted candidate with its prediction; None where its free run does not stay finite."""
    prediction = predict(fit, prepared)
    return None if prediction.diverged else FittedCandidate(entries, fit, prediction)


def with_best_settled(tried: Sequence[FittedCandidate], prepared: Prepared) -> list[FittedCandidate]:
    """The best candidates fitted as they would be if they were added, then the others.

    The best alone where all work is done that may be.
    """
    ordered, most = sorted(tried, key=_worse), 1 if work.is_done() else SETTLED
    return all_settled(ordered[:most], prepared) + ordered[most:]


def all_settled(candidates: Sequence[FittedCandidate], prepared: Prepared) -> list[FittedCandidate]:
    """Candidates fitted to the whole fitting part and with enough steps, as they would be if they were added."""

    def settle(candidate: FittedCandidate) -> FittedCandidate:
        if candidate.settled:
            return candidate
        found = None
        with suppress(StudyError):
            fit = finished(with_all_knots(candidate.fit, prepared), prepared)
            found = judged_candidate(tuple(_as_in(entry, fit) for entry in candidate.entries), fit, prepared)
        return replace(found or candidate, settled=True)

    return list(side_by_side(settle, candidates, lambda candidate: candidate.term.effort))


def _as_in(entry: ModelTerm, fit: FreeRunFit) -> ModelTerm:
    """An effect as it is asked for, with the knots that it has in a fit."""
    if entry.term.variation is None:
        return entry
    return free(next(e.term for e in fit.model.terms if e.name == entry.name), entry.place)
