"""Faults beside physics: none is taken for the other, on trials of the wide ranges in which each once was."""

import numpy as np
import pytest

from study import trials
from study.faults.accounting import accounted
from study.faults.imposed import impose
from study.records.prepared import prepare_record
from study.trials.experiment import WIDE


def found(seed, hidden, noise, response, fault, completed=False):
    made = trials.make_trial(seed, (hidden,), noise, response, fault, WIDE)
    model = made.completed if completed else made.believed
    return made.fault["value"], accounted(model, prepare_record(made.record)).faults


def test_the_value_of_a_fault_is_found_again_beside_an_effect_that_the_search_adds():
    """The delay is first found beside a linear model, which a quintic stiffness has spoilt: 0.69 samples."""
    value, faults = found(520270, "quintic_stiffness", 0.1, "velocity", "delay")
    (delay,) = faults
    assert delay.fault == "delay"
    assert 3.0 * delay.error < 0.1
    assert abs(delay.value - value) < 3.0 * delay.error


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


def test_a_mass_that_friction_holds_has_not_dropped_out_and_its_reversals_are_no_spikes():
    value, faults = found(520277, "coulomb_friction", 0.0, "acceleration", "force_noise", completed=True)
    (noise,) = faults
    assert noise.fault == "force_noise"
    assert abs(noise.value - value) < 3.0 * noise.error


@pytest.mark.parametrize("fault", ["spikes", "drop_outs"])
def test_spikes_and_drop_outs_beside_friction_are_found(fault):
    made = trials.make_trial(520277, ("coulomb_friction",), 0.0, "acceleration", ranges=WIDE)
    record, known = impose(made.record, "acceleration", fault, np.random.default_rng(3))
    faults = accounted(made.completed, prepare_record(record)).faults
    assert [f.fault for f in faults] == [fault]
    assert faults[0].value == pytest.approx(known["value"], rel=0.25)
