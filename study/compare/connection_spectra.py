"""The dynamic stiffness of each connection as spectra show it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.compare.comparison import Comparison
from study.compare.noise import segments_of
from study.identify.frequency_domain import coefficients, conditioned
from study.identify.frequency_domain.inputs import Input
from study.identify.frequency_domain.reverse_system import Equation, equations_of
from study.records import spectra
from study.support.arrays import Floats
from study.support.errors import StudyError


@dataclass(frozen=True, eq=False)
class DynamicStiffness:
    """A_j(f) of the relative displacement at a connection; arrays of shape (lines,).

    Attributes
    ----------
    equation : str
        The coordinate whose equation it is read from: where other inputs determine least of it.
    frequency : array
        In hertz.
    measured, error : array
        Real part by conditioned spectra (the report's Sections 4.2 to 4.5), and its standard error, in N/m.
    model : array
        That of the fitted model.
    """

    equation: str
    frequency: Floats
    measured: Floats
    error: Floats
    model: Floats


def highest_frequency(comparison: Comparison) -> float:
    """Where pictures of spectra end, in hertz: above the modes, below half of the sampling frequency."""
    half = 0.5 / comparison.prepared.dt
    # pictures of spectra end somewhat above the highest natural frequency
    fastest = 1.6 * float(np.max(comparison.modes.frequency, initial=0.0))
    return min(half, fastest) if fastest > 0.0 else half


def dynamic_stiffnesses(comparison: Comparison) -> dict[frozenset[str], DynamicStiffness]:
    """The dynamic stiffness of every connection with a linear term; none where no equation or line can be read."""
    model, prepared = comparison.fit.model, comparison.prepared
    if not comparison.missing.equations:
        return {}
    try:
        equations, _ = equations_of(model, prepared)
    except StudyError:
        return {}
    paths = {t.place.label: t.place.path for t in model.terms if t.place.kind != "couples"}
    best: dict[frozenset[str], tuple[float, DynamicStiffness]] = {}
    for equation in equations:
        matrix = spectra.cross_spectra(equation.channels, prepared.dt, segments_of(len(equation.channels[0])))
        found = conditioned.analyse(matrix)
        share = coefficients.independent_share(found, matrix)
        inside = (found.frequency > 0.0) & (found.frequency <= highest_frequency(comparison))
        for j, item in enumerate(equation.inputs if np.any(inside) else ()):  # segments may be too short for any line
            path = _path(item, paths)
            own = float(np.median(share[inside, j]))
            if path is not None and item.linear and own > best.get(path, (0.0, None))[0]:
                best[path] = own, _read(equation, item, j, found, inside, model.numbers())
    return {path: read for path, (_, read) in best.items()}


def _path(item: Input, paths: Mapping[str, frozenset[str]]) -> frozenset[str] | None:
    """The place of an input that stands for one alone."""
    labels = {p.symbol[p.symbol.index("[") + 1 : -1] for p in item.parts}
    known = {paths[label] for label in labels if label in paths}
    return known.pop() if len(known) == 1 else None


def _read(
    equation: Equation, item: Input, j: int, found: conditioned.MisoResult, inside: NDArray[np.bool_],
    values: dict[str, float],
) -> DynamicStiffness:  # fmt: skip
    scale = 1.0 if equation.mass is None else values[equation.mass]
    frequency = found.frequency[inside]
    error = np.sqrt(0.5 * found.covariance[inside, j, j].real) * scale
    exact = item.response(frequency, values).real
    return DynamicStiffness(equation.coordinate, frequency, found.response[j][inside].real * scale, error, exact)
