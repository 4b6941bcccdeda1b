"""Where a decay begins: against the backbone of a Duffing oscillator, and on a measured beam."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from study.compare import decay
from study.compare.decay import at_the_release
from tests.public_records import DATA, needs

DT, OMEGA, K3, ZETA, AMPLITUDE = 0.001, 2.0 * np.pi * 37.0, 0.48, 0.005, 220.0


@pytest.fixture(scope="module")
def hardening() -> np.ndarray:
    times = np.arange(0.0, 1.5, DT)

    def motion(_, y):
        return [y[1], -(OMEGA**2) * y[0] - K3 * y[0] ** 3 - 2.0 * ZETA * OMEGA * y[1]]

    return solve_ivp(motion, (0.0, 1.5), [AMPLITUDE, 0.0], t_eval=times, rtol=1e-9, atol=1e-9).y[0]


def backbone(amplitude: float) -> float:
    """First harmonic balance of the undamped oscillator (A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, 1979)."""
    return float(np.sqrt(OMEGA**2 + 0.75 * K3 * amplitude**2) / (2.0 * np.pi))


@pytest.mark.parametrize("seed", range(4))
def test_the_frequency_at_the_release_is_that_of_the_backbone(hardening, seed):
    noisy = hardening + np.random.default_rng(seed).normal(0.0, 0.5, len(hardening))
    amplitude, frequency, damping, error, damping_error = at_the_release(noisy[:150], DT, 2.0 * np.pi * 41.0, 12.0)
    assert amplitude == pytest.approx(AMPLITUDE, rel=0.01)
    assert abs(frequency - backbone(amplitude)) < 2.0 * error < 0.2
    expected = ZETA * OMEGA / (2.0 * np.pi * frequency)  # the damper is linear, the frequency above that of no motion
    assert abs(damping - expected) < 3.0 * damping_error


def test_a_decay_begins_where_no_window_of_the_analytic_signal_reaches(hardening):
    found = decay._decay(hardening, DT, OMEGA, 1.0)
    gap = found.frequency - np.array([backbone(a) for a in found.amplitude])
    assert np.max(np.abs(gap)) < 0.1
    assert found.amplitude[0] == pytest.approx(AMPLITUDE, rel=0.01)
    assert found.amplitude[1] < 0.9 * AMPLITUDE


def test_a_decay_without_noise():
    t = DT * np.arange(150)
    values = 3.0 * np.exp(-1.2 * t) * np.cos(250.0 * t + 0.4) + 7.0
    amplitude, frequency, damping, _, _ = at_the_release(values, DT, 249.0, 12.0)
    natural = np.hypot(250.0, 1.2)
    assert (amplitude, 2.0 * np.pi * frequency) == pytest.approx((3.0, natural), rel=1e-4)
    assert damping == pytest.approx(1.2 / natural, rel=0.01)


@needs("beam_ringdown")
def test_the_beam_falls_from_42_to_36_9_hertz():
    """Driven at 42.05 Hz until 12.15 s; the first point lies where it is let go, the last where noise begins."""
    strain = np.loadtxt(DATA / "beam_ringdown" / "decay.csv", delimiter=",", skiprows=1, usecols=1)
    found = decay._decay(strain[12150:], DT, 2.0 * np.pi * 38.0, 2.5)
    assert found.frequency[0] == pytest.approx(42.0, abs=0.1)
    quiet = found.amplitude < 10.0
    assert np.mean(found.frequency[quiet]) == pytest.approx(36.9, abs=0.05)
    assert np.mean(found.damping[quiet]) == pytest.approx(0.0023, abs=0.0003)
    assert np.max(found.damping[found.amplitude < 200.0]) == pytest.approx(0.0071, abs=0.0003)
