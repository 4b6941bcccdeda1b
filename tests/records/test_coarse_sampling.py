"""A sampling that is too coarse for a motion is said in words; one that is not, is not mentioned."""

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
from study.records.sampling_rate import too_coarse

FINE = 20  # samples of the simulation to one of the record
LINEAR = Model("rig", tuple(free(get(n)) for n in ("inertia", "linear_damping", "linear_stiffness")))


def sampled(a_period, response="displacement", samples=1500):
    """A lightly damped system of 1 Hz under noise up to 4 Hz, sampled so many times a period."""
    dt = 1.0 / (a_period * FINE)
    drive = force(Excitation("gaussian_lowpass", 60.0, "filtered", 4.0), samples * FINE, dt, 3)
    truth = LINEAR.with_values({"m": 1.0, "c": 0.377, "k": 39.5})
    motion = predict_response(
        truth, Record(dt, {"force": drive}, dict(SI_UNITS)), response=response, steps_per_sample=2
    )
    seen = motion[::FINE] + displacement_noise(motion[::FINE], 1e-3, 2)
    return prepare_record(Record(dt * FINE, {"force": drive[::FINE], response: seen}, dict(SI_UNITS), "rig"))


@pytest.mark.parametrize("a_period", [1.6, 2.6, 3.3])
def test_a_resonance_near_or_above_the_nyquist_frequency_is_said(a_period):
    assert "four samples a period" in too_coarse(sampled(a_period))


@pytest.mark.parametrize("response", ["displacement", "acceleration"])
@pytest.mark.parametrize("a_period", [5.0, 9.0])
def test_five_samples_a_period_are_enough(a_period, response):
    assert too_coarse(sampled(a_period, response)) == ""


def test_noise_alone_is_no_motion_that_is_too_fast():
    rng = np.random.default_rng(1)
    record = Record(0.1, {"force": rng.standard_normal(800), "displacement": rng.standard_normal(800)})
    assert too_coarse(prepare_record(record)) == ""


def test_it_stands_in_the_notes_of_a_comparison():
    found = accounted(LINEAR, sampled(3.3), switched_off=FAULTS).comparison
    assert any("sampled too coarsely" in note for note in found.notes)
