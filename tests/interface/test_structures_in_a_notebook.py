"""A structure in a notebook: loaded or made, fitted, diagnosed, an effect added at its place and taken out again."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import study as st
from study.equations.simulate import Integrator, simulate
from study.records.excitation import Excitation, force
from study.records.record import Sensor, record_of, write_csv
from study.support.errors import StudyError

SAMPLES, DT = 2400, 0.02
FEW = ("cubic_stiffness", "quadratic_damping", "coulomb_friction")
PLACES = (("ground", "a"), ("a", "b"))


def pair(*more: st.Term) -> st.Model:
    """Two masses one above the other, driven at the lower one."""
    ties = [st.term(name, between=place) for name in ("linear_stiffness", "linear_damping") for place in PLACES]
    masses = [st.term("inertia", at="a"), st.term("inertia", at="b")]
    return st.Model(*masses, *ties, *more, name="pair", coordinates=["a", "b"], forces={"shaker": "a"})


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The record of a pair whose upper spring hardens, and the model file of one that does not."""
    place = tmp_path_factory.mktemp("pair")
    true = pair(st.term("cubic_stiffness", between=("a", "b")))
    values = dict(zip(true.values, (1.0, 0.6, 900.0, 700.0, 1.2, 0.8, 4e6), strict=True))
    drive, rng = force(Excitation(level=10.0, cutoff=12.5), SAMPLES, DT, 1), np.random.default_rng(1)
    sensors = [Sensor(c, "displacement") for c in "ab"]
    made = simulate(true.hold(values).equation, {"shaker": drive}, DT, Integrator("rk4", 8), sensors=sensors)
    noisy = {s: made[s] + 0.005 * np.std(made[s]) * rng.standard_normal(SAMPLES) for s in sensors}
    write_csv(record_of(DT, {"shaker": drive}, noisy), place / "pair.csv")
    pair().save(place / "pair.yaml")
    return place


@pytest.fixture(scope="module")
def fit(folder) -> st.Fit:
    model = st.Model.load(folder / "pair.yaml")
    return model.fit(st.read(folder / "pair.csv", model=model))


def test_a_structure_is_loaded_as_it_was_made(folder):
    assert st.Model.load(folder / "pair.yaml") == pair()
    assert pair().coordinates == ("a", "b")


def test_the_walk_from_record_to_the_right_model(fit):
    found = fit.diagnose(without=[t for t in st.library().index if t not in FEW])
    assert found.verdict == "missing_effect"
    assert found.best is not None
    assert found.best.name == "cubic_stiffness[a-b]"
    assert "between a and b" in found.says
    after = fit.add(found.best)
    low, high = after.coefficients["k3[a-b]"].interval or (0.0, 0.0)
    assert low < 4e6 < high
    assert after.error < 0.2 * fit.error
    by_hand = fit.add("cubic_stiffness", between=("a", "b"))
    assert by_hand.coefficients["k3[a-b]"].value == pytest.approx(after.coefficients["k3[a-b]"].value, rel=1e-3)
    back = after.drop("cubic_stiffness", between=("a", "b"))
    assert back.error == pytest.approx(fit.error, rel=1e-3)


def test_what_is_told_and_drawn_of_it(fit):
    assert set(fit.errors) == {"a displacement", "b displacement"}
    modes = fit.modes()
    assert list(modes.columns[-2:]) == ["shape at b", "error at b"]
    assert modes.frequency.is_monotonic_increasing
    assert fit.f_n is not None
    assert fit.f_n.value == pytest.approx(modes.frequency[1])
    axes = fit.plot(sensor="b displacement")
    assert "displacement" not in axes.get_title()
    for drawn in (fit.plot_residual(), fit.plot_missing_force(), fit.plot_histogram()):
        assert drawn.has_data()
    plt.close("all")
    assert b"<html" in fit.page()


def test_what_does_not_go_is_said_in_a_sentence(fit):
    with pytest.raises(StudyError, match=r"expected one of a displacement, b displacement"):
        fit.plot(sensor="c displacement")
    with pytest.raises(StudyError, match="expected coordinates"):
        st.Model("inertia", st.term("linear_stiffness", between=("ground", "a")))
    with pytest.raises(StudyError, match="expected one of"):
        st.term("linear_stiffness", at="a", between=("a", "b"))
    with pytest.raises(StudyError, match="'c'"):
        pair(st.term("cubic_stiffness", between=("a", "c")))
    with pytest.raises(StudyError, match="coordinate is 'c'; expected one of a, b"):
        fit.plot_force_error(coordinate="c")
    with pytest.raises(StudyError, match="identify reads a single mass in reverse"):
        st.identify(st.Record.of(fit.comparison.record), fit.given)
    with pytest.raises(StudyError, match="has no 'shaker'; expected every force of pair"):
        fit.predict(st.record({"force": np.arange(99.0) ** 2, "displacement": np.arange(99.0)}, dt=DT))


def test_a_structure_is_simulated_and_its_fit_predicts(fit):
    added = fit.add("cubic_stiffness", between=("a", "b"))
    record = st.Record.of(fit.comparison.record)
    drive = st.Force(record["shaker"], DT, seed=3)
    made, by_name = st.simulate(added.model, drive), added.predict(record)
    assert {"a displacement", "b velocity"} <= set(made.channels)
    assert made["b displacement"] == pytest.approx(by_name["b displacement"])
    assert np.std(made["b displacement"] - record["b displacement"]) < 0.02 * np.std(record["b displacement"])
    noisy = st.simulate(added.model, drive, noise=0.01)
    assert [str(s) for s in noisy.sensors] == ["a displacement", "b displacement"]
    added_noise = [noisy[str(s)] - made[str(s)] for s in noisy.sensors]
    assert abs(np.corrcoef(added_noise)[0, 1]) < 0.1
    assert "shaker" in record.plot_spectrum().get_ylabel()
    plt.close("all")


def test_response_functions_and_the_error_of_the_force_are_drawn_of_each_coordinate(fit):
    for of in ("a", "b"):
        assert fit.plot_frf(sensor=f"{of} displacement").lines
        assert fit.plot_force_error(coordinate=of).lines
    assert fit.plot_frf().lines
    assert fit.plot_force_error().lines
