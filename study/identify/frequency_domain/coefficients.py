"""From frequency response functions A_j(f) to coefficients with standard errors."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from study.identify.frequency_domain.inputs import Input
from study.identify.frequency_domain.responses import Responses
from study.support.arrays import Complexes, Floats

EXACT = 1e-12  # variances below this share of the largest are rounding


@dataclass(frozen=True)
class Estimate:
    """Coefficients of a model, estimated together.

    Attributes
    ----------
    symbols : tuple of str
        Their names.
    values : array, shape (p,)
        Estimates.
    covariance : array, shape (p, p)
        Their random-error covariance.
    freedom : float
        Its degrees of freedom; few where it comes from the scatter between few parts of a record.
    """

    symbols: tuple[str, ...]
    values: Floats
    covariance: Floats
    freedom: float = math.inf

    def __getitem__(self, symbol: str) -> float:
        """One estimate."""
        return float(self.values[self.symbols.index(symbol)])

    def __contains__(self, symbol: str) -> bool:
        """Whether this coefficient was estimated."""
        return symbol in self.symbols

    def error(self, symbol: str) -> float:
        """Standard error of one estimate."""
        i = self.symbols.index(symbol)
        return float(np.sqrt(self.covariance[i, i]))

    def derived_error(self, gradient: dict[str, float]) -> float:
        """Standard error of a function of the coefficients with these partial derivatives."""
        g = np.array([gradient.get(s, 0.0) for s in self.symbols])
        return float(np.sqrt(max(g @ self.covariance @ g, 0.0)))


def fit_coefficients(
    result: Responses, inputs: Sequence[Input], band: tuple[float, float], line_inflation: float
) -> Estimate:
    """Weighted least squares of A_j(f) on powers of j 2 pi f, over the lines of a band (Hz).

    Each input is fitted by itself, every line weighted by the inverse of its random-error variance
    (Bendat and Piersol). Real and imaginary part are fitted together, the coefficients being real. Estimates
    from different inputs keep their covariance. ``line_inflation`` is that of the segments: neighbouring lines of
    a windowed spectrum are not independent.
    """
    keep = (result.frequency >= band[0]) & (result.frequency <= band[1])
    frequency = result.frequency[keep]
    covariance = result.covariance[keep]
    responses = result.response[:, keep]
    weights = [_weights(covariance[:, j, j].real, responses[j]) for j in range(len(inputs))]
    maps = [_map(item.powers(frequency), weights[j]) for j, item in enumerate(inputs)]
    values = [(maps[j] @ responses[j]).real for j in range(len(inputs))]
    symbols = tuple(p.symbol for item in inputs for p in item.parts)
    return Estimate(symbols, np.concatenate(values), _joint_covariance(maps, covariance) * line_inflation)


def _weights(variance: Floats, response: Complexes) -> Floats:
    """Inverse variances, to a common factor; zero where the input is silent and the response exactly zero."""
    divisor = floored(variance)
    return np.where(response == 0.0, 0.0, np.max(divisor, initial=0.0) / divisor)


def floored(variance: Floats) -> Floats:
    """Variances to divide by; ones where a model explains everything to the last digit."""
    largest = float(np.max(variance, initial=0.0))
    return np.maximum(variance, EXACT * largest) if largest > 0.0 else np.ones_like(variance)


def _map(powers: Complexes, weights: Floats) -> Complexes:
    """The linear map from A(f) to its real coefficients, shape (parts, lines)."""
    scale = np.sqrt(np.mean(np.abs(powers) ** 2, axis=0))
    design = powers / scale
    weighted: Complexes = (design * weights[:, None]).conj().T
    normal: Floats = np.asarray((weighted @ design).real, dtype=np.float64)
    inverse = np.linalg.pinv(normal, hermitian=True)
    return np.asarray((inverse @ weighted) / scale[:, None], dtype=np.complex128)


def _joint_covariance(maps: Sequence[Complexes], covariance: Complexes) -> Floats:
    """Covariance of ``Re(map_i A_i)`` and ``Re(map_j A_j)`` for circular errors of A."""
    blocks = [
        [((a * covariance[:, i, j]) @ b.conj().T).real / 2.0 for j, b in enumerate(maps)] for i, a in enumerate(maps)
    ]
    return np.block(blocks)
