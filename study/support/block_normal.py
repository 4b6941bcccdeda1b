"""Normal equations of least squares over segments of a record.

Some variables are shared by all samples (coefficients), others belong to one segment each (its initial state). The
latter are eliminated segment by segment, so that a fit in hundreds of segments costs no more linear algebra than one
in a single segment.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from study.support.arrays import Floats
from study.support.least_squares import INDISTINCT

BLOCK = 32  # samples whose products are summed together


@dataclass(frozen=True)
class Normal:
    """``J^T J`` and ``J^T residual`` for columns of unit length; k shared variables, f own ones of N segments each."""

    shared: Floats  # products of the shared columns, shape (k, k)
    cross: Floats  # of the shared with the own columns of each segment, shape (N, k, f)
    own: Floats  # of the own columns, shape (N, f, f)
    links: Floats | None  # of each segment's own columns, the first's left out, with those before it, (N - 1, f, f)
    right: Floats  # of the shared columns with the residual, shape (k,)
    own_right: Floats  # of the own columns with it, shape (N, f)

    def _own_solved(self, damping: float, right: Floats) -> Floats:
        """Solution of the equations of the own variables alone for right sides of shape (N, f, m)."""
        if self.links is not None:
            return _tridiagonal(self.own, self.links, damping, right)
        values, vectors = np.linalg.eigh(self.own)
        known = values + damping > INDISTINCT  # a segment may not determine every direction
        inverse = np.where(known, 1.0 / np.where(known, values + damping, 1.0), 0.0)
        solved = (vectors * inverse[:, None, :]) @ (vectors.transpose(0, 2, 1) @ right)
        return np.asarray(solved, dtype=np.float64)

    def _eliminated(self, damping: float) -> tuple[Floats, Floats]:
        """The own variables' answer to a change of each shared one, (N, f, k), and to their right side, (N, f)."""
        right = np.concatenate([self.cross.transpose(0, 2, 1), self.own_right[:, :, None]], axis=2)
        solved = self._own_solved(damping, right)
        return solved[:, :, :-1], solved[:, :, -1]

    def _left(self, damping: float, answers: Floats, alone: Floats) -> tuple[Floats, Floats]:
        matrix = self.shared + damping * np.eye(len(self.right)) - np.einsum("nif,nfj->ij", self.cross, answers)
        return matrix, self.right - np.einsum("nif,nf->i", self.cross, alone)

    def reduced(self) -> Floats:
        """What is left of the shared variables' matrix with the own ones eliminated, shape (k, k)."""
        return self._left(0.0, *self._eliminated(0.0))[0]

    def step(self, damping: float) -> Floats:
        """Solution with ``damping`` added to the diagonal: shared variables, then segment by segment the own ones."""
        answers, alone = self._eliminated(damping)
        shared = np.asarray(np.linalg.solve(*self._left(damping, answers, alone)), dtype=np.float64)
        return np.concatenate([shared, (alone - answers @ shared).ravel()])

    def gradient(self) -> Floats:
        """Right side of all variables, in the order of :meth:`step`."""
        return np.concatenate([self.right, self.own_right.ravel()])

    def decrement(self) -> float:
        """How much the sum of squares would fall in a full Gauss-Newton step, were the model linear."""
        answers, alone = self._eliminated(0.0)
        matrix, right = self._left(0.0, answers, alone)
        values, vectors = np.linalg.eigh(matrix)
        known = values > INDISTINCT
        return float(np.sum(self.own_right * alone) + np.sum((vectors.T @ right)[known] ** 2 / values[known]))


@dataclass(frozen=True)
class ContinuityGaps:
    """Penalised continuity constraints: each segment is to arrive in the state in which the next begins."""

    gaps: Floats  # differences of the two states, times the weight, shape (N - 1, f)
    jacobian: Floats  # of the gaps by the shared variables and by those of the segment before, shape (N - 1, f, k + f)
    weight: Floats  # derivative by the state after, with its sign turned, shape (f,)


def _tridiagonal(own: Floats, links: Floats, damping: float, right: Floats) -> Floats:
    """Solve the block tridiagonal equations of segments under continuity constraints, right sides (N, f, m)."""
    count, f, m = right.shape
    bands = np.zeros((2 * f, count * f))
    for row in range(f):
        for column in range(f):
            if row >= column:
                bands[row - column, column::f] = own[:, row, column]
            bands[f + row - column, column : (count - 1) * f : f] = links[:, row, column]
    bands[0] += max(damping, INDISTINCT)
    solved = solveh_banded(bands, right.reshape(count * f, m), lower=True, check_finite=False)
    return np.asarray(solved, dtype=np.float64).reshape(count, f, m)


def _products(rows: Floats, begins: Sequence[int]) -> Floats:
    """``X^T X`` of the rows X of each segment, shape (N, columns, columns).

    Segments are cut to blocks of equal length, short ones padded with zeros: one product of all blocks together takes
    a sixth of the time of hundreds of small ones.
    """
    if len(begins) == 1:
        return np.asarray((rows.T @ rows)[None], dtype=np.float64)
    lengths = np.diff([*begins, len(rows)])
    block = min(int(np.max(lengths)), BLOCK)
    counts = -(-lengths // block)
    first = np.cumsum(counts) - counts
    offset = block * (np.arange(np.sum(counts)) - np.repeat(first, counts))[:, None] + np.arange(block)
    inside = offset < np.repeat(lengths, counts)[:, None]
    filled = np.concatenate([rows, np.zeros((1, rows.shape[1]))])
    blocks = filled[np.where(inside, np.repeat(begins, counts)[:, None] + offset, len(rows))]
    return np.asarray(np.add.reduceat(blocks.transpose(0, 2, 1) @ blocks, first), dtype=np.float64)


def normal_equations(
    residual: Floats, jacobian: Floats, shared: int, begins: Sequence[int], continuity: ContinuityGaps | None = None
) -> tuple[Floats, Normal]:
    """Normal equations of a residual, and the lengths of the columns.

    Parameters
    ----------
    residual : array, shape (n,)
        Measured minus predicted.
    jacobian : array, shape (n, k + f)
        Derivatives of what is predicted: by the shared variables, then by those of the sample's own segment.
    shared : int
        k.
    begins : sequence of int
        First sample of each segment.
    continuity : ContinuityGaps, optional
        Gaps between the segments, which are to vanish too.

    Returns
    -------
    scale : array, shape (k + N f,)
        Length of each column, one where it is zero.
    normal : Normal
    """
    products = _products(np.column_stack([jacobian, residual]), begins)
    grams, rights = products[:, :-1, :-1], products[:, :-1, -1]
    links = None
    if continuity is not None:
        turned = continuity.jacobian.transpose(0, 2, 1)
        after = -continuity.weight[:, None] * continuity.jacobian  # by the next segment's state (rows)
        grams[:-1] += turned @ continuity.jacobian
        grams[1:, shared:, :shared] += after[:, :, :shared]
        grams[1:, :shared, shared:] += after[:, :, :shared].transpose(0, 2, 1)
        grams[1:, shared:, shared:] += np.diag(continuity.weight**2)
        rights[:-1] -= (turned @ continuity.gaps[:, :, None])[:, :, 0]
        rights[1:, shared:] += continuity.weight * continuity.gaps
        links = after[:, :, shared:]
    lengths = np.sqrt(np.einsum("nii->ni", grams))
    together, own = np.sqrt(np.sum(lengths[:, :shared] ** 2, axis=0)), lengths[:, shared:]
    together, own = (np.where(x == 0.0, 1.0, x) for x in (together, own))
    normal = Normal(
        shared=np.sum(grams[:, :shared, :shared], axis=0) / np.outer(together, together),
        cross=grams[:, :shared, shared:] / (together[:, None] * own[:, None, :]),
        own=grams[:, shared:, shared:] / (own[:, :, None] * own[:, None, :]),
        links=None if links is None else links / (own[1:, :, None] * own[:-1, None, :]),
        right=np.sum(rights[:, :shared], axis=0) / together,
        own_right=rights[:, shared:] / own,
    )
    return np.concatenate([together, own.ravel()]), normal
