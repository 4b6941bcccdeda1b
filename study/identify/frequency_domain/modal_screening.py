"""Which effects between sensors promise to explain what a modal linear part leaves: modes fitted to lines.

Forces and the term's force along the measured motion are inputs, the sensors outputs, and modes pass them on
(``modal_lines``): a fit to the lines of a record takes hundredths of a second, and no free run.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from study.equations.model import Model, ModelTerm
from study.identify.frequency_domain.modal_lines import line_fits
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.shape_search import PITCHES, Screened, Start, highest_lines, values_to_try, windowed
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.cores import cores
from study.support.errors import StudyError


def screened_by_lines(
    model: Model, prepared: Prepared, entries: Sequence[ModelTerm], fit: FreeRunFit
) -> list[Screened]:  # fmt: skip
    """Candidates with the shape parameters that explain most, the most promising first.

    ``fit`` is that without any of them: lines that stand out of what its free run leaves are tried as the frequencies
    of periodic effects, and there may be as many modes as it has.
    """
    power = np.sum([np.abs(windowed(left)) ** 2 for left in (fit.misfit / prepared.scale).T], axis=0)
    lines = np.array(highest_lines(power)) / (fit.samples * prepared.dt)
    modes = fit.model.modal.count if fit.model.modal else 0
    alone = _left(model, prepared, modes)

    def best(entry: ModelTerm) -> Screened | None:
        left = {p: _left(_with(model, entry, p), prepared, modes) for p in _points(entry, model, prepared, lines)}
        point = min(left, key=lambda p: left[p], default=None)
        if point is None:
            return None
        return Screened(replace(entry, parameters=point), (Start(point, (), 1.0 - left[point] / alone),))

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

    def near(kind: str, shifts: Floats) -> Floats:
        if kind == PITCHES:  # what is left beside modes is not looked at along a displacement
            return np.zeros(0)
        return np.add.outer(lines, shifts / (len(u) * prepared.dt)).ravel()

    points: list[tuple[float, ...]] = [()]
    for parameter, given in zip(entry.term.parameters, entry.parameters, strict=True):
        points = [
            (*point, x)
            for point in points
            for x in ([given] if given is not None else values_to_try(parameter, point, u, prepared.dt, near))
            if np.isfinite(x)
        ]
    return points
