"""In which frequency band does the unexplained power lie?"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from study.compare.force_error import ForceError
from study.compare.prediction import SensorPrediction
from study.support.arrays import Floats

MOST_OF_POWER = 2.0 / 3.0  # that is unexplained, at least, lies in the band that is named
STANDS_OUT = 2.0  # standard errors above the noise, for a line to count


@dataclass(frozen=True)
class Band:
    """The narrowest band that holds most of what is unexplained."""

    of: str  # ``response`` or ``force``; of several sensors, which
    low: float  # in hertz
    high: float  # in hertz
    share: float  # share of the unexplained power that lies in it


def bands(views: Sequence[SensorPrediction], forces: Sequence[ForceError]) -> tuple[Band, ...]:
    """The bands of each response and each force; one that has nothing unexplained is left out."""
    widest = [
        *(narrowest(str(v.sensor) if len(views) > 1 else "response", v.noise.frequency, _response(v)) for v in views),
        *(narrowest(f"force at {f.coordinate}" if len(views) > 1 else "force", f.frequency, _force(f)) for f in forces),
    ]
    return tuple(band for band in widest if band is not None)


def _response(view: SensorPrediction) -> Floats:
    """Density of the response that stands above the noise, shape (lines,)."""
    noise = view.noise
    spread = STANDS_OUT / np.sqrt(noise.averages)
    response = np.where(noise.residual > noise.density * (1.0 + spread), noise.residual - noise.density, 0.0)
    response[noise.frequency < view.prepared.low] = 0.0
    return response


def _force(force: ForceError) -> Floats:
    """Density of the force that no input explains, shape (lines,)."""
    return np.where(force.band & (force.unexplained > force.noise), force.unexplained - force.noise, 0.0) * force.force


def narrowest(of: str, frequency: Floats, power: Floats, most: float = MOST_OF_POWER) -> Band | None:
    """The shortest run of lines which holds at least ``most`` of the power; of several, the one with most power.

    A line stands for the band of its width about it.
    """
    total = float(np.sum(power))
    if not total > 0.0:
        return None
    sums = np.concatenate([[0.0], np.cumsum(power)])
    ends = np.searchsorted(sums, sums[:-1] + most * total * (1.0 - 1e-12))
    first = np.flatnonzero(ends < len(sums))
    length = ends[first] - first
    inside = sums[ends[first]] - sums[first]
    best = first[np.lexsort((-inside, length))[0]]
    half = 0.5 * float(frequency[1])
    low, high = float(frequency[best]) - half, float(frequency[ends[best] - 1]) + half
    return Band(of, max(low, 0.0), min(high, float(frequency[-1])), float(sums[ends[best]] - sums[best]) / total)
