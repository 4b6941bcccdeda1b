"""Least squares of many columns beside the same ones."""

import numpy as np
import pytest

from study.support.least_squares import factored, least_squares

RNG = np.random.default_rng(5)
N = 400
OWN = RNG.normal(size=(N, 4)) * np.array([1.0, 1e-9, 1e6, 1.0])


@pytest.mark.parametrize("kind", ["independent", "one twice", "one of the own again", "nothing"])
def test_others_beside_the_same_columns_have_the_amounts_of_one_least_squares(kind: str):
    others = RNG.normal(size=(N, 3)) * np.array([1e-7, 1.0, 1e3])
    if kind == "one twice":
        others[:, 2] = others[:, 1]
    if kind == "one of the own again":
        others[:, 1] = 3.0 * OWN[:, 2]
    if kind == "nothing":
        others[:, 0] = 0.0
    target = RNG.normal(size=N)
    expected = least_squares(np.hstack([OWN, others]), target, 1e-6)
    assert factored(OWN, target).beside(others, 1e-6) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_columns_that_are_nothing_get_nothing():
    own = RNG.normal(size=(N, 3))
    own[:, 1] = 0.0
    target = own[:, 0] + 2.0 * own[:, 2]
    amounts = factored(own, target).beside(RNG.normal(size=(N, 2)))
    assert amounts == pytest.approx([1.0, 0.0, 2.0, 0.0, 0.0], abs=1e-12)
