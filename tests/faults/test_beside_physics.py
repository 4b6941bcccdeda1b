"""Faults beside physics: none is taken for the other, on trials of the wide ranges in which each once was."""

import numpy as np
import pytest

from study import trials
from study.diagnose.confirmed_faults import diagnose_accounted
from study.equations.terms import LIBRARY
from study.faults.accounting import accounted
from study.faults.imposed import impose, shifted
from study.faults.seen_in_residual import _turning
from study.records.prepared import prepare_record
from study.trials import DRIVEN_MASS


def found(seed, hidden, noise, response, fault, completed=False):
    made = trials.make_trial(seed, (hidden,), noise, response, fault, DRIVEN_MASS)
    model = made.completed if completed else made.believed
    return made.fault["value"], accounted(model, prepare_record(made.record)).faults


@pytest.mark.long
def test_the_value_of_a_fault_is_found_again_beside_an_effect_that_the_search_adds():
    """The delay is first found beside a linear model, which a quintic stiffness has spoilt: 0.69 samples."""
    value, faults = found(520270, "quintic_stiffness", 0.1, "velocity", "delay")
    (delay,) = faults
    assert delay.fault == "delay"
    assert 3.0 * delay.error < 0.1
    assert abs(delay.value - value) < 3.0 * delay.error


@pytest.mark.long
def test_an_effect_that_is_none_does_not_rival_a_fault():
    """A response that is read early looks like a Maxwell element of negative stiffness."""
    value, faults = found(520259, "harmonic_force", 0.01, "displacement", "delay")
    (delay,) = faults
    assert delay.corrected
    assert abs(delay.value - value) < 3.0 * delay.error


def test_an_effect_whose_linear_share_is_too_much_of_it_is_tried_from_nothing():
    """Relaxation takes over the stiffness: the model's own, held, would make it four times too stiff and run away."""
    _, faults = found(520264, "relaxation", 0.05, "acceleration", "converter_steps")
    assert [f.rivals for f in faults if f.corrected] == []
    assert ("relaxation",) in [f.rivals for f in faults]


@pytest.mark.long
def test_a_mass_that_friction_holds_has_not_dropped_out_and_its_reversals_are_no_spikes():
    """What the noise on the force leaves of an acceleration is nearly that of noise on the response."""
    _, faults = found(520277, "coulomb_friction", 0.0, "acceleration", "force_noise", completed=True)
    assert {fault.fault for fault in faults} <= {"force_noise"}


def test_noise_on_the_force_of_a_nonlinear_system_is_measured_as_its_motion_passes_it_on():
    """Passed through the nearest linear system it would be 9 % larger, six of its standard errors."""
    made = trials.make_trial(
        520321, ("cubic_damping", "bilinear_stiffness"), 0.0, "acceleration", "force_noise", DRIVEN_MASS
    )
    (noise,) = accounted(made.completed, prepare_record(made.record)).faults
    assert noise.fault == "force_noise"
    assert noise.value == pytest.approx(made.fault["value"], rel=0.03)


@pytest.mark.long
def test_a_fault_found_in_a_stretch_has_the_value_that_the_whole_record_tells():
    """In 8,192 samples of either part, 113 periods of a structure that remembers 65, the delay is -0.64 samples."""
    made = trials.make_trial(520303, (), 0.01, "velocity", "delay", DRIVEN_MASS)
    (delay,) = accounted(made.believed, prepare_record(made.record)).faults
    assert abs(delay.value - made.fault["value"]) < 3.0 * delay.error < 0.03


@pytest.mark.long
@pytest.mark.parametrize("late", [-1.42, -1.0, 1.5])
def test_a_delay_that_loses_the_fit_is_found_along_the_motion(late: float) -> None:
    """A complete model, its velocity read 1.42 samples early: "nothing missing" was said at 72 %."""
    made = trials.make_trial(560354, (), 0.0, "velocity", "none", DRIVEN_MASS)
    read = shifted(made.record["velocity"], late)
    result = accounted(made.believed, prepare_record(made.record.with_channels({"velocity": read})))
    (delay,) = result.faults
    assert delay.fault == "delay"
    assert abs(delay.value - late) < 3.0 * delay.error < 0.03
    assert result.comparison.prediction.error < 0.01


@pytest.mark.long
def test_a_delay_that_takes_a_part_of_a_missing_effect_does_not_displace_it():
    _, faults = found(560297, "signed_quadratic_stiffness", 0.1, "velocity", "drift")
    assert [fault.fault for fault in faults] == ["drift"]


def test_drop_outs_beside_noise_are_counted_where_the_motion_passes_through_zero_too():
    made = trials.make_trial(520339, ("signed_quadratic_stiffness",), 0.01, "velocity", "drop_outs", DRIVEN_MASS)
    (fault,) = accounted(made.completed, prepare_record(made.record)).faults
    assert fault.value == pytest.approx(made.fault["value"], rel=1e-9)


def test_a_clipped_record_that_is_looked_at_in_part_first_keeps_what_was_read_within_the_limits():
    """All that the first look had left out was taken for limits in the second, and nothing was left to judge."""
    made = trials.make_trial(520340, ("van_der_pol_damping",), 0.1, "velocity", "clipping", DRIVEN_MASS)
    (fault,) = accounted(made.believed, prepare_record(made.record)).faults
    assert fault.fault == "clipping"
    assert 0.02 < np.mean(fault.lost) < 0.2


def test_what_is_missing_near_the_nyquist_frequency_is_no_spikes():
    """Beside the model alone 7 % of the samples stand out as spikes do, and the effect was found in what those left."""
    made = trials.make_trial(560106, ("displacement_damping",), 0.0, "acceleration", test=DRIVEN_MASS)
    first = accounted(made.believed, prepare_record(made.record))
    assert [f.fault for f in first.faults] == ["spikes"]
    others = [name for name in LIBRARY if name not in ("displacement_damping", "cubic_damping", "quadratic_damping")]
    found = diagnose_accounted(first, without=others)
    assert found.accounted.faults == ()
    assert [e.term.name for e in found.diagnosis.answer.entries] == ["displacement_damping"]
    assert found.diagnosis.answer.response_error < 0.001


@pytest.mark.long
@pytest.mark.parametrize("fault", ["spikes", "drop_outs"])
def test_spikes_and_drop_outs_beside_friction_are_found(fault):
    made = trials.make_trial(520277, ("coulomb_friction",), 0.0, "acceleration", test=DRIVEN_MASS)
    record, known = impose(made.record, "acceleration", fault, np.random.default_rng(3))
    faults = accounted(made.completed, prepare_record(record)).faults
    assert [f.fault for f in faults] == [fault]
    assert faults[0].value == pytest.approx(known["value"], rel=0.25)


@pytest.mark.long
def test_a_record_that_is_over_in_its_middle_has_lost_nothing():
    """Zeros to the end of the file, where nothing was written, were called 50 % drop-outs."""
    made = trials.make_trial(520303, (), 0.0, "displacement", "none", DRIVEN_MASS)
    record = made.record
    half = len(record) // 2
    over = {name: np.where(np.arange(len(record)) < half, record[name], 0.0) for name in ("force", "displacement")}
    prepared = prepare_record(record.with_channels(over))
    assert prepared.plan.judge[1] == half
    assert accounted(made.believed, prepared).faults == ()


def test_a_rest_begins_where_friction_holds_the_mass_whatever_rounding_leaves_of_its_velocity():
    """On one kind of processor 1e-34 m/s were left: of the sign before the rest, they hid where it begins."""
    velocity = np.array([[0.5, 0.2, 1e-34, 1e-34, 1e-34, 0.1, 0.3]]).T
    assert _turning(velocity).tolist() == [False, True, True, False, True, True, False]
    assert _turning(-velocity).tolist() == _turning(velocity).tolist()


def test_a_drift_that_is_nearly_all_that_a_linear_model_leaves_is_seen_beneath_the_response():
    """The search beneath it begins with as much left as the plain one, which sees nothing, and goes on to its end."""
    (drift,) = found(21, "cubic_stiffness", 0.01, None, "drift")[1]
    assert drift.fault == "drift"
    assert drift.corrected
