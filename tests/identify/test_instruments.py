"""Instruments from a free run: corrected inputs, and A_j(f) that noise on the response does not bias."""

from dataclasses import replace

import numpy as np
import pytest

from study.identify import estimators
from study.identify.estimators.base import Settings
from study.identify.frequency_domain import instruments
from study.identify.frequency_domain.inputs import Input, Part, input_history, reverse_inputs
from study.records.excitation import displacement_noise
from study.records.record import Record
from study.records.spectra import Segments
from study.support.errors import StudyError

TOLD = Settings(Segments(512), (0.3, 10.0))
NOISE = 0.3


def one_input(shape, *parameters):
    return Input(shape, (Part("q", 0, 1.0),), ("own",), parameters)


def still(shape_of_u=0.0, velocity=0.0, count=3):
    """A motion that stays where it is."""
    at = {"force": 0.0, "displacement": shape_of_u, "velocity": velocity}
    return Record(0.02, {name: np.full(count, value) for name, value in at.items()})


def noisy(record, fraction, seed):
    clean = record["displacement"]
    return record.with_channels({"displacement": clean + displacement_noise(clean, fraction, seed)})


@pytest.mark.parametrize("u", [-1.2, 0.0, 0.7])
def test_mean_of_a_power_is_what_its_moments_say(u):
    spread = {"displacement": np.array([0.0, NOISE]), "velocity": np.zeros(2)}
    for shape, exact in (
        ("u**3", u**3 + 3 * NOISE**2 * u),
        ("u**5", u**5 + 10 * NOISE**2 * u**3 + 15 * NOISE**4 * u),
        ("u*cos(2*pi*f_m*t)", u),
    ):
        item = one_input(shape, *([("f_m", 0.0)] if "f_m" in shape else []))
        np.testing.assert_allclose(instruments.expected(item, still(u), spread), exact, atol=1e-12)


@pytest.mark.parametrize("shape", ["u*abs(u)", "max(min(u, u_g), -u_g)", "u**2*v", "v*abs(v)", "abs(u)*v"])
def test_mean_of_any_shape_is_that_of_many_draws(shape):
    """Noise on u and v that goes together, and kinked shapes."""
    root = np.array([[0.1, 0.3], [0.2, -0.1]])
    spread = dict(zip(("displacement", "velocity"), root, strict=True))
    item = one_input(shape, *([("u_g", 0.4)] if "u_g" in shape else []))
    draws = np.random.default_rng(3).standard_normal((2, 400_000))
    noise = root @ draws
    moved = Record(0.02, {"force": noise[0], "displacement": 0.2 + noise[0], "velocity": 0.5 + noise[1]})
    values = input_history(item, moved)
    found = instruments.expected(item, still(0.2, 0.5), spread)[0]
    assert abs(found - values.mean()) < 4.0 * values.std() / np.sqrt(values.size) + 1e-3 * abs(values.mean())


def test_corrected_inputs_have_the_mean_of_the_true_ones(systems, records):
    clean = records["duffing_van_der_pol"]
    cube = reverse_inputs(systems["duffing_van_der_pol"])[1]
    true = input_history(cube, clean)
    raw, mended = [], []
    for seed in range(6):
        measured = noisy(clean, 0.2, seed)
        mended.append(instruments.inputs_without_noise([cube], measured, clean)[0])
        raw.append(input_history(cube, measured))
    slope = [float(np.mean([x @ true for x in found]) / (true @ true)) for found in (raw, mended)]
    u = clean["displacement"]
    drawn_to = 1.0 + 3.0 * 0.2 * np.mean(u**2) * np.mean(u**4) / np.mean(u**6)
    assert slope[0] == pytest.approx(drawn_to, abs=0.02)
    assert slope[1] == pytest.approx(1.0, abs=0.02)
    assert drawn_to > 1.1


def test_noise_of_the_measured_channels_is_that_which_was_added(records):
    clean = records["duffing"]
    measured = noisy(clean, 0.1, 2)
    spread = instruments.noise_spread(measured, clean)
    added = 0.1 * np.mean(clean["displacement"] ** 2)
    assert np.linalg.norm(spread["displacement"]) ** 2 == pytest.approx(added, rel=0.05)
    assert not np.any(spread["velocity"])


def test_without_noise_it_is_miso(systems, records):
    """Up to what the free run differs from the simulation by."""
    for name in ("duffing_van_der_pol", "mathieu"):
        found = estimators.identify("instrumental", systems[name], records[name], TOLD)
        miso = estimators.identify("miso", systems[name], records[name], TOLD)
        keep = (miso.responses.frequency > 0.3) & (miso.responses.frequency < 10.0)
        size = np.abs(miso.responses.response[:, keep])
        assert np.max(np.abs(found.responses.response - miso.responses.response)[:, keep] / size) < 1e-2
        assert not found.note


def test_lines_and_coefficients_are_not_biased_by_noise(systems, records):
    """... where MI/SO's are, and its errors are those of the lines."""
    model, clean = systems["duffing_van_der_pol"], records["duffing_van_der_pol"]
    found = [estimators.identify("instrumental", model, noisy(clean, 0.2, seed), TOLD) for seed in range(4)]
    frequency, count = found[0].responses.frequency, len(found)
    keep = (frequency > 0.5) & (frequency < 6.0)
    for j, item in enumerate(found[0].inputs):
        exact = item.response(frequency, model.values)[keep]
        off = np.stack([f.responses.response[j, keep] - exact for f in found])
        error = np.stack([np.sqrt(f.responses.covariance[keep, j, j].real) for f in found])
        mean = np.sum(off / error**2) / np.sum(1.0 / error**2)
        assert abs(mean) < 4.0 / np.sqrt(np.sum(1.0 / error**2)) * np.sqrt(2.0)
        assert np.sqrt(np.mean(np.abs(off / error) ** 2)) == pytest.approx(1.0, abs=0.25)
    values = np.array([[f.estimate[s] / model.values[s] - 1.0 for s in ("m", "c", "k", "k3", "c3")] for f in found])
    assert np.all(np.abs(values.mean(axis=0)) < 4.0 * values.std(axis=0, ddof=1) / np.sqrt(count))
    miso = estimators.identify("miso", model, noisy(clean, 0.2, 0), TOLD).estimate
    assert miso["k3"] < 0.7 * model.values["k3"]


def test_a_formula_of_a_missing_channel_is_refused(records):
    record = records["duffing"]
    lacking = replace(record, channels={name: record[name] for name in ("force", "displacement")})
    with pytest.raises(StudyError, match="velocity"):
        instruments.inputs_without_noise([one_input("v**3")], lacking, lacking)


def test_coherence_along_the_free_run_is_that_without_noise(systems, records):
    model, clean = systems["duffing_van_der_pol"], records["duffing_van_der_pol"]
    measured = noisy(clean, 0.1, 1)
    found = estimators.identify("instrumental", model, measured, TOLD).analysis
    blurred, true = (estimators.identify("miso", model, r, TOLD).responses for r in (measured, clean))
    keep = (true.frequency > 0.3) & (true.frequency < 10.0)
    assert np.max(np.abs(found.cumulative - true.cumulative)[:, keep]) < 0.02
    assert np.mean(blurred.multiple[keep]) < 0.8 < 0.99 < np.mean(found.multiple[keep])
