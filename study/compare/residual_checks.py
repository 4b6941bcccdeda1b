"""Is what a model leaves noise, and nothing of the force? Autocorrelation, correlation with the force, histogram.

The checks of system identification (Ljung, System Identification, 1999, Section 16.6): a right model in white noise
leaves a residual without correlation to itself; a right model in any noise leaves one without correlation to the force,
or where motion is prescribed to the displacement.
"""

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import ndtri

from study.compare.prediction import Prediction
from study.compare.response_functions import drive_of
from study.support.arrays import Floats

LAGS = 100  # to each side, at most
BAND_LEVEL = 0.99  # at each lag
QUANTILE = float(ndtri(0.5 + BAND_LEVEL / 2.0))
BINS = 41
HISTOGRAM_REACH = 4.0  # standard deviations


@dataclass(frozen=True)
class ResidualChecks:
    """Correlations and distribution of the held-out residual."""

    lag: Floats  # in seconds from 0 on, shape (lags,)
    autocorrelation: Floats  # of the residual over its mean square, shape (lags,)
    band: float  # 99 % of the autocorrelations of white noise lie within it
    lag_force: Floats  # in seconds, negative before the force, shape (2 lags - 1,)
    with_force: Floats  # correlation of residual and force, or prescribed displacement, shape (2 lags - 1,)
    band_force: float  # 99 % lie within it where they are independent, whatever their colours
    edges: Floats  # of the histogram, in standard deviations, shape (bins + 1,)
    counts: Floats  # share of the samples over the width of a bin: a normal density if it is one; shape (bins,)


def residual_checks(prediction: Prediction, sensor: int = 0) -> ResidualChecks:
    """The checks of the residual of one of the sensors on the judging part."""
    prepared, seen = prediction.prepared, prediction.of(sensor)
    residual = seen.residual
    residual = residual - np.mean(residual)
    n, force = len(residual), np.zeros(len(residual))
    if not prepared.free:
        force = prepared.record[drive_of(seen)][slice(*prepared.plan.judge)]
        force = force - np.mean(force)
    lags = min(LAGS, n // 4)
    own, drive = cross_correlation(residual, residual, lags), cross_correlation(force, force, lags)
    both = cross_correlation(residual, force, lags)
    # n times the variance of an estimated cross-correlation is the sum of the autocorrelations' products (Ljung, 16.6)
    spread = max(float(np.sum(own * drive)), 0.0)
    steps = prediction.dt * np.arange(-(lags - 1), lags, dtype=np.float64)
    edges = np.linspace(-HISTOGRAM_REACH, HISTOGRAM_REACH, BINS + 1).astype(np.float64)
    counts = np.histogram(residual / (float(np.std(residual)) or 1.0), edges)[0] / (n * (edges[1] - edges[0]))
    return ResidualChecks(
        steps[lags - 1 :], own[lags - 1 :], QUANTILE / np.sqrt(n), steps, both, QUANTILE * float(np.sqrt(spread / n)),
        edges, counts,
    )  # fmt: skip


def cross_correlation(later: Floats, earlier: Floats, lags: int) -> Floats:
    """Correlation of two signals without mean at lags from -(lags - 1) to lags - 1 samples, shape (2 lags - 1,).

    At a positive lag the first follows the second. Each lag's sum is over n, as for the estimate with least error.
    """
    n = len(later)
    size = next_fast_len(2 * n, real=True)
    products = irfft(rfft(later, size) * np.conj(rfft(earlier, size)), size)
    around = np.concatenate([products[-(lags - 1) :], products[:lags]]) if lags > 1 else products[:1]
    norm = float(np.linalg.norm(later) * np.linalg.norm(earlier)) or 1.0
    return np.asarray(around / norm, dtype=np.float64)
