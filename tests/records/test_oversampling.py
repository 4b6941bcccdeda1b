"""Samples that a motion does not ask for are left out, and nothing with them."""

from dataclasses import replace

import numpy as np
import pytest

from study.equations.free_run import predict_response
from study.equations.model import Model, free
from study.equations.terms import get
from study.faults.accounting import accounted
from study.faults.fault import FAULTS
from study.records.excitation import Excitation, displacement_noise, force
from study.records.prepared import prepare_record
from study.records.record import SI_UNITS, Record
from study.records.sampling_rate import content, decimated, without_spare_samples

A_PERIOD, SAMPLES, DT = 180, 11520, 1.0 / 180  # of a system of 1 Hz
VALUES = {"m": 1.0, "c": 0.377, "k": 39.5}


def believed(*more):
    return Model("rig", tuple(free(get(n)) for n in ("inertia", "linear_damping", "linear_stiffness", *more)))


def measured(model, response, noise, seed=1, samples=SAMPLES):
    """A record of a known system with so much noise (mean square over that of the response)."""
    drive = force(Excitation("gaussian_lowpass", 60.0, "filtered", 3.0), samples, DT, seed)
    record = Record(DT, {"force": drive}, dict(SI_UNITS), "rig")
    clean = predict_response(model, record, response=response, steps_per_sample=4)
    return record.with_channels({response: clean + displacement_noise(clean, noise, seed)})


@pytest.mark.parametrize(
    ("term", "values"), [("cubic_stiffness", {"k3": 8.0}), ("coulomb_friction", {"fc": 1.5})]
)  # fmt: skip
def test_coefficients_and_their_errors_are_those_of_all_samples(term, values):
    model = believed(term)
    truth = model.with_values(VALUES | values)
    prepared = prepare_record(measured(truth, "displacement", 1e-4))
    every, some = (
        accounted(model, prepared, switched_off=FAULTS, as_sampled=all_).comparison for all_ in (True, False)
    )
    assert every.prepared.every == 1
    assert some.prepared.every >= 5
    assert some.spans == every.spans == ((0, SAMPLES // 2), (SAMPLES // 2, SAMPLES))
    assert any("low-pass" in note for note in some.notes)
    assert not any("low-pass" in note for note in every.notes)
    for one, other in zip(every.coefficients, some.coefficients, strict=True):
        assert abs(other.value - one.value) < 0.4 * one.error, one.key
    white = [np.sqrt(np.diag(c.fit.covariance)) for c in (every, some)]
    np.testing.assert_allclose(white[1], white[0], rtol=0.05)


def test_an_acceleration_that_jumps_keeps_its_samples():
    truth = believed("coulomb_friction").with_values(VALUES | {"fc": 1.5})
    prepared = prepare_record(measured(truth, "acceleration", 0.01))
    assert without_spare_samples(prepared) is prepared


def test_a_record_whose_motion_asks_for_all_is_left_as_it_is():
    truth = believed().with_values(VALUES)
    coarse = measured(truth, "displacement", 1e-4)
    record = Record(1.0 / 9.0, {name: coarse[name][::20] for name in coarse.channels}, dict(SI_UNITS))
    prepared = prepare_record(record)
    assert without_spare_samples(prepared) is prepared


def test_white_noise_stays_white_and_a_slow_sine_stays_itself():
    rng = np.random.default_rng(4)
    noise, slow = rng.standard_normal(60_000), np.sin(2.0 * np.pi * 300 / 60_000 * np.arange(60_000))
    record = Record(1.0, {"force": slow, "displacement": noise})
    kept = decimated(record, 6)
    assert kept.dt == 6.0
    np.testing.assert_allclose(kept["force"], slow[::6], atol=1e-12)
    values = kept["displacement"]
    assert np.var(values) == pytest.approx(1.0 / 6.0, rel=0.05)
    for lag in (1, 2, 3):
        assert abs(np.mean(values[lag:] * values[:-lag])) * 6.0 < 4.0 / np.sqrt(len(values))


@pytest.mark.parametrize(("reading", "delay"), [("held", 0.5), ("straight", 0.0)])
def test_a_force_that_a_program_made_is_filtered_as_it_acts(reading, delay):
    slow = np.sin(2.0 * np.pi * 600 / 60_000 * np.arange(60_000))
    record = replace(Record(1.0, {"force": slow, "displacement": slow}), between=reading)
    kept = decimated(record, 6)
    x = np.pi * 0.01
    size = (np.sin(x) / x) ** (2 if reading == "straight" else 1)
    late = size * np.sin(2.0 * np.pi * 0.01 * (6.0 * np.arange(10_000) - delay))
    np.testing.assert_allclose(kept["force"], late, atol=1e-10)
    assert kept.between == "band_limited"


def test_what_stands_above_the_noise_is_found_where_it_ends():
    rng = np.random.default_rng(5)
    time = np.arange(20_000)
    values = np.sin(2.0 * np.pi * 0.01 * time) + 0.1 * np.sin(2.0 * np.pi * 0.05 * time)
    found = content(values + 0.05 * rng.standard_normal(len(time)), 1.0)
    assert 0.05 <= found.highest <= 0.05 * 2.0 ** (1.0 / 3.0), "to a third of an octave"
    silent = content(rng.standard_normal(len(time)), 1.0)
    assert silent.highest < 0.01


def test_a_period_holds_whole_samples_still():
    truth = believed().with_values(VALUES)
    record = measured(truth, "displacement", 1e-4)
    kept = without_spare_samples(prepare_record(replace(record, period=SAMPLES // 9)))
    assert kept.every > 1
    assert (SAMPLES // 9) % kept.every == 0
    assert kept.record.period == SAMPLES // 9 // kept.every
