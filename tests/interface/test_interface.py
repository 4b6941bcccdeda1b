import pickle
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import study as st
from study.equations.terms import LIBRARY

NONLINEAR = st.Model(
    st.term("inertia", value=1.0), st.term("linear_damping", value=3.77), st.term("linear_stiffness", value=355.3),
    st.term("cubic_stiffness", value=2e7), name="duffing",
)  # fmt: skip
OPEN = NONLINEAR.free()
LINEAR = OPEN.drop("cubic_stiffness")


@pytest.fixture(scope="module")
def record():
    return st.simulate(NONLINEAR, st.gaussian(1.0, samples=2048, seed=3), name="rig")


@pytest.fixture(scope="module")
def fit(record):
    return LINEAR.fit(record, measurement=False)


@pytest.fixture(scope="module")
def found(fit):
    return fit.diagnose({"bushing": "u*abs(u)"}, without=["hysteresis", "relaxation", "periodic_stiffness"])


@pytest.fixture(scope="module")
def better(fit, found):
    return fit.add(found.best)


def test_importing_the_package_loads_none_of_its_parts():
    heavy = "{'numpy', 'scipy', 'pandas', 'matplotlib', 'study.interface'} & set(sys.modules)"
    code = f"import sys; import study as st; dir(st); print({heavy})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_every_public_name_is_there_and_says_what_it_is():
    for name in st.__all__:
        if name != "__version__":
            assert getattr(st, name).__doc__, name
    with pytest.raises(AttributeError, match="it offers Across"):
        _ = st.no_such_name


def test_the_stub_names_what_the_package_offers():
    from pathlib import Path

    stub = Path(st.__file__).with_suffix(".pyi").read_text()
    named = {line.rpartition(" as ")[2] for line in stub.splitlines() if " as " in line}
    assert named | {"__version__"} == set(st.__all__)


def test_a_package_is_a_package_and_a_function_whatever_was_loaded_first():
    for first in ("st.compare", "importlib.import_module('study.compare.comparison')"):
        code = f"import study as st, importlib; {first}"
        code += "; import study.compare.panels as panels; panels.DRAWN_COLUMNS\ntry:\n    st.compare([])\n"
        code += "except st.StudyError as error:\n    print(error)"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "no fit is given; expected one or more"


def test_a_fit_has_coefficients_with_errors_and_what_follows_from_them(better):
    assert better.coefficients["k3"].value == pytest.approx(2e7, rel=1e-3)
    assert better.f_n.value == pytest.approx(3.0, rel=1e-4)
    assert better.zeta.value == pytest.approx(0.1, rel=1e-3)
    # (4.4) to first order from the errors of a fit with m held: half of k's relative error
    held = OPEN.hold(m=1.0).fit(better.record, measurement=False)
    k = held.coefficients["k"]
    assert held.f_n.error / held.f_n.value == pytest.approx(0.5 * k.error / k.value, rel=1e-6)
    assert better.error < 1e-4
    assert 99.9 < better.fit_percent <= 100.0


def test_a_model_that_is_held_whole_has_a_natural_frequency_without_error(record):
    fit = NONLINEAR.fit(record, measurement=False)
    assert fit.f_n.value == pytest.approx(3.0, rel=1e-4)
    assert np.isnan(fit.f_n.error)
    assert fit.to_frame()["held"].all()


def test_the_diagnosis_names_the_effect_and_its_frame_holds_every_candidate(found):
    assert (found.verdict, found.best.name) == ("missing_effect", "cubic_stiffness")
    frame = found.to_frame()
    assert frame.index[0] == "cubic_stiffness"
    assert {"bushing", "quintic_stiffness"} <= set(frame.index)
    assert "hysteresis" not in frame.index
    assert found["bushing"].name == "bushing"
    with pytest.raises(st.StudyError, match="is no candidate"):
        _ = found["flux_capacitor"]
    assert "missing" in found.says


def test_what_changes_is_not_dropped_before_its_change():
    change = st.term("linear_stiffness", varies_with="time", shape="line")
    changing = LINEAR.add(change)
    with pytest.raises(st.StudyError, match="linear_stiffness_over_time says how linear_stiffness changes"):
        changing.drop("linear_stiffness")
    assert changing.drop("linear_stiffness_over_time").terms == LINEAR.terms


def test_what_is_missing_beside_values_that_are_held_is_found():
    braked = NONLINEAR.add(st.term("coulomb_friction", value=0.2))
    record = st.simulate(braked, st.gaussian(1.0, samples=2048, seed=5), noise=1e-4, name="braked")
    missing = ("coulomb_friction", "cubic_stiffness")
    held = braked.drop("coulomb_friction").drop("cubic_stiffness").fit(record, measurement=False)
    found = held.diagnose(without=[name for name in LIBRARY if name not in missing])
    assert {effect.name for effect in found.best.effects} == set(missing)


def test_a_candidate_is_added_as_the_command_adds_it_by_name(fit, better):
    assert better.given.terms[-1] == "cubic_stiffness"
    by_name = fit.add("cubic_stiffness")
    assert by_name.coefficients["k3"].value == pytest.approx(better.coefficients["k3"].value, rel=1e-5)
    held = fit.add(st.term("cubic_stiffness", value=2e7))
    assert held.coefficients["k3"].held
    assert better.drop("cubic_stiffness").error == pytest.approx(fit.error, rel=1e-3)


def test_nothing_is_not_added(better):
    assert better.diagnose().best is None
    with pytest.raises(st.StudyError, match="None is no effect; expected one by name"):
        better.add(better.diagnose().best)


def test_a_candidate_added_to_the_model_brings_what_was_found_as_a_start(fit, found):
    model = fit.given.add(found.best)
    assert model.terms == (*fit.given.terms, "cubic_stiffness")
    assert model.values["k3"] == pytest.approx(found.best.coefficient)
    assert model.equation.values["k3"] is None, "held by no fit"


def test_models_are_ranked_with_the_error_of_the_difference(fit, better):
    table = st.compare([fit, better]).to_frame()
    assert table["error"].is_monotonic_increasing
    assert table["explained"].iloc[1] == pytest.approx(1.0, abs=1e-3)
    assert table["p_value"].iloc[1] < 0.01
    assert np.isnan(table["explained"].iloc[0])


@pytest.mark.long
def test_what_a_wrong_model_has_moves_with_the_level_and_a_right_one_not(record, fit, better):
    low = st.simulate(NONLINEAR, st.gaussian(0.2, samples=2048, seed=4), name="low")
    wrong, right = fit.across([record, low]), better.across([record, low])
    assert "k" in wrong.moving
    assert right.moving == ()
    assert [f.record.name for f in wrong.fits] == ["low", "rig"]
    assert set(wrong.to_frame().index.get_level_values("record")) == {"low", "rig"}
    with pytest.raises(st.StudyError, match="expected two or more"):
        fit.across([record])


def test_prediction_is_the_simulation_of_the_fitted_model(better, record):
    ahead = better.predict(record)
    assert np.allclose(ahead["displacement"], record["displacement"], atol=1e-3 * np.std(record["displacement"]))
    assert np.array_equal(better.predict(record["force"])["displacement"], ahead["displacement"])
    with pytest.raises(st.StudyError, match="expected one row"):
        better.predict(3.0)


def test_a_model_is_saved_with_its_values_or_without(better, tmp_path):
    better.model.save(tmp_path / "rig.yaml")
    better.model.save(tmp_path / "open.yaml", values=False)
    again = st.Model.load(tmp_path / "rig.yaml")
    assert again == better.model
    assert again.values["k3"] == better.coefficients["k3"].value
    assert set(st.Model.load(tmp_path / "open.yaml").values.values()) == {None}


@pytest.mark.parametrize("estimator", ["siso", "miso", "local_polynomial"])
def test_the_reverse_analysis_gives_parameters_and_functions(record, estimator):
    found = st.identify(record, NONLINEAR, estimator)
    assert found.parameters["m"] == pytest.approx(1.0, rel=0.15)
    if estimator != "siso":
        assert found.parameters["k3"] == pytest.approx(2e7, rel=0.05)
        assert set(found.responses()["input"]) == set(found.inputs)
        found.plot(2, Figure().subplots())
        with pytest.raises(st.StudyError, match="there is no input 3"):
            found.plot(3)
    if estimator == "miso":
        found.plot_coherence(Figure().subplots())


def test_results_are_short_in_print_and_whole_after_pickling(record, fit, found, better):
    ranking, across = (
        st.compare([fit, better]),
        fit.across([record, st.simulate(NONLINEAR, st.gaussian(0.3, samples=2048))]),
    )
    identified = st.identify(record, NONLINEAR, "miso")
    for result in (record, NONLINEAR, fit, found, found.best, better, ranking, across, identified, st.gaussian()):
        again = pickle.loads(pickle.dumps(result))
        assert repr(again) == repr(result)
        assert len(repr(result)) < 300
        assert "\n" not in repr(result)
    for result in (record, NONLINEAR, fit, found, better, ranking, across, identified):
        assert "<table" in result._repr_html_()
    assert repr(fit.summary()) == str(fit.summary())


def test_what_a_user_typed_is_escaped_in_a_notebook(record):
    bad = st.Model("inertia", "linear_stiffness", name="<script>alert(1)</script>")
    assert "<script" not in bad._repr_html_()
    assert (
        "<script"
        not in st.record(
            {"force": record["force"], "displacement": record["displacement"]}, dt=0.02, name="<script>"
        )._repr_html_()
    )


def test_every_picture_is_drawn_on_the_axes_that_are_given(record, fit, found):
    across = fit.across([record, st.simulate(NONLINEAR, st.gaussian(0.3, samples=2048))])
    draw = [
        fit.plot, lambda ax: fit.plot(ax, closeup=True), fit.plot_residual, fit.plot_frf,
        lambda ax: fit.plot_frf(ax, part="phase"), lambda ax: fit.plot_frf(ax, part="coherence"),
        fit.plot_autocorrelation, fit.plot_force_correlation, fit.plot_histogram, fit.plot_force_error,
        lambda ax: fit.plot_missing_force("velocity", ax), found.plot, found.plot_constancy,
        lambda ax: found.plot_constancy(ax, along="frequency"), lambda ax: across.plot(ax=ax),
        st.compare([fit]).plot, lambda ax: record.plot(ax=ax), lambda ax: record.plot_spectrum(ax=ax),
    ]  # fmt: skip
    for one in draw:
        axes = Figure().subplots()
        assert one(axes) is axes
        assert axes.lines or axes.collections or axes.patches
        assert axes.get_xlabel()


def test_a_record_of_arrays_passes_the_checks_of_a_file(record):
    frame = record.to_frame().reset_index()[["time", "force", "displacement"]]
    again = st.record(frame, name="again")
    assert np.array_equal(again["force"], record["force"])
    assert again.dt == pytest.approx(record.dt)
    with pytest.raises(st.StudyError, match="no column of times"):
        st.record({"force": record["force"], "displacement": record["displacement"]})
    with pytest.raises(st.StudyError, match="expected one row of numbers"):
        st.record({"force": np.zeros((3, 3))}, dt=0.1)
    with pytest.raises(st.StudyError):
        st.record({"force": record["force"], "displacement": np.full(len(record), np.nan)}, dt=0.02)


def test_a_record_is_written_and_read_again(record, tmp_path):
    record.save(tmp_path / "rig.csv")
    again = st.read(tmp_path / "rig.csv")
    assert np.array_equal(again["displacement"], record["displacement"])
    assert again.source == tmp_path / "rig.csv"
    with pytest.raises(st.StudyError, match="there is no such file"):
        st.read(tmp_path / "none.csv")


def test_what_stands_beside_a_file_holds_for_a_fit_of_it(record, tmp_path):
    # A record whose response is sampled late: the fault is corrected unless the file or the caller says otherwise.
    late = np.interp(record.time - 0.4 * record.dt, record.time, record["displacement"])
    st.record({"force": record["force"], "displacement": late}, dt=record.dt).save(tmp_path / "late.csv")
    (tmp_path / "late.record.yaml").write_text("measurement: off\n")
    switched_off = OPEN.fit(st.read(tmp_path / "late.csv"))
    (tmp_path / "late.record.yaml").unlink()
    searched = OPEN.fit(st.read(tmp_path / "late.csv"))
    assert switched_off.faults == ()
    assert [fault.fault for fault in searched.faults] == ["delay"]
    assert searched.error < 0.2 * switched_off.error


def test_noise_on_the_response_is_of_the_asked_size_and_leaves_out_what_was_not_measured():
    force = st.gaussian(samples=4096, seed=5)
    clean, noisy = st.simulate(NONLINEAR, force), st.simulate(NONLINEAR, force, noise=0.05)
    added = noisy["displacement"] - clean["displacement"]
    assert np.mean(added**2) / np.mean(clean["displacement"] ** 2) == pytest.approx(0.05, rel=0.1)
    assert tuple(noisy.channels) == ("force", "displacement")


@pytest.mark.parametrize(
    ("force", "rms"),
    [(st.multisine(2.0, samples=1024), 2.0), (st.sweep(2.0, samples=1024), 2.0), (st.waves(2.0, samples=4096), None)],
)
def test_forces_have_their_level_and_are_the_same_each_time(force, rms):
    assert len(force.values) in (1024, 4096)
    if rms is not None:
        assert np.mean(force.values**2) == pytest.approx(rms, rel=0.02)


def test_wrong_use_is_one_sentence(record, fit):
    cases = [
        (lambda: st.term("cubic_stifness"), "did you mean 'cubic_stiffness'"),
        (lambda: st.term("cubic_stiffness", k3=1.0), "unknown key 'k3'"),
        (lambda: st.Model(), "a model needs terms"),
        (lambda: st.Model("inertia", "inertia"), "twice"),
        (lambda: NONLINEAR.hold(k9=1.0), "no value 'k9'"),
        (lambda: NONLINEAR.hold("k9"), "no value 'k9'"),
        (lambda: st.Model("inertia").hold("m"), "no start for 'm'; expected a number, m=..."),
        (lambda: NONLINEAR.drop("hysteresis"), "no term 'hysteresis'"),
        (lambda: fit.diagnose(without=["cubic"]), "there is no term 'cubic'"),
        (lambda: fit.diagnose({"bad": "__import__('os')"}), "'__import__"),
        (lambda: LINEAR.fit(record, estimator="miso").diagnose(), "this one is by miso"),
        (lambda: LINEAR.fit(record, fit=(0, 10)), "must hold 64 samples"),
        (lambda: LINEAR.fit(record, response="acceleration_2"), "acceleration_2"),
        (lambda: st.gaussian(-1.0), "level of the excitation is -1"),
        (lambda: fit.plot_frf(part="size"), "expected magnitude, phase or coherence"),
        (lambda: st.identify(record, LINEAR, "magic"), "there is no estimator 'magic'"),
        (lambda: record.plot("torque"), "no channel 'torque'"),
        (lambda: st.library("flux capacitor"), "there is no term"),
    ]  # fmt: skip
    for use, sentence in cases:
        with pytest.raises(st.StudyError, match=None) as caught:
            use()
        assert sentence in str(caught.value), str(caught.value)


def test_the_library_is_a_table_that_a_word_searches():
    assert isinstance(st.library(), pd.DataFrame)
    assert list(st.library("cubic").index) == ["cubic_stiffness", "cubic_damping"]
    assert "hysteresis" in st.library("bolted").index


def test_correlations_of_a_residual_are_those_of_their_definition():
    from study.compare.residual_checks import cross_correlation

    random = np.random.default_rng(0)
    one, other = random.standard_normal(500), random.standard_normal(500)
    later = np.concatenate([np.zeros(7), one[:-7]])
    by_lag = cross_correlation(later, one, 20)
    assert int(np.argmax(by_lag)) - 19 == 7
    direct = np.sum(one[3:] * other[:-3]) / np.linalg.norm(one) / np.linalg.norm(other)
    assert cross_correlation(one, other, 20)[19 + 3] == pytest.approx(direct)


def test_the_checks_tell_a_right_model_in_noise_from_a_wrong_one():
    noisy = st.simulate(NONLINEAR, st.gaussian(1.0, samples=4096, seed=3), noise=0.01)
    right, wrong = (model.fit(noisy, measurement=False).residual_checks() for model in (OPEN, LINEAR))
    beyond = [
        (np.mean(np.abs(c.autocorrelation[1:]) > c.band), np.mean(np.abs(c.with_force) > c.band_force))
        for c in (right, wrong)
    ]
    assert beyond[0][0] < 0.05
    assert beyond[0][1] < 0.05
    assert beyond[1][0] > 0.3


def test_the_measured_response_function_is_that_of_the_linear_system_within_its_band():
    linear = NONLINEAR.drop("cubic_stiffness")
    noisy = st.simulate(linear, st.gaussian(1.0, samples=8192, seed=6), noise=0.02)
    found = linear.fit(noisy, measurement=False).response_functions()
    inside = (found.frequency > 1.0) & (found.frequency < 8.0)
    f = found.frequency[inside]
    exact = 1.0 / (355.3 - (2 * np.pi * f) ** 2 + 3.77j * 2 * np.pi * f)
    assert np.median(np.abs(found.measured[inside] / exact - 1.0)) < 0.05
    # The standard error of the magnitude: about two in three lines lie within one of them.
    off = np.abs(found.magnitude[0][inside] - found.magnitude[1][inside])
    assert 0.5 < np.mean(off < found.error[inside]) < 0.95
    assert np.all(found.coherence_predicted[inside] > 0.9)


def test_the_users_own_candidate_is_shown_whatever_its_rank(found, monkeypatch):
    from study.diagnose import diagnosis_report

    monkeypatch.setattr(diagnosis_report, "ON_SCREEN", 1)
    rank = 1 + [c.name for c in found.candidates].index("bushing")
    assert rank > 1
    lines = found.table().splitlines()
    assert any(line.split()[:2] == [str(rank), "bushing"] for line in lines)
    assert "bushing" in found._repr_html_()


def test_an_own_candidate_that_cannot_be_fitted_is_said(fit):
    found = fit.diagnose({"wall": "exp(30000*u)"}, without=["hysteresis", "relaxation", "periodic_stiffness"])
    assert list(found.not_fitted) == ["wall"]
    assert "wall could not be fitted: " in found.says
    with pytest.raises(st.StudyError, match=r"friction\(vs\)"):
        fit.diagnose({"own": "tanh(v/vs)"})
    with pytest.raises(st.StudyError, match="belongs to the library"):
        fit.diagnose({"inertia": "u*v"})


def test_a_parameter_of_an_own_formula_is_fitted():
    hidden = st.Model(
        st.term("inertia", value=1.0), st.term("linear_damping", value=3.0), st.term("linear_stiffness", value=355.0),
        st.term("brake(vs)", force="tanh(v/vs)", value=0.5, vs=0.02), name="braked",
    )  # fmt: skip
    record = st.simulate(hidden, st.gaussian(1.0, samples=2048, seed=5), name="braked")
    found = hidden.drop("brake").free().fit(record, measurement=False).diagnose({"own(vs)": "tanh(v/vs)"})
    assert found["own"].ranked.effect.parameters["vs"] == pytest.approx(0.02, rel=0.02)
    assert found["own"].coefficient == pytest.approx(0.5, rel=0.02)


def test_a_saved_fit_is_the_start_of_another_and_holds_what_was_held(record, tmp_path):
    fit = OPEN.hold(m=1.0).fit(record, measurement=False)
    fit.model.save(tmp_path / "rig.yaml")
    text = (tmp_path / "rig.yaml").read_text()
    assert "{term: inertia, value: 1.0}" in text
    assert text.count("held: false") == 3
    again = st.Model.load(tmp_path / "rig.yaml").fit(record, measurement=False)
    assert [key for key, c in again.coefficients.items() if c.held] == ["m"]
    for key in ("c", "k", "k3"):
        assert again.coefficients[key].value == pytest.approx(fit.coefficients[key].value, rel=1e-6)
        assert again.coefficients[key].error == pytest.approx(fit.coefficients[key].error, rel=0.01)
    held = st.Model.load(tmp_path / "rig.yaml").hold()
    assert all(c.held for c in held.fit(record, measurement=False).coefficients.values())
    one = st.Model.load(tmp_path / "rig.yaml").hold("k", c=4.0).equation
    assert one.held_keys == ("m", "c", "k")
    assert (one.values["k"], one.values["c"]) == (fit.coefficients["k"].value, 4.0)
    assert set(st.Model.load(tmp_path / "rig.yaml").free().values.values()) == {None}


def test_a_start_may_be_given_and_only_what_has_a_value(tmp_path):
    model = st.Model("inertia", st.term("dead_band", value=-20.0, u_g=0.01, held=["u_g"]), name="rig")
    assert model.equation.held_keys == ("dead_band.u_g",)
    assert list(model.equation.starts.values()) == [-20.0]
    model.save(tmp_path / "rig.yaml")
    assert st.Model.load(tmp_path / "rig.yaml") == model
    with pytest.raises(st.StudyError, match="held of inertia is"):
        st.term("inertia", value=1.0, held=["c"])
    with pytest.raises(st.StudyError, match="no 'held' where no value is given"):
        st.term("inertia", held=["m"])


def test_of_two_modes_the_one_that_is_meant_is_fitted():
    structure = st.Model(
        st.term("inertia", at="low", value=2.0), st.term("inertia", at="high", value=0.2),
        st.term("linear_stiffness", between=("ground", "low"), value=4000.0),
        st.term("linear_stiffness", between=("low", "high"), value=8000.0),
        st.term("linear_damping", between=("ground", "low"), value=2.0),
        st.term("linear_damping", between=("low", "high"), value=0.4),
        name="pair", coordinates=["low", "high"], forces={"shaker": "low"},
    )  # fmt: skip
    from study.equations.simulate import simulate

    force = np.random.default_rng(2).standard_normal(8192)
    shaken = simulate(structure.equation, {"shaker": force}, 1.0 / 256.0)["low acceleration"]
    record = st.record({"force [N]": force, "acceleration [m/s^2]": shaken}, fs=256.0)
    assert record.name == "record"
    coupled = [[12000.0 / 2.0, -8000.0 / 0.4**0.5], [-8000.0 / 0.4**0.5, 8000.0 / 0.2]]
    first = np.sqrt(np.linalg.eigvalsh(coupled)[0]) / (2.0 * np.pi)
    single = st.Model("inertia", "linear_damping", "linear_stiffness", name="one")
    meant = single.fit(record, measurement=False, near=7.0, up_to=15.0)
    assert meant.f_n.value == pytest.approx(first, rel=0.02)
    ended = f"the fit began at the mode near 7 Hz (--near) and ended at {meant.f_n.value:.4g} Hz"
    assert ended in meant.comparison.notes
    assert meant.error < 0.2 < single.fit(record, measurement=False).error
    with pytest.raises(st.StudyError, match="too little in common near 500 Hz"):
        single.fit(record, measurement=False, near=500.0)
    with pytest.raises(st.StudyError, match=r"--up-to is [0-9.]+ Hz; expected 42"):
        single.fit(record, measurement=False, up_to=100.0)
