"""Linear least squares with columns of any size, against NumPy's own."""

import numpy as np
import pytest

from study.support.least_squares import least_squares


@pytest.mark.parametrize(
    ("count", "size"), [*((1, s) for s in (1.0, 1e-200, 1e200, 0.0)), *((3, s) for s in (1.0, 1e-100, 1e100, 0.0))]
)
def test_amounts_are_those_of_numpy_whatever_the_size_of_a_column(count: int, size: float):
    random = np.random.default_rng(3)
    columns, target = random.standard_normal((50, count)), random.standard_normal((50, 2))
    expected = np.linalg.lstsq(columns, target)[0]
    columns[:, 0] *= size
    expected[0] /= size or 1.0
    if size == 0.0:
        expected = np.concatenate([np.zeros((1, 2)), np.linalg.lstsq(columns[:, 1:], target)[0]])
    np.testing.assert_allclose(least_squares(columns, target), expected, rtol=1e-10)
    np.testing.assert_allclose(least_squares(columns, target[:, 0]), expected[:, 0], rtol=1e-10)


def test_a_column_that_is_nothing_beside_the_others_gets_nothing():
    random = np.random.default_rng(4)
    columns, target = random.standard_normal((50, 2)), random.standard_normal(50)
    columns[:, 0] *= 1e-180
    found = least_squares(columns, target)
    assert found[0] == 0.0
    np.testing.assert_allclose(found[1], np.linalg.lstsq(columns[:, 1:], target)[0][0], rtol=1e-10)
