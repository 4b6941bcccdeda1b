"""A mass between two wells: the linear model loses the motion, and the true one is chaotic."""

import numpy as np
import pytest

from study.compare.comparison import compare
from study.compare.prediction import predict
from study.diagnose.needless import needless
from study.diagnose.verdict import MISSING, NOTHING, diagnose
from study.equations.model import Model, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LIBRARY, get
from study.faults.accounting import accounted
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.motion_start import has_lost_the_motion, motion_start
from study.records.excitation import Excitation, force
from study.records.prepared import Prepared, prepare_record
from study.records.record import Record

TRUTH = {"m": 1.0, "c": 0.5, "k": -10.0, "k3": 20.0}
LINEAR = Model("linear", tuple(free(get(name)) for name in ("inertia", "linear_damping", "linear_stiffness")))
COMPLETE = LINEAR.with_term(free(get("cubic_stiffness")))
RIVALS = ("quintic_stiffness", "signed_quadratic_stiffness", "coulomb_friction", "cubic_stiffness")


@pytest.fixture(scope="module", params=[0.0, 0.02])
def wells(request: pytest.FixtureRequest) -> Prepared:
    """4,096 samples, which cross from well to well again and again; without noise and with 2 % of it."""
    drive = force(Excitation("gaussian_lowpass", 6.0, "filtered", 3.0), 4096, 0.05, 4)
    u = simulate(COMPLETE.with_values(TRUTH), drive, 0.05, Integrator("rk4", 8))["displacement"]
    assert np.count_nonzero(np.diff(np.sign(u))) > 20
    noise = request.param * np.std(u) * np.random.default_rng(4).standard_normal(len(u))
    return prepare_record(Record(0.05, {"force": drive, "displacement": u + noise}))


def test_the_start_along_the_measured_motion_is_near(wells: Prepared) -> None:
    start = motion_start(COMPLETE, wells, ())
    assert start == pytest.approx(TRUTH, rel=0.1)
    held = motion_start(COMPLETE.with_values({"k": TRUTH["k"]}), wells, ("k",))
    assert held == pytest.approx({key: TRUTH[key] for key in ("m", "c", "k3")}, rel=0.05)


def test_the_true_model_is_found_and_judged_in_segments(wells: Prepared) -> None:
    """One free run from the true values leaves all of the motion."""
    fit = fit_model(COMPLETE, wells)
    prediction = predict(fit, wells)
    assert fit.model.numbers() == pytest.approx(TRUTH, rel=0.02)
    assert prediction.run is not None
    assert 0 < len(prediction.run.restarts) < 30
    assert prediction.error == pytest.approx(prediction.floor, rel=0.1)


@pytest.mark.long
def test_the_cubic_spring_is_named_and_then_nothing_is_missing(wells: Prepared) -> None:
    without = tuple(name for name in LIBRARY if name not in RIVALS)
    before = accounted(LINEAR, wells)
    assert before.faults == (), "a motion between two wells is no drift"
    assert has_lost_the_motion(before.comparison.fit, wells)
    assert needless(before.comparison) == ()
    found = diagnose(before.comparison, without=without)
    assert (found.verdict, found.candidates[0].name) == (MISSING, "cubic_stiffness")
    assert found.candidates[0].tied_with == ()
    assert diagnose(compare(COMPLETE, wells), without=without).verdict == NOTHING


def test_a_model_that_has_lost_the_motion_is_never_complete(wells: Prepared) -> None:
    """With nothing else to offer than what leaves all of it, what is left is no noise for that."""
    alone = (*(name for name in LIBRARY if name != "constant_force"),)
    assert diagnose(compare(LINEAR, wells), without=alone).verdict != NOTHING
