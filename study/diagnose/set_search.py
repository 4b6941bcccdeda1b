"""The search over sets of effects: each set is fitted once, in free run, and all that is asked of sets is asked here.

A set of one size begins where the best of the size below ended; which are worth a fit the sensitivities there say, and
the reverse system. Effects come, go and change places with others: what a smaller set had, a larger one need not have.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from study.diagnose import candidates, set_screening
from study.diagnose.candidates import FittedCandidate, Progress, judged_candidate, unknowns_of
from study.diagnose.set_screening import SetStart
from study.equations.model import ModelTerm
from study.identify.time_domain import shape_search
from study.identify.time_domain.fit_model import TRIED, grown_states
from study.identify.time_domain.part_fit import fit_part
from study.identify.time_domain.shape_search import Baseline, Start
from study.support import statistics, work
from study.support.cores import side_by_side
from study.support.errors import StudyError
from study.support.thresholds import ALPHA
from study.support.work import WorkDoneError

MOST_EFFECTS = 4  # in a set
EACH = 6  # sets of a size that are fitted from one beginning


@dataclass(frozen=True, eq=False)
class SetSearch:
    """Sets of effects beside a fitted model, by their names."""

    base: Baseline  # the model
    entries: dict[str, ModelTerm]  # the effects and their places
    offered: dict[str, ModelTerm]  # those that are worth a fit, with shape parameters at which each explains most
    tried: dict[frozenset[str], FittedCandidate] = field(default_factory=dict[frozenset[str], FittedCandidate])
    ended: str = ""  # why and where, if the search did not come to its end by itself

    def sets(self, size: int, *, simple: bool = False) -> list[FittedCandidate]:
        """Sets of so many effects, or simple ones, that were fitted; the best first, what is not physical last."""
        fitted = (c for names, c in self.tried.items() if len(names) == size and not (simple and c.flexible))
        return sorted(fitted, key=by_power)

    def asked(self, *, simple: bool) -> dict[str, ModelTerm]:
        """The effects that are offered, or the simple ones."""
        return {name: entry for name, entry in self.offered.items() if not simple or unknowns_of(entry) == 1}

    def go_on(self, starts: Iterable[SetStart], progress: Progress | None = None) -> None:
        """Fit more sets, as long as the search may do more."""
        work.go_on()
        self.fit(starts, progress)

    def fit(self, starts: Iterable[SetStart], progress: Progress | None = None) -> None:
        """Fit sets; of a set that was fitted before the better fit stays."""
        listed, before = list(starts), len(self.tried)
        for count, found in enumerate(side_by_side(self.fitted, listed), start=1):
            if found is not None:
                names = frozenset(found.names)
                self.tried[names] = min(found, self.tried.get(names, found), key=by_power)
            if progress is not None:
                progress(before + count, before + len(listed), f"sets of {max(len(start.names) for start in listed)}")

    def fitted(self, start: SetStart, held: Sequence[str] = ()) -> FittedCandidate | None:
        """One set, fitted with some coefficients held; None where it has no finite motion. Nothing is kept of it."""
        prepared, begun = self.base.prepared, self.base.fit if start.beside is None else start.beside.fit
        own = begun.held if start.model.modal else self.base.fit.held  # modes that damping does not couple stay so
        try:
            fit = fit_part(
                start.model,
                prepared,
                [*(k for k in own if k in start.model.values), *held],
                steps=max(self.base.fit.steps_per_sample, begun.steps_per_sample),
                max_iterations=TRIED,
                initial=None if begun.restarts else grown_states(begun, start.model),  # segments have their own
            )
            return judged_candidate(tuple(e for n, e in self.entries.items() if n in start.names), fit, prepared)
        except StudyError:
            return None

    def without(self, names: frozenset[str], name: str) -> FittedCandidate | None:
        """The set without one of its effects, fitted if it was not."""
        fewer = names - {name}
        if fewer and fewer not in self.tried:
            self.fit([start_without(self.tried[names], name)])
        return self.tried.get(fewer)


def start_without(whole: FittedCandidate, name: str) -> SetStart:
    """A set without one of its effects, begun where the fit of all ended."""
    return SetStart(frozenset(whole.names) - {name}, whole.fit.model.without_term(name), whole)


def by_power(candidate: FittedCandidate) -> tuple[bool, float]:
    """Order among sets of one size."""
    return bool(candidate.unphysical), candidate.power


def searched(
    base: Baseline, singles: Sequence[FittedCandidate], settled: Sequence[FittedCandidate],
    asked: Sequence[ModelTerm], done: Callable[[FittedCandidate], bool], fewer_than: int | None = None,
    progress: Progress | None = None, *, from_above: bool = True,
) -> SetSearch:  # fmt: skip
    """Grow sets of effects until one leaves nothing, none gains by one effect more, or they are large enough.

    ``singles`` are the effects as fitted alone, ``settled`` those that were fitted on and may have left a side valley,
    ``asked`` all effects at places, those too beside which alone no motion stays finite. ``done`` says whether a set
    leaves nothing to be explained; ``fewer_than`` are the unknowns of an effect that explains nearly all alone: then
    sets of simple effects with fewer are asked for. It ends when all is done that may be (:mod:`study.support.work`),
    and the user may end it (Ctrl-C): then what was fitted so far is there.
    """
    offered = {c.name: next(t for t in c.fit.model.terms if t.name == c.name) for c in singles}
    if not base.several:  # damping that others leave nothing of lets a motion escape alone
        offered |= {entry.name: entry for entry in asked if entry.name not in offered and unknowns_of(entry) == 1}
    entries = {entry.name: entry for entry in asked} | {c.name: c.entry for c in singles}
    search = SetSearch(base, entries, offered, {frozenset(c.names): c for c in singles})
    sizes = range(2, MOST_EFFECTS + 1)
    search.fit(SetStart(frozenset(c.names), c.fit.model) for c in settled)
    reverse = set_screening.by_the_reverse_system(offered, base, sizes, EACH)
    try:
        _grow(search, reverse, sizes, done, fewer_than, progress)
        # of a structure's many places those that were not tried are missing from the whole
        if from_above and search.tried and not (base.several or done(min(search.tried.values(), key=by_power))):
            _reduce(search, sizes, progress)
        _side_valleys(search, sizes)
    except (KeyboardInterrupt, WorkDoneError) as end:  # what was found so far is there to be told
        why = work.ENDED if isinstance(end, WorkDoneError) else "by hand"
        return replace(search, ended=f"{why} at sets of {max(map(len, search.tried), default=1)}")
    return search


def _grow(
    search: SetSearch, reverse: Mapping[int, Sequence[SetStart]], sizes: Sequence[int],
    done: Callable[[FittedCandidate], bool], fewer_than: int | None, progress: Progress | None,
) -> None:  # fmt: skip
    """Fit sets of growing size; ``reverse`` are those that the reverse system promises, by size."""
    base = search.base
    best = next(iter(search.sets(1, simple=fewer_than is not None)), None)
    patient = True
    for size in sizes:
        simple = fewer_than is not None
        if best is None or (fewer_than is not None and size >= fewer_than):
            break
        starts = [start for start in reverse.get(size, ()) if start.names <= set(search.asked(simple=simple))]
        if size == 2:
            starts += set_screening.by_sensitivities(None, search.asked(simple=simple), base, [size], EACH)[size]
        for parent in _parents(search.sets(size - 1), simple=simple):
            offer_beside(search, parent, simple=simple)
            starts += set_screening.by_sensitivities(parent, search.asked(simple=simple), base, [size], EACH)[size]
        search.go_on(starts, progress)
        _exchange(search, search.asked(simple=simple), size, simple, progress)
        larger = next(iter(search.sets(size, simple=simple)), None)
        gained = larger is not None and gains(best, larger, len(starts))
        if larger is None or not (gained or patient):
            break
        patient = gained  # of three effects that act together no two need gain alone
        best = larger if gained else best
        if fewer_than is None and done(best):
            fewer_than = best.unknowns


def offer_beside(search: SetSearch, parent: FittedCandidate, *, simple: bool) -> None:
    """Offer effects with the shapes at which they explain most beside a fitted set, and those that were not offered.

    Alone the motion may not show an effect at its place, nor bear it, and what has a shape of its own imitates others.
    Beside modes each shape takes a fit of all of them: there the shapes stand that were found alone.
    """
    sides = {e.effect: name for name, e in search.offered.items()}  # one side of a place is enough
    asked = [
        entry
        for name, entry in search.entries.items()
        if (sides.get(entry.effect) == name and entry.term.parameters and not simple)
        or (entry.effect not in sides and not (simple and unknowns_of(entry) > 1))
    ]
    shaped = parent.fit.model.modal is None
    beside = [e for e in asked if e.name not in parent.names and (shaped or not e.term.parameters)]
    if not beside:
        return
    work.go_on()
    found = candidates.screened(beside, shape_search.baseline(parent.fit, search.base.prepared))
    for item in candidates.worth_fitting(found) if search.base.several else found:
        entry = item.entry
        if sides.setdefault(entry.effect, entry.name) == entry.name:
            search.offered[entry.name] = replace(entry, parameters=item.points[0].parameters)


def _side_valleys(search: SetSearch, sizes: Sequence[int]) -> None:
    """Fit the best sets without each of their effects: beside others an effect may leave a side valley."""
    for best, *others in filter(None, (search.sets(size)[:2] for size in sizes)):
        search.go_on([start_without(best, name) for name in best.names])
        for second in others:
            for name in second.names:
                search.without(frozenset(second.names), name)


def _exchange(
    search: SetSearch, asked: Mapping[str, ModelTerm], size: int, simple: bool, progress: Progress | None
) -> None:  # fmt: skip
    """Let one effect of the best sets of a size change places with another until none gains."""
    seen = set[frozenset[str]]()
    while parents := [p for p in _parents(search.sets(size), simple=simple) if frozenset(p.names) not in seen]:
        for parent in parents:
            exchanged = set_screening.by_sensitivities(parent, asked, search.base, [size], EACH)[size]
            search.go_on([start for start in exchanged if start.names not in search.tried], progress)
        seen |= {frozenset(parent.names) for parent in parents}


def _reduce(search: SetSearch, sizes: Sequence[int], progress: Progress | None) -> None:
    """From above: fit all simple effects at once and flexible ones beside them, then the few that do as much.

    Where several effects act at once a wrong one may stand for two of them, and what is grown on it misses both. Beside
    all others an effect shows what is its own, and the motion is nearly the true one: there the sensitivities tell
    which few of them do as much (general to specific, Hendry, 1995).
    """
    plain = [c for c in search.tried.values() if not c.flexible]
    whole = _whole(search, min(plain, key=by_power)) if plain else None
    if whole is None:
        return
    larger = [whole, *_with_shapes(search, whole)]
    if len(larger) > 1:
        larger += _with_shapes(search, larger[1])[:1]
    for every in larger:
        asked = search.offered | {entry.name: entry for entry in every.fit.model.terms if entry.name in every.names}
        starts = set_screening.by_sensitivities(every, asked, search.base, sizes, EACH, moved=True)
        for size in sizes:
            search.go_on(starts[size], progress)
    found = [(every.names, entry) for every in larger for entry in every.fit.model.terms]
    shaped = {entry.name: entry for names, entry in found if entry.name in names and unknowns_of(entry) > 1}
    for size in sizes:
        _exchange(search, search.offered | shaped, size, simple=False, progress=progress)


def _whole(search: SetSearch, beside: FittedCandidate) -> FittedCandidate | None:
    """All simple effects at once, begun at the best set of them; None where they have no finite motion."""
    work.go_on()
    model, names = beside.fit.model, list(beside.names)
    for name, entry in search.offered.items():
        if unknowns_of(entry) == 1 and name not in names:
            model = model.with_term(replace(entry, coefficients=(0.0,) * len(entry.symbols)))
            names.append(name)
    return search.fitted(SetStart(frozenset(names), model, beside))


def _with_shapes(search: SetSearch, whole: FittedCandidate) -> list[FittedCandidate]:
    """The sets with one flexible effect more, of those that promise most; the best two."""
    work.go_on()
    base = shape_search.baseline(whole.fit, search.base.prepared)
    entries = [e for e in search.entries.values() if unknowns_of(e) > 1 and e.name not in whole.names]
    begun = zip(entries, shape_search.starts_of(entries, base), strict=True)
    promising = sorted((pair for pair in begun if pair[1]), key=lambda pair: -pair[1][0].share)[:3]
    starts = [(entry, point) for entry, points in promising for point in points[:2]]
    found = list(filter(None, side_by_side(lambda start: _shaped(search, whole, *start), starts)))
    best = {c.names: c for c in sorted(found, key=by_power, reverse=True)}  # of two starts the better end
    return sorted(best.values(), key=by_power)[:2]


def _shaped(search: SetSearch, whole: FittedCandidate, entry: ModelTerm, point: Start) -> FittedCandidate | None:
    """A set with a flexible effect more: fitted with its shape held first, as its misfit has kinks along that."""
    amounts = point.coefficients or (0.0,) * len(entry.symbols)
    model = whole.fit.model.with_term(replace(entry, coefficients=amounts, parameters=point.parameters))
    names, shape = frozenset((*whole.names, entry.name)), entry.keys[len(entry.symbols) :]
    begun = search.fitted(SetStart(names, model, whole), held=shape)
    return None if begun is None else search.fitted(SetStart(names, begun.fit.model, begun))


def gains(smaller: FittedCandidate, larger: FittedCandidate, asked: int) -> bool:
    """Whether a larger set, the best of so many, leaves less of what neither was fitted to, and not by chance."""
    if smaller.prediction.prepared.record.stretches:
        one, other = (np.concatenate([c.fit.residual, c.prediction.residual]) for c in (smaller, larger))
    else:
        one, other = smaller.prediction.residual, larger.prediction.residual
    evenly = smaller.prediction.prepared.free  # of a decay: what a set explains lies in the loud blocks
    return statistics.gain(one, other, evenly=evenly).p_value * asked < ALPHA


def _parents(sets: Sequence[FittedCandidate], *, simple: bool) -> list[FittedCandidate]:
    """The best set and the best of simple effects; flexible ones imitate what several simple ones do together."""
    plain = next((c for c in sets if not c.flexible), None)
    parents = [plain] if simple else [next(iter(sets), None), plain]
    return list({id(c): c for c in parents if c is not None}.values())
