"""Linear prediction: what noise of any colour, or a motion, tells of its next sample."""

from collections.abc import Iterator

import numpy as np

from study.support.arrays import Floats

PREDICTABLE = 1e-14  # share of the power at which the prediction is complete, above the rounding of the recursion


def autoregression(noise: Floats) -> Floats:
    """Coefficients ``1, a1, ... ap`` with which ``noise`` filtered is white; p by Schwarz's criterion (1978), or 0.

    Shape (p + 1,).
    """
    n, centred = len(noise), noise - np.mean(noise)
    best, least = np.ones(1), 0.0
    for weights, left in _lattice(centred, min(32, n // 20)):  # 20 samples for each coefficient, at least
        price = n * np.log(max(left, np.finfo(float).eps)) + len(weights) * np.log(n)
        if price < least:
            best, least = np.concatenate([[1.0], -weights]), float(price)
    return best


def whitened(values: Floats, coefficients: Floats, at_a_time: int = 1 << 14) -> Floats:
    """``values`` along their first axis filtered, those before the first sample taken as equal to it; same shape.

    So many samples are filtered ``at_a_time``: they stay in the cache.
    """
    order = len(coefficients) - 1
    total, before = coefficients[0] * values, np.broadcast_to(values[:1], (order, *values.shape[1:]))
    for begin in range(0, len(values), at_a_time):  # SciPy's signal package takes longer to load than this takes
        padded, part = np.concatenate([before, values[begin : begin + at_a_time]]), total[begin : begin + at_a_time]
        for k in range(1, order + 1):
            part += coefficients[k] * padded[order - k : len(padded) - k]
        before = padded[len(padded) - order :]
    return total


def burg(values: Floats, order: int) -> Floats:
    """Coefficients of a stable linear prediction ``x_n = sum_k a_k x_(n-k)`` (Burg, 1975), shape (order,).

    Fewer where nothing is left to predict.
    """
    weights = np.zeros(0)
    for longer, _ in _lattice(values, order):
        weights = longer
    return weights


def continued_by(weights: Floats, recent: Floats, reach: int) -> Floats:
    """The samples after the last one as a linear prediction has them, shape (reach,)."""
    order = len(weights)
    if order == 0:
        return np.zeros(reach)
    series = np.concatenate([recent[len(recent) - order :], np.empty(reach)])
    backwards = weights[::-1].copy()
    for i in range(order, len(series)):
        series[i] = backwards @ series[i - order : i]
    return series[order:]


def _lattice(values: Floats, order: int) -> Iterator[tuple[Floats, float]]:
    """Linear predictions of order 1, 2, ..., each with the share of the mean square that it leaves (Burg, 1975).

    The recursion minimises forward and backward prediction errors together and uses no window, so that a sinusoid
    continues as itself. It stops early once nothing is left to predict.
    """
    forward, backward = values[1:].copy(), values[:-1].copy()
    weights, left = np.zeros(0), 1.0
    floor = PREDICTABLE * float(forward @ forward + backward @ backward)
    for _ in range(order):
        power = float(forward @ forward + backward @ backward)
        if power <= floor or len(forward) < 2:
            return
        reflection = 2.0 * float(forward @ backward) / power
        weights = np.concatenate([weights - reflection * weights[::-1], [reflection]])
        forward, backward = (forward - reflection * backward)[1:], (backward - reflection * forward)[:-1]
        left *= 1.0 - reflection**2
        yield weights, left
