"""Coefficients that stand in two equations of motion: jointly, and one by one as a check that action equals reaction.

Each equation alone gives its coefficients b, over the own mass where no force drives it: ``b = theta / m``. The joint
estimate minimises the distance of all b from this form, weighted with each equation's own covariance; its covariance
takes in that errors of two equations go together, for they share motions (minimum distance estimation: Chamberlain,
Journal of Econometrics 18, 1982). The check lets one coefficient have another value in its second equation.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from study.identify.frequency_domain.coefficients import Estimate
from study.identify.frequency_domain.reverse_system import ReverseSystem
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.support.least_squares import DISTINCT
from study.support.levenberg_marquardt import Point, minimise, point_at

MOST_TRIALS = 60  # of the search


@dataclass(frozen=True)
class Reaction:
    """A coefficient in two equations.

    Attributes
    ----------
    key : str
        The coefficient.
    coordinates : pair of str
        Whose equations they are.
    values : pair of float
        The coefficient as the first has it, and as the second has it; all else is estimated jointly.
    error : float
        Standard error of their difference.
    p_value : float
        Of a difference at least as large by chance alone.
    """

    key: str
    coordinates: tuple[str, str]
    values: tuple[float, float]
    error: float
    p_value: float


@dataclass(frozen=True, eq=False)
class JointEstimate:
    """Coefficients of all equations together, and each that stands in two of them checked."""

    estimate: Estimate
    reactions: tuple[Reaction, ...]

    @property
    def least_p(self) -> float:
        """Probability that chance alone makes the largest of so many differences: small if a term's place is wrong."""
        return min((min(1.0, len(self.reactions) * r.p_value) for r in self.reactions), default=1.0)


@dataclass(frozen=True, eq=False)
class _Rows:
    """What all equations say: the coefficients of each in turn."""

    owner: tuple[int, ...]  # number of the equation
    key: tuple[int, ...]  # number of the coefficient
    mass: tuple[int, ...]  # number of the coefficient that divides it; -1 if none does
    value: Floats
    left: Floats  # whitens the errors of each equation; shape (rows, rows)
    keys: tuple[str, ...]


def joint_estimate(system: ReverseSystem, held: Mapping[str, float] | None = None) -> JointEstimate:
    """Coefficients of a structure from those of its equations.

    ``held`` are values that are known: of a mass, where nothing drives the structure.

    Raises
    ------
    StudyError
        If the equations leave a coefficient open.
    """
    rows, known = _rows(system), dict(held or {})
    start = _started(rows, known)
    free = [k for k, key in enumerate(rows.keys) if key not in known]

    def point(x: Floats) -> Point | None:
        full = start.copy()
        full[free] = x
        if any(full[m] == 0.0 for m in rows.mass if m >= 0):
            return None
        residual, jacobian = _distance(rows, full)
        return point_at(x, rows.left @ residual, rows.left @ jacobian[:, free], len(free), (0,))

    first = point(start[free])
    if first is None:
        raise StudyError("the equations of motion have no finite coefficients; expected a motion at every coordinate")
    full = start.copy()
    full[free] = minimise(point, first, float(np.linalg.norm(rows.left @ rows.value)), MOST_TRIALS).point.x
    residual, jacobian = _distance(rows, full)
    inverse = _inverse(rows.left @ jacobian[:, free]) @ rows.left
    freedom = min(_estimate(r.found).freedom for r in system.results)
    covariance = inverse @ system.covariance @ inverse.T
    estimate = Estimate(tuple(rows.keys[k] for k in free), full[free], covariance, freedom)
    checks = (_reaction(system, rows, k, full, free, (residual, jacobian), freedom) for k in range(len(rows.keys)))
    return JointEstimate(estimate, tuple(c for c in checks if c is not None))


def _estimate(found: object) -> Estimate:
    estimate = getattr(found, "estimate", None)
    assert isinstance(estimate, Estimate), "estimators of structures find their coefficients together"
    return estimate


def _rows(system: ReverseSystem) -> _Rows:
    estimates = [_estimate(r.found) for r in system.results]
    masses = [r.mass for r in system.results]
    keys = tuple(dict.fromkeys([s for e in estimates for s in e.symbols] + [m for m in masses if m is not None]))
    owner = tuple(i for i, e in enumerate(estimates) for _ in e.symbols)
    left = np.zeros((len(owner), len(owner)))
    for i, e in enumerate(estimates):
        at = np.flatnonzero(np.array(owner) == i)
        left[np.ix_(at, at)] = _whitening(e)
    numbers = tuple(-1 if m is None else keys.index(m) for m in masses)
    return _Rows(
        owner, tuple(keys.index(s) for e in estimates for s in e.symbols), tuple(numbers[i] for i in owner),
        np.concatenate([e.values for e in estimates]), left, keys,
    )  # fmt: skip


def _whitening(estimate: Estimate) -> Floats:
    """What makes the errors of an estimate independent and of unit size; those of an exact one relative."""
    size = np.sqrt(np.diag(estimate.covariance))
    size = np.maximum(size, 1e-12 * np.maximum(np.abs(estimate.values), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(estimate.covariance / np.outer(size, size))
    floor = 1e-10 * float(np.max(values, initial=1e-10))
    return (vectors / np.sqrt(np.maximum(values, floor))).T / size


def _started(rows: _Rows, held: Mapping[str, float]) -> Floats:
    """A first value of every coefficient, from equation to equation: each gives its mass by what is known already."""
    x = np.array([held.get(key, np.nan) for key in rows.keys])
    for _ in range(2 * len(rows.keys)):
        before = x.copy()
        for k, m, b in zip(rows.key, rows.mass, rows.value, strict=True):
            scale = 1.0 if m < 0 else x[m]
            if np.isnan(x[k]) and not np.isnan(scale):
                x[k] = b * scale
        for m in {m for m in rows.mass if m >= 0 and np.isnan(x[m])}:
            x[m] = _mass(rows, m, x)
        if np.array_equal(before, x, equal_nan=True):
            break
    if np.any(np.isnan(x)):
        open_ones = ", ".join(key for key, value in zip(rows.keys, x, strict=True) if np.isnan(value))
        raise StudyError(f"the equations of motion leave {open_ones} open; expected a force there, or a mass held")
    return x


def _mass(rows: _Rows, m: int, x: Floats) -> float:
    """The mass of an equation from the coefficients that are known of it; nan if none is."""
    own = [i for i, mass in enumerate(rows.mass) if mass == m and not np.isnan(x[rows.key[i]])]
    size = np.array([float(np.linalg.norm(rows.left[:, i])) for i in own])
    b, theta = rows.value[own] * size, x[[rows.key[i] for i in own]] * size
    return float(theta @ b / (b @ b)) if own and float(b @ b) > 0.0 else math.nan


def _distance(rows: _Rows, x: Floats) -> tuple[Floats, Floats]:
    """Measured coefficients minus those of x, and the derivatives of the latter."""
    jacobian = np.zeros((len(rows.key), len(x)))
    expected = np.zeros(len(rows.key))
    for i, (k, m) in enumerate(zip(rows.key, rows.mass, strict=True)):
        scale = 1.0 if m < 0 else float(x[m])
        expected[i] = x[k] / scale
        jacobian[i, k] += 1.0 / scale
        if m >= 0:
            jacobian[i, m] -= x[k] / scale**2
    return rows.value - expected, jacobian


def _inverse(jacobian: Floats) -> Floats:
    size = np.linalg.norm(jacobian, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    return np.linalg.pinv(jacobian / size, rcond=DISTINCT) / size[:, None]


def _reaction(
    system: ReverseSystem, rows: _Rows, k: int, full: Floats, free: Sequence[int], at: tuple[Floats, Floats],
    freedom: float,
) -> Reaction | None:  # fmt: skip
    """One coefficient with a value of its own in its second equation; None if the equations do not tell."""
    where = [i for i, key in enumerate(rows.key) if key == k]
    if len(where) < 2 or k not in free:
        return None
    residual, jacobian = at
    column = np.zeros(len(jacobian))
    column[where[1]] = jacobian[where[1], k]
    design = rows.left @ np.column_stack([jacobian[:, free], column])
    size = np.linalg.norm(design, axis=0)
    lowest = np.linalg.svd(design / np.where(size > 0.0, size, 1.0), compute_uv=False)
    if len(lowest) <= len(free) or lowest[-1] < DISTINCT * lowest[0]:
        return None
    inverse = _inverse(design) @ rows.left
    moved, covariance = inverse @ residual, inverse @ system.covariance @ inverse.T
    error = float(np.sqrt(max(covariance[-1, -1], 0.0)))
    value = float(full[k] + moved[free.index(k)])
    names = [system.results[rows.owner[i]].coordinate for i in where[:2]]
    p = _p_value(float(moved[-1]), error, freedom)
    return Reaction(rows.keys[k], (names[0], names[1]), (value, value + float(moved[-1])), error, p)


def _p_value(difference: float, error: float, freedom: float) -> float:
    """Two-sided, by Student's t where the error comes from few stretches."""
    if error == 0.0:
        return 1.0 if difference == 0.0 else 0.0
    z = abs(difference) / error
    if math.isinf(freedom):
        return math.erfc(z / math.sqrt(2.0))
    from scipy.special import stdtr

    return float(2.0 * stdtr(freedom, -z))
