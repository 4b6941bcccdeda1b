"""Components and free decays: forms of one force, a force that is read late, and where a free run has lost a motion."""

import numpy as np
import pytest

from study.diagnose.late_force import late_force
from study.diagnose.verdict import diagnose
from study.equations.free_run import predict_response
from study.equations.model import Model, free
from study.equations.terms import get
from study.faults.imposed import shifted
from study.records.record import SI_UNITS, Record
from study.trials import make_trial
from study.way_in.compare_records import compare_records

LOST = "loses the motion"


def test_of_forms_that_are_one_force_the_simplest_comes_first():
    """Without noise: a contact never left, and a relaxation without end, make a constant force to the last digits."""
    trial = make_trial(620026, ("constant_force",), 0.0, test="component")
    first = diagnose(compare_records([trial.record], trial.believed).comparison).candidates[0]
    assert first.name == "constant_force"
    assert {"one_sided_contact", "relaxation"} & set(first.tied_with)


@pytest.mark.parametrize(("hidden", "late"), [((), 1.0), (("relaxation",), 0.0)])
def test_a_force_that_is_read_late_is_told_from_a_relaxation(hidden, late):
    trial = make_trial(9 if late else 14, hidden, 0.01, test="component")
    record = trial.record.with_channels({"force": shifted(trial.record["force"], late)})
    diagnosis = diagnose(compare_records([record], trial.believed).comparison)
    assert diagnosis.candidates[0].name == "relaxation"
    found = late_force(diagnosis)
    assert (found is not None) == bool(late)
    if found is not None:
        assert abs(found.value - late) < 3.0 * found.error < 0.3
        assert "relaxation may be no more than that" in found.says


def quintic() -> tuple[Model, Record]:
    """A decay whose frequency falls by a third, under noise of 5 % of the mean square."""
    names = ("inertia", "linear_damping", "linear_stiffness", "quintic_stiffness")
    values = {"m": 1.0, "c": 0.14, "k": 480.0, "k5": 3.4e12}
    model = Model("hardening", tuple(free(get(n)).with_values(values) for n in names))
    record = Record(0.01, {"force": np.zeros(1980)}, dict(SI_UNITS), "decay")
    u = predict_response(model, record, steps_per_sample=8, initial=(0.0035, 0.0))
    noise = np.sqrt(0.05 * np.mean(u**2)) * np.random.default_rng(16).standard_normal(len(u))
    return model, record.with_channels({"displacement": u + noise})


def test_a_strongly_hardening_decay_is_fitted_and_predicted_to_its_noise():
    """Its first samples tell the states with which the stretches begin too badly for a frequency that follows them."""
    model, record = quintic()
    comparison = compare_records([record], model.with_values(dict.fromkeys(model.values))).comparison
    k5 = next(c for c in comparison.coefficients if c.key == "k5")
    assert comparison.prediction.error < 0.3
    assert k5.interval[0] < 3.4e12 < k5.interval[1]


def test_a_loud_noise_is_no_lost_motion_and_a_motion_out_of_step_is():
    model, record = quintic()
    linear = Model("linear", tuple(free(get(t.name)) for t in model.terms[:3]))
    u = predict_response(linear.with_values({"m": 1.0, "c": 0.14, "k": 480.0}), record, initial=(0.0035, 0.0))
    u = u + 0.5 * np.std(u) * np.random.default_rng(17).standard_normal(len(u))
    comparison = compare_records([record.with_channels({"displacement": u})], linear).comparison
    assert comparison.prediction.error > 0.3
    assert not any(LOST in note for note in comparison.notes)
    assert any(LOST in note for note in compare_records([record], linear).comparison.notes)
