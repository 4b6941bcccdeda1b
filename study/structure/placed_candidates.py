"""Candidates of a structure: effects times places, preselected by what they would explain, then fitted in free run."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from study.compare.prediction import Prediction, predict
from study.equations import formulas, kernels
from study.equations.graph import Graph, Program
from study.equations.linear_part import connections
from study.equations.model import Model, ModelTerm, free
from study.equations.place import Place
from study.equations.term import Term
from study.equations.terms import effects_but
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.placed_search import PlacedBaseline, PlacedStart, placed_starts, with_placed_term
from study.identify.time_domain.weighted_fit import finished
from study.records.prepared import Prepared
from study.support.cores import cores
from study.support.errors import StudyError

FITTED = 12  # candidates that promise most, whatever they are: fitted in free run ...
AT_EACH_PLACE = 2  # ... with so many at each place that explain this share of what the best explains ...
PROMISING = 0.3
OF_EACH_EFFECT = 1  # ... and each effect where it explains most: the motion that it is judged by may lack its own part
SETTLED = 4  # of the candidates, the best: fitted on the whole fitting part and with enough steps

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class PlacedCandidate:
    """A candidate as fitted."""

    entry: ModelTerm  # the effect and its place
    fit: FreeRunFit
    prediction: Prediction

    @property
    def unphysical(self) -> str:
        """Why it is no physical effect as fitted; empty if it is one."""
        return physical(self.entry, self.fit.model)

    @property
    def left(self) -> float:
        """Mean square of what it leaves of the judging part, in shares of the sensors' sizes."""
        return self.prediction.error**2


def physical(entry: ModelTerm, model: Model) -> str:
    """Why a fitted term is no physical effect; empty if it is one."""
    values = model.values
    return entry.term.physical({own: values.get(key) for own, key in zip(entry.term.keys, entry.keys, strict=True)})


def external(term: Term) -> bool:
    """Whether it is a force from outside: none of its formulas names the motion."""
    texts = [c.shape for c in term.components] + ([term.state] if term.state else [])
    return not any({"u", "v"} & set(formulas.names(text)) for text in texts)


def one_sided(term: Term) -> bool:
    """Whether its force at the opposite motion is neither the same nor the opposite: it matters which end is second."""
    values = {p.name: 0.3 for p in term.parameters}
    motions = np.array([[0.7, 0.4], [1.3, -0.6], [0.2, 1.1]])
    for component in term.components:
        graph = Graph()
        nodes = {n: graph.input(n) for n in ("u", "v", "t", "z", *values, *term.channels)}
        program = graph.program([formulas.add_formula(graph, component.shape, nodes)])
        forces = [
            _value(program, {**values, "u": s * u, "v": s * v, "z": s * u}) for u, v in motions for s in (1.0, -1.0)
        ]
        if any(abs(abs(a) - abs(b)) > 1e-9 for a, b in zip(forces[::2], forces[1::2], strict=True)):
            return True
    return False


def _value(program: Program, values: dict[str, float]) -> float:
    known = program.with_inputs({name: values.get(name, 0.3) for name in program.inputs})
    return float(kernels.evaluate(known, {}, 1)[0, 0])


def candidate_entries(model: Model, extra: Sequence[Term] = (), without: Sequence[str] = ()) -> list[ModelTerm]:
    """Every effect at every place where the model does not have it.

    What depends on the sign of the motion alone, a stop on one side, is tried on either side of its place.
    """
    known = {(t.term.name, t.place.path) for t in model.terms}
    found: list[ModelTerm] = []
    for term in effects_but(without, extra):
        places = [Place("at", (c,)) for c in model.coordinates] if external(term) else connections(model)
        sided = not external(term) and one_sided(term)
        for place in places:
            if (term.name, place.path) not in known:
                found.append(free(term, place))
                if sided:
                    found.append(free(term, Place("between", place.ends[::-1])))
    return found


def screened(entries: Sequence[ModelTerm], base: PlacedBaseline) -> list[tuple[ModelTerm, list[PlacedStart]]]:
    """Candidates with the points that explain most, the most promising first; those that explain nothing left out."""

    def points(entry: ModelTerm) -> tuple[ModelTerm, list[PlacedStart]]:
        return entry, placed_starts(entry.term, entry.place, base)

    with ThreadPoolExecutor(cores()) as pool:
        tried = list(pool.map(points, entries))
    return sorted((item for item in tried if item[1]), key=lambda item: -item[1][0].share)


def worth_fitting(
    ordered: Sequence[tuple[ModelTerm, list[PlacedStart]]],
) -> list[tuple[ModelTerm, list[PlacedStart]]]:
    """Those worth a fit in free run: the first of all, of each place and of each effect."""
    best = ordered[0][1][0].share if ordered else 0.0
    places: dict[frozenset[str], int] = {}
    effects: dict[str, int] = {}
    chosen: list[tuple[ModelTerm, list[PlacedStart]]] = []
    for rank, (entry, points) in enumerate(ordered):
        path = entry.place.path if entry.place else frozenset[str]()
        near = places.get(path, 0) < AT_EACH_PLACE and points[0].share >= PROMISING * best
        if rank < FITTED or near or effects.get(entry.term.name, 0) < OF_EACH_EFFECT:
            chosen.append((entry, points))
            places[path] = places.get(path, 0) + 1
            effects[entry.term.name] = effects.get(entry.term.name, 0) + 1
    return chosen


def elsewhere(
    tried: Sequence[PlacedCandidate], ordered: Sequence[tuple[ModelTerm, list[PlacedStart]]]
) -> list[tuple[ModelTerm, list[PlacedStart]]]:
    """The best effect at the places where it was not tried and explains a share like that where it was.

    Two places that the sensors cannot tell apart explain alike: a place is believed only if the others were tried.
    """
    if not tried:
        return []
    best = min(tried, key=lambda c: (bool(c.unphysical), c.left)).entry
    done = {c.entry.name for c in tried}
    share = max(points[0].share for entry, points in ordered if entry.term.name == best.term.name)
    return [
        (entry, points)
        for entry, points in ordered
        if entry.term.name == best.term.name and entry.name not in done and points[0].share >= PROMISING * share
    ]


def try_placed(
    chosen: Sequence[tuple[ModelTerm, list[PlacedStart]]], base: PlacedBaseline, progress: Progress
) -> list[PlacedCandidate]:
    """Fit and judge candidates; those that cannot be fitted are left out, of two sides of a place the better stays."""

    def fitted(item: tuple[ModelTerm, list[PlacedStart]]) -> PlacedCandidate | None:
        entry, points = item
        try:
            fit = with_placed_term(base.fit, entry, base.prepared, base, points)
        except StudyError:
            return None
        prediction = predict(fit, base.prepared)
        return None if prediction.diverged else PlacedCandidate(entry, fit, prediction)

    done: list[PlacedCandidate] = []
    with ThreadPoolExecutor(cores()) as pool:
        for candidate in pool.map(fitted, chosen):
            progress("")
            if candidate is not None:
                done.append(candidate)
    return one_side(done)


def one_side(candidates: Sequence[PlacedCandidate]) -> list[PlacedCandidate]:
    """Of candidates that are the same effect on two sides of a place the better."""
    best: dict[tuple[str, frozenset[str]], PlacedCandidate] = {}
    for candidate in sorted(candidates, key=lambda c: (bool(c.unphysical), c.left)):
        best.setdefault((candidate.entry.term.name, candidate.entry.place.path), candidate)
    return list(best.values())


def with_best_placed_settled(tried: Sequence[PlacedCandidate], prepared: Prepared) -> list[PlacedCandidate]:
    """The best candidates fitted as they would be if they were added, then the others."""
    ordered = sorted(tried, key=lambda c: (bool(c.unphysical), c.left))

    def settle(candidate: PlacedCandidate) -> PlacedCandidate:
        try:
            fit = finished(candidate.fit, prepared)
        except StudyError:
            return candidate
        prediction = predict(fit, prepared)
        return candidate if prediction.diverged else PlacedCandidate(candidate.entry, fit, prediction)

    with ThreadPoolExecutor(cores()) as pool:
        return [*pool.map(settle, ordered[:SETTLED]), *ordered[SETTLED:]]
