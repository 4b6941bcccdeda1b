"""Shape parameters that a model leaves open are found in the record; the estimators that rest on it."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from study.equations.simulate import Integrator, simulate
from study.identify import estimators
from study.identify.estimators import in_free_run
from study.identify.estimators.base import Settings
from study.identify.frequency_domain.starting_values import linear_start
from study.identify.time_domain.part_fit import fit_part
from study.records.excitation import displacement_noise
from study.records.prepared import whole
from study.records.spectra import Segments
from study.reproduction import tables
from study.support.errors import StudyError

TOLD = Settings(Segments(512), (0.3, 10.0))
LINEAR = {"inertia": {"m": 1.0}, "linear_damping": {"c": 3.77}, "linear_stiffness": {"k": 355.3}}
HIDDEN = {
    "one_sided_contact": {"kc": 300.0, "one_sided_contact.gap": 0.002},
    "relaxation": {"kr": 200.0, "relaxation.tau": 0.05},
    "hysteresis": {"kz": 200.0, "hysteresis.beta": 300.0, "hysteresis.gamma": 100.0},
}


def noisy(record, fraction, seed):
    clean = record["displacement"]
    return (
        record.with_channels({"displacement": clean + displacement_noise(clean, fraction, seed)})
        if fraction
        else record
    )


def opened(model):
    """The model without its shape parameters."""
    return model.with_values({key: None for key in model.values if "." in key})


def by_name(found):
    return {p.name: p for p in found.parameters}


@pytest.mark.parametrize("fraction", [0.0, 0.05])
def test_frequency_and_phase_of_a_stiffness(fraction, systems, records):
    record = noisy(records["mathieu"], fraction, 4)
    found = estimators.identify("output_error", opened(systems["mathieu"]), record, TOLD)
    own = by_name(found)
    assert not found.note
    assert own["f_m"].value == pytest.approx(1.0, abs=1e-3)
    assert own["phase"].value == pytest.approx(0.0, abs=0.02)
    if fraction:
        for name, true in (("f_m", 1.0), ("phase", 0.0), ("k_m", 177.7)):
            assert abs(own[name].value - true) < 4.0 * own[name].error


@pytest.mark.parametrize("fraction", [0.0, 0.05])
def test_width_of_a_dead_band(fraction, systems, records):
    """A chaotic system: in one free run the record is lost, however true the model."""
    record = noisy(records["dead_band"], fraction, 3).part(0, 4096)
    found = estimators.identify("miso_free_shape", systems["dead_band"], record, TOLD)
    width = by_name(found)["u_g"]
    assert width.value == pytest.approx(0.0025, rel=0.02 if fraction else 1e-3)  # half a record
    if fraction:
        assert abs(width.value - 0.0025) < 4.0 * width.error
    assert dict(found.inputs[1].parameters)["u_g"] == width.value


@pytest.mark.parametrize("name", HIDDEN)
def test_the_rest_of_the_library(name, make_model, report_force):
    """... of which MI/SO tells no relaxation: it finds a negative mass, and no fit should begin there."""
    model = make_model(name, {**LINEAR, name: HIDDEN[name]})
    clean = simulate(model, report_force, 0.02)
    for seed in (1, 2):
        record = noisy(clean, 0.02, seed).part(0, 4096)
        found = estimators.identify("output_error", opened(model), record, TOLD)
        assert not found.note
        true = np.array([model.values[key] for key in found.estimate.symbols])
        errors = np.sqrt(np.diag(found.estimate.covariance))
        assert np.max(np.abs(found.estimate.values - true) / errors) < 4.0
        assert set(found.estimate.symbols) == set(model.values)


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_a_chaotic_system_is_found_in_segments(seed, systems, records):
    """In one free run every width leaves the motion, and the best of them says little."""
    model, record = systems["dead_band"], noisy(records["dead_band"], 0.05, seed)
    fit = in_free_run.free_run_fit(opened(model), record)
    assert fit.restarts
    for key, true in model.values.items():
        assert fit.model.values[key] == pytest.approx(true, rel=0.3)


@pytest.mark.parametrize("name", ["duffing", "mathieu"])
def test_without_noise_the_error_is_that_of_the_integration(name, systems, records):
    """It is what a fit with twice the steps moves the coefficients by, beside which the residual's own is nothing."""
    model, prepared = systems[name], whole(records[name])
    held = [key for key in model.values if "." in key]
    rough = fit_part(model, prepared, held, steps=4)
    finer = fit_part(rough.model, prepared, held, steps=8, initial=np.atleast_2d(rough.initial))
    told = in_free_run.with_step_error(replace(rough, covariance=0.0 * rough.covariance), prepared)
    assert np.sqrt(np.diag(told.covariance)) == pytest.approx(np.abs(finer.values - rough.values), rel=0.01)


def test_given_shapes_are_kept(systems, records):
    model, record = systems["mathieu"], records["mathieu"]
    fit = in_free_run.free_run_fit(model, record)
    assert fit.model.values["periodic_stiffness.f_m"] == model.values["periodic_stiffness.f_m"]
    assert set(model.values) - set(fit.keys) == {"periodic_stiffness.f_m"}
    assert "f_m" not in by_name(estimators.identify("output_error", model, record, TOLD))
    assert set(in_free_run.free_run_fit(opened(model), record).keys) == set(model.values)


def test_nothing_is_found_for_a_model_without_shapes(systems, records):
    found = estimators.identify("miso_free_shape", systems["duffing"], records["duffing"], TOLD)
    assert found.inputs == ()
    assert found.parameters == ()
    assert found.responses is None


def test_curves_are_of_the_form_of_the_model(systems, records):
    """A_j(f) exact but for the coefficients, whose errors it carries."""
    model, record = systems["duffing_van_der_pol"], noisy(records["duffing_van_der_pol"], 0.1, 1)
    found = estimators.identify("output_error", model, record, TOLD)
    result, estimate = found.responses, found.estimate
    np.testing.assert_allclose(result.response[1].real, estimate["k3"], rtol=1e-12)
    np.testing.assert_allclose(
        result.response[1].imag, estimate["c3"] * 2.0 * math.pi * result.frequency / 3.0, rtol=1e-12
    )
    np.testing.assert_allclose(np.sqrt(result.covariance[0, 1, 1].real), estimate.error("k3"), rtol=1e-12)
    assert np.sqrt(result.covariance[-1, 0, 0].real) > estimate.error("k")


@pytest.mark.parametrize("name", ["linear", "duffing", "mathieu", "dead_band"])
def test_without_noise_the_errors_are_those_of_the_steps(name, systems, report_force):
    """Of which the residual alone says nothing: it gives errors that are fifty times too small.

    The record is made in finer steps than a fit takes: with the same steps both would make the same error.
    """
    model = systems[name]
    record = simulate(model, report_force, 0.02, Integrator("rk4", 32))
    found = estimators.identify("output_error", model, record, TOLD).estimate
    off = {key: abs(found[key] - model.values[key]) / found.error(key) for key in ("m", "k")}
    assert max(off.values()) < 3.0
    assert min(off.values()) > 0.3 or name == "dead_band"  # at its corners the order is lower


def test_a_search_that_does_not_arrive_says_so(systems, records, monkeypatch):
    def hasty(model, prepared):
        return fit_part(model, prepared, model.held_keys, linear_start(model, prepared), max_iterations=1)

    monkeypatch.setattr("study.identify.estimators.in_free_run.fit_model", hasty)
    record = noisy(records["duffing"], 0.05, 1)
    found = estimators.identify("output_error", systems["duffing"], record, TOLD)
    assert found.note == "still falling after 1 free runs, the most allowed"
    tolerances = SimpleNamespace(relative={}, absolute={})
    table = tables.parameter_table("x", systems["duffing"], {"output_error": found}, tolerances)
    assert set(table["note"]) == {found.note}


def test_one_free_run_is_enough_for_all_but_the_dead_band(systems, records):
    for name, model in systems.items():
        if name == "dead_band":
            continue
        fit = in_free_run.free_run_fit(model, records[name].part(0, 2048))
        assert fit.converged
        assert fit.restarts == (), name


def test_a_record_that_does_not_show_it_is_refused(systems, records):
    record = records["linear"].with_channels({"displacement": np.zeros(8192)})
    with pytest.raises(StudyError):
        in_free_run.free_run_fit(opened(systems["mathieu"]), record)
