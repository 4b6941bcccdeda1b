"""Long records for a narrow screen: the least and the greatest value of each bucket, so that no peak is lost."""

import numpy as np
from numpy.typing import NDArray

from study.support.arrays import Floats

BUCKETS = 1200  # about one for each column of pixels


def extremes(values: Floats, buckets: int = BUCKETS) -> Floats:
    """Least and greatest value of each bucket, in the order in which they come; short records stay as they are."""
    if len(values) <= 2 * buckets:
        return values
    starts = _starts(len(values), buckets)
    low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    ends = np.append(starts[1:], len(values))
    rising = np.array([np.argmin(values[a:b]) <= np.argmax(values[a:b]) for a, b in zip(starts, ends, strict=True)])
    return np.where(rising, [low, high], [high, low]).T.ravel()


def times(time: Floats, buckets: int = BUCKETS) -> Floats:
    """The times that belong to :func:`extremes`: first sample and middle of each bucket."""
    if len(time) <= 2 * buckets:
        return time
    starts = _starts(len(time), buckets)
    ends = np.append(starts[1:], len(time))
    return np.stack([time[starts], time[(starts + ends) // 2]], axis=1).ravel()


def gaps(time: Floats, shown: Floats, dt: float) -> NDArray[np.int64]:
    """Places in the times that are shown at which a line breaks: before them lies time that is not in ``time``."""
    after = time[1:][np.diff(time) > 1.5 * dt]
    return np.searchsorted(shown, after - 0.5 * dt).astype(np.int64)


def broken(values: Floats, places: NDArray[np.int64]) -> Floats:
    """Values with one that is none at each gap."""
    return np.insert(values, places, np.nan) if len(places) else values


def _starts(samples: int, buckets: int) -> NDArray[np.int64]:
    return np.linspace(0, samples, buckets + 1).astype(np.int64)[:-1]
