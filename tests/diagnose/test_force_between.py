"""What a force does between its samples is tried before an effect is called missing."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from study.compare.comparison import compare
from study.diagnose.force_between import diagnose_as_read, reading_in_words
from study.diagnose.verdict import NOTHING, diagnose
from study.equations.model import Model, ModelTerm
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LIBRARY, get
from study.records.prepared import prepare_record
from study.records.record import Record

DT, FINER, SAMPLES = 0.05, 32, 2048  # four samples in a period of the structure, whose force a program made
# Few candidates are tried, among them what a force that is read wrongly looks like, and a test is soon done.
TRIED = ("relaxation", "hysteresis", "cubic_stiffness", "quadratic_damping", "coulomb_friction")
WITHOUT = tuple(name for name in LIBRARY if name not in TRIED)
TRUE = {"inertia": 2.0, "linear_damping": 3.0, "linear_stiffness": 2.0 * (2.0 * np.pi * 5.0) ** 2}


def model(**more):
    terms = {**TRUE, **more}
    return Model("rig", tuple(ModelTerm(get(name), (value,), ()) for name, value in terms.items()))


def drawn():
    return np.random.default_rng(11).standard_normal(SAMPLES)


def record(between):
    """The exact motion of the structure under a force that goes between its samples as it is told (SciPy's hold)."""
    m, c, k = TRUE.values()
    continuous = np.array([[0.0, 1.0], [-k / m, -c / m]]), np.array([[0.0], [1.0 / m]]), np.eye(1, 2), np.zeros((1, 1))
    discrete = cont2discrete(continuous, DT, {"held": "zoh", "straight": "foh"}[between])
    _, motion, _ = dlsim(discrete, drawn())
    return Record(DT, {"force": drawn(), "displacement": motion[:, 0]}, name="made")


def believed():
    return model().with_values(dict.fromkeys(model().values, None))


@pytest.mark.long
@pytest.mark.parametrize(("between", "said"), [("held", "is held from each sample"), ("straight", "straight lines")])
def test_a_force_that_a_program_made_is_read_as_it_was_before_an_effect_is_called_missing(between, said):
    comparison = compare(believed(), prepare_record(record(between)))
    assert diagnose(comparison, without=WITHOUT).verdict != NOTHING
    found = diagnose_as_read(comparison, without=WITHOUT)
    assert found.verdict == NOTHING
    assert said in reading_in_words(found.comparison)
    assert found.comparison.fit.model.numbers()["m"] == pytest.approx(TRUE["inertia"], rel=0.01)


@pytest.mark.long
def test_an_effect_that_is_missing_is_not_explained_by_the_force_between_its_samples():
    """Simulated with many samples between those that are kept."""
    fine = np.interp(np.arange(SAMPLES * FINER) / FINER, np.arange(SAMPLES), drawn())
    run = simulate(model(cubic_stiffness=4e7), fine, DT / FINER, Integrator("rk4", 1))
    made = Record(DT, {"force": drawn(), "displacement": run["displacement"][::FINER]}, run.units, "made")
    found = diagnose_as_read(compare(believed(), prepare_record(made)), without=WITHOUT)
    assert found.answer is not None
    assert found.answer.names == ("cubic_stiffness",)
