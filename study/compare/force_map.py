"""The missing force over the plane of displacement and velocity, as a map and as curves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.support.arrays import Floats

CELLS = (21, 15, 11, 7)  # along each axis of the map, from the finest
CLASSES = 24  # of a curve
FEWEST_VISITS = 8  # for a mean with an error
END_QUANTILE = 0.001  # where map and curves end, on each side


@dataclass(frozen=True)
class ForceCurve:
    """Mean missing force in classes of a quantity; arrays of shape (classes,)."""

    at: Floats  # mean of the quantity in the class
    mean: Floats  # of the force
    error: Floats  # standard error of the mean: a stay in a class counts once, however many samples it has


@dataclass(frozen=True)
class Surface:
    """Mean missing force in cells of the (u, v) plane."""

    displacement: Floats  # edges of the cells; shape (cells + 1,)
    velocity: Floats  # the same
    mean: Floats  # by displacement, then velocity; NaN where the motion hardly came; shape (cells, cells)
    error: Floats  # standard error of the mean; shape (cells, cells)


def curve(at: Floats, force: Floats) -> ForceCurve:
    """Mean force against a quantity, in classes of equal width that hold enough visits."""
    bounds = edges(at, CLASSES)
    place = np.searchsorted(bounds, at) - 1
    inside = (place >= 0) & (place < CLASSES)
    mean, error, visits = _means(place, force, inside, CLASSES)
    centre = _means(place, at, inside, CLASSES)[0]
    keep = visits >= FEWEST_VISITS
    return ForceCurve(centre[keep], mean[keep], error[keep])


def surface(u: Floats, v: Floats, force: Floats, cells: int | None = None) -> Surface:
    """Mean force over the (u, v) plane in cells of equal size, as many along an axis as :func:`cells_of` says."""
    cells = cells or cells_of(u, v)
    bounds = [edges(x, cells) for x in (u, v)]
    place, inside = _cell(u, v, bounds)
    mean, error, visits = _means(place, force, inside, cells * cells)
    seen = visits >= FEWEST_VISITS
    grids = [np.where(seen, x, np.nan).reshape(cells, cells) for x in (mean, error)]
    return Surface(bounds[0], bounds[1], grids[0], grids[1])


def cells_of(u: Floats, v: Floats) -> int:
    """Cells along each axis: the most of which those that have a mean hold the greater part of the motion."""
    for cells in CELLS:
        place, inside = _cell(u, v, [edges(x, cells) for x in (u, v)])
        visits = np.bincount(place[_entered(place, inside)], minlength=cells * cells)
        if np.count_nonzero(visits[place[inside]] >= FEWEST_VISITS) > 0.5 * len(u):
            return cells
    return CELLS[-1]


def _cell(u: Floats, v: Floats, bounds: list[Floats]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Number of each sample's cell, and whether it lies in one."""
    i, j = (np.searchsorted(e, x) - 1 for e, x in zip(bounds, (u, v), strict=True))
    cells = len(bounds[0]) - 1
    return i * cells + j, (i >= 0) & (i < cells) & (j >= 0) & (j < cells)


def _entered(place: NDArray[np.int64], inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where a visit begins. Neighbouring samples are no independent evidence: a run in one class is one visit."""
    return inside & np.concatenate([[True], place[1:] != place[:-1]])


def edges(values: Floats, classes: int) -> Floats:
    """Edges of classes of equal width, shape (classes + 1,), from which a few extreme samples stand out."""
    low, high = (float(q) for q in np.quantile(values, [END_QUANTILE, 1.0 - END_QUANTILE]))
    return np.linspace(low, high, classes + 1)


def _means(
    place: NDArray[np.int64], values: Floats, inside: NDArray[np.bool_], classes: int
) -> tuple[Floats, Floats, Floats]:
    """Mean, standard error and number of visits of each class, shape (classes,)."""
    visits = np.bincount(place[_entered(place, inside)], minlength=classes).astype(np.float64)
    counts = np.maximum(np.bincount(place[inside], minlength=classes), 1.0)
    mean = np.bincount(place[inside], values[inside], minlength=classes) / counts
    spread = np.bincount(place[inside], (values[inside] - mean[place[inside]]) ** 2, minlength=classes) / counts
    return mean, np.sqrt(spread / np.maximum(visits - 1.0, 1.0)), visits
