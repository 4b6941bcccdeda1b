"""Steps that a free run needs: by the motion, by the model, by how coarsely the record is sampled."""

import numpy as np
import pytest

from study.equations.free_run import needed_steps
from study.equations.simulate import Integrator, simulate
from study.identify import estimators
from study.identify.estimators.base import Settings
from study.identify.time_domain.fit_model import fit_model
from study.records.excitation import Excitation, displacement_noise, force
from study.records.prepared import whole
from study.records.spectra import Segments

LINEAR = {"inertia": {"m": 1.0}, "linear_damping": {"c": 3.77}, "linear_stiffness": {"k": 355.3}}


@pytest.mark.parametrize(("c", "k", "steps"), [(3.77, 355.3, 1), (3.77, 1e4, 4), (200.0, 355.3, 8)])
def test_fast_free_motion_asks_for_short_steps(c, k, steps, systems, records):
    model = systems["linear"].with_values({"c": c, "k": k})
    assert needed_steps(model, records["linear"]) == steps
    assert needed_steps(model, records["linear"], most=4) == min(steps, 4)


def test_the_force_of_other_terms_counts_too(make_model, records):
    """A short memory, and damping that grows with the velocity."""
    memory = make_model("memory", {**LINEAR, "relaxation": {"kr": 2000.0, "relaxation.tau": 0.005}})
    assert needed_steps(memory, records["linear"]) == 8
    slow = make_model("slow", {**LINEAR, "relaxation": {"kr": 20.0, "relaxation.tau": 0.5}})
    assert needed_steps(slow, records["linear"]) == 1
    cubic = make_model("cubic", {**LINEAR, "cubic_damping": {"cv3": 1e5}})
    assert needed_steps(cubic, records["linear"]) > 1


@pytest.mark.parametrize("seed", [1, 2])
def test_a_short_memory_is_fitted_with_its_errors(seed, make_model):
    terms = {**LINEAR, "relaxation": {"kr": 2000.0, "relaxation.tau": 0.005}}
    model = make_model("memory", terms)
    record = simulate(model, force(Excitation(), 4096, 0.02, seed), 0.02, Integrator("rk4", 16))
    opened = model.with_values(dict.fromkeys(("m", "c", "k", "kr")))
    fit = fit_model(opened, whole(record), start={"m": 1.0, "c": 5.0, "k": 400.0, "kr": 1500.0})
    assert fit.converged
    assert fit.estimate["c"] == pytest.approx(3.77, rel=0.01)
    assert fit.estimate["kr"] == pytest.approx(2000.0, rel=0.01)


def test_what_the_steps_shift_is_followed_along_directions_that_are_hard_to_tell_apart(make_model):
    """A memory that is short beside the motion is nearly a damping: kr and c trade places over many runs."""
    model = make_model("memory", {**LINEAR, "relaxation": {"kr": 2000.0, "relaxation.tau": 0.008}})
    record = simulate(model, force(Excitation(), 4096, 0.02, 1), 0.02, Integrator("rk4", 32))
    asked = model.with_values({"relaxation.tau": None})
    found = estimators.identify("output_error", asked, record, Settings(Segments(512), (0.3, 10.0))).estimate
    for key in ("c", "kr", "relaxation.tau"):
        assert abs(found[key] - model.values[key]) < 3.0 * found.error(key)


@pytest.mark.parametrize("apart", [1, 3, 4])
def test_coarse_sampling_does_not_bias_what_noise_leaves(apart, systems):
    """Sixteen to four samples in a period of the resonance; the force has nothing above the Nyquist frequency."""
    model, told = systems["duffing"], Settings(Segments(256), (0.3, 5.0))
    made = simulate(model, force(Excitation(cutoff=5.0), 8192, 0.02, 3), 0.02, Integrator("rk4", 8))
    channels = {name: made[name][::apart].copy() for name in ("force", "displacement", "velocity", "acceleration")}
    record = type(made)(0.02 * apart, channels, made.units, "coarse")
    noise = displacement_noise(record["displacement"], 4e-4, 5)
    record = record.with_channels({"displacement": record["displacement"] + noise})
    found = estimators.identify("output_error", model, record, told)
    assert not found.note
    errors = np.sqrt(np.diag(found.estimate.covariance))
    true = np.array([model.values[key] for key in found.estimate.symbols])
    assert np.max(np.abs(found.estimate.values - true) / errors) < 4.0
