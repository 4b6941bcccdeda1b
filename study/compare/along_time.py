"""Does the error change along the record, beyond what the level of the response accounts for?"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from study.compare.prediction import SensorPrediction
from study.support.arrays import Floats

STRETCHES = 6
MOST_BLOCKS = 48  # of time
APART = 6.0  # correlation times in a block, at least: then neighbours are nearly independent


@dataclass(frozen=True)
class JudgedStretch:
    """A stretch of the judging part."""

    begin: float  # in seconds
    end: float  # in seconds
    error: float  # rms residual over the rms response of the whole judging part
    response: float  # rms response over that of the whole judging part
    ratio: float  # power of the residual over what is usual at this level of the response


@dataclass(frozen=True)
class AlongTime:
    """The stretches and the test."""

    stretches: tuple[JudgedStretch, ...]  # in order of time
    p_value: float  # of such differences between stretches of equal level; 1 with too few blocks for a test
    growth: float  # exponent with which the power of the residual grows with the power of the response, block by block
    growth_error: float  # its standard error
    confounded: bool  # level and time change together, so that they cannot be told apart


def along_time(seen: SensorPrediction) -> AlongTime:
    """Compare stretches of the judging part, as one sensor shows them.

    The logarithm of the residual's power in blocks is explained by that of the response (and its square)
    and then by the stretch as well; an F test says whether the second step brings more than chance would.
    """
    residual, response = seen.residual, seen.measured - float(np.mean(seen.measured))
    count = _blocks(residual)
    e, y = _log_powers(residual, count), _log_powers(response, count)
    group = np.arange(count) * STRETCHES // count
    level = y - np.mean(y)
    plain = np.stack([np.ones(count), level, level**2], axis=1)
    usual, sum_plain = _regress(plain, e)
    stretch = (group[:, None] == np.arange(1, STRETCHES)).astype(np.float64)
    full = np.concatenate([plain, stretch], axis=1)
    _, sum_full = _regress(full, e)
    freedom = count - full.shape[1]
    p_value = 1.0
    if freedom > 2 and sum_full > 0.0:
        ratio = (sum_plain - sum_full) / (STRETCHES - 1) / (sum_full / freedom)
        p_value = float(np.asarray(fdtrc(STRETCHES - 1, freedom, ratio), dtype=np.float64))
    growth, growth_error = _slope(level, e)
    rows = tuple(_stretch(seen, residual, response, k, np.exp(e - usual), group) for k in range(STRETCHES))
    together = 1.0 - _regress(np.concatenate([plain[:, :1], stretch], axis=1), level)[1] / max(
        float(level @ level), 1e-300
    )
    # where the blocks hold more of the level's variance, level and time change together
    return AlongTime(rows, p_value, growth, growth_error, together > 0.75)


def _blocks(residual: Floats) -> int:
    """How many blocks are long against the residual's memory: the sum of its squared autocorrelation."""
    n = len(residual)
    size = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(residual - np.mean(residual), size)) ** 2
    correlation = np.fft.irfft(power, size)[: n // 4]
    memory = 2.0 * float(np.sum((correlation / max(float(correlation[0]), 1e-300)) ** 2)) - 1.0
    return int(np.clip(n / (APART * memory), 2 * STRETCHES, MOST_BLOCKS))


def _log_powers(values: Floats, count: int) -> Floats:
    powers = np.array([float(np.mean(part**2)) for part in np.array_split(values, count)])
    return np.log(np.maximum(powers, 1e-30 * max(float(np.max(powers)), 1e-300)))


def _regress(columns: Floats, values: Floats) -> tuple[Floats, float]:
    fitted = columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
    return fitted, float(np.sum((values - fitted) ** 2))


def _slope(x: Floats, y: Floats) -> tuple[float, float]:
    power = float(x @ x)
    if not power > 0.0:
        return 0.0, np.inf
    slope = float(x @ y) / power
    rest = y - np.mean(y) - slope * x
    return slope, float(np.sqrt(np.sum(rest**2) / max(len(x) - 2, 1) / power))


def _stretch(
    seen: SensorPrediction, residual: Floats, response: Floats, k: int, ratios: Floats, group: NDArray[np.int64]
) -> JudgedStretch:
    bounds = np.linspace(0, len(residual), STRETCHES + 1).round().astype(int)
    first, last = int(bounds[k]), int(bounds[k + 1])
    begin = float(seen.time[first])
    return JudgedStretch(
        begin, begin + (last - first) * seen.dt,
        float(np.sqrt(np.mean(residual[first:last] ** 2))) / seen.size,
        float(np.sqrt(np.mean(response[first:last] ** 2))) / seen.size,
        float(np.exp(np.mean(np.log(ratios[group == k])))),
    )  # fmt: skip
