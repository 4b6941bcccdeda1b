"""A number over the seeds of an ensemble, and how far a distribution is from a Gaussian."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import stdtrit

from study.support.arrays import Floats
from study.support.numbers import percent
from study.support.thresholds import ALPHA

GAUSSIAN_CENTRAL_SHARE = math.erf(0.5 / math.sqrt(2.0))  # of a Gaussian's values: within half a standard deviation
GAUSSIAN_OUTER_SHARE = math.erfc(2.0 / math.sqrt(2.0))  # of a Gaussian's values: beyond two standard deviations


@dataclass(frozen=True)
class Sample:
    """One number from each seed of an ensemble, and from the study's own record where there is one."""

    values: tuple[float, ...]
    own: float | None = None

    @staticmethod
    def own_first(numbers: Iterable[float]) -> "Sample":
        """A sample of one number a record, of which the first is the study's own."""
        own, *values = numbers
        return Sample(tuple(values), own)

    @property
    def mean(self) -> float:
        return float(np.mean(self.values))

    @property
    def median(self) -> float:
        """Median over the seeds; a reading that now and then misses the curve does not spoil it."""
        return float(np.median(self.values))

    @property
    def scatter(self) -> float:
        """Standard deviation of one record."""
        return float(np.std(self.values, ddof=1))

    @property
    def error(self) -> float:  # of the mean
        return self.scatter / math.sqrt(len(self.values))

    def __str__(self) -> str:
        own = "" if self.own is None else f" (own record {self.own:.4g})"
        return f"{self.mean:.4g} +- {self.error:.2g}{own}"

    def scaled(self, factor: float) -> "Sample":
        return Sample(tuple(factor * v for v in self.values), None if self.own is None else factor * self.own)

    def minus(self, other: "Sample") -> "Sample":
        """Seed by seed, the difference from another sample over the same seeds."""
        own = None if self.own is None or other.own is None else self.own - other.own
        return Sample(tuple(a - b for a, b in zip(self.values, other.values, strict=True)), own)


def average(values: Floats | NDArray[np.bool_] | Sequence[float]) -> float:
    """Mean of numbers, or share of what is true."""
    return float(np.mean(np.asarray(values, dtype=np.float64)))


def share_of_power(density: Floats, keep: NDArray[np.bool_]) -> Sample:
    """Share of the power of each record's autospectrum, shape (records, lines), that lies in the kept lines."""
    return Sample.own_first(float(np.sum(d[keep]) / np.sum(d)) for d in density)


def relative_distance(curve: NDArray[np.complex128], exact: NDArray[np.complex128] | Floats) -> float:
    """Root mean square of the difference of two curves, over that of the second."""
    return float(np.linalg.norm(curve - exact) / np.linalg.norm(exact))


def kurtosis(values: Floats) -> float:
    """Fourth standardised moment: 3 for a Gaussian, lower for a flat top with short tails."""
    centred = values - np.mean(values)
    return float(np.mean(centred**4) / np.mean(centred**2) ** 2)


def gaussian_score(values: Floats) -> float:
    """Excess kurtosis of an evenly sampled record over the standard error that a Gaussian process would show.

    Of a process of the same correlation, a sample of n is worth ``n / sum rho^4`` independent values to its
    kurtosis: the standard error is ``sqrt(24 sum rho^4 / n)`` (Lomnicki, 1961). Symmetric systems leave nothing
    to the skewness. Beyond +-1.96 the Gaussian is refused at 5 %.
    """
    return (kurtosis(values) - 3.0) / math.sqrt(24.0 / effective_size(values))


def effective_size(values: Floats) -> float:
    """Number of independent values that a correlated sample is worth to its kurtosis."""
    n = len(values)
    centred = values - np.mean(values)
    power = np.abs(np.asarray(rfft(centred, next_fast_len(2 * n)))) ** 2
    correlation = irfft(power)[:n]
    rho = correlation / correlation[0]
    return n / float(1.0 + 2.0 * np.sum(rho[1:] ** 4))


def is_gaussian(values: Floats) -> bool:
    """Whether the kurtosis is one that a Gaussian process may well show (5 % level)."""
    return abs(gaussian_score(values)) <= 1.96  # two-sided 5 % of the standard normal


def central_share(values: Floats) -> float:
    """Share of the values within half a standard deviation of the mean."""
    centred = values - np.mean(values)
    return float(np.mean(np.abs(centred) < 0.5 * np.std(centred)))


def outer_share(values: Floats) -> float:
    """Share of the values beyond two standard deviations of the mean."""
    centred = values - np.mean(values)
    return float(np.mean(np.abs(centred) > 2.0 * np.std(centred)))


@dataclass(frozen=True)
class Departure:
    """How far the line of an averaged spectrum that departs most stands from the mean of all lines."""

    share: float  # of the mean
    errors: float  # in standard errors, by the scatter between the seeds
    allowed: float  # standard errors that one of so many lines reaches by chance (Student, Bonferroni)

    def __str__(self) -> str:
        return f"the line furthest off departs by {percent(self.share, '.2g')}, {self.errors:.2g} standard errors"

    @property
    def uniform(self) -> bool:
        """Whether chance alone may account for it."""
        return self.errors <= self.allowed


def departure(spectra: Floats) -> Departure:
    """How far the mean of autospectra, shape (seeds, lines), departs from a uniform one."""
    seeds, lines = spectra.shape
    mean: Floats = np.mean(spectra, axis=0)
    away: Floats = np.abs(mean - average(mean))
    error: Floats = np.std(spectra, axis=0, ddof=1) / math.sqrt(seeds)
    score: Floats = away / error
    worst = int(np.argmax(score))
    allowed = -float(cast(float, stdtrit(seeds - 1, ALPHA / (2.0 * lines))))
    return Departure(float(away[worst]) / average(mean), float(score[worst]), allowed)
