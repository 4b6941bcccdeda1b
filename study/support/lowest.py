"""The lowest value of a function of one number that has many shallow minima."""

from collections.abc import Callable, Sequence

import numpy as np

MORE = 40  # values that are tried about the best, at most


def lowest(function: Callable[[float], float], tried: Sequence[float], apart: float) -> float:
    """Where a function is lowest: of some values, then of those half as far to either side of the best, and so on.

    ``tried`` are evenly spread; until neighbours are no more than ``apart``. Each value is asked for once.
    """
    known = {at: function(at) for at in tried}
    best, step = min(known, key=lambda at: known[at]), 0.5 * float(np.max(np.diff(tried)))
    while step > apart and len(known) < len(tried) + MORE:
        for at in (best - step, best + step):
            if at not in known:
                known[at] = function(at)
        nearest = min(known, key=lambda at: known[at])
        step, best = (0.5 * step if nearest == best else step), nearest
    return best
