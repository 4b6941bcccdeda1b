"""What belongs together: for each block of time, in which bands the difference lies and which motions were visited.

A stretch of time, a band of frequency and a range of amplitudes are tied to each other through blocks of the
judging part: a band through the power of the difference in each block, an amplitude through the samples of each
block that reach it. The sums over blocks are those of the spectra, maps and curves of a comparison.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft, rfftfreq

from study.compare.force_map import CLASSES, cells_of, edges
from study.compare.missing_force import MissingForce
from study.compare.prediction import Prediction, SensorPrediction
from study.records.spectra import Segments
from study.support.arrays import Floats
from study.support.statistics import IN_A_BLOCK

LINK_BLOCKS = 64  # of time, at most


@dataclass(frozen=True)
class Classes:
    """Visits and missing force in classes of a quantity, block by block."""

    edges: Floats  # of the classes: those of ``force_map.curve``; shape (classes + 1,)
    visits: Floats  # samples in the class; shape (blocks, classes)
    force: Floats  # their sum of the missing force; shape (blocks, classes)


@dataclass(frozen=True)
class Visits:
    """The motions at one place, block by block."""

    displacement: Classes  # what each block holds of the curves
    velocity: Classes
    cells: Floats  # samples in the cells of the map, by displacement, then velocity; shape (blocks, cells^2)


def times_of_blocks(prediction: Prediction) -> Floats:
    """Edges of the blocks of the judging part in seconds, shape (blocks + 1,)."""
    time = prediction.time
    return np.append(time[_bounds(len(time))[:-1]], time[-1] + prediction.dt)


def power_in_blocks(seen: SensorPrediction) -> tuple[Floats, Floats]:
    """Lines in hertz, and the autospectral density of a sensor's difference about the middle of each block.

    Shapes (lines,) and (blocks, lines). The window of a spectrum may reach beyond its block.
    """
    values, bounds = seen.residual, _bounds(len(seen.residual))
    length = min(256, 2 ** int(np.log2(len(values))))  # samples in the spectrum of a block, at most
    taper = Segments(length).taper()
    first = np.clip((bounds[1:] + bounds[:-1] - length) // 2, 0, len(values) - length)
    cut = np.lib.stride_tricks.sliding_window_view(values, length)[first] * taper
    density = 2.0 * seen.dt / np.sum(taper**2) * np.abs(np.asarray(rfft(cut, axis=1))) ** 2
    return np.asarray(rfftfreq(length, seen.dt)), density


def visits_in_blocks(lacking: MissingForce) -> Visits:
    """What each block holds of the motions at the place where a force is missing."""
    n = len(lacking.force)
    bounds = _bounds(n)
    count = len(bounds) - 1
    block = (np.searchsorted(bounds, np.arange(n), side="right") - 1)[lacking.inner]
    u, v, force = (x[lacking.inner] for x in (lacking.displacement, lacking.velocity, lacking.force))
    return Visits(_classes(u, force, block, count), _classes(v, force, block, count), _cells(u, v, block, count))


def _bounds(samples: int) -> NDArray[np.int64]:
    """First sample of each block, and the one after the last."""
    return np.linspace(0, samples, int(np.clip(samples // IN_A_BLOCK, 1, LINK_BLOCKS)) + 1).round().astype(np.int64)


def _place(values: Floats, bounds: Floats) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    place = np.searchsorted(bounds, values) - 1
    return place, (place >= 0) & (place < len(bounds) - 1)


def _classes(values: Floats, force: Floats, block: NDArray[np.int64], count: int) -> Classes:
    bounds = edges(values, CLASSES)
    place, inside = _place(values, bounds)
    where = (block * CLASSES + place)[inside]
    visits = np.bincount(where, minlength=count * CLASSES).astype(np.float64)
    sums = np.asarray(np.bincount(where, force[inside], minlength=count * CLASSES), dtype=np.float64)
    return Classes(bounds, visits.reshape(count, CLASSES), sums.reshape(count, CLASSES))


def _cells(u: Floats, v: Floats, block: NDArray[np.int64], count: int) -> Floats:
    cells = cells_of(u, v)
    (i, in_u), (j, in_v) = (_place(x, edges(x, cells)) for x in (u, v))
    inside = in_u & in_v
    where = (block * cells**2 + i * cells + j)[inside]
    return np.bincount(where, minlength=count * cells**2).astype(np.float64).reshape(count, cells**2)
