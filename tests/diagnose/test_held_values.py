"""A value that the model holds and the record contradicts is told as such, and no effect is called missing for it."""

from functools import partial
from typing import Any

import numpy as np
import pytest

from study.compare.comparison import Comparison, compare
from study.diagnose import confirmed_faults
from study.diagnose.diagnosis_files import choices_in_words
from study.diagnose.force_between import diagnose_as_read
from study.diagnose.held_values import diagnose_with_values_let_go
from study.diagnose.verdict import NOTHING, Diagnosis, diagnose
from study.equations.model import Model, ModelTerm
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LIBRARY, get
from study.explore import session as sessions
from study.faults.accounting import accounted
from study.faults.correction import corrected
from study.faults.fault import Fault
from study.records.prepared import prepare_record
from study.records.record import Record

DT, SAMPLES = 0.02, 2048
TRIED = ("relaxation", "cubic_stiffness", "displacement_damping", "coulomb_friction")  # so that a test is soon done
WITHOUT = tuple(name for name in LIBRARY if name not in TRIED)
TRUE = {"inertia": 2.0, "linear_damping": 3.0, "linear_stiffness": 800.0}


def model(**values):
    return Model("rig", tuple(ModelTerm(get(name), (value,), ()) for name, value in (TRUE | values).items()))


def record(**more):
    rng = np.random.default_rng(4)
    run = simulate(model(**more), rng.standard_normal(SAMPLES), DT, Integrator("rk4", 8))
    seen = run["displacement"] + 0.01 * np.std(run["displacement"]) * rng.standard_normal(SAMPLES)
    return prepare_record(Record(DT, {"force": run["force"], "displacement": seen}, run.units, "made"))


def contradicted(diagnosis):
    return [note for note in choices_in_words(diagnosis.comparison.notes) if "contradicts" in note]


def test_a_damping_that_is_held_too_small_is_no_missing_effect():
    comparison = compare(model(linear_damping=2.5), record())
    assert diagnose(comparison, without=WITHOUT).verdict != NOTHING  # effects that imitate damping
    found = diagnose_with_values_let_go(comparison, without=WITHOUT)
    assert found.verdict == NOTHING
    (said,) = contradicted(found)
    assert "c is 3.0" in said or "c is 2.9" in said or "c is 3 " in said
    assert "not 2.5" in said
    assert found.comparison.fit.keys == ("c",)  # mass and stiffness are right and stay held


def test_where_all_that_is_held_is_wrong_one_diagnosis_with_it_fitted_is_enough(monkeypatch: pytest.MonkeyPatch):
    made: list[tuple[str, ...]] = []

    def counted(comparison: Comparison, **options: Any) -> Diagnosis:
        made.append(comparison.fit.keys)
        return diagnose(comparison, **options)

    monkeypatch.setattr("study.diagnose.held_values.diagnose", counted)
    held = model(linear_damping=2.5).with_values({"m": None, "k": None})
    found = diagnose_with_values_let_go(compare(held, record()), without=WITHOUT)
    assert found.verdict == NOTHING
    assert made == [("m", "k"), ("m", "c", "k")]
    assert "not 2.5" in contradicted(found)[0]


def test_beside_an_effect_that_is_missing_a_wrong_value_is_let_go_and_a_right_one_is_not():
    seen = record(cubic_stiffness=4e5)
    for damping, fitted in ((2.0, ("c",)), (3.0, ())):
        comparison = compare(model(linear_damping=damping), seen)
        found = diagnose_with_values_let_go(comparison, without=WITHOUT)
        assert found.answer is not None
        assert found.answer.names == ("cubic_stiffness",)
        assert found.comparison.fit.keys == fitted
        assert len(contradicted(found)) == len(fitted)


def test_of_free_decays_no_mass_is_let_go():
    """They tell ratios to it alone: with all coefficients let go it would be anything."""
    run = simulate(model(linear_damping=0.3), np.zeros(SAMPLES), DT, Integrator("rk4", 8), initial=(0.01, 0.0))
    noise = np.random.default_rng(5).standard_normal(SAMPLES)
    seen = {"force": run["force"], "displacement": run["displacement"] + 1e-5 * noise}
    comparison = compare(model(linear_damping=0.25), prepare_record(Record(DT, seen, run.units, "decay")))
    found = diagnose_with_values_let_go(comparison, without=WITHOUT)
    assert found.verdict == NOTHING
    assert found.comparison.fit.keys == ("c",)
    assert len(contradicted(found)) == 1


@pytest.mark.long
def test_what_is_added_on_the_page_is_added_beside_the_value_that_was_let_go(monkeypatch: pytest.MonkeyPatch):
    few = partial(diagnose_as_read, without=WITHOUT)
    monkeypatch.setattr(confirmed_faults, "diagnose_as_read", few)
    session = sessions.begin(model(linear_damping=2.5), record(cubic_stiffness=4e5))
    session = sessions.with_stage(session, sessions.examined(session)[0])
    assert session.now.diagnosis is not None
    assert session.now.comparison.fit.keys == ("c",)
    promised = session.now.diagnosis.answer.response_error if session.now.diagnosis.answer else None
    grown = sessions.with_added(session, "cubic_stiffness")
    assert grown.now.comparison.prediction.error == pytest.approx(promised, rel=0.02)


@pytest.mark.long
def test_faults_are_looked_for_beside_the_values_that_are_let_go():
    """Corrected for a gain that seems to grow, the record would contradict the mass no longer; the delay is real."""
    late = corrected(record(), [Fault("delay", "displacement", -0.4)])
    found = confirmed_faults.diagnose_accounted(accounted(model(inertia=2.05), late), without=WITHOUT)
    assert found.diagnosis.verdict == NOTHING
    assert [fault.fault for fault in found.faults] == ["delay"]
    assert found.faults[0].value == pytest.approx(0.4, abs=0.01)
    (said,) = contradicted(found.diagnosis)
    assert "not 2.05" in said
