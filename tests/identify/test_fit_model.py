"""The one fit of a model to a record: held values, order of terms, starts, and what counts as lost."""

from dataclasses import replace

import numpy as np
import pytest

from study.compare.comparison import compare
from study.equations.model import Model, ModelTerm, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.identify.frequency_domain.starting_values import coherent_lines
from study.identify.time_domain import fit_model as fits
from study.identify.time_domain import multiple_shooting, settling, shape_search
from study.identify.time_domain.fit_model import fit_model, with_term
from study.identify.time_domain.multiple_shooting import is_chaotic
from study.identify.time_domain.no_response import LINEAR, driven_at
from study.identify.time_domain.part_fit import covariance_of, fit_part, linearise, with_states
from study.identify.time_domain.settling import continued
from study.identify.time_domain.stretch_states import is_poor
from study.records.excitation import Excitation, displacement_noise, force
from study.records.plan import Plan
from study.records.prepared import prepare_record, whole
from study.records.record import Record
from study.support.errors import StudyError
from study.support.least_squares import least_squares


def noisy(record, seed=1, fraction=0.01):
    clean = record["displacement"]
    return record.with_channels({"displacement": clean + displacement_noise(clean, fraction, seed)})


def opened(model):
    return model.with_values(dict.fromkeys(model.values))


def test_what_is_held_stays_and_the_terms_keep_their_order(systems, records):
    """A term with an open shape parameter is fitted last, wherever it stands."""
    model = opened(systems["mathieu"]).with_values({"k": 355.3})
    model = replace(model, terms=model.terms[::-1])
    fit = fit_model(model, whole(noisy(records["mathieu"])))
    assert fit.model.values["k"] == 355.3
    assert "k" not in fit.keys
    assert [t.name for t in fit.model.terms] == [t.name for t in model.terms]
    assert fit.model.values["periodic_stiffness.f_m"] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("held", [("m", "c", "k"), ("m", "k")])
def test_what_is_held_is_integrated_as_finely_as_what_is_fitted(held):
    """A true model that its owner holds, 7 periods in a second sampled 50 times: the integration alone left 1 %."""
    model = Model("rig", tuple(free(get(n)) for n in ("inertia", "linear_damping", "linear_stiffness")))
    true = {"m": 1.0, "c": 2.0, "k": 2000.0}
    record = simulate(model.with_values(true), force(Excitation(), 4096, 0.02, 1), 0.02, Integrator("rk4", 32))
    comparison = compare(model.with_values({key: true[key] for key in held}), prepare_record(record))
    assert comparison.prediction.error < 1e-4


def test_with_a_start_nothing_is_searched_for(systems, records, monkeypatch):
    def searched(*_, **__):
        pytest.fail("a search")

    for name in ("best_fit", "first_starts", "with_term"):
        monkeypatch.setattr(fits, name, searched)
    model = systems["mathieu"]
    fit = fit_model(opened(model), whole(noisy(records["mathieu"])), start=model.numbers())
    assert fit.converged
    assert fit.model.values["k"] == pytest.approx(355.3, rel=0.01)


def test_a_fit_that_did_not_arrive_is_lost_and_noise_is_not(systems, records):
    prepared = whole(noisy(records["duffing"], fraction=0.2))
    fit = fit_model(opened(systems["duffing"]), prepared)
    assert not is_poor(fit, prepared.fitted), "a residual of nearly half the response that is white"
    assert is_poor(replace(fit, converged=False), prepared.fitted)
    linear = fit_part(systems["linear"], prepared, ())
    assert is_poor(linear, prepared.fitted), "a cube is missing: what is left looks like motion"


def test_a_dead_band_magnifies_disturbances_and_a_duffing_oscillator_does_not(systems, records):
    for name, chaotic in (("dead_band", True), ("duffing", False)):
        prepared = whole(records[name].part(0, 2048))
        fit = fit_part(systems[name], prepared, tuple(systems[name].values))
        assert is_chaotic(fit, prepared) is chaotic, name


def test_a_chaotic_system_is_fitted_in_segments_at_once(systems, monkeypatch):
    """Single runs lose its motion: build-ups, steps and starts of more of them took half of the time, for nothing."""
    truth = systems["dead_band"]
    made = simulate(truth, force(Excitation(), 8192, 0.02, 9101), 0.02, Integrator("abm4", 16))

    def built_up(*_):
        pytest.fail("a build-up term by term")

    def in_a_side_valley(*_, **__):
        pytest.fail("one more search from segments' ends")

    monkeypatch.setattr(fits, "_built_up", built_up)
    monkeypatch.setattr(fits, "from_segments", in_a_side_valley)
    unknown = truth.with_values({key: None for key in truth.values if "." not in key})
    fit = fit_model(unknown, whole(noisy(made, fraction=1e-4)))
    assert fit.converged
    assert fit.restarts
    for key in fit.keys:
        assert abs(fit.estimate[key] - truth.values[key]) < 4.0 * fit.estimate.error(key), key


@pytest.mark.parametrize("fails", [False, True])
def test_a_chaotic_system_begun_near_its_values_is_one_motion_at_once(systems, monkeypatch, fails):
    """Longer and longer segments, half of the time of a search, are for where that fails."""
    truth, longer, motions = systems["dead_band"], [], []
    made = simulate(truth, force(Excitation(), 8192, 0.02, 9101), 0.02, Integrator("abm4", 16))
    prepared = whole(noisy(made, fraction=1e-4))
    by_shooting = {name: getattr(multiple_shooting, name) for name in ("lengthen", "_one_motion")}

    def lengthened(*told):
        longer.append(told)
        return by_shooting["lengthen"](*told)

    def one_motion(*told):
        motions.append(told)
        return None if fails and len(motions) == 1 else by_shooting["_one_motion"](*told)

    monkeypatch.setattr(multiple_shooting, "lengthen", lengthened)
    monkeypatch.setattr(multiple_shooting, "_one_motion", one_motion)
    fit = fit_model(truth.opened(held=["dead_band.u_g"]), prepared)
    assert len(longer) == fails
    assert fit.converged
    assert fit.restarts
    for key in fit.keys:
        assert abs(fit.estimate[key] - truth.values[key]) < 4.0 * fit.estimate.error(key), key


def test_starts_that_follow_the_motion_and_want_more_steps_are_no_search(systems, monkeypatch):
    """Two steps a sample leave more of the dead band's corners than noise: the fit comes to no minimum with them."""
    truth = systems["dead_band"]
    blows = Excitation(kind="blows", cutoff=12.5, blows=12, level=0.5)
    made = simulate(truth, force(blows, 8192, 0.02, 9101), 0.02, Integrator("abm4", 16))
    monkeypatch.setattr(fits, "_from_nothing", lambda *_: pytest.fail("a search from nothing"))
    fit = fit_model(truth.opened(held=["dead_band.u_g"]), whole(noisy(made, fraction=1e-4)))
    assert fit.converged
    assert fit.steps_per_sample > 2
    for key in fit.keys:
        assert abs(fit.estimate[key] - truth.values[key]) < 4.0 * fit.estimate.error(key), key


def test_a_term_more_never_fits_worse_and_is_found_with_its_shape(systems, records):
    prepared = prepare_record(noisy(records["mathieu"]))
    fit = fit_model(opened(systems["linear"]), prepared)
    base = shape_search.baseline(fit, prepared)
    grown = with_term(base, free(get("periodic_stiffness")))
    assert grown.rms < 0.5 * fit.rms
    assert grown.model.values["periodic_stiffness.f_m"] == pytest.approx(1.0, abs=2e-3)
    useless = with_term(shape_search.baseline(grown, prepared), free(get("cubic_damping")))
    assert useless.rms <= grown.rms * (1.0 + 1e-9)


def test_a_fit_of_the_beginning_goes_on_to_the_whole_fitting_part(systems, records):
    prepared = prepare_record(noisy(records["duffing"]))
    look = prepared.shortened(1024)
    fit = fit_model(opened(systems["duffing"]), look)
    assert continued(fit, look) is fit
    longer = continued(fit, prepared)
    assert len(longer.residual) == len(prepared.fitted)
    assert np.all(np.diag(longer.covariance) < np.diag(fit.covariance))


@pytest.mark.long
@pytest.mark.parametrize("seed", [6000, 6007])
def test_a_width_is_found_within_its_error_where_no_free_run_follows(seed, systems):
    """None with the width held may stand for one that has it open, and none in a side valley for the record."""
    made = simulate(systems["dead_band"], force(Excitation(), 8192, 0.02, seed), 0.02, Integrator("abm4", 16))
    fit = fit_model(opened(systems["dead_band"]), whole(noisy(made, seed, 0.05)))
    assert set(fit.keys) == set(systems["dead_band"].values)
    assert fit.restarts
    assert abs(fit.estimate["dead_band.u_g"] - 0.0025) < 4.0 * fit.estimate.error("dead_band.u_g")
    assert fit.estimate["dead_band.u_g"] == pytest.approx(0.0025, rel=0.02)
    beside, all_states = linearise(fit, whole(made)), with_states(fit, whole(made))
    keys, target = len(fit.keys), np.random.default_rng(seed).standard_normal(len(fit.residual))
    assert beside.shape[1] == keys < len(fit.restarts) < all_states.shape[1]
    assert least_squares(beside, target) == pytest.approx(least_squares(all_states, target)[:keys], rel=1e-6)
    assert covariance_of(fit, beside) == pytest.approx(covariance_of(fit, all_states)[:keys, :keys], rel=1e-3)


def test_where_the_motion_runs_away_from_a_start_one_nearer_to_the_linear_one_is_taken(systems):
    """Stiffness that differs between the sides: by the reverse system it softens so far that the motion escapes."""
    terms = systems["linear"].with_term(free(get("quadratic_stiffness")))
    truth = terms.with_values({"m": 0.0156127, "c": 0.0798547, "k": 582.264, "k2": 50.0108})
    settings = Excitation(
        "swept_sine", 34400.0, start_frequency=9.4385, stop_frequency=223.859, sweep="logarithmic", periods=4
    )  # fmt: skip
    dt = 1.0 / (41.8 * 30.7356)
    drive = force(settings, 24640, dt, 1)
    clean = simulate(truth, drive, dt, Integrator("rk4", 8))
    noise = displacement_noise(clean["acceleration"], 0.05, 3_100_029)
    record = replace(clean, channels={"force": drive, "acceleration": clean["acceleration"] + noise})
    prepared = prepare_record(record)
    starts = fits.first_starts(opened(truth), prepared)
    assert fits._tried(opened(truth), prepared, (), starts[1], 5) is None, "the case that this is about"
    fit = fit_model(opened(truth), prepared)
    assert fit.rms == pytest.approx(float(np.std(noise[: len(drive) // 2])), rel=0.02)
    assert fit.model.values["k2"] == pytest.approx(50.0, rel=0.05)


def test_a_search_looks_at_everything_where_a_stretch_shows_nothing_of_the_structure(systems):
    """The end of a slow sweep, sampled often, beside a harmonic force that was not measured."""
    values = {
        "m": 32.5561,
        "c": 72.9475,
        "k": 1505923.3,
        "fh_cos": -2.0873,
        "fh_sin": 0.1035,
        "harmonic_force.f": 26.9567,
    }
    truth = systems["linear"].with_term(free(get("harmonic_force"))).with_values(values)
    settings = Excitation(
        "swept_sine", 2.33142, start_frequency=13.951, stop_frequency=176.987, sweep="linear", periods=4
    )  # fmt: skip
    dt = 1.0 / (97.4 * 34.23)
    drive = force(settings, 48656, dt, 1)
    clean = simulate(truth, drive, dt, Integrator("rk4", 4))
    noise = displacement_noise(clean["displacement"], 0.01, 3)
    record = replace(clean, channels={"force": drive, "displacement": clean["displacement"] + noise})
    prepared = prepare_record(record)
    with pytest.raises(StudyError, match="nothing in common"):
        fits.first_starts(systems["linear"], prepared.shortened(shape_search.SEARCHED))
    fit = fit_model(opened(truth), prepared)
    assert fit.model.values["harmonic_force.f"] == pytest.approx(26.9567, rel=1e-4)
    assert fit.rms == pytest.approx(float(np.std(noise[: len(drive) // 2])), rel=0.02)


def driven_by_a_sine(noise=0.0):
    """A linear oscillator (m = 1 kg, c = 0.8 N s/m, k = 172.8 N/m) from rest, driven at 12 rad/s for 40 s."""
    t = 0.01 * np.arange(4000)
    terms = (ModelTerm(get(name), (value,), ()) for name, value in zip(LINEAR, (1.0, 0.8, 172.8), strict=True))
    model = Model("linear", tuple(terms))
    record = simulate(model, np.sin(12.0 * t), 0.01, Integrator("rk4", 4))
    channels = {name: record[name] for name in ("force", "displacement")}
    return opened(model), Record(0.01, channels | {"displacement": noisy(record, fraction=noise)["displacement"]})


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_transient_tells_the_mass_under_a_single_frequency(noise):
    model, record = driven_by_a_sine(noise)
    prepared = prepare_record(record)
    fit = fit_model(model, prepared)
    errors = np.sqrt(np.diag(covariance_of(fit, linearise(fit, prepared)))[: len(fit.keys)])
    for key, truth, error in zip(fit.keys, (1.0, 0.8, 172.8), errors, strict=True):
        assert fit.model.values[key] == pytest.approx(truth, rel=1e-6, abs=3.0 * error)
        assert error < 0.01 * truth


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_steady_sine_does_not_tell_the_mass(noise):
    """Without noise, what the record's rounding leaves chooses one mass, and its error is next to nothing."""
    model, _ = driven_by_a_sine()
    t = 0.01 * np.arange(4000)
    motion = np.round(0.01 * np.sin(12.0 * t - 0.3), 9) + np.random.default_rng(4).normal(0.0, noise * 0.007, len(t))
    prepared = prepare_record(Record(0.01, {"force": np.sin(12.0 * t), "displacement": motion}))
    with pytest.raises(StudyError, match=r"drives one frequency, 1\.91 Hz, which cannot tell mass from stiffness"):
        fit_model(model, prepared)
    assert fit_model(model.with_values({"m": 1.0}), prepared).model.values["k"] == pytest.approx(239.6, rel=0.01)


def test_a_wide_band_in_a_short_record_is_not_taken_for_one_frequency():
    """Its usual segments have four lines, as few as a window makes of a sine; longer ones have more."""
    model, sine = driven_by_a_sine(0.01)
    true = model.with_values({"m": 1.0, "c": 0.8, "k": 800.0})
    record = simulate(true, force(Excitation(level=1.0, cutoff=4.0), 2000, 0.01, 1), 0.01, Integrator("rk4", 4))
    short = prepare_record(Record(0.01, {name: record[name] for name in ("force", "displacement")}))
    assert len(coherent_lines(short).omega) == 4
    assert driven_at(model, short) == 0.0
    assert driven_at(model, prepare_record(sine)) == pytest.approx(12.0, rel=0.01)


def test_noise_is_no_decay():
    """It was called complete: what is left of it depends on nothing."""
    noise = Record(0.01, {"force": np.zeros(4000), "displacement": np.random.default_rng(1).standard_normal(4000)})
    model, _ = driven_by_a_sine()
    prepared = prepare_record(noise, Plan("displacement", (0, 2000), (2000, 4000)))
    with pytest.raises(StudyError, match=r"no free motion of 'linear' explains any .*; expected the record of a decay"):
        fit_model(model.with_values({"m": 1.0}), prepared)


def test_segments_that_lead_astray_displace_no_better_free_run(monkeypatch):
    """Of a beam's decay they ended at a damping that feeds energy in, and nothing of the motion was left explained."""
    model = Model("beam", tuple(free(get(n)) for n in (*LINEAR, "cubic_stiffness")))
    true = {"m": 1.0, "c": 1.8, "k": 53900.0, "k3": 0.47}
    decay = simulate(model.with_values(true), np.zeros(8000), 0.001, Integrator("rk4", 8), initial=(120.0, 0.0))
    prepared = prepare_record(noisy(decay), Plan("displacement", (0, 4000), (4000, 8000)))
    linear = replace(model, terms=model.terms[:3]).with_values({"m": 1.0})
    fit = fit_model(linear, prepared)
    astray = fit_part(linear, prepared, ("m",), {"c": -26.8, "k": 318481.0}, max_iterations=20)
    assert astray.rms > 1.5 * fit.rms
    monkeypatch.setattr(settling, "from_segments", lambda *_: astray)
    monkeypatch.setattr(settling, "is_chaotic", lambda f, _: f is astray)
    monkeypatch.setattr(settling, "_in_segments", lambda *_: replace(astray, converged=True))
    again = settling.settled(fit, prepared)
    assert again.rms < 1.01 * fit.rms
