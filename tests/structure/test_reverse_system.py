"""Each coordinate's equation of motion in reverse, and what two equations say of one coefficient."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from study.equations.model_file import parse_model
from study.equations.simulate import Integrator, simulate
from study.identify import estimators
from study.identify.estimators.base import Settings
from study.identify.frequency_domain.action_reaction import joint_estimate
from study.identify.frequency_domain.local_polynomial import LocalPolynomial
from study.identify.frequency_domain.reverse_system import equations_of, exact_responses, reverse_system
from study.records.excitation import Excitation, force
from study.records.prepared import prepare_record
from study.records.record import Record, record_of
from study.records.spectra import Segments
from study.support.errors import StudyError

DT, SAMPLES = 0.02, 4096
SETTINGS = Settings(Segments(256), (0.5, 10.0), LocalPolynomial(2, 30))
TWO = """
name: two
coordinates: [a, b]
forces: {first: a, second: b}
terms:
  - {term: inertia, at: a, value: 1.0}
  - {term: inertia, at: b, value: 0.5}
  - {term: linear_stiffness, between: [ground, a], value: 350.0}
  - {term: linear_damping, between: [ground, a], value: 4.0}
  - {term: linear_stiffness, between: [a, b], value: 200.0}
  - {term: linear_damping, between: [a, b], value: 2.0}
  - {term: cubic_stiffness, between: [a, b], value: 1.0e+6}
"""


def model(text=TWO):
    return parse_model(text, Path("two.yaml"))


@pytest.fixture(scope="module")
def record():
    level = Excitation(level=1.0, cutoff=12.5)
    drives = {name: force(level, SAMPLES, DT, seed) for seed, name in enumerate(("first", "second"), 1)}
    return simulate(model(), drives, DT, Integrator("rk4", 8))


@pytest.fixture(scope="module")
def one_force(record):
    """The same structure driven at its first mass alone."""
    driven = model(TWO.replace(", second: b", ""))
    return driven, simulate(driven, {"first": record["first"]}, DT, Integrator("rk4", 8))


def equations(structure, record: Record):
    return equations_of(structure, prepare_record(record), (0, len(record)))[0]


def test_every_line_is_the_direct_least_squares_solution(one_force):
    """Segment by segment transforms of inputs and output, solved by dense least squares."""
    for equation in (own := equations(*one_force)):
        taper = SETTINGS.segments.taper()
        cuts = [np.lib.stride_tricks.sliding_window_view(x, 256)[::128] * taper for x in equation.channels]
        lines = np.fft.rfft(np.stack(cuts), axis=2)
        result = reverse_system("miso", own, DT, SETTINGS).results[own.index(equation)].found.responses
        for k in (5, 20, 40):
            columns = lines[:-1, :, k].T
            size = np.linalg.norm(columns, axis=0)
            direct = np.linalg.lstsq(columns / size, lines[-1, :, k], rcond=None)[0] / size
            np.testing.assert_allclose(result.response[:, k], direct, rtol=1e-7)


@pytest.mark.parametrize("estimator", ["miso", "siso", "local_polynomial"])
def test_one_coordinate_is_the_single_mass(estimator):
    """A structure of one coordinate and the plain model give the same numbers."""
    kinds = ["inertia", "linear_stiffness", "linear_damping", "cubic_stiffness"]
    values = dict(zip(kinds, (1.0, 355.3, 3.77, 2e7), strict=True))
    placed = "".join(f"  - {{term: {t}, at: a, value: {v}}}\n" for t, v in values.items())
    structure = model(f"name: one\ncoordinates: [a]\nforces: {{shaker: a}}\nterms:\n{placed}")
    drive = force(Excitation(level=1.0, cutoff=12.5), SAMPLES, DT, 3)
    motions = simulate(structure, {"shaker": drive}, DT, Integrator("rk4", 8))
    alone = {s.motion: x for s, x in motions.motions.items()}
    plain = model("name: one\nterms:\n" + "".join(f"  - {t}\n" for t in kinds))
    direct = estimators.identify(estimator, plain, Record(DT, {"force": drive, **alone}), SETTINGS)
    system = reverse_system(estimator, equations(structure, motions), DT, SETTINGS)
    found = system.results[0].found
    np.testing.assert_array_equal(found.responses.response, direct.responses.response)
    assert found.estimate.symbols == tuple(f"{s}[a]" for s in direct.estimate.symbols)
    rtol = 1e-13 if estimator == "local_polynomial" else 0.02  # spectra give the coefficients of all inputs at once
    np.testing.assert_allclose(found.estimate.values, direct.estimate.values, rtol=rtol)
    joint = joint_estimate(system).estimate
    np.testing.assert_allclose(joint.values, found.estimate.values, rtol=1e-9)
    np.testing.assert_allclose(np.diag(joint.covariance), np.diag(found.estimate.covariance), rtol=1e-6)


def test_local_polynomials_find_the_exact_functions_in_every_equation(one_force):
    structure, motions = one_force
    system = reverse_system("local_polynomial", equations(structure, motions), DT, SETTINGS)
    result = system.results[1]  # in the first no line tells: see below
    inside = (result.found.responses.frequency > 1.0) & (result.found.responses.frequency < 10.0)
    for got, exact in zip(result.found.responses.response, exact_responses(result, structure.values), strict=True):
        error = np.sqrt(np.mean(np.abs(got - exact)[inside] ** 2) / np.mean(np.abs(exact[inside]) ** 2))
        assert error < 1e-3
    joint = joint_estimate(system).estimate
    assert set(joint.symbols) == set(structure.values)  # the second mass too, though nothing drives it
    for key in joint.symbols:
        assert joint[key] == pytest.approx(structure.values[key], rel=1e-4)


def test_inputs_that_determine_each_other_are_said_to(one_force, record):
    """With one force, the second equation ties the three inputs of the first together; with two it does not."""
    shares = []
    for structure, motions in (one_force, (model(), record)):
        system = reverse_system("miso", equations(structure, motions), DT, SETTINGS)
        frequency = system.results[0].found.responses.frequency
        inside = (frequency > 1.0) & (frequency < 6.0)
        shares.append([float(np.min(np.median(r.independent[inside], axis=0))) for r in system.results])
        joint = joint_estimate(system).estimate
        assert joint["k3[a-b]"] == pytest.approx(1e6, rel=0.02)  # all lines together tell the coefficients
        assert joint["k[a-b]"] == pytest.approx(200.0, rel=0.02)
    assert shares[0][0] < 0.05 < 0.08 < min(shares[0][1], *shares[1]), shares  # segments' ends leak the rest


def test_coefficients_of_all_inputs_at_once_are_the_direct_solution(one_force):
    """Every segment's transform, stacked and weighted with the noise of its line."""
    own = equations(*one_force)[0]
    result = reverse_system("miso", [own], DT, SETTINGS).results[0].found
    cuts = [np.lib.stride_tricks.sliding_window_view(x, 256)[::128] * SETTINGS.segments.taper() for x in own.channels]
    lines, noise = np.fft.rfft(np.stack(cuts), axis=2), result.responses.noise
    f = result.responses.frequency
    keep = (f >= SETTINGS.band[0]) & (f <= SETTINGS.band[1])
    parts = [(j, p) for j, item in enumerate(own.inputs) for p in item.parts]
    weight = (1.0 / np.sqrt(noise[keep]))[None]
    columns = [(lines[j][:, keep] * p.factor * (2j * np.pi * f[keep]) ** p.order * weight).ravel() for j, p in parts]
    stacked = np.stack([np.concatenate([c.real, c.imag]) for c in columns], axis=1)
    target = (lines[-1][:, keep] * weight).ravel()
    size = np.linalg.norm(stacked, axis=0)
    direct = np.linalg.lstsq(stacked / size, np.concatenate([target.real, target.imag]), rcond=None)[0] / size
    np.testing.assert_allclose(result.estimate.values, direct, rtol=1e-6)


def test_miso_puts_the_cubic_spring_where_it_is_and_siso_does_not(one_force):
    structure, motions = one_force
    everywhere = parse_model(TWO.replace(", second: b", "") + "  - {term: cubic_stiffness, at: a}\n", Path("all.yaml"))
    own = equations(everywhere, motions)
    joint = joint_estimate(reverse_system("miso", own, DT, SETTINGS)).estimate
    assert joint["k3[a-b]"] == pytest.approx(1e6, rel=0.03)
    assert abs(joint["k3[a]"]) < 0.03 * 1e6
    linear = joint_estimate(reverse_system("siso", own, DT, SETTINGS)).estimate
    errors = [abs(e["k[a-b]"] - structure.values["k[a-b]"]) for e in (joint, linear)]
    assert errors[1] > 4.0 * errors[0]


def noisy(record, sign, seed):
    """Noise on both measured forces: independent, or the same with a sign."""
    rng = np.random.default_rng(seed)
    first, second = 0.1 * rng.standard_normal((2, SAMPLES))
    noise = {"first": first, "second": second if sign == 0 else sign * first}
    forces = {name: record[name] + noise[name] for name in record.forces}
    return record_of(DT, forces, record.motions)


@pytest.mark.parametrize("estimator", ["miso", "local_polynomial"])
@pytest.mark.parametrize("sign", [0, -1, 1])
def test_the_error_of_the_difference_is_its_scatter(record, estimator, sign):
    """Where the errors of both equations are correlated too."""
    structure, scores = model(), []
    for seed in range(16):
        own = equations(structure, noisy(record, sign, seed))
        for reaction in joint_estimate(reverse_system(estimator, own, DT, SETTINGS)).reactions:
            assert reaction.coordinates == ("a", "b")
            scores.append((reaction.values[1] - reaction.values[0]) / reaction.error)
    assert len(scores) == 16 * 3
    low, high = (0.4, 1.2) if estimator == "miso" else (0.7, 1.5)  # spectra's errors are on the safe side
    assert low < np.sqrt(np.mean(np.square(scores))) < high


def test_a_term_at_the_wrong_place_breaks_action_and_reaction(record):
    structure, own = model(), model(TWO.replace("cubic_stiffness, between: [a, b]", "cubic_stiffness, at: b"))
    grounded = simulate(own, {name: record[name] for name in record.forces}, DT, Integrator("rk4", 8))
    for motions, holds in ((record, True), (grounded, False)):
        system = reverse_system("miso", equations(structure, noisy(motions, 0, 5)), DT, SETTINGS)
        assert (joint_estimate(system).least_p > 1e-6) == holds


def test_what_no_equation_tells_is_said(one_force):
    structure, motions = one_force
    still = model(TWO.replace("forces: {first: a, second: b}\n", ""))
    free = record_of(DT, {}, motions.motions)
    system = reverse_system("local_polynomial", equations(still, free), DT, SETTINGS)
    with pytest.raises(StudyError, match="a mass held"):
        joint_estimate(system)
    joint = joint_estimate(system, {"m[b]": 0.5}).estimate
    assert joint["k3[a-b]"] == pytest.approx(1e6, rel=1e-3)
    blind = motions.with_motions({s: x for s, x in motions.motions.items() if s.coordinate == "a"})
    with pytest.raises(StudyError, match="no sensor is at b"):
        equations(structure, blind)
    with pytest.raises(StudyError, match="known are siso"):
        reverse_system("guess", equations(structure, motions), DT, SETTINGS)


def test_the_joint_estimate_is_the_nearest_one(one_force):
    """Minimum distance by a general solver, whose derivatives are differences."""
    structure, motions = one_force
    rng = np.random.default_rng(2)
    noisy_force = motions["first"] + 0.3 * rng.standard_normal(SAMPLES)
    shaken = {s: x * (1.0 + 1e-3 * rng.standard_normal(SAMPLES)) for s, x in motions.motions.items()}
    system = reverse_system("miso", equations(structure, record_of(DT, {"first": noisy_force}, shaken)), DT, SETTINGS)
    joint = joint_estimate(system).estimate
    own = [(r.mass, r.found.estimate) for r in system.results]
    size = np.array([structure.values[key] for key in joint.symbols])

    def distance(x):
        theta, parts = dict(zip(joint.symbols, x * size, strict=True)), []
        for mass, e in own:
            expected = np.array([theta[s] for s in e.symbols]) / (1.0 if mass is None else theta[mass])
            deviation = np.sqrt(np.diag(e.covariance))
            correlation = e.covariance / np.outer(deviation, deviation)
            parts.append(np.linalg.solve(np.linalg.cholesky(correlation), (e.values - expected) / deviation))
        return np.concatenate(parts)

    direct = least_squares(distance, np.ones(len(size)), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    np.testing.assert_allclose(joint.values / size, direct.x, rtol=1e-5)
    assert np.sum(distance(joint.values / size) ** 2) < 1.0001 * np.sum(direct.fun**2)
