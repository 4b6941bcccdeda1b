"""What belongs together: for each block of time, in which bands the difference lies and which motions were visited.

A stretch of time, a band of frequency and a range of amplitudes are tied to each other through blocks of the
judging part: a band through the power of the difference in each block, an amplitude through the samples of each
block that reach it. The sums over blocks are those of the spectra, maps and curves of a comparison.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft, rfftfreq

from study.compare.comparison import Comparison
from study.compare.force_map import CLASSES, cells_of, edges
from study.records.spectra import Segments

Floats = NDArray[np.float64]
BLOCKS = 64  # at most
SHORTEST = 16  # samples in a block
WINDOW = 256  # samples in the spectrum of a block, at most


@dataclass(frozen=True)
class Classes:
    """Visits and missing force in classes of a quantity, block by block."""

    edges: Floats  # of the classes: those of ``force_map.curve``; shape (classes + 1,)
    visits: Floats  # samples in the class; shape (blocks, classes)
    force: Floats  # their sum of the missing force; shape (blocks, classes)


@dataclass(frozen=True)
class Links:
    """Blocks of the judging part."""

    edges: Floats  # times in seconds; shape (blocks + 1,)
    frequency: Floats  # in hertz; shape (lines,)
    power: Floats  # autospectral density of the difference around the middle of each block; shape (blocks, lines)
    displacement: Classes  # what each block holds of the curves
    velocity: Classes
    cells: Floats  # samples in the cells of the map, by displacement, then velocity; shape (blocks, cells^2)


def links(comparison: Comparison) -> Links:
    """Tie the stretches, bands and amplitudes of a comparison to each other."""
    n = len(comparison.prediction.residual)
    count = int(np.clip(n // SHORTEST, 1, BLOCKS))
    bounds = np.linspace(0, n, count + 1).round().astype(np.int64)
    lacking = comparison.missing_force
    block = np.searchsorted(bounds, np.arange(n), side="right") - 1
    place = block[lacking.inner]
    u, v, force = (x[lacking.inner] for x in (lacking.displacement, lacking.velocity, lacking.force))
    frequency, power = _spectra(comparison.prediction.residual, comparison.prediction.dt, bounds)
    time = comparison.prediction.time
    times = np.append(time[bounds[:-1]], time[-1] + comparison.prediction.dt)
    return Links(
        times, frequency, power, _classes(u, force, place, count),
        _classes(v, force, place, count), _cells(u, v, place, count),
    )  # fmt: skip


def _spectra(values: Floats, dt: float, bounds: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Density around the middle of each block, from a window that may reach beyond it."""
    length = min(WINDOW, 2 ** int(np.log2(len(values))))
    taper = Segments(length).taper()
    first = np.clip((bounds[1:] + bounds[:-1] - length) // 2, 0, len(values) - length)
    cut = np.lib.stride_tricks.sliding_window_view(values, length)[first] * taper
    density = 2.0 * dt / np.sum(taper**2) * np.abs(np.asarray(rfft(cut, axis=1))) ** 2
    return np.asarray(rfftfreq(length, dt)), density


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
