"""Normal equations of pieces against those of the whole matrix."""

import tracemalloc
from collections.abc import Sequence

import numpy as np
import pytest

from study.support import levenberg_marquardt
from study.support.levenberg_marquardt import ContinuityGaps, normal_equations, point_at


def test_own_variables_are_eliminated_exactly() -> None:
    """Steps, decrement and covariance of pieces, loose and tied, are those of the whole matrix."""
    random, k, f, count = np.random.default_rng(4), 3, 2, 5
    jacobian, residual = random.standard_normal((40, k + f)), random.standard_normal(40)
    ties = ContinuityGaps(random.standard_normal((4, f)), random.standard_normal((4, f, k + f)), np.array([2.0, 3.0]))
    for tied in (None, ties):
        whole = np.zeros((48, k + count * f))
        for i in range(count):
            rows = slice(8 * i, 8 * i + 8)
            whole[rows, :k], whole[rows, k + f * i : k + f * i + f] = jacobian[rows, :k], jacobian[rows, k:]
        right = np.concatenate([residual, np.zeros(8)])
        for i in range(4 if tied else 0):
            rows = slice(40 + 2 * i, 42 + 2 * i)
            whole[rows, :k], whole[rows, k + f * i : k + f * i + f] = ties.jacobian[i, :, :k], ties.jacobian[i, :, k:]
            whole[rows, k + f * (i + 1) : k + f * (i + 2)] = -np.diag(ties.weight)
            right[rows] = -ties.gaps[i]
        x = np.zeros(k + count * f)
        point = point_at(x, residual, jacobian, k, range(0, 40, 8), tied)
        assert point is not None
        scaled = whole / point.scale
        np.testing.assert_allclose(point.scale, np.linalg.norm(whole, axis=0), rtol=1e-12)
        for damping in (0.0, 0.1):
            step = np.linalg.solve(scaled.T @ scaled + damping * np.eye(len(x)), scaled.T @ right)
            np.testing.assert_allclose(point.normal.step(damping), step, rtol=1e-8, atol=1e-9)
        fall = right @ right - np.sum((right - whole @ np.linalg.lstsq(whole, right)[0]) ** 2)
        assert point.normal.decrement() == pytest.approx(fall, rel=1e-9)
        variance = np.sum(right**2) / ((48 if tied else 40) - len(x))
        np.testing.assert_allclose(point.covariance(), variance * np.linalg.inv(whole.T @ whole)[:k, :k], rtol=1e-7)


@pytest.mark.parametrize("begins", [(0,), (0, 3, 40, 41, 120, 300), tuple(range(0, 500, 7))])
def test_a_few_rows_at_a_time_are_all_of_them(begins: Sequence[int]) -> None:
    random = np.random.default_rng(5)
    jacobian, residual = random.standard_normal((500, 5)), random.standard_normal(500)
    whole, parts = (levenberg_marquardt._products(jacobian, residual, begins, n) for n in (500, 64))  # pyright: ignore[reportPrivateUsage]
    np.testing.assert_allclose(parts, whole, rtol=1e-13, atol=1e-13)
    rows = np.column_stack([jacobian, residual])
    for begin, end, own in zip(begins, (*begins[1:], 500), parts, strict=True):
        np.testing.assert_allclose(own, rows[begin:end].T @ jacobian[begin:end], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("apart", [400_000, 50])
def test_a_long_jacobian_is_not_copied(apart: int) -> None:
    jacobian, residual = np.ones((400_000, 7)), np.ones(400_000)
    tracemalloc.start()
    normal_equations(residual, jacobian, 5, range(0, 400_000, apart))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < jacobian.nbytes
