"""Rates and means over trials, each with its 95 % interval."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

NORMAL = 1.959963984540054  # 97.5 % of a standard normal variable lie below


@dataclass(frozen=True)
class Rate:
    """A value over trials."""

    trials: int
    value: float  # nan without a trial
    low: float  # of the 95 % interval
    high: float


NO_TRIALS = Rate(0, math.nan, math.nan, math.nan)


def proportion(successes: Sequence[float], asked: Sequence[float] | None = None) -> Rate:
    """Share of successes with its interval (Wilson, 1927); of ``asked`` in each trial, one if left out.

    What is asked in one trial is no independent sample: where the trials scatter more than so many independent answers
    would, the interval is that of as many as scatter as they do (Rao and Scott, 1992).
    """
    if not len(successes):
        return NO_TRIALS
    good, all_asked = np.asarray(successes, dtype=np.float64), np.ones(len(successes))
    if asked is not None:
        all_asked = np.asarray(asked, dtype=np.float64)
    total, n = float(np.sum(all_asked)), len(good)
    p = float(np.sum(good)) / total
    binomial = p * (1.0 - p) / total
    excess = 1.0
    if asked is not None and binomial > 0.0 and n > 1:
        excess = max(1.0, n / (n - 1) * float(np.sum((good - p * all_asked) ** 2)) / total**2 / binomial)
    return Rate(n, p, *_wilson(p, total / excess))


def _wilson(p: float, n: float) -> tuple[float, float]:
    z2 = NORMAL**2
    middle = (p + 0.5 * z2 / n) / (1.0 + z2 / n)
    half = NORMAL / (1.0 + z2 / n) * math.sqrt(p * (1.0 - p) / n + 0.25 * z2 / n**2)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def mean(values: Sequence[float]) -> Rate:
    """Mean with its interval from the scatter; none of a single value."""
    if not len(values):
        return NO_TRIALS
    middle, n = float(np.mean(values)), len(values)
    half = NORMAL * float(np.std(values, ddof=1)) / math.sqrt(n) if n > 1 else math.inf
    return Rate(n, middle, middle - half, middle + half)
