"""Local polynomials: exact where theory says so, free of leakage, and as sure of themselves as they may be."""

import re
from dataclasses import replace

import numpy as np
import pytest

from study.equations.simulate import Integrator, simulate
from study.identify import estimators
from study.identify.estimators.base import Settings
from study.identify.frequency_domain import local_polynomial
from study.identify.frequency_domain.inputs import Input, Part, histories, reverse_inputs
from study.identify.frequency_domain.local_polynomial import Lines, LocalPolynomial, fit_local_polynomial, transform
from study.records.excitation import Excitation, force
from study.records.spectra import Segments
from study.support.errors import StudyError

BAND = (0.3, 10.0)
TOLD = Settings(Segments(512), BAND)
INPUTS = (
    Input("u", (Part("k", 0, 1.0), Part("c", 1, 1.0), Part("m", 2, 1.0)), ("a",), ()),
    Input("u**3", (Part("k3", 0, 1.0),), ("b",), ()),
)


def made_lines(count=400, noise=0.0, seed=3):
    """Lines of an output that is made of two inputs and a smooth transient."""
    rng = np.random.default_rng(seed)
    frequency = np.arange(1, count + 1) * 0.05
    inputs = np.array([[1.0], [1e-8]]) * (rng.standard_normal((2, count, 2)) @ [1.0, 1j])
    inputs[1] += 2e-8 * inputs[0]
    omega = 2j * np.pi * frequency
    exact = np.stack([1.5 * omega**2 + 3.0 * omega + 400.0, np.full(count, 2e9 + 0j)])
    leakage = 30.0 - 4.0 * frequency + 1j * frequency**2
    output = np.sum(exact * inputs, axis=0) + leakage + noise * (rng.standard_normal((count, 2)) @ [1.0, 1j])
    return Lines(frequency, inputs, output, density=0.5, samples=2 * count + 1), exact


# ---- A_j(f)


def test_polynomials_are_found_exactly_whatever_leaks():
    lines, exact = made_lines()
    found = local_polynomial.local_polynomial_responses(lines, LocalPolynomial(2, 12))
    index = np.searchsorted(lines.frequency, found.frequency - 1e-9)
    np.testing.assert_allclose(found.response, exact[:, index], rtol=1e-9)
    assert np.all(found.noise < 1e-18 * np.mean(np.abs(lines.output) ** 2))
    assert found.response.shape == (2, len(found.frequency))
    assert np.all(np.diff(index) == 6), "bands stand half of their half width apart"


def test_a_band_is_solved_as_a_dense_solver_does():
    lines, _ = made_lines(noise=50.0)
    how = LocalPolynomial(1, 10)
    found = local_polynomial.local_polynomial_responses(lines, how)
    b, first = 3, 3 * 5
    x = np.arange(-10, 11) / 10.0
    part = slice(first, first + 21)
    columns = [lines.inputs[j, part] * x**r for j in (0, 1) for r in (0, 1)] + [x**0 + 0j, x + 0j]
    design = np.stack(columns, axis=1)
    solution, squares, _, _ = np.linalg.lstsq(design / np.linalg.norm(design, axis=0), lines.output[part], rcond=None)
    np.testing.assert_allclose(found.response[:, b], (solution / np.linalg.norm(design, axis=0))[[0, 2]], rtol=1e-9)
    variance = squares[0] / (21 - 6)
    assert found.noise[b] == pytest.approx(0.5 * variance)
    covariance = np.linalg.inv(design.conj().T @ design)[np.ix_([0, 2], [0, 2])] * variance
    np.testing.assert_allclose(found.covariance[b], covariance, rtol=1e-6)


def test_bands_solved_in_chunks_are_the_same(monkeypatch):
    lines, _ = made_lines(noise=1.0)
    whole = local_polynomial.local_polynomial_responses(lines, LocalPolynomial(2, 12))
    monkeypatch.setattr(local_polynomial, "AT_A_TIME", 7)
    parts = local_polynomial.local_polynomial_responses(lines, LocalPolynomial(2, 12))
    np.testing.assert_array_equal(whole.response, parts.response)
    np.testing.assert_array_equal(whole.covariance, parts.covariance)


def test_covariance_and_noise_are_those_of_many_seeds():
    found = [
        local_polynomial.local_polynomial_responses(made_lines(120, 50.0, s)[0], LocalPolynomial(2, 15))
        for s in range(60)
    ]
    exact = made_lines(120)[1][:, np.searchsorted(made_lines(120)[0].frequency, found[0].frequency - 1e-9)]
    off = np.array([f.response - exact for f in found])
    claimed = np.array([np.einsum("fjj->jf", f.covariance.real) for f in found])
    assert np.mean(np.abs(off) ** 2 / claimed) == pytest.approx(1.0, abs=0.1)
    assert np.mean([f.noise for f in found]) == pytest.approx(0.5 * 2.0 * 50.0**2, rel=0.03)


# ---- coefficients


def test_coefficients_are_those_of_one_dense_solve():
    """Least squares of everything at once: coefficients, and a transient of its own in every band."""
    lines, _ = made_lines(noise=50.0)
    how, band = LocalPolynomial(2, 12), (1.0, 6.1)
    inside = np.flatnonzero((lines.frequency >= band[0]) & (lines.frequency <= band[1]))
    width = len(inside) // (len(inside) // 25)
    bands = [inside[i : i + width] for i in range(0, len(inside) - width + 1, width)]
    assert len(bands) == 4
    rows, right = [], []
    for b, index in enumerate(bands):
        x = np.linspace(-1.0, 1.0, width)
        smooth = np.stack([x**r + 0j for r in range(3)], axis=1)
        free = np.concatenate([lines.inputs[j, index][:, None] * smooth * s for j, s in ((0, 1.0), (1, 1e8))], axis=1)
        free = np.concatenate([free, smooth], axis=1)
        rest = lines.output[index] - free @ np.linalg.lstsq(free, lines.output[index], rcond=None)[0]
        weight = 1.0 / np.sqrt(np.sum(np.abs(rest) ** 2) / (width - 9))
        omega = 2j * np.pi * lines.frequency[index]
        own = np.stack(
            [lines.inputs[0, index] * omega**r for r in range(3)] + [1e8 * lines.inputs[1, index]], axis=1
        )  # fmt: skip
        block = np.zeros((width, 4 + 6 * len(bands)), dtype=complex)
        block[:, :4] = own
        block[:, 4 + 6 * b : 7 + 6 * b], block[:, 7 + 6 * b : 10 + 6 * b] = smooth, 1j * smooth
        rows.append(block * weight)
        right.append(lines.output[index] * weight)
    design, target = np.concatenate(rows), np.concatenate(right)
    solution = np.linalg.lstsq(
        np.concatenate([design.real, design.imag]), np.concatenate([target.real, target.imag]), rcond=None
    )[0]
    estimate = fit_local_polynomial(lines, INPUTS, band, how)[0]
    np.testing.assert_allclose(estimate.values, solution[:4] * [1.0, 1.0, 1.0, 1e8], rtol=1e-8)


def errors(found, truth):
    return {p.name: abs(p.value / truth[p.name] - 1.0) for p in found.parameters if p.name in truth}


@pytest.mark.parametrize(
    ("system", "within"),
    [
        ("linear", {"k": 1e-7, "m": 1e-7, "zeta": 1e-7}),
        ("mathieu", {"k": 1e-7, "m": 1e-7, "k_m": 1e-7}),
        ("duffing", {"k": 1e-4, "m": 1e-4, "f_n": 1e-4, "k3": 1e-4, "zeta": 3e-4}),
        ("dead_band", {"k": 1e-3, "k_dead_band": 1e-3, "zeta": 1e-2}),
    ],
)
def test_noise_free_systems_leave_next_to_nothing(system, within, systems, report_force):
    """The integrator leaves what is left of the linear systems: four times as many steps as elsewhere."""
    record = simulate(systems[system], report_force, 0.02, Integrator("rk4", 32))
    truth = {"k": 355.3, "m": 1.0, "f_n": 2.99998, "k3": 2e7, "k_m": 177.7, "k_dead_band": 355.3}
    truth["zeta"] = (1.89 if system == "dead_band" else 3.77) / (2.0 * np.sqrt(355.3))
    truth["f_n"] = np.sqrt(355.3) / (2.0 * np.pi)
    own = errors(estimators.identify("local_polynomial", systems[system], record, TOLD), truth)
    report = errors(estimators.identify("miso", systems[system], record, TOLD), truth)
    for name, most in within.items():
        assert own[name] < most
    if system != "dead_band":  # its shape is not smooth: what is left are its harmonics beyond the Nyquist frequency
        assert all(own[name] < report[name] / 100.0 for name in ("k", "m"))


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_standard_errors_are_the_scatter(noise, systems):
    values, claimed = [], []
    for seed in range(24):
        record = simulate(systems["duffing"], force(Excitation(), 2048, 0.02, seed), 0.02, Integrator("rk4", 8))
        u, rng = record["displacement"], np.random.default_rng(seed)
        record = record.with_channels({"displacement": u + noise * np.std(u) * rng.standard_normal(len(u))})
        told = replace(TOLD, local_polynomial=LocalPolynomial(2, 20))
        found = estimators.identify("local_polynomial", systems["duffing"], record, told).estimate
        values.append(found.values)
        claimed.append(np.sqrt(np.diag(found.covariance)))
    ratio = np.sqrt(np.mean(np.square(claimed), axis=0)) / np.std(values, axis=0, ddof=1)
    low, high = (0.6, 1.7) if noise else (0.4, 2.0)  # without noise there is what a few bursts leave: heavy tails
    assert np.all((ratio > low) & (ratio < high)), ratio


def test_units_change_nothing(systems, records):
    record = records["duffing_van_der_pol"]
    other = record.with_channels({"displacement": 1e3 * record["displacement"], "force": 1e-3 * record["force"]})
    one = estimators.identify("local_polynomial", systems["duffing_van_der_pol"], record, TOLD).estimate
    two = estimators.identify("local_polynomial", systems["duffing_van_der_pol"], other, TOLD).estimate
    powers = np.array([1e-6, 1e-6, 1e-6, 1e-12, 1e-12])
    np.testing.assert_allclose(two.values, one.values * powers, rtol=1e-8)
    np.testing.assert_allclose(np.diag(two.covariance), np.diag(one.covariance) * powers**2, rtol=1e-4)


def test_an_input_without_power_in_the_band_has_no_coefficient(records, make_model):
    record = records["linear"]
    offset = make_model("offset", {"inertia": {}, "linear_damping": {}, "linear_stiffness": {}, "constant_force": {}})
    found = estimators.identify("local_polynomial", offset, record, TOLD)
    assert found.estimate.symbols == ("m", "c", "k")
    np.testing.assert_array_equal(found.responses.response[1], 0.0)
    assert found.estimate["k"] == pytest.approx(355.3, rel=1e-5)


def test_memory_does_not_grow_with_bands_times_inputs():
    """1e5 samples: no array of all bands at once."""
    rng = np.random.default_rng(1)
    lines = transform([rng.standard_normal(100_000) for _ in range(3)], 0.01)
    import tracemalloc

    tracemalloc.start()
    local_polynomial.local_polynomial_responses(lines, LocalPolynomial())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    bands = len(lines.frequency) // 20
    assert peak < 0.5 * bands * 81 * 9 * 16


# ---- what cannot be done


def test_records_that_are_too_short(systems, records):
    inputs, record = reverse_inputs(systems["duffing"]), records["duffing"].part(0, 256)
    lines = transform([*histories(inputs, record), record["force"]], record.dt)
    says = (
        "the record of 256 samples has 50 lines from 0.3 to 10 Hz; local_polynomial needs 81; expected a longer record"
    )
    with pytest.raises(StudyError, match=re.escape(says)):
        fit_local_polynomial(lines, inputs, BAND, LocalPolynomial())
    with pytest.raises(StudyError, match="the record of 256 samples has 127 lines, fewer than the 161 of a band"):
        local_polynomial.local_polynomial_responses(lines, LocalPolynomial(2, 80))


def test_bands_that_are_too_narrow():
    with pytest.raises(
        StudyError, match="half_width is 7; 2 inputs of degree 2 have 9 unknowns in a band, which needs 8"
    ):
        LocalPolynomial(2, 7).check(2)
    LocalPolynomial(2, 8).check(2)
    with pytest.raises(StudyError, match="degree is -1; at least 0"):
        LocalPolynomial(-1)
    with pytest.raises(StudyError, match="half_width is 0; at least 1"):
        LocalPolynomial(2, 0)
