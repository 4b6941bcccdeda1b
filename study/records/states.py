"""Displacement and velocity at some instants of a record, and the angular rate of its motion."""

from collections.abc import Sequence
from functools import lru_cache, partial

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from study.records.outputs import Outputs
from study.records.record import ALONE, MOTIONS, Record, Sensor
from study.support.arrays import Floats
from study.support.recent import Recent

REACH = 0.2  # half width, in periods, of the cubic that smooths a displacement into a state
_STATES = Recent(most=16, largest=1 << 23)  # every candidate asks for the same; a long record is not kept for it


def angular_rate(values: Floats, dt: float) -> float:
    """Typical angular frequency of a motion in rad/s: rms of its derivative over its own."""
    size = float(np.std(values))
    return float(np.sqrt(np.mean(np.diff(values) ** 2))) / (dt * size) if size > 0.0 else 1.0 / dt


def period(values: Floats) -> float:
    """Samples in a period of a motion: four times the lag at which the autocorrelation first vanishes.

    White noise does not move it.
    """
    n, centred = len(values), values - np.mean(values)
    size = next_fast_len(2 * n)
    correlation = irfft(np.abs(rfft(centred, size)) ** 2, size)[:n]
    below = np.flatnonzero(correlation <= 0.0)
    return 4.0 * float(below[0]) if len(below) else 4.0 * n


def starting_states(
    record: Record, outputs: Outputs, samples: Sequence[int], reach: float = REACH,
    coordinates: Sequence[str] = (ALONE,),
) -> Floats:  # fmt: skip
    """Displacements, then velocities of all coordinates at some samples, shape (samples, 2 coordinates).

    A displacement that is compared is smoothed by a cubic over a part of its period, which yields the velocity too;
    what neither it nor a channel of the record shows is zero.
    """
    states = np.empty((len(samples), 2, len(coordinates)))
    for i, coordinate in enumerate(coordinates):
        own = Sensor(coordinate, "displacement")
        if own in outputs.sensors:
            of = record, str(own), tuple(samples), reach
            states[:, :, i] = _STATES.get(of, 8 * len(record) * len(record.channels), partial(_smoothed, *of))
            continue
        for row, motion in enumerate(MOTIONS[:2]):  # of a prescribed motion too, where the force is what is predicted
            channel = str(Sensor(coordinate, motion))
            states[:, row, i] = record[channel][list(samples)] if channel in record else 0.0
    return states.reshape(len(samples), -1)


def _smoothed(record: Record, displacement: str, samples: tuple[int, ...], reach: float) -> Floats:
    """Displacement and velocity of one coordinate from its displacement, shape (samples, 2)."""
    values = record[displacement]
    if record.stretches:  # a wrong velocity may keep the fit of a stretch's state from its minimum
        wanted = round(reach * period(values))
    else:
        wanted = round(reach * 2.0 * np.pi / (angular_rate(values, record.dt) * record.dt))
    states = np.empty((len(samples), 2))
    for i, sample in enumerate(samples):
        begin, end = record.stretch_of(sample)
        half = int(np.clip(wanted, 2, max((end - begin - 1) // 2, 1)))
        first = max(begin, min(sample - half, end - 2 * half - 1))
        window = values[first : first + 2 * half + 1]
        states[i] = _smoothing(first - sample, len(window), half) @ window / np.array([1.0, half * record.dt])
    return states


@lru_cache(maxsize=256)
def _smoothing(first: int, count: int, half: int) -> Floats:
    """The linear map from a window to the value and slope of its cubic at zero, shape (2, count)."""
    offset = (first + np.arange(count)) / half
    inverse = np.linalg.pinv(np.vander(offset, min(4, count), increasing=True))
    return np.asarray(inverse[:2], dtype=np.float64)
