"""Decays that a model loses begin anew; a better model runs on, as it would be compared by itself."""

import numpy as np
import pytest

from study.diagnose.adding import added
from study.equations.model import Model, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.records.excitation import displacement_noise
from study.records.record import Record
from study.way_in.compare_records import compare_records, has_lost_its_way


@pytest.fixture(scope="module")
def hardening():
    """A decay from 6 to 5 Hz, and its linear model."""
    model = Model("rig", tuple(free(get(n)) for n in ("inertia", "linear_damping", "linear_stiffness")))
    true = model.with_term(free(get("cubic_stiffness"))).with_values({"m": 1.0, "c": 0.35, "k": 987.0, "k3": 60.0})
    motion = simulate(true, np.zeros(3000), 0.01, Integrator("rk4", 8), initial=(3.0, 0.0))["displacement"]
    return model, Record(0.01, {"force": np.zeros(3000), "displacement": motion + displacement_noise(motion, 1e-4, 3)})


def test_with_the_effect_that_was_missing_the_motion_runs_on(hardening):
    model, record = hardening
    before = compare_records([record], model).comparison
    assert before.prepared.running_on is not None, "the linear model follows: the test asks nothing"
    after = added(before, get("cubic_stiffness"))
    alone = compare_records([record], model.with_term(free(get("cubic_stiffness")))).comparison
    assert after.prepared.running_on is None
    assert len(after.prepared.record.stretches) == len(alone.prepared.record.stretches)
    assert after.prediction.error == pytest.approx(alone.prediction.error, rel=1e-3)
    assert not has_lost_its_way(after.prediction)


def test_with_another_that_loses_it_too_it_does_not(hardening):
    model, record = hardening
    before = compare_records([record], model).comparison
    after = added(before, get("quadratic_damping"))
    assert len(after.prepared.record.stretches) == len(before.prepared.record.stretches)
