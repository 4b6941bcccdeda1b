"""Hum: a line in the response that the structure did not pass on.

A force of one frequency would leave the same line. What tells them apart is the frequency, that of the mains or one of
its multiples, as the sampling shows it; or a force beyond reason that the line would ask for.
"""

import numpy as np
from scipy.fft import rfft
from scipy.special import fdtrc

from study.faults.fault import HUM, Fault
from study.faults.leftover import FittedResidual, share
from study.support.arrays import Floats
from study.support.thresholds import ALPHA

MAINS = (50.0, 60.0)  # hertz
MULTIPLES = 6  # of them
WANDER = 1e-3  # share by which the mains' frequency wanders
BESIDE = 24  # lines on either side that a line is held against
NEAREST = 3  # of them, left out: a line between two shows in its neighbours
SLOWEST = 12  # lines from zero that are drift, not hum


def hum(left: FittedResidual, asked: int) -> Fault | None:
    """The strongest line of the residual, None where none stands out of its neighbours by more than chance."""
    frequency = strongest_line(left, ALPHA / asked)
    if frequency is None:
        return None
    frequency = _refined(frequency, left)
    found = share(left, line(frequency, left))
    if found is None or not found.significant(asked):
        return None
    amplitude = float(np.hypot(*found.amounts))
    direction = found.amounts / amplitude
    error = float(np.sqrt(max(direction @ found.covariance @ direction, 0.0)))
    turn = 2.0 * np.pi * frequency * left.prepared.dt * np.arange(len(left.prepared.record))
    waveform = found.amounts[0] * np.cos(turn) + found.amounts[1] * np.sin(turn)
    unit = left.prepared.record.units.get(left.prepared.response, "")
    return Fault(
        HUM, left.prepared.response, amplitude, error, unit, found.gain.explained, waveform, frequency=frequency
    )


def is_of_the_mains(frequency: float, left: FittedResidual) -> bool:
    """Whether a frequency is that of the mains or a multiple, or what the sampling makes of these, to a line."""
    dt = left.prepared.dt
    line = 1.0 / (dt * (len(left.fit.residual) + len(left.residual[1])))
    for multiple in range(1, MULTIPLES + 1):
        for mains in MAINS:
            true = multiple * mains
            seen = abs((true * dt + 0.5) % 1.0 - 0.5) / dt
            if abs(frequency - seen) < max(line, WANDER * true if seen == true else 0.0):
                return True
    return False


def line(frequency: float, left: FittedResidual) -> tuple[Floats, Floats]:
    """Cosine and sine on both parts."""
    turns = [2.0 * np.pi * frequency * left.prepared.dt * places for places in left.samples]
    first, second = (np.column_stack([np.cos(turn), np.sin(turn)]) for turn in turns)
    return first, second


def strongest_line(left: FittedResidual, level: float) -> float | None:
    """Frequency in hertz of the line that stands highest over its neighbours, by the F test of all lines."""
    residual = np.concatenate(left.residual)
    n = len(residual)
    power = np.abs(np.asarray(rfft(residual * np.hanning(n)))) ** 2
    if len(power) < 4 * BESIDE:
        return None
    kernel = np.ones(2 * BESIDE + 1)
    kernel[BESIDE - NEAREST : BESIDE + NEAREST + 1] = 0.0
    count = np.convolve(np.ones_like(power), kernel, "same")
    level_beside = np.convolve(power, kernel, "same") / count
    ratio = power / np.maximum(level_beside, np.finfo(float).tiny)
    ratio[:SLOWEST] = 0.0
    ratio[-2:] = 0.0
    best = int(np.argmax(ratio))
    # A taper lets neighbours share power: of the lines beside, about half are independent.
    p_value = float(fdtrc(2.0, float(count[best]), float(ratio[best]))) * len(power)
    return best / (n * left.prepared.dt) if p_value < level else None


def _refined(frequency: float, left: FittedResidual) -> float:
    """The frequency at which the line takes most of both parts, within a line to either side."""
    resolution = 1.0 / (left.prepared.dt * (len(left.residual[0]) + len(left.residual[1])))
    places, residual = np.concatenate(left.samples), np.concatenate(left.residual)
    taper = np.hanning(len(residual))
    for width in (1.0, 0.2, 0.04, 0.008):
        tried = frequency + width * resolution * np.linspace(-1.0, 1.0, 11)
        turns = np.exp(-2j * np.pi * left.prepared.dt * np.outer(tried, places))
        frequency = float(tried[int(np.argmax(np.abs(turns @ (taper * residual))))])
    return frequency
