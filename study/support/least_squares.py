"""Linear least squares with columns of any size.

One number tells what is rounding: of columns of unit length, sums of thousands of products agree to about 1e-12 of the
largest. What singular values or variances fall below that share of the largest is known of nothing.
"""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from study.support.arrays import Complexes, Floats

DISTINCT = 1e-9  # share of the largest singular value below which equations do not tell of a direction
INDISTINCT = 1e-12  # share of the largest singular value, eigenvalue or variance below which there is rounding alone
_lstsq, _pinv = cast(Any, np.linalg.lstsq), cast(Any, np.linalg.pinv)  # their annotations leave the element type open


def least_squares(columns: Floats, target: Floats, cutoff: float = INDISTINCT) -> Floats:
    """Amounts of the columns that approximate the target best, shape (columns,); of several targets (columns, targets).

    Columns are scaled to unit length first; singular values below ``cutoff`` of the largest then count as zero.
    """
    scale = _scale(columns)
    amounts: Floats = np.asarray(_lstsq(columns / scale, target, rcond=cutoff)[0], dtype=np.float64)
    return (amounts.T / scale).T


def _scale(columns: Floats) -> Floats:
    """Length of each column, infinity for those that are nothing beside the others."""
    peak = np.maximum(np.max(columns, axis=0, initial=0.0), -np.min(columns, axis=0, initial=0.0))
    least = np.sqrt(np.finfo(float).tiny) * np.max(peak, initial=0.0)  # the square of a larger amount may be no number
    peak = np.where(peak > least, peak, np.inf)  # first, so that no square overflows
    return peak * length_or_one(columns / peak)


@dataclass(frozen=True, eq=False)
class Factored:
    """Columns and a target that are asked beside many others: their part of each least squares is done once."""

    scale: Floats
    basis: Floats  # orthonormal, shape (n, columns)
    triangle: Floats  # the columns over their scale by that basis
    target: Floats  # shape (n,)

    def beside(self, others: Floats, cutoff: float = INDISTINCT) -> Floats:
        """Amounts of the columns and of others that approximate the target best, as :func:`least_squares` has them."""
        scale = _scale(others)
        along = self.basis.T @ (others / scale)
        basis, triangle = np.linalg.qr(others / scale - self.basis @ along)
        nothing = np.zeros((len(triangle), len(self.triangle)))
        both = np.block([[self.triangle, along], [nothing, triangle]])
        seen = np.concatenate([self.basis.T @ self.target, basis.T @ self.target])
        amounts: Floats = np.asarray(_lstsq(both, seen, rcond=cutoff)[0], dtype=np.float64)
        return amounts / np.concatenate([self.scale, scale])


def factored(columns: Floats, target: Floats) -> Factored:
    """Columns, shape (n, any), and a target, shape (n,), for many least squares with other columns beside them."""
    scale = _scale(columns)
    return Factored(scale, *np.linalg.qr(columns / scale), target)


def pseudo_inverse(columns: Floats, cutoff: float = INDISTINCT) -> Floats:
    """What makes of any target the amounts that :func:`least_squares` gives, shape (columns, samples)."""
    scale = length_or_one(columns)
    left, size, right = np.linalg.svd(columns / scale, full_matrices=False)
    kept = size > cutoff * np.max(size, initial=0.0)
    inverse: Floats = (right[kept].T / size[kept]) @ left[:, kept].T / scale[:, None]
    return inverse


def influence(design: Complexes, weight: Floats) -> Complexes:
    """How the lines of a complex target move its real coefficients: these are ``Re(influence @ target)``.

    Parameters
    ----------
    design : complex array, shape (lines, coefficients)
        What a unit of each coefficient makes of the target.
    weight : array, shape (lines,)
        Inverse variances of the lines, to a common factor.

    Returns
    -------
    complex array, shape (coefficients, lines)
        Zero for a coefficient that no line tells.
    """
    root = np.sqrt(weight)
    columns = np.concatenate([design.real, design.imag]) * np.concatenate([root, root])[:, None]
    size = length_or_one(columns)
    inverse: Floats = np.asarray(_pinv(columns / size, rcond=INDISTINCT), dtype=np.float64) / size[:, None]
    lines = len(design)
    return (inverse[:, :lines] - 1j * inverse[:, lines:]) * root


def normal_inverse(normal: Floats, size: Floats | None = None) -> Floats:
    """Inverse of a normal matrix ``J^T W J``, or ``Z^T W J`` with instruments Z, for p unknowns of any size.

    Shapes (..., p, p). ``size`` has the lengths of the columns; the roots of the diagonal if left out. Of unknowns of
    which the data tell a sum alone, the shortest amounts are taken.
    """
    symmetric = size is None
    size = np.sqrt(np.diagonal(normal, axis1=-2, axis2=-1)) if size is None else size
    size = np.where(size > 0.0, size, np.inf)
    scale = size[..., :, None] * size[..., None, :]
    return np.asarray(_pinv(normal / scale, rcond=INDISTINCT, hermitian=symmetric), dtype=np.float64) / scale


def length_or_one(columns: Floats | Complexes) -> Floats:
    """Length of each column, one where it is zero; of one so long that its square overflows, infinity."""
    with np.errstate(over="ignore"):
        length = np.linalg.norm(columns, axis=0)
    return np.where(length > 0.0, length, 1.0)


def floored(variance: Floats) -> Floats:
    """Variances to divide by; ones where a model explains everything to the last digit."""
    largest = float(np.max(variance, initial=0.0))
    return np.maximum(variance, INDISTINCT * largest) if largest > 0.0 else np.ones_like(variance)
