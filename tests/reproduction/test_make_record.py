"""A case from settings to estimates."""

import sys
from pathlib import Path

import numpy as np
import pytest

from study.identify.estimators import ESTIMATORS
from study.reproduction import tables
from study.reproduction.cases import assumed_model, estimator_settings, identify_case, make_record
from study.reproduction.config import load_config
from study.support.errors import DivergenceError, StudyError

CONFIG = load_config(Path(__file__).parents[2] / "config")


def settings(case, **changed):
    return CONFIG.record_settings(case).model_copy(update=changed)


def test_the_record_is_the_models_response_to_the_configured_force(systems):
    told = settings("duffing")
    record = make_record(systems["duffing"], told)
    assert record.name == "duffing"
    assert len(record) == told.sampling.samples
    u, v, a = (record[c] for c in ("displacement", "velocity", "acceleration"))
    np.testing.assert_allclose(a + 3.77 * v + 355.3 * u + 2e7 * u**3, record["force"], atol=1e-9)


def test_the_same_seed_gives_the_same_record_and_another_another(systems):
    told = settings("linear")
    one, same, other = (make_record(systems["linear"], told, seed=seed)["force"] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.1


def test_noise_is_on_the_displacement_alone_and_has_the_asked_mean_square(systems):
    quiet = make_record(systems["duffing_van_der_pol"], settings("noise_20", noise=0.0))
    noisy = make_record(systems["duffing_van_der_pol"], settings("noise_20"))
    for channel in ("force", "velocity", "acceleration"):
        np.testing.assert_array_equal(quiet[channel], noisy[channel])
    noise = noisy["displacement"] - quiet["displacement"]
    assert np.mean(noise**2) / np.mean(quiet["displacement"] ** 2) == pytest.approx(0.2, rel=0.05)
    again = make_record(systems["duffing_van_der_pol"], settings("noise_20"), noise_seed=999)
    assert abs(np.corrcoef(noise, again["displacement"] - quiet["displacement"])[0, 1]) < 0.1


def test_a_run_that_diverges_yields_no_record(systems):
    with pytest.raises(
        DivergenceError, match=r"case 'duffing' at level 1e\+08: the simulation .* diverged at t = .* mean square"
    ):
        make_record(systems["duffing"], settings("duffing", level=1e8))


def test_a_term_may_be_assumed_beside_the_models_own(systems):
    linear = systems["linear"]
    assert assumed_model(linear, "") is linear
    assert "cubic_stiffness" in assumed_model(linear, "cubic_stiffness")
    with pytest.raises(StudyError, match="there is no term 'cubic'"):
        assumed_model(linear, "cubic")


def test_every_configured_estimator_is_asked(systems, records):
    told = CONFIG.identification_settings("linear")
    assert estimator_settings(told).segments.length == told.segments.length
    found = identify_case(systems["linear"], records["linear"], told)
    assert list(found) == list(told.estimators)
    assert [len(found[name].inputs) for name in ("siso", "miso")] == [1, 2], "the assumed cubic stiffness is an input"


def test_an_estimator_whose_model_diverges_leaves_the_others_alone(systems, records, monkeypatch):
    def diverges(*_):
        raise DivergenceError("the free run diverges", 1.0)

    monkeypatch.setitem(ESTIMATORS, "output_error", __name__)
    monkeypatch.setattr(sys.modules[__name__], "output_error", diverges, raising=False)
    told = CONFIG.identification_settings("linear", ("miso", "output_error"))
    found = identify_case(systems["linear"], records["linear"], told)
    assert found["output_error"].note.startswith("output_error finds nothing in linear: the free run diverges")
    assert found["output_error"].parameters == ()
    assert found["miso"].estimate is not None
    assert set(tables.parameter_table("linear", systems["linear"], found, told)["estimator"]) == {"miso"}


def test_every_estimator_but_miso_tells_a_relaxation_from_the_spring(make_model):
    """Both are linear in u: spectra of segments cannot part them, and what MI/SO gives diverges in a free run."""
    effects = {"linear_damping": {"c": 3.77}, "linear_stiffness": {"k": 355.3}}
    shape = {"relaxation": {"kr": 100.0, "relaxation.tau": 0.1}}
    model = make_model("r", {"inertia": {"m": 1.0}, **effects, **shape})
    record = make_record(model, settings("linear"))
    told = CONFIG.identification_settings("linear", ("miso", "output_error", "instrumental"))
    told = told.model_copy(update={"also_assumed": ""})
    found = identify_case(model, record, told)
    assert found["miso"].estimate["m"] < 0.0
    for name, share in (("output_error", 1e-4), ("instrumental", 0.02)):
        assert found[name].estimate["kr"] == pytest.approx(100.0, rel=share), name
