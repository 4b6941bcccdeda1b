"""Each fault is found on records of known systems, its value within reach, and the coefficients are right after it."""

import numpy as np
import pytest

from study.compare.comparison import compare
from study.faults.accounting import accounted
from study.faults.fault import FAULTS
from study.faults.imposed import impose
from study.records.excitation import displacement_noise
from study.records.prepared import Prepared, prepare_record
from study.records.record import Record
from study.trials.draw import make_trial

COUNTED = {
    "spikes": 0.02,
    "drop_outs": 0.02,
    "clipping": 1e-9,
    "converter_steps": 1e-6,
}  # error as a share; no estimate
FAR = 3.7  # standard errors: once in five thousand, and some fifty are asked for
NOISE = 0.01  # mean square


@pytest.fixture(scope="module")
def measured(records):
    """``measured(system, response)``: force and one motion with noise."""

    def make(name: str, response: str = "displacement") -> Record:
        whole = records[name]
        noisy = whole[response] + displacement_noise(whole[response], NOISE, 5)
        return Record(whole.dt, {"force": whole["force"], response: noisy}, whole.units, name)

    return make


def unknown(model):
    return model.with_values(dict.fromkeys(model.values, None))


def off_by(result, truth):
    """Distance of each coefficient from the truth in standard errors."""
    return {c.key: (c.value - truth.values[c.key]) / c.error for c in result.comparison.coefficients}


@pytest.mark.parametrize("system", ["linear", "duffing"])
@pytest.mark.parametrize("fault", [f for f in FAULTS if f != "force_noise"])
def test_a_fault_is_found_with_its_value_and_the_coefficients_are_right(fault, system, measured, systems):
    response = "acceleration" if (fault, system) == ("offset", "linear") else "displacement"
    faulty, known = impose(measured(system, response), response, fault, np.random.default_rng(11))
    result = accounted(unknown(systems[system]), prepare_record(faulty))
    (found,) = result.faults
    assert (found.fault, found.channel, found.unit) == (fault, response, known["unit"])
    reach = COUNTED.get(fault, 0.0) * abs(known["value"]) + FAR * found.error
    assert abs(found.value - known["value"]) <= reach
    if (fault, system) == ("high_pass", "linear"):  # relaxation slows a linear system down just so
        assert found.corrected or found.rivals == ("relaxation",)
    else:
        assert found.corrected == (fault != "converter_steps")
        assert all(abs(z) < FAR for z in off_by(result, systems[system]).values())


def test_without_its_correction_a_fault_leaves_wrong_coefficients(measured, systems):
    faulty, _ = impose(measured("duffing"), "displacement", "delay", np.random.default_rng(11))
    result = accounted(unknown(systems["duffing"]), prepare_record(faulty), switched_off=FAULTS)
    assert result.faults == ()
    assert max(abs(z) for z in off_by(result, systems["duffing"]).values()) > FAR


@pytest.mark.long
def test_noise_on_the_force_is_told_from_noise_on_the_response(records, systems):
    whole = records["linear"]
    record = Record(whole.dt, {"force": whole["force"], "acceleration": whole["acceleration"]}, whole.units, "linear")
    for seed in range(3):
        faulty, known = impose(record, "acceleration", "force_noise", np.random.default_rng(seed))
        (found,) = accounted(unknown(systems["linear"]), prepare_record(faulty)).faults
        assert (found.fault, found.channel, found.corrected) == ("force_noise", "force", False)
        assert found.value == pytest.approx(known["value"], rel=0.25)


@pytest.mark.parametrize("system", ["linear", "duffing", "van_der_pol"])
def test_a_record_without_faults_is_compared_as_it_is(system, measured, systems):
    prepared, model = prepare_record(measured(system)), unknown(systems[system])
    result, plain = accounted(model, prepared), compare(model, prepared)
    assert result.faults == ()
    assert result.comparison.prepared is prepared
    assert result.comparison.prediction.error == plain.prediction.error
    assert [c.value for c in result.comparison.coefficients] == [c.value for c in plain.coefficients]


@pytest.mark.long
@pytest.mark.parametrize("fault", ["delay", "drift", "hum", "gain_change", "spikes", "high_pass"])
def test_a_fault_is_found_beside_a_hidden_effect_and_the_effect_is_left(fault, measured, systems):
    faulty, known = impose(measured("duffing"), "displacement", fault, np.random.default_rng(3))
    result = accounted(unknown(systems["linear"]), prepare_record(faulty))  # cubic stiffness is hidden
    assert [f.fault for f in result.faults] == [fault]
    reach = COUNTED.get(fault, 0.02) * abs(known["value"]) + FAR * result.faults[0].error
    assert abs(result.faults[0].value - known["value"]) <= reach
    alone = compare(unknown(systems["linear"]), prepare_record(measured("duffing")))
    assert result.comparison.prediction.error == pytest.approx(alone.prediction.error, rel=0.1)
    assert result.comparison.growths is not None


def test_what_an_effect_does_as_well_is_said_and_left_alone(measured, systems):
    faulty, known = impose(measured("linear"), "displacement", "offset", np.random.default_rng(2))
    prepared = prepare_record(faulty)
    (found,) = accounted(unknown(systems["linear"]), prepared).faults
    assert found.rivals == ("constant_force",)
    assert not found.corrected
    assert "constant force would do as much" in found.says
    assert found.value == pytest.approx(known["value"], rel=0.05)


@pytest.mark.long
@pytest.mark.parametrize("size", [0.5, 3.0])
@pytest.mark.parametrize("shape", ["ramp", "walk"])
def test_a_drift_from_zero_is_no_constant_force_however_large(shape, size, measured, systems):
    record = measured("linear")
    walk = np.cumsum(np.random.default_rng(4).standard_normal(len(record)))
    slow = np.linspace(0.0, 1.0, len(record)) if shape == "ramp" else np.convolve(walk, np.ones(2001) / 2001, "same")
    slow = slow * size * np.std(record["displacement"]) / np.std(slow)
    faulty = record.with_channels({"displacement": record["displacement"] + slow})
    result = accounted(unknown(systems["linear"]), prepare_record(faulty))
    found = {fault.fault: fault for fault in result.faults}
    assert set(found) == {"drift", "offset"}
    assert all(fault.corrected for fault in found.values())
    assert found["drift"].value == pytest.approx(np.std(slow), rel=0.03)
    assert found["offset"].value == pytest.approx(np.mean(slow), rel=0.03)
    assert all(abs(z) < FAR for z in off_by(result, systems["linear"]).values())


def test_a_held_value_is_undone_and_not_searched_for(measured, systems):
    faulty, known = impose(measured("duffing"), "displacement", "delay", np.random.default_rng(11))
    prepared, model = prepare_record(faulty), unknown(systems["duffing"])
    result = accounted(model, prepared, held={"delay": known["value"]})
    (found,) = result.faults
    assert found.value == known["value"]
    assert "as given; corrected" in found.says
    assert all(abs(z) < FAR for z in off_by(result, systems["duffing"]).values())


@pytest.mark.long
def test_two_faults_are_both_found(measured, systems):
    rng = np.random.default_rng(8)
    late, delay = impose(measured("duffing"), "displacement", "delay", rng)
    faulty, drift = impose(late, "displacement", "drift", rng)
    result = accounted(unknown(systems["duffing"]), prepare_record(faulty))
    values = {f.fault: f for f in result.faults}
    assert set(values) == {"delay", "drift"}
    for known in (delay, drift):
        found = values[known["fault"]]
        assert abs(found.value - known["value"]) <= FAR * found.error + 0.02 * abs(known["value"])


def test_lost_samples_are_neither_fitted_nor_judged(measured, systems):
    faulty, _ = impose(measured("linear"), "displacement", "spikes", np.random.default_rng(1))
    comparison = accounted(unknown(systems["linear"]), prepare_record(faulty)).comparison
    prepared: Prepared = comparison.prepared
    assert prepared.lost is not None
    assert np.all(comparison.fit.residual[prepared.lost[slice(*comparison.fit.span)]] == 0.0)
    assert np.all(comparison.prediction.misfit[prepared.lost[slice(*prepared.plan.judge)]] == 0.0)
    assert comparison.prediction.error == pytest.approx(np.sqrt(NOISE), rel=0.1)


@pytest.mark.long
def test_what_was_read_far_from_the_limits_is_kept_though_the_model_lacks_something() -> None:
    """A record whose every sample is lost would be followed without any error."""
    trial = make_trial(12, ("cubic_stiffness",), 0.01, "displacement", "clipping")
    comparison = accounted(trial.believed, prepare_record(trial.record)).comparison
    lost, values = comparison.prepared.lost, comparison.record["displacement"]
    assert lost is not None
    assert np.mean(lost) < 0.3
    assert not np.any(lost[np.abs(values) < 0.2 * np.max(np.abs(values))])
    assert comparison.prediction.error > 0.05
