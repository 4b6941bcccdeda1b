"""The sampling interval: stated, or worked out from a column of times."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.support.errors import StudyError, expect

Floats = NDArray[np.float64]
JITTER = 0.01  # of the sampling interval: the unevenness of sampling that is taken for even
ROUNDING = 0.4  # of the sampling interval: the coarsest rounding of printed times that still shows a lost sample


def even_interval(path: Path, time: Floats, place: Callable[[int], str]) -> tuple[float, float]:
    """Sampling interval and first time in seconds; ``place`` says where in the file a sample stands.

    The interval is the shortest decimal (of itself or of its inverse) that the times allow; times that lie exactly on
    a grid are met to the last bit.

    Raises
    ------
    StudyError
        If time stands still or runs backwards, has a gap, or leaves the even grid by more than 1 % of the
        interval (or, for times printed with few decimals, by more than these decimals explain).
    """
    steps = np.diff(time)
    mean = float(time[-1] - time[0]) / (len(time) - 1)
    back = int(np.argmax(steps <= 0.0))
    fault = "stands still" if steps[back] == 0.0 else "runs backwards"
    times = f"{time[back]:.9g} s, then {time[back + 1]:.9g} s"
    expect(steps[back] > 0.0, f"{path}: time {fault} in {place(back + 1)} ({times}); expected times that grow")
    grid = np.arange(len(time), dtype=np.float64)
    away = 0.5 * float(np.ptp(time - mean * grid))  # from the line that lies in the middle
    rounding = _rounding(time)
    if away > max(JITTER * mean, min(rounding, ROUNDING * mean)):
        raise StudyError(f"{path}: {_uneven(time, steps, place)}; expected even sampling (within 1 % of the interval)")
    exact = next((dt for dt in _candidates(mean) if np.array_equal(time[0] + dt * grid, time)), None)
    if exact is not None:
        return exact, float(time[0])
    slack = (2.0 * away + rounding) / (len(time) - 1)
    return shortest_decimal(mean, slack), float(time[0])


def shortest_decimal(interval: float, slack: float) -> float:
    """The interval that a rounded one stands for: of those within ``slack``, the fewest digits (or of its inverse)."""
    return next((dt for dt in _decimals(interval) if abs(dt - interval) <= slack), interval)


def _uneven(time: Floats, steps: Floats, place: Callable[[int], str]) -> str:
    usual = float(np.median(steps))
    widest = int(np.argmax(steps))
    if steps[widest] > 1.5 * usual:
        gap = f"{steps[widest]:.6g} s instead of {usual:.6g} s"
        return f"a gap of {gap} follows the time {time[widest]:.9g} s, before {place(widest + 1)}"
    worst = int(np.argmax(np.abs(steps - usual)))
    return f"sampling is uneven ({usual:.6g} s usually, {steps[worst]:.6g} s before {place(worst + 1)})"


def _rounding(time: Floats) -> float:
    """The last decimal place that the times are printed with, as a number of seconds."""
    largest = float(np.max(np.abs(time)))
    sample = time[:: max(1, len(time) // 1000)]
    for digits in range(10):
        scaled = sample * 10.0**digits
        if np.all(np.abs(scaled - np.rint(scaled)) <= 4.0 * np.spacing(largest * 10.0**digits)):
            return 10.0**-digits
    return 0.0


def _candidates(mean: float) -> Iterator[float]:
    """Intervals that the times may have been made with, the likeliest first."""
    yield from _decimals(mean)
    yield mean
    below = above = mean
    for _ in range(8):
        below, above = math.nextafter(below, 0.0), math.nextafter(above, math.inf)
        yield below
        yield above


def _decimals(interval: float) -> Iterator[float]:
    for digits in range(16):
        yield float(f"{interval:.{digits}e}")
        yield 1.0 / float(f"{1.0 / interval:.{digits}e}")
