"""Fits in free run: the coefficients with their errors, what is held, and what is refused."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from study.equations.free_run import FreeRun, predict_response, prepare
from study.equations.model import Model, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import custom
from study.identify.frequency_domain import coefficients
from study.identify.frequency_domain.conditioned import analyse
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.time_domain.free_run_fit import FreeRunFit, fit_free_run
from study.records.excitation import displacement_noise
from study.records.outputs import alone
from study.records.record import SI_UNITS, Record
from study.records.spectra import Segments, cross_spectra
from study.support.errors import DivergenceError, StudyError

Floats = NDArray[np.float64]
Make = Callable[[str, Mapping[str, Mapping[str, float]]], Model]
DT = 0.02
LINEAR = {"inertia": {"m": 1.0}, "linear_damping": {"c": 3.77}, "linear_stiffness": {"k": 355.3}}
EFFECTS: dict[str, dict[str, float]] = {
    "inertia": {},
    "linear_damping": {},
    "linear_stiffness": {},
    "quadratic_stiffness": {"k2": 1e4},
    "signed_quadratic_stiffness": {"k2s": 5e4},
    "cubic_stiffness": {"k3": 2e7},
    "quintic_stiffness": {"k5": 1e12},
    "van_der_pol_damping": {"c3": 2e6},
    "displacement_damping": {"cu": 2e3},
    "quadratic_damping": {"c2": 60.0},
    "cubic_damping": {"cv3": 1e3},
    "coulomb_friction": {"fc": 0.2},
    "dead_band": {"kg": -300.0, "dead_band.u_g": 0.0025},
    "bilinear_stiffness": {"kb": 100.0},
    "one_sided_contact": {"kc": 300.0, "one_sided_contact.gap": 0.002},
    "periodic_stiffness": {"km_cos": 150.0, "km_sin": 50.0, "periodic_stiffness.f_m": 1.0},
    "relaxation": {"kr": 200.0, "relaxation.tau": 0.05},
    "hysteresis": {"kz": 200.0, "hysteresis.beta": 300.0, "hysteresis.gamma": 100.0},
    "constant_force": {"f0": 0.2},
    "harmonic_force": {"fh_cos": 0.3, "fh_sin": 0.2, "harmonic_force.f": 4.0},
}


def with_effect(make_model: Make, name: str) -> Model:
    return make_model(name, {**LINEAR, **({name: EFFECTS[name]} if EFFECTS[name] else {})})


def numbers(model: Model) -> dict[str, float]:
    return {key: float(value) for key, value in model.values.items() if value is not None}


def known(model: Model, fit: FreeRunFit) -> Floats:
    return np.array([numbers(model)[key] for key in fit.keys])


def error_in_standard_errors(model: Model, fit: FreeRunFit) -> Floats:
    return (fit.values - known(model, fit)) / np.sqrt(np.diag(fit.covariance))


def started(model: Model, record: Record) -> dict[str, float]:
    """What MI/SO makes of the record."""
    inputs, cut = reverse_inputs(model), Segments()
    responses = analyse(cross_spectra([*histories(inputs, record), record["force"]], record.dt, cut))
    estimate = coefficients.fit_coefficients(responses, inputs, (0.3, 10.0), cut.line_inflation())
    return dict(zip(estimate.symbols, (float(v) for v in estimate.values), strict=True))


def noisy(record: Record, fraction: float, seed: int) -> Record:
    clean = record["displacement"]
    return record.with_channels({"displacement": clean + displacement_noise(clean, fraction, seed)})


@pytest.mark.parametrize("name", ["linear", "duffing_van_der_pol", "mathieu", "extreme"])
def test_recovers_table_1_without_noise(name: str, systems: dict[str, Model], records: dict[str, Record]) -> None:
    model, record = systems[name], records[name]
    fit = fit_free_run(model, record, start=started(model, record), steps_per_sample=8)
    assert fit.converged
    assert fit.rms < 1e-9 * np.std(record["displacement"])
    scale = np.where(known(model, fit) == 0.0, 1.0, known(model, fit))
    np.testing.assert_allclose(fit.values / scale, known(model, fit) / scale, atol=1e-8)
    np.testing.assert_allclose(fit.initial, 0.0, atol=1e-8)


@pytest.mark.parametrize("fraction", [0.05, 0.1, 0.2])
def test_noise_scatters_but_does_not_bias(
    fraction: float, systems: dict[str, Model], records: dict[str, Record]
) -> None:
    model, record = systems["duffing_van_der_pol"], records["duffing_van_der_pol"]
    errors: list[Floats] = []
    for seed in range(16):
        measured = noisy(record, fraction, seed)
        fit = fit_free_run(model, measured, start=started(model, measured))
        assert fit.converged
        assert fit.rms == pytest.approx(np.sqrt(fraction) * np.std(record["displacement"]), rel=0.03)
        errors.append(error_in_standard_errors(model, fit))
    table = np.array(errors)
    assert np.all(np.abs(np.mean(table, axis=0)) < 3.5 / np.sqrt(len(table)))
    assert 0.75 < np.sqrt(np.mean(table**2)) < 1.25


def test_residual_and_covariance_are_those_of_the_estimates(
    systems: dict[str, Model], records: dict[str, Record]
) -> None:
    model, record = systems["duffing"], noisy(records["duffing"], 0.05, 3)
    fit = fit_free_run(model, record, span=(100, 3000))
    again = predict_response(fit.model, record, span=(100, 3000), initial=tuple(fit.initial))
    np.testing.assert_allclose(record["displacement"][100:3000] - again, fit.residual, atol=1e-12)
    jacobian = prepare(model, record, fit.keys, span=(100, 3000)).respond(numbers(fit.model), fit.initial, 2)[1][:, 0]
    scale = np.linalg.norm(jacobian, axis=0)
    inverse = np.linalg.inv((jacobian / scale).T @ (jacobian / scale)) / np.outer(scale, scale)
    variance = np.sum(fit.residual**2) / (2900 - jacobian.shape[1])
    size = len(fit.keys)
    np.testing.assert_allclose(fit.covariance, variance * inverse[:size, :size], rtol=1e-6)
    assert fit.estimate.error("k3") == np.sqrt(fit.covariance[3, 3])


def test_units_do_not_matter(systems: dict[str, Model], records: dict[str, Record]) -> None:
    model, record = systems["duffing_van_der_pol"], noisy(records["duffing_van_der_pol"], 0.05, 1)
    start = started(model, record)
    fit = fit_free_run(model, record, start=start)
    force, length = 1e-3, 1e3  # kilonewtons and millimetres
    powers = {"m": 1, "c": 1, "k": 1, "k3": 3, "c3": 3}
    factors = {key: force / length**power for key, power in powers.items()}
    scaled = record.with_channels({"force": record["force"] * force, "displacement": record["displacement"] * length})
    again = fit_free_run(model, scaled, start={key: start[key] * factors[key] for key in start})
    assert again.iterations == fit.iterations
    np.testing.assert_allclose(again.values / [factors[key] for key in again.keys], fit.values, rtol=1e-7)


SHAPES = {
    "dead_band": {"dead_band.u_g": 1.2},
    "one_sided_contact": {"one_sided_contact.gap": 0.8},
    "periodic_stiffness": {"periodic_stiffness.f_m": 1.002},
    "relaxation": {"relaxation.tau": 1.5},
    "hysteresis": {"hysteresis.beta": 0.7, "hysteresis.gamma": 1.5},
    "harmonic_force": {"harmonic_force.f": 1.0005},
    "coulomb_friction": {"fc": 0.5},
}


@pytest.mark.parametrize("name", SHAPES)
def test_shape_parameters_are_found(name: str, make_model: Make, report_force: Floats) -> None:
    model = with_effect(make_model, name)
    clean = predict_response(model, Record(DT, {"force": report_force}), steps_per_sample=8)
    record = noisy(Record(DT, {"force": report_force, "displacement": clean}), 0.05, 5)
    values = numbers(model)
    start = {key: value * SHAPES[name].get(key, 0.9) for key, value in values.items()}
    fit = fit_free_run(model, record, start=start)
    assert fit.converged, fit.message
    assert fit.rms == pytest.approx(np.sqrt(0.05) * np.std(clean), rel=0.03)
    assert np.max(np.abs(error_in_standard_errors(model, fit))) < 3.5


def test_acceleration_is_enough(systems: dict[str, Model], records: dict[str, Record]) -> None:
    model, record = systems["duffing"], records["duffing"]
    measured = Record(DT, {name: record[name] for name in ("force", "acceleration")})
    start = {"m": 1.1, "c": 5.0, "k": 400.0, "k3": 1e7}
    fit = fit_free_run(model, measured, start=start, outputs=alone("acceleration"), steps_per_sample=8)
    assert fit.converged
    np.testing.assert_allclose(fit.values, known(model, fit), rtol=1e-8)


def test_state_of_a_hysteresis_is_found_in_mid_record(make_model: Make, report_force: Floats) -> None:
    model = with_effect(make_model, "hysteresis")
    clean = predict_response(model, Record(DT, {"force": report_force}), steps_per_sample=8)
    record = Record(DT, {"force": report_force, "displacement": clean})
    fit = fit_free_run(model, record, steps_per_sample=8, span=(3000, 6000))
    assert fit.rms < 1e-9 * np.std(clean)
    assert abs(fit.initial[2]) > 1e-5
    np.testing.assert_allclose(fit.values, known(model, fit), rtol=1e-7)


def test_held_keys_keep_their_values(systems: dict[str, Model], records: dict[str, Record]) -> None:
    model, record = systems["duffing"], records["duffing"]
    fit = fit_free_run(model, record, start={"c": 3.0}, held=("m", "k", "k3"), span=(500, 2500))
    assert fit.keys == ("c",)
    assert numbers(fit.model)["k3"] == 2e7
    state = fit_free_run(model, record, held=tuple(model.values), span=(500, 2500), steps_per_sample=8)
    assert state.keys == ()
    np.testing.assert_allclose(state.initial, [record["displacement"][500], record["velocity"][500]], rtol=1e-7)


def test_own_term_of_a_measured_channel(make_model: Make, report_force: Floats) -> None:
    wind = np.sin(np.arange(2048.0))
    model = make_model("windy", LINEAR).with_term(free(custom("drag", "wind*abs(v)*v")).with_values({"q_drag": 80.0}))
    record = simulate(model, report_force[:2048], DT, Integrator("rk4", 8), extra={"wind": wind})
    fit = fit_free_run(model, record, start={"q_drag": 10.0}, steps_per_sample=8)
    np.testing.assert_allclose(fit.values, known(model, fit), rtol=1e-8)


def test_a_trial_that_diverges_is_a_rejected_step(
    systems: dict[str, Model], records: dict[str, Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    diverged: list[float] = []
    respond = FreeRun.respond_by_segment

    def watched(self: FreeRun, *arguments: object) -> tuple[Floats, Floats]:
        try:
            return respond(self, *arguments)  # type: ignore[arg-type]
        except DivergenceError as error:
            diverged.append(error.time)
            raise

    monkeypatch.setattr(FreeRun, "respond_by_segment", watched)
    model, record = systems["duffing_van_der_pol"], records["duffing_van_der_pol"]
    fit = fit_free_run(model, record, start={"m": 0.3, "c3": 0.0, "k3": 5e7})
    assert diverged
    assert fit.converged
    np.testing.assert_allclose(fit.values, known(model, fit), rtol=1e-3)


def test_says_when_it_has_not_converged(systems: dict[str, Model], records: dict[str, Record]) -> None:
    model, record = systems["duffing"], records["duffing"]
    fit = fit_free_run(model, record, start={"k": 300.0, "k3": 1e7}, max_iterations=2)
    assert not fit.converged
    assert fit.message == "still falling after 2 free runs, the most allowed"


def test_says_what_the_record_does_not_show(systems: dict[str, Model], records: dict[str, Record]) -> None:
    model = systems["dead_band"].with_values({"kg": -10.0, "dead_band.u_g": 1.0})  # a gap nothing ever reaches
    fit = fit_free_run(model, noisy(records["linear"], 0.05, 2))
    assert "k, kg, dead_band.u_g" in fit.message
    assert fit.estimate.error("kg") > 1e3 * abs(fit.estimate["kg"])
    assert fit.estimate.error("m") < 0.02


def test_start_that_diverges_is_refused(systems: dict[str, Model], records: dict[str, Record]) -> None:
    with pytest.raises(DivergenceError, match="diverges with the starting values m = 1, "):
        fit_free_run(systems["duffing"], records["duffing"], start={"k": -1e6, "k3": -1e9})
    with pytest.raises(StudyError, match="starting values m = -1"):
        fit_free_run(systems["linear"], records["linear"], start={"m": -1.0})


def predict_in_pieces(model: Model, record: Record, restarts: tuple[int, ...]) -> FreeRun:
    return prepare(model, record, restarts=restarts)


def test_bad_arguments_are_named(systems: dict[str, Model], records: dict[str, Record]) -> None:
    model, record = systems["duffing"], records["duffing"]
    nothing = model.with_values({"k3": None})
    only_force = Record(DT, {"force": record["force"]}, SI_UNITS, "rig")
    cases: list[tuple[str, Callable[[], object]]] = [
        ("'rig' has no displacement", lambda: fit_free_run(model, only_force)),
        ("initial is 'zero'", lambda: fit_free_run(model, record, initial="zero")),
        ("no 'k9'", lambda: fit_free_run(model, record, start={"k9": 1.0})),
        ("no 'k9'", lambda: fit_free_run(model, record, held=("k9",))),
        ("None for k3", lambda: fit_free_run(nothing, record)),
        ("no value for k3", lambda: fit_free_run(nothing, record, held=("k3",))),
        ("no value for k3", lambda: predict_response(nothing, record)),
        ("no response 'jerk'", lambda: predict_response(model, record, response="jerk")),
        ("steps_per_sample is 0", lambda: predict_response(model, record, steps_per_sample=0)),
        ("the span 9 to 9000", lambda: predict_response(model, record, span=(9, 9000))),
        ("cannot be 'rest'", lambda: fit_free_run(model, record, initial="rest", restarts=(50,))),
        ("restarts \\(9, 5\\) must rise", lambda: predict_in_pieces(model, record, (9, 5))),
        ("has no k9", lambda: prepare(model, record, ("k9",))),
    ]
    for message, call in cases:
        with pytest.raises(StudyError, match=message):
            call()
