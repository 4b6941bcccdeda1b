"""What a channel must not be: with gaps, constant, saturated, too short."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FEWEST_SAMPLES = 16
SMALLEST, LARGEST = 1e-50, 1e50  # size of a value
SHORTEST, LONGEST = 1e-15, 1e15  # seconds between samples
FEWEST_CLIPPED = 10  # samples at the very same extreme value ...
CLIPPED_SHARE = 1e-3  # ... and this share of the record ...
CLIPPED_RATIO = 10.0  # ... and this many times as many as at the values next to it: then it is clipped
FEWEST_VALUES = 20  # with fewer different values it is a switched signal, not a clipped one
SAME = 1e-9  # of the range: values that differ by rounding errors only
NEAR = 0.05  # of the range: the values next to the extreme


def not_finite(values: Floats, place: Callable[[int], str]) -> str | None:
    """A sentence on the first sample without a number."""
    bad = np.flatnonzero(~np.isfinite(values))
    if not len(bad):
        return None
    value = "no number" if np.isnan(values[bad[0]]) else "an infinite value"
    more = f" and {len(bad) - 1} more" if len(bad) > 1 else ""
    return f"has {value} in {place(int(bad[0]))}{more}; fill the gap, or cut it away by 'samples: [first, last]'"


def beyond(values: Floats, place: Callable[[int], str]) -> str | None:
    """A sentence on a number of a size that no unit makes: its square, or its derivatives', may be no number."""
    size = np.abs(values)
    large = np.flatnonzero(size > LARGEST)
    if len(large):
        return f"holds {values[large[0]]:g} in {place(int(large[0]))}; expected numbers below {LARGEST:g}"
    if 0.0 < float(np.ptp(values)) < SMALLEST:
        return f"moves by {np.ptp(values):g} alone; expected a signal of more than {SMALLEST:g} in its unit"
    return None


def constant(values: Floats) -> str | None:
    """A sentence on a channel that does not move."""
    if np.ptp(values) > 0.0:
        return None
    return f"is {values[0] + 0.0:g} throughout; expected a signal that moves"


def change_after(values: Floats, period: int) -> float:
    """Rms of the change of a channel after so many samples over its own standard deviation; 0 in a single period."""
    later, size = values[period:] - values[: len(values) - period], float(np.std(values))
    return float(np.sqrt(np.mean(later**2))) / size if len(later) and size > 0.0 else 0.0


def saturated(values: Floats) -> str | None:
    """A sentence on a channel that rests at its highest or lowest value.

    A signal passes its extreme once, a coarsely digitised one a few times more often than the values next
    to it. A clipped one rests there. Signals of a few values (square waves, steps) and a lowest or highest
    value of zero (blows of a hammer) are no sign of clipping.
    """
    for extreme, side in ((float(np.max(values)), "highest"), (float(np.min(values)), "lowest")):
        count = int(np.count_nonzero(values == extreme))
        if extreme == 0.0 or count < max(FEWEST_CLIPPED, CLIPPED_SHARE * len(values)):
            continue
        below = np.rint(np.abs(values - extreme) / (SAME * np.ptp(values)))  # 0 at the extreme, whole numbers elsewhere
        different, times = np.unique(below, return_counts=True)
        if len(different) < FEWEST_VALUES:
            continue
        near = (different > 0.0) & (different <= NEAR / SAME)
        usual = float(np.mean(times[near])) if near.any() else float(np.median(times))
        if count > CLIPPED_RATIO * usual and not _comes_to_rest(values, extreme):
            return (
                f"rests at its {side} value {extreme:g} for {count} of {len(values)} samples, as a saturated channel "
                "does; expected a wider measuring range (or 'accept_saturated: true' if the signal is like that)"
            )
    return None


def _comes_to_rest(values: Floats, extreme: float) -> bool:
    """Whether a digitised motion slows down to rest at its extreme, as an axis does at the end of its moves.

    It comes there and leaves by the smallest step of its converter every time. What is clipped is cut off at the speed
    that it has, of many steps a sample; where the whole motion has no more than a step or two nothing can be told.
    """
    change = np.abs(np.diff(values))
    moving = change[change > SAME * float(np.ptp(values))]
    there = values == extreme
    edges = change[there[1:] != there[:-1]]
    step = float(np.min(moving, initial=np.inf))
    fast = float(np.mean(moving)) > CLIPPED_RATIO * step if len(moving) else False
    return bool(fast and len(edges) and np.all(edges < 1.5 * step))
