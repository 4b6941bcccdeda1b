"""Estimators: names, recipes, and what follows from fitted coefficients."""

import math
from dataclasses import replace

import numpy as np
import pytest

from study.equations.simulate import Integrator, simulate
from study.identify import estimators
from study.identify.estimators.base import Settings, named_parameters, true_parameters
from study.identify.estimators.in_reverse import read_linear
from study.identify.frequency_domain.coefficients import Estimate
from study.records.spectra import Segments
from study.support.errors import StudyError

M, C, K = 1.0, 3.77, 355.3
TOLD = Settings(Segments(512), (0.3, 10.0))


def estimate(values, covariance=None):
    count = len(values)
    spread = np.zeros((count, count)) if covariance is None else covariance
    return Estimate(tuple(values), np.array(list(values.values())), spread)


def by_name(found):
    return {p.name: p for p in found}


def test_an_unknown_estimator_is_refused():
    with pytest.raises(StudyError, match="there is no estimator 'mosi'; known are siso, miso, miso_hand_read"):
        estimators.get_estimator("mosi")


@pytest.mark.parametrize("name", [name for name in estimators.ESTIMATORS if name != "miso_free_shape"])
def test_every_entry_is_an_estimator(name, systems, records):
    record = records["linear"]
    if name == "errors_in_variables":
        repeated = np.tile(record["force"][:2048], 4)
        record = replace(simulate(systems["linear"], repeated, record.dt, Integrator("rk4", 8)), period=2048)
    found = by_name(estimators.identify(name, systems["linear"], record, TOLD).parameters)
    loose = 0.12 if name == "miso_hand_read" else 0.01
    assert found["k"].value == pytest.approx(K, rel=loose)
    assert found["f_n"].value == pytest.approx(3.0, rel=loose)
    assert found["zeta"].value == pytest.approx(0.1, rel=loose)


# ---- what follows from coefficients


def test_modal_parameters_and_their_errors():
    covariance = np.diag([1e-6, 1e-4, 1e-2])
    found = by_name(named_parameters(estimate({"m": M, "c": C, "k": K}, covariance)))
    omega = math.sqrt(K / M)
    assert found["f_n"].value == pytest.approx(omega / (2 * math.pi))
    assert found["zeta"].value == pytest.approx(C / (2 * M * omega))
    draws = np.random.default_rng(1).multivariate_normal([M, C, K], covariance, 200_000)
    for name, values in (
        ("f_n", np.sqrt(draws[:, 2] / draws[:, 0]) / (2 * math.pi)),
        ("zeta", draws[:, 1] / (2 * np.sqrt(draws[:, 2] * draws[:, 0]))),
    ):
        assert found[name].error == pytest.approx(values.std(), rel=0.01)


def test_a_system_without_stiffness_has_no_natural_frequency():
    assert set(by_name(named_parameters(estimate({"m": 1.0, "c": 0.1, "k": -2.0})))) == {"m", "c", "k"}


@pytest.mark.parametrize(
    ("cosine", "sine", "size", "phase"), [(3.0, -4.0, 5.0, math.atan2(4, 3)), (2.0, 0.0, 2.0, 0.0)]
)
def test_periodic_stiffness_has_amplitude_and_phase(cosine, sine, size, phase):
    """k_m cos(w t + phase) = k_m cos(phase) cos(w t) - k_m sin(phase) sin(w t), (4.9)."""
    covariance = np.diag([0.01, 0.01])
    found = by_name(named_parameters(estimate({"km_cos": cosine, "km_sin": sine}, covariance)))
    assert found["k_m"].value == pytest.approx(size)
    assert found["phase"].value == pytest.approx(phase)
    assert math.copysign(1.0, found["phase"].value) == 1.0, "no minus before a zero"
    assert found["k_m"].error == pytest.approx(0.1)
    assert found["phase"].error == pytest.approx(0.1 / size)


def test_an_amplitude_of_zero_has_no_phase():
    found = by_name(named_parameters(estimate({"km_cos": 0.0, "km_sin": 0.0}, np.eye(2))))
    assert found["k_m"].value == 0.0
    assert found["phase"].error == math.inf


def test_dead_band_stiffness_is_positive():
    found = by_name(named_parameters(estimate({"kg": -355.3}, np.array([[4.0]]))))
    assert (found["k_dead_band"].value, found["k_dead_band"].error) == (355.3, 2.0)


def test_true_parameters_have_the_same_names(systems):
    assert set(true_parameters(systems["mathieu"].values)) == {"m", "c", "k", "f_n", "zeta", "k_m", "phase", "f_m"}
    assert true_parameters(systems["dead_band"].values)["k_dead_band"] == 355.3
    assert "f_n" not in true_parameters(systems["extreme"].values)


# ---- read by hand (Section 5.2.1)


def test_reading_the_exact_curve():
    frequency = np.arange(0.0, 10.0, 0.01)
    omega = 2j * np.pi * frequency
    found = read_linear(frequency, M * omega**2 + C * omega + K, (0.3, 10.0))
    assert found["k"] == pytest.approx(K, rel=1e-4), "of the lowest lines, not of the lowest of the band"
    f_n = frequency[np.argmin(np.abs(M * omega**2 + C * omega + K))]
    assert found["f_n"] == pytest.approx(f_n, abs=0.01)
    assert found["m"] == pytest.approx(found["k"] / (2 * np.pi * found["f_n"]) ** 2)
    assert found["c"] == pytest.approx(C, rel=0.02), "at its minimum, abs(A_1) is nearly 2 pi f_n c"
    assert found["zeta"] == pytest.approx(found["c"] / (2.0 * math.sqrt(found["k"] * found["m"])))


def test_the_minimum_is_found_between_the_lines():
    frequency = np.array([2.0, 2.1, 2.2, 2.3, 2.4])
    found = read_linear(frequency, (100.0 + 50.0 * (frequency - 2.23) ** 2).astype(complex), (1.0, 3.0))
    assert found["f_n"] == pytest.approx(2.23)


def test_a_curve_without_a_minimum_gives_stiffness_alone():
    frequency = np.arange(0.3, 10.0, 0.1)
    assert list(read_linear(frequency, -(frequency**2) + 0j, (0.3, 10.0))) == ["k"]


def test_plateaus_are_read_off_the_nonlinear_paths(systems, records):
    read = {
        system: by_name(estimators.identify("miso_hand_read", systems[system], records[system], TOLD).parameters)
        for system in ("duffing_van_der_pol", "mathieu", "dead_band")
    }
    assert read["duffing_van_der_pol"]["k3"].value == pytest.approx(2.0e7, rel=0.02)
    assert read["duffing_van_der_pol"]["c3"].value == pytest.approx(2.0e6, rel=0.02)
    assert read["mathieu"]["k_m"].value == pytest.approx(177.7, rel=0.02)
    assert read["dead_band"]["k_dead_band"].value == pytest.approx(355.3, rel=0.05)
    assert all(math.isnan(p.error) for p in read["mathieu"].values()), "a hand gives no standard error"
