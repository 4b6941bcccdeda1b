"""Which effects between sensors promise to explain what a measured linear part leaves: modes fitted to lines.

Forces and the term's force along the measured motion are inputs, the sensors outputs, and modes pass them on
(``measured_start``): a fit to the lines of a record takes hundredths of a second, and no free run.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from study.equations import formulas
from study.equations.layout import LINEAR, check
from study.equations.model import Model, ModelTerm, free
from study.equations.place import GROUND, Place
from study.equations.term import Term
from study.equations.terms import LIBRARY
from study.identify.frequency_domain.inputs import input_history, reverse_inputs
from study.identify.time_domain.placed_lines import placed_residual_lines
from study.identify.time_domain.shape_search import values_to_try
from study.records.prepared import Prepared
from study.records.record import Record
from study.structure.measured_start import line_fits
from study.structure.placed_candidates import external, one_sided
from study.support.arrays import Floats
from study.support.cores import cores
from study.support.errors import StudyError


@dataclass(frozen=True)
class Screened:
    """An effect at a place with the shape parameters that explain most of the lines, and the share that it explains."""

    entry: ModelTerm
    share: float


def between_sensors(model: Model, prepared: Prepared) -> tuple[Place, ...]:
    """Every place that the sensors show: each to the ground, and each two of them."""
    seen = [s.coordinate for s in prepared.sensors]
    pairs = [*((GROUND, c) for c in seen), *combinations(seen, 2)]
    known = {t.place.path: t.place for t in model.terms if t.place.kind == "between"}
    return tuple(known.get(frozenset(ends), Place("between", ends)) for ends in pairs)


def measured_entries(
    model: Model, prepared: Prepared, extra: Sequence[Term] = (), without: Sequence[str] = ()
) -> list[ModelTerm]:
    """Every nonlinear effect at every place that the sensors show and where the model does not have it.

    A force from outside is none: it is no property of a place.
    """
    known = {(t.term.name, t.place.path) for t in model.terms}
    effects = [t for t in (*LIBRARY.values(), *extra) if t.name not in (*LINEAR, *without)]
    found: list[ModelTerm] = []
    for term in (t for t in effects if not external(t) and not _linear(t)):
        for place in between_sensors(model, prepared):
            if (term.name, place.path) not in known:
                found.append(free(term, place))
                if one_sided(term):
                    found.append(free(term, Place("between", place.ends[::-1])))
    return [entry for entry in found if _fits_in(model, entry)]


def _linear(term: Term) -> bool:
    """Whether twice the motion has twice the force, at any time: the measured linear part holds it already."""
    if any("t" in formulas.names(c.shape) for c in term.components) or term.channels:
        return False
    u, v = (np.random.default_rng(1).standard_normal(200).cumsum() for _ in range(2))
    model = Model("alone", (replace(free(term), parameters=(0.3,) * len(term.parameters)),))

    def forces(times: float) -> list[Floats]:
        motion = {"force": 0.0 * u, "displacement": times * u, "velocity": times * v}
        return [input_history(item, Record(0.1, motion)) for item in reverse_inputs(model)]

    return all(np.allclose(b, 2.0 * a) for a, b in zip(forces(1.0), forces(2.0), strict=True))


def _fits_in(model: Model, entry: ModelTerm) -> bool:
    try:
        check(model.with_term(entry))
    except StudyError:
        return False
    return True


def screened_by_lines(
    model: Model, prepared: Prepared, entries: Sequence[ModelTerm], residual: Floats, modes: int
) -> list[Screened]:
    """Candidates with the shape parameters that explain most, the most promising first.

    ``residual`` is what the free run leaves of the fitting part, shape (samples, sensors): lines that stand out of it
    are tried as the frequencies of periodic effects. ``modes`` is how many there may be at most.
    """
    lines = placed_residual_lines(residual / prepared.scale) / (len(residual) * prepared.dt)
    alone = _left(model, prepared, modes)

    def best(entry: ModelTerm) -> Screened | None:
        left = {p: _left(_with(model, entry, p), prepared, modes) for p in _points(entry, model, prepared, lines)}
        point = min(left, key=lambda p: left[p], default=None)
        return None if point is None else Screened(replace(entry, parameters=point), 1.0 - left[point] / alone)

    with ThreadPoolExecutor(cores()) as pool:
        found = [s for s in pool.map(best, entries) if s is not None]
    return sorted((s for s in found if s.share > 0.0), key=lambda s: -s.share)


def _with(model: Model, entry: ModelTerm, point: tuple[float, ...]) -> Model:
    return model.with_term(replace(entry, parameters=point))


def _left(model: Model, prepared: Prepared, modes: int) -> float:
    """Share of the lines' power that a model leaves with as many modes as Bayes' criterion asks for."""
    try:
        fits = list(line_fits(model, prepared, modes))
    except StudyError:
        return np.inf
    return min(fits, key=lambda f: f.criterion).left if fits else np.inf


def _points(
    entry: ModelTerm, model: Model, prepared: Prepared, lines: Floats
) -> list[tuple[float, ...]]:  # fmt: skip
    e = entry.place.direction(model.coordinates)
    u = np.sum([w * prepared.record.motion(c)[0] for c, w in zip(model.coordinates, e, strict=True) if w], axis=0)
    u = u[slice(*prepared.plan.fit)]

    def near(_: str, shifts: Floats) -> Floats:
        return np.add.outer(lines, shifts / (len(u) * prepared.dt)).ravel()

    points: list[tuple[float, ...]] = [()]
    for parameter in entry.term.parameters:
        points = [(*p, x) for p in points for x in values_to_try(parameter, p, u, prepared.dt, near) if np.isfinite(x)]
    return points
