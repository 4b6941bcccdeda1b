"""Nonlinear least squares by the method of Levenberg and Marquardt, for exact derivatives.

The variables are scaled by the columns of the Jacobian, and every test compares a step with its standard
error or with the size of the data: nothing changes with the units. A trial without a finite response is a
rejected step.

Some variables are shared by all samples of a record (coefficients), others belong to one segment of it each (its
initial state). The latter are eliminated segment by segment, so that a fit in hundreds of segments costs no more linear
algebra than one in a single segment.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from study.support.arrays import Floats, Ints
from study.support.least_squares import INDISTINCT

RELATIVE_OFFSET = 1e-4  # of the next step, in standard errors: a search has converged then (Bates and Watts, 1981)
ROUNDING = 1e-11  # share of the response that a step changes at which a search has converged too
PATIENCE = 8  # trials that may pass without lowering the error by what matters
MATTERS = 1e-3  # fall of the error that matters, as a share of what a step of one standard error brings


@dataclass(frozen=True)
class Normal:
    """``J^T J`` and ``J^T residual`` for columns of unit length; k shared variables, f own ones of N segments each."""

    shared: Floats  # products of the shared columns, shape (k, k)
    cross: Floats  # of the shared with the own columns of each segment, shape (N, k, f)
    own: Floats  # of the own columns, shape (N, f, f)
    links: Floats | None  # of each segment's own columns, the first's left out, with those before it, (N - 1, f, f)
    right: Floats  # of the shared columns with the residual, shape (k,)
    own_right: Floats  # of the own columns with it, shape (N, f)

    @cached_property
    def _parts(self) -> tuple[Floats, Floats, Floats]:
        """Eigenvalues and eigenvectors of the own columns' products, and right sides along these."""
        values, vectors = np.linalg.eigh(self.own)
        return values, vectors, vectors.transpose(0, 2, 1) @ self._right

    @cached_property
    def _right(self) -> Floats:
        """Right sides of the own variables: one for each shared variable, then their own, shape (N, f, k + 1)."""
        return np.concatenate([self.cross.transpose(0, 2, 1), self.own_right[:, :, None]], axis=2)

    def _eliminated(self, damping: float) -> tuple[Floats, Floats]:
        """The own variables' answer to a change of each shared one, (N, f, k), and to their right side, (N, f)."""
        if self.links is not None:
            solved = _tridiagonal(self.own, self.links, damping, self._right)
        else:
            values, vectors, right = self._parts
            damped = values + damping
            known = damped > INDISTINCT  # a segment may not determine every direction
            inverse = np.divide(1.0, damped, out=np.zeros_like(damped), where=known)
            solved = (vectors * inverse[:, None, :]) @ right
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


def _products(jacobian: Floats, residual: Floats, begins: Sequence[int], at_a_time: int = 1 << 16) -> Floats:
    """``X^T J`` of each segment, X being its Jacobian J and its residual side by side, (N, columns + 1, columns).

    Of many segments so many rows ``at_a_time``, so that a long record's Jacobian is not copied as a whole.
    """
    if len(begins) == 1:
        return np.concatenate([jacobian.T @ jacobian, (residual @ jacobian)[None]])[None]
    firsts = range(0, len(residual), at_a_time)
    bounds = np.array([*begins, len(residual)])
    block = min(int(np.max(np.diff(bounds))), 32)
    edges = [*np.unique(np.searchsorted(bounds[:-1], firsts)).tolist(), len(begins)]
    groups = (bounds[first : last + 1] for first, last in pairwise(edges) if last > first)
    return np.concatenate([_in_blocks(jacobian, residual, own, block) for own in groups])[:, :, :-1]


def _in_blocks(jacobian: Floats, residual: Floats, bounds: Ints, block: int) -> Floats:
    """``X^T X`` of the segments between these bounds, X as :func:`_products` has them.

    Segments are cut to blocks of equal length, short ones padded with zeros: one product of all blocks together takes
    a sixth of the time of hundreds of small ones.
    """
    part = slice(int(bounds[0]), int(bounds[-1]))
    rows = np.column_stack([jacobian[part], residual[part]])
    begins, lengths = bounds[:-1] - bounds[0], bounds[1:] - bounds[:-1]
    counts: Ints = -(-lengths // block)
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
    products = _products(jacobian, residual, begins)
    grams, rights = products[:, :-1], products[:, -1]
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


@dataclass(frozen=True)
class Point:
    """A point of the search; n samples, p variables: shared ones, then segment by segment its own."""

    x: Floats  # the variables, shape (p,)
    residual: Floats  # measured minus predicted, shape (n,)
    cost: float  # sum of squares of the residual
    scale: Floats  # length of each column of the Jacobian, one where it is zero, shape (p,)
    normal: Normal  # normal equations of the Jacobian with columns of unit length

    def covariance(self) -> Floats:
        """Of the k shared variables, s^2 from the residual; very large where the data do not decide, shape (k, k)."""
        variance = self.cost / max(len(self.residual) - len(self.x), 1)
        values, vectors = np.linalg.eigh(self.normal.reduced())
        inverse = (vectors / np.maximum(values, np.finfo(float).eps)) @ vectors.T
        scale = self.scale[: len(values)]
        with np.errstate(over="ignore"):  # where a value runs off, its error is beyond all measure
            return np.asarray(variance * inverse / np.outer(scale, scale), dtype=np.float64)

    def undecided(self) -> NDArray[np.bool_]:
        """Which shared variables the data do not show, or cannot tell apart from others, shape (k,)."""
        values, vectors = np.linalg.eigh(self.normal.reduced())
        return np.max(np.abs(vectors[:, values <= INDISTINCT]), axis=1, initial=0.0) > 0.1


def point_at(
    x: Floats,
    residual: Floats,
    jacobian: Floats,
    shared: int,
    begins: Sequence[int],
    continuity: ContinuityGaps | None = None,
) -> Point | None:
    """The point with this residual and Jacobian (:func:`normal_equations`); None if they are not finite.

    Weighted gaps between segments count among the residual.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what is out of range is refused below
        scale, normal = normal_equations(residual, jacobian, shared, begins, continuity)
        if continuity is not None:
            residual = with_gaps(residual, continuity.gaps)
        cost = float(residual @ residual)
    if not (np.isfinite(cost) and np.all(np.isfinite(scale)) and np.all(np.isfinite(normal.shared))):
        return None
    return Point(x, residual, cost, scale, normal)


def with_gaps(residual: Floats, gaps: Floats) -> Floats:
    """A residual and, behind it, weighted gaps between segments."""
    return np.concatenate([residual, -gaps.ravel()])


@dataclass(frozen=True)
class End:
    """Where a search ended, after how many trials, and why."""

    point: Point
    converged: bool
    iterations: int
    message: str


def minimise(
    linearise: Callable[[Floats], Point | None], point: Point, size: float, max_iterations: int,
    offset: float = RELATIVE_OFFSET, cost: Callable[[Floats], float] | None = None,
) -> End:  # fmt: skip
    """Search from a point with Nielsen's damping.

    Parameters
    ----------
    linearise : callable
        The point at given variables, None where there is none.
    point : Point
        Where to begin.
    size : float
        Root of the sum of squares of the measured response.
    max_iterations : int
        Trials after which to give up.
    offset : float
        Length of the next step, in standard errors, at which the search has converged.
    cost : callable, optional
        Sum of squares of the residual alone at given variables, infinite where there is none, which takes less than its
        derivatives: where a step was rejected the next one mostly is, and it is asked first.
    """
    count = len(point.x)
    freedom = max(len(point.residual) - count, 1)
    damping, growth, costs, fall = 1e-3, 2.0, list[float](), np.inf
    for iteration in range(1, max_iterations + 1):
        unit = count * point.cost / freedom  # fall of the error in a step of one standard error
        if growth == 2.0:  # else the step before was rejected, and the point is the same
            fall = point.normal.decrement()
        found = f"converged after {iteration} free runs"
        if fall <= offset**2 * unit or fall <= (ROUNDING * size) ** 2:
            return End(point, True, iteration, found)
        costs.append(point.cost)
        if len(costs) > PATIENCE and costs[-1 - PATIENCE] - point.cost < MATTERS * unit:
            left = float(np.sqrt(fall / unit))  # in a kink of the sum of squares, as friction and stops cause
            if left <= 1.0:  # the kink may be the minimum
                return End(point, True, iteration, f"{found} to where no step lowers the error")
            why = f"no step lowers the error, though one of {left:.2g} standard errors should"
            return End(point, False, iteration, f"stuck after {iteration} free runs: {why}")
        step = point.normal.step(damping)
        x = point.x + step / point.scale
        expected = float(step @ (damping * step + point.normal.gradient()))
        hopeful = cost is None or growth == 2.0 or (point.cost - cost(x)) / expected > 0.0
        trial = linearise(x) if hopeful else None
        gain = -1.0 if trial is None else (point.cost - trial.cost) / expected
        if trial is not None and gain > 0.0:
            point = trial
            damping, growth = max(damping * max(0.1, 1.0 - (2.0 * gain - 1.0) ** 3), INDISTINCT), 2.0
        else:
            damping, growth = damping * growth, 2.0 * growth
    return End(point, False, max_iterations, f"still falling after {max_iterations} free runs, the most allowed")
