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


@pytest.mark.parametrize("seed", range(5))
def test_a_variance_is_positive_where_a_single_sample_decides_an_estimate(seed):
    """The initial velocity of a system with friction: what it changes later, the initial displacement changes too."""
    rng = np.random.default_rng(seed)
    others = rng.standard_normal((960, 3)) * (np.arange(960) > 0)[:, None]
    jacobian = np.column_stack([others, 0.05 * others[:, 2] + (np.arange(960) == 0)])
    noise = rng.standard_normal(960)
    residual = noise - jacobian @ np.linalg.lstsq(jacobian, noise, rcond=None)[0]
    variance = np.diag(statistics.clustered_covariance(jacobian, residual))
    white = np.diag(np.linalg.inv(jacobian.T @ jacobian)) * float(residual @ residual) / (960 - 4)
    assert np.all(variance >= white * (1.0 - 1e-9))
    assert variance[3] == pytest.approx(white[3], rel=1e-6)


def test_errors_of_a_models_own_coefficients_are_no_evidence_for_a_change_that_resembles_them():
    """Its column grows along the judging part, as that of a frequency does; 400 samples of white noise, 300 times."""
    rng, n = np.random.default_rng(4), 200
    along = np.linspace(0.0, 1.0, 2 * n)
    own, column = along * np.cos(300.0 * along), along**2 * np.cos(300.0 * along + 0.3)
    alarms = dict.fromkeys(("gain", "beside"), 0)
    for noise in rng.standard_normal((300, 2 * n)):
        left = noise - own * (own[:n] @ noise[:n]) / (own[:n] @ own[:n])
        alone = column - own * (own[:n] @ column[:n]) / (own[:n] @ own[:n])
        change = alone[n:] * (alone[:n] @ left[:n]) / (alone[:n] @ alone[:n])
        freed = noise - own * (own @ noise) / (own @ own)
        alarms["gain"] += statistics.gain(left[n:], left[n:] - change).p_value < 0.02
        alarms["beside"] += statistics.gain_beside(left[n:], change, freed[n:]).p_value < 0.02
    assert alarms["beside"] <= 14  # six are meant: more have a chance of 2 in a thousand
    assert alarms["gain"] > 30  # what is held against the residual as it stands


def of_a_decay(noise):
    """The residual of a decay whose candidate matters in its first part alone, and the change that it makes."""
    n = len(noise)
    change = 3.0 * np.exp(-60.0 * np.arange(n) / n) * np.sin(0.4 * np.arange(n))
    return change, noise


def test_what_lies_in_the_first_block_of_a_decay_is_seen_and_no_more_invented_for_it():
    rng = np.random.default_rng(3)
    seen, plain, invented = [], [], []
    for _ in range(300):
        change, noise = of_a_decay(rng.standard_normal(4096))
        seen.append(statistics.gain(change + noise, noise, evenly=True).p_value)
        plain.append(statistics.gain(change + noise, noise).p_value)
        invented.append(statistics.gain(noise, noise - change, evenly=True).p_value)
    assert np.median(seen) < 0.02
    assert np.median(plain) > 0.3, "in blocks of equal time the ranks of mere noise decide"
    assert np.mean(np.array(invented) < 0.05) < 0.07


@pytest.mark.parametrize("far", [1e3, 1e170, 1e307])
def test_what_runs_far_astray_is_worse_however_far(far):
    residual = np.random.default_rng(3).standard_normal(4800)
    astray = far * np.random.default_rng(4).standard_normal(4800)
    assert statistics.worse(astray, residual) > 4.0
    assert statistics.worse(residual, astray) < -4.0
