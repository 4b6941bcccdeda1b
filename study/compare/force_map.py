"""The missing force over the plane of displacement and velocity, as a map and as curves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
CELLS = 21  # along each axis of the map
CLASSES = 24  # of a curve
FEWEST = 8  # visits, for a mean with an error
REACH = 0.001  # quantile at each end where map and curves end


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
    keep = visits >= FEWEST
    return ForceCurve(centre[keep], mean[keep], error[keep])


def surface(u: Floats, v: Floats, force: Floats) -> Surface:
    """Mean force over the (u, v) plane in cells of equal size."""
    bounds = [edges(x, CELLS) for x in (u, v)]
    i, j = (np.searchsorted(e, x) - 1 for e, x in zip(bounds, (u, v), strict=True))
    inside = (i >= 0) & (i < CELLS) & (j >= 0) & (j < CELLS)
    mean, error, visits = _means(i * CELLS + j, force, inside, CELLS * CELLS)
    seen = visits >= FEWEST
    grids = [np.where(seen, x, np.nan).reshape(CELLS, CELLS) for x in (mean, error)]
    return Surface(bounds[0], bounds[1], grids[0], grids[1])


def edges(values: Floats, classes: int) -> Floats:
    """Edges of classes of equal width, shape (classes + 1,), from which a few extreme samples stand out."""
    low, high = (float(q) for q in np.quantile(values, [REACH, 1.0 - REACH]))
    return np.linspace(low, high, classes + 1)


def _means(
    place: NDArray[np.int64], values: Floats, inside: NDArray[np.bool_], classes: int
) -> tuple[Floats, Floats, Floats]:
    """Mean, standard error and number of visits of each class, shape (classes,).

    Neighbouring samples are no independent evidence: a run of samples in one class is one visit.
    """
    entered = inside & np.concatenate([[True], place[1:] != place[:-1]])
    visits = np.bincount(place[entered], minlength=classes).astype(np.float64)
    counts = np.maximum(np.bincount(place[inside], minlength=classes), 1.0)
    mean = np.bincount(place[inside], values[inside], minlength=classes) / counts
    spread = np.bincount(place[inside], (values[inside] - mean[place[inside]]) ** 2, minlength=classes) / counts
    return mean, np.sqrt(spread / np.maximum(visits - 1.0, 1.0)), visits
