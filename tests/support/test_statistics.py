"""The signed-rank test against SciPy's, which takes too long to load for what is asked of it."""

import numpy as np
import pytest
from scipy.stats import wilcoxon

from study.support import statistics


@pytest.mark.parametrize("count", [2, 7, 24, 48])
@pytest.mark.parametrize("shift", [-0.5, 0.0, 0.3, 2.0])
def test_the_signed_rank_test_is_exact(count, shift):
    products = np.random.default_rng(count).standard_normal(count) + shift
    exact = wilcoxon(products, alternative="greater", method="exact").pvalue
    assert statistics._p_value(products) == pytest.approx(exact, rel=1e-9)


def test_nothing_gained_is_no_evidence():
    assert statistics._p_value(np.zeros(48)) == 1.0
