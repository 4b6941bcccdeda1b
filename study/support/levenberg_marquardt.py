"""Nonlinear least squares by the method of Levenberg and Marquardt, for exact derivatives.

The variables are scaled by the columns of the Jacobian, and every test compares a step with its standard
error or with the size of the data: nothing changes with the units. A trial without a finite response is a
rejected step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.support.arrays import Floats
from study.support.block_normal import ContinuityGaps, Normal, normal_equations
from study.support.least_squares import INDISTINCT

OFFSET = 1e-4  # length of the next step, in standard errors, at which a search has converged (Bates and Watts, 1981)
ROUNDING = 1e-11  # share of the response that a step changes at which a search has converged too
PATIENCE = 8  # trials that may pass without lowering the error by what matters
MATTERS = 1e-3  # fall of the error that matters, as a share of what a step of one standard error brings


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
    """The point with this residual and Jacobian (``block_normal``); None if they are not finite.

    Weighted gaps between segments count among the residual.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what is out of range is refused below
        scale, normal = normal_equations(residual, jacobian, shared, begins, continuity)
        if continuity is not None:
            residual = np.concatenate([residual, -continuity.gaps.ravel()])
        cost = float(residual @ residual)
    if not (np.isfinite(cost) and np.all(np.isfinite(scale)) and np.all(np.isfinite(normal.shared))):
        return None
    return Point(x, residual, cost, scale, normal)


@dataclass(frozen=True)
class End:
    """Where a search ended, after how many trials, and why."""

    point: Point
    converged: bool
    iterations: int
    message: str


def minimise(
    linearise: Callable[[Floats], Point | None], point: Point, size: float, max_iterations: int, offset: float = OFFSET
) -> End:
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
    """
    count = len(point.x)
    freedom = max(len(point.residual) - count, 1)
    damping, growth, costs = 1e-3, 2.0, list[float]()
    for iteration in range(1, max_iterations + 1):
        unit = count * point.cost / freedom  # fall of the error in a step of one standard error
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
        trial = linearise(point.x + step / point.scale)
        expected = float(step @ (damping * step + point.normal.gradient()))
        gain = -1.0 if trial is None else (point.cost - trial.cost) / expected
        if trial is not None and gain > 0.0:
            point = trial
            damping, growth = max(damping * max(0.1, 1.0 - (2.0 * gain - 1.0) ** 3), INDISTINCT), 2.0
        else:
            damping, growth = damping * growth, 2.0 * growth
    return End(point, False, max_iterations, f"still falling after {max_iterations} free runs, the most allowed")
