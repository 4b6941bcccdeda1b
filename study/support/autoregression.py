"""The colour of noise: an autoregressive model, and what it makes white."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from study.support.arrays import Floats

ORDERS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
SAMPLES = 20  # for each coefficient, at least


def autoregression(noise: Floats) -> Floats:
    """Coefficients ``1, a1, ... ap`` with which ``noise`` filtered is white; p by Schwarz's criterion (1978), or 0.

    From the Yule and Walker equations, with the taper that a spectrum of many decades needs; shape (p + 1,).
    """
    n = len(noise)
    covariance = _autocovariance(noise - np.mean(noise), min(ORDERS[-1], n // SAMPLES))
    best, least = np.ones(1), 0.0
    if covariance[0] <= 0.0:
        return best
    for order in (p for p in ORDERS if p < len(covariance)):
        a = solve_toeplitz(covariance[:order] * _RIDGE[:order], covariance[1 : order + 1])
        left = 1.0 - float(a @ covariance[1 : order + 1]) / covariance[0]
        price = n * np.log(max(left, np.finfo(float).eps)) + order * np.log(n)
        if price < least:
            best, least = np.concatenate([[1.0], -a]), price
    return best


_RIDGE = np.where(np.arange(ORDERS[-1] + 1) == 0, 1.0 + 1e-9, 1.0)  # keeps the equations solvable without noise


def _autocovariance(values: Floats, lags: int) -> Floats:
    """At lags of 0 to ``lags`` samples, shape (lags + 1,); positive definite."""
    tapered = values * np.hanning(len(values))
    power = np.abs(rfft(tapered, next_fast_len(2 * len(values)))) ** 2
    return np.asarray(irfft(power)[: lags + 1], dtype=np.float64)


def whitened(values: Floats, coefficients: Floats) -> Floats:
    """``values`` along their first axis filtered, those before the first sample taken as equal to it; same shape."""
    first = np.broadcast_to(values[:1], (len(coefficients) - 1, *values.shape[1:]))
    padded = np.concatenate([first, values])
    return np.asarray(lfilter(coefficients, [1.0], padded, axis=0)[len(first) :], dtype=np.float64)
