"""How much better one fit is than another, with its uncertainty, from blocks of time.

Where a residual is not white noise, formulas for independent samples give errors that are too small. Sums of squares
over blocks much longer than the response's memory are practically independent.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from study.support.arrays import Floats
from study.support.least_squares import length_or_one, normal_inverse
from study.support.thresholds import BLOCKS

IN_A_BLOCK = 16  # samples in a block


@dataclass(frozen=True)
class Gain:
    """How much of one fit's residual another explains."""

    explained: float  # share of the mean square of the residual
    error: float  # its standard error, by leaving out one block at a time
    # Probability of so steady an agreement between the residual and the change of the prediction if there were none
    # (one-sided, over blocks).
    p_value: float


def block_powers(residual: Floats) -> Floats:
    """Sum of squares in each of ``BLOCKS`` blocks of equal length (fewer for a short residual)."""
    count = max(2, min(BLOCKS, len(residual) // IN_A_BLOCK))
    size = len(residual) // count
    return np.sum(residual[: size * count].reshape(count, size) ** 2, axis=1)


def gain(before: Floats, after: Floats, *, evenly: bool = False) -> Gain:
    """What ``after`` explains of ``before``; residuals of the same samples.

    ``before - after`` is the change of the prediction, fitted elsewhere. If it is useless, its product with
    ``before`` is of either sign: that is tested, block by block. A test of whether the residual's power falls
    would be half as sensitive, as the change adds its own power to the residual. With ``evenly`` the test is made
    in blocks with equal shares of the change as well, and the smaller p value of both doubled: of a decay, all of it
    may lie in one block in fifty, among forty-nine of noise.
    """
    a, apart, b = (block_powers(values) for values in (before, before - after, after))
    total = float(np.sum(a))
    if total == 0.0:
        return Gain(0.0, 0.0, 1.0)
    explained = 1.0 - float(np.sum(b)) / total
    left_out = 1.0 - (np.sum(b) - b) / np.maximum(np.sum(a) - a, np.finfo(float).tiny)
    n = len(a)
    with np.errstate(over="ignore"):  # of one far astray the error is beyond all measure too
        error = float(np.sqrt((n - 1) / n * np.sum((left_out - np.mean(left_out)) ** 2)))
    p_value = _p_value(a + apart - b)
    if evenly:
        p_value = min(1.0, 2.0 * min(p_value, _p_value(_of_even_changes(before, before - after))))
    return Gain(explained, error, p_value)


def _of_even_changes(before: Floats, change: Floats) -> Floats:
    """Sum of the products of a residual and a change, in blocks with equal shares of the change's power.

    None is shorter than ``IN_A_BLOCK``: what loud ones have more is shared by those that follow.
    """
    peak = float(np.max(np.abs(change)))
    change = change / peak if peak > 0.0 else change  # one that runs far astray would overflow
    power = np.concatenate([np.zeros(1), np.cumsum(change**2)])
    count, last = max(2, min(BLOCKS, len(change) // IN_A_BLOCK)), len(change)
    edges = [0]
    while len(edges) < count:
        wanted = power[edges[-1]] + (power[-1] - power[edges[-1]]) / (count - len(edges) + 1)
        edge = max(int(np.count_nonzero(power < wanted)), edges[-1] + IN_A_BLOCK)
        if edge > last - IN_A_BLOCK:
            break
        edges.append(edge)
    return np.asarray(np.add.reduceat(before * change, edges), dtype=np.float64)


def gain_beside(before: Floats, change: Floats, freed: Floats, *, evenly: bool = False) -> Gain:
    """What a change of the prediction explains of ``before``, which the model's own coefficients leave, all shape (n,).

    These come from other samples with errors, and what errors leave goes with the motion as the change does: by chance
    of a few coefficients, not of n samples. With J the sensitivities and C the covariance of the coefficients over the
    noise's variance s^2, ``cov = s^2 (I + J C J^T)``, and the test is of ``change^T cov^-1 before``, in which
    ``s^2 cov^-1 before`` is what coefficients fitted to these samples as well leave (Woodbury, 1950): ``freed``.
    ``evenly`` as of :func:`gain`.
    """
    return replace(gain(before, before - change), p_value=gain(freed, freed - change, evenly=evenly).p_value)


def worse(first: Floats, second: Floats) -> float:
    """By how many standard errors ``first`` leaves more than ``second``; residuals of the same samples, shape (n,).

    The larger of two answers over blocks of time, as each is blind where the other sees: the mean difference in its
    standard errors, which a few strong blocks can hide in their scatter, and the signed ranks (Wilcoxon, 1945), where
    they count no more than weak ones.
    """
    peak = max(float(np.max(np.abs(first))), float(np.max(np.abs(second))))  # of one far astray no square is finite
    size = math.ldexp(0.5, math.frexp(peak)[1])
    d = block_powers(first / size) - block_powers(second / size)
    spread, mean = float(np.std(d, ddof=1) / np.sqrt(len(d))), float(np.mean(d))
    by_mean = mean / spread if spread > 0.0 else math.copysign(math.inf, mean) if mean else 0.0
    n = len(d)
    rank = np.argsort(np.argsort(np.abs(d))) + 1
    by_rank = (float(np.sum(rank[d > 0.0])) - n * (n + 1) / 4) / math.sqrt(n * (n + 1) * (2 * n + 1) / 24)
    return max(by_mean, by_rank) if mean else 0.0


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


def clustered_covariance(
    jacobian: Floats, residual: Floats, others: int = 0, keys: int = 0, beside: Floats | None = None
) -> Floats:
    """Covariance of least-squares estimates when the residual is correlated in time or with the motion.

    The sandwich ``H^-1 (sum over blocks g_b g_b^T) H^-1`` with ``g_b = J_b^T e_b`` and ``H = J^T J``
    (Liang and Zeger, 1986), never below the formula for white noise. ``others`` is how many unknowns the columns of the
    Jacobian are beside. Blocks tell the variances of any number of estimates, but the correlations of few: where there
    are not five blocks to each of the ``keys``, as of a structure, correlations are those of white noise. Rows
    ``beside`` the Jacobian say what was known of the estimates before, with errors as large as those of a sample
    (the covariance is then that of estimates given the samples, which allows for what the rows pull them aside).
    """
    scale = length_or_one(jacobian)
    j = jacobian / scale
    known = np.zeros((0, len(scale))) if beside is None else beside / scale
    inverse = normal_inverse(j.T @ j + known.T @ known)
    count = max(2, min(BLOCKS, len(residual) // IN_A_BLOCK))
    size = len(residual) // count
    blocks = np.einsum(
        "bsp,bs->bp", j[: size * count].reshape(count, size, -1), residual[: size * count].reshape(count, size)
    )
    steps = blocks @ inverse  # what each block moves the estimates by: of their products no variance is negative
    noise = float(residual @ residual) / max(len(residual) - len(scale) - others, 1)
    rows = known @ inverse
    sandwich = steps.T @ steps * count / (count - 1) + noise * rows.T @ rows
    variance = np.diag(sandwich)
    white = np.diag(inverse) * noise
    larger = np.sqrt(np.maximum(variance, white) / np.maximum(variance, np.finfo(float).tiny))
    if 5 * keys > count:
        size = np.sqrt(np.maximum(np.diag(inverse), np.finfo(float).tiny))
        own = np.sqrt(np.maximum(variance, white))
        covariance = inverse / np.outer(size, size) * np.outer(own, own)
    else:
        covariance = sandwich * np.outer(larger, larger)
    np.fill_diagonal(covariance, np.maximum(variance, white))  # one that a single sample decides has no scatter at all
    return covariance / np.outer(scale, scale)
