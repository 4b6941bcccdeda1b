"""Trials are drawn so that their record shows what is hidden: by the true model's own information, and in no chaos."""

import numpy as np
import pytest

from study.equations.free_run import predict_response
from study.equations.model import Model, free
from study.equations.terms import get
from study.records.record import Record
from study.trials import make_trial
from study.trials.effects import VISIBLE_ERRORS, forgets, stands_out
from study.trials.runs import Order, run_trial

NAMES = ("inertia", "linear_damping", "linear_stiffness", "cubic_stiffness")


def system(k: float, k3: float) -> Model:
    return Model("system", tuple(free(get(n)).with_values({"m": 1.0, "c": 0.3, "k": k, "k3": k3}) for n in NAMES))


@pytest.mark.parametrize(("k", "k3", "calm"), [(40.0, 0.0, True), (40.0, 10.0, True), (-40.0, 40.0, False)])
def test_a_motion_between_two_wells_does_not_forget_a_push_and_one_in_a_single_well_does(k, k3, calm):
    def motion(force):
        return predict_response(system(k, k3), Record(0.02, {"force": force}, {}), steps_per_sample=4)

    force = 40.0 * np.random.default_rng(1).standard_normal(9000)
    assert forgets(motion, force[:3000], 20, slight=True) is calm
    assert forgets(motion, 0.5 * force, 20) is calm, "a larger one, and to a thousandth"


def test_an_effect_stands_out_of_so_much_noise_and_no_more():
    """The bound of Cramer and Rao is in proportion to the noise, and the true fit's own error is near it."""
    trial = make_trial(11, ("cubic_damping",), 0.0, test="component")
    true, name = trial.truth, "cubic_damping"
    most = 1.0
    while stands_out(trial.record, true, name, most):
        most *= 2.0
    assert not stands_out(trial.record, true, name, 2.0 * most)
    assert stands_out(trial.record, true, name, 0.49 * most)


@pytest.mark.parametrize("test", ["axis", "free_decay"])
def test_what_is_drawn_with_noise_shows_in_the_fit_of_the_true_model(test):
    row = run_trial(Order("", 630003, None, None, None, test=test))
    assert row["hidden"] != "none"
    assert row["noise"] == 0.0 or row["shown"] > 0.5 * VISIBLE_ERRORS


def test_derivatives_that_overflow_end_no_trial():
    assert run_trial(Order("", 630002, None, None, None, test="blows"))["trouble"] == ""
