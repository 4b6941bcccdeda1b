"""How much better one fit is than another, with its uncertainty, from blocks of time.

Where a residual is not white noise, formulas for independent samples give errors that are too small. Sums of squares
over blocks much longer than the response's memory are practically independent.
"""

from dataclasses import dataclass

import numpy as np

from study.support.arrays import Floats

BLOCKS = 24
TESTED = 48  # blocks of a test that ranks them: with 24 it lacks power
SHORTEST = 16  # samples in a block
ALPHA = 0.01  # probability of believing in what is not there, all that was asked for together
SMALLEST_GAIN = 1e-3  # of the rms response: what an effect must explain; less is the resolution of integration


@dataclass(frozen=True)
class Gain:
    """How much of one fit's residual another explains.

    Attributes
    ----------
    explained : float
        Share of the mean square of the residual.
    error : float
        Its standard error, by leaving out one block at a time.
    p_value : float
        Probability of so steady an agreement between the residual and the change of the prediction if there
        were none (one-sided, over blocks).
    """

    explained: float
    error: float
    p_value: float


def block_powers(residual: Floats, count: int = BLOCKS) -> Floats:
    """Sum of squares in each of ``count`` blocks of equal length (fewer for a short residual)."""
    count = max(2, min(count, len(residual) // SHORTEST))
    size = len(residual) // count
    return np.sum(residual[: size * count].reshape(count, size) ** 2, axis=1)


def gain(before: Floats, after: Floats) -> Gain:
    """What ``after`` explains of ``before``; residuals of the same samples.

    ``before - after`` is the change of the prediction, fitted elsewhere. If it is useless, its product with
    ``before`` is of either sign: that is tested, block by block. A test of whether the residual's power falls
    would be half as sensitive, as the change adds its own power to the residual.
    """
    a, b = block_powers(before), block_powers(after)
    total = float(np.sum(a))
    if total == 0.0:
        return Gain(0.0, 0.0, 1.0)
    explained = 1.0 - float(np.sum(b)) / total
    left_out = 1.0 - (np.sum(b) - b) / np.maximum(np.sum(a) - a, np.finfo(float).tiny)
    n = len(a)
    error = float(np.sqrt((n - 1) / n * np.sum((left_out - np.mean(left_out)) ** 2)))
    products = [block_powers(values, TESTED) for values in (before, before - after, after)]
    return Gain(explained, error, _p_value(products[0] + products[1] - products[2]))


def difference(first: Floats, second: Floats) -> float:
    """Mean difference of two residuals' block powers in its own standard errors; positive if the first is larger."""
    d = block_powers(first) - block_powers(second)
    spread = float(np.std(d, ddof=1) / np.sqrt(len(d)))
    mean = float(np.mean(d))
    return mean / spread if spread > 0.0 else float(np.sign(mean)) * np.inf if mean else 0.0


def _p_value(products: Floats) -> float:
    """Signed-rank test (Wilcoxon, 1945), so that a few strong blocks do not decide alone; exact, one-sided.

    Here and not from ``scipy.stats``, which takes longer to load than a comparison takes.
    """
    if not np.any(products):
        return 1.0
    n, rank = len(products), np.argsort(np.argsort(np.abs(products))) + 1
    ways = np.zeros(n * (n + 1) // 2 + 1)  # to choose ranks that sum to 0, 1, 2, ...
    ways[0] = 1.0
    for k in range(1, n + 1):
        ways[k:] += ways[:-k].copy()
    return float(np.sum(ways[int(np.sum(rank[products > 0.0])) :])) / 2.0**n


def clustered_covariance(jacobian: Floats, residual: Floats, count: int = 2 * BLOCKS) -> Floats:
    """Covariance of least-squares estimates when the residual is correlated in time or with the motion.

    The sandwich ``H^-1 (sum over blocks g_b g_b^T) H^-1`` with ``g_b = J_b^T e_b`` and ``H = J^T J``
    (Liang and Zeger, 1986), never below the formula for white noise.
    """
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    j = jacobian / scale
    inverse = np.linalg.pinv(j.T @ j, rcond=1e-12, hermitian=True)
    count = max(2, min(count, len(residual) // SHORTEST))
    size = len(residual) // count
    blocks = np.einsum(
        "bsp,bs->bp", j[: size * count].reshape(count, size, -1), residual[: size * count].reshape(count, size)
    )
    sandwich = inverse @ (blocks.T @ blocks) @ inverse * count / (count - 1)
    white = inverse * float(residual @ residual) / max(len(residual) - j.shape[1], 1)
    larger = np.sqrt(np.maximum(np.diag(sandwich), np.diag(white)) / np.maximum(np.diag(sandwich), 1e-300))
    return sandwich * np.outer(larger, larger) / np.outer(scale, scale)
