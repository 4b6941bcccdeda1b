"""What a fitted model leaves is held against general shapes of the motion; two effects against one and other two."""

import numpy as np
import pytest

from study import trials
from study.compare import dependence
from study.compare.comparison import compare
from study.diagnose import candidates, constancy, set_screening, set_search
from study.diagnose.ranking import rank
from study.equations.model import free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.identify.time_domain import shape_search
from study.identify.time_domain.fit_model import fit_model
from study.records.excitation import Excitation, force
from study.records.prepared import prepare_record
from study.records.record import Record
from study.support.errors import DivergenceError


def left_by(model, record):
    prepared = prepare_record(record)
    return dependence.unexplained(shape_search.baseline(fit_model(model, prepared), prepared))


def test_an_imitator_under_noise_leaves_a_shape_and_the_truth_leaves_none():
    """u|v| and u^2 v differ by a hundredth of the noise's power; the truth is fitted as the imitator is."""
    made = trials.make_trial(94181, ("van_der_pol_damping",), 0.05, "displacement")
    imitator = left_by(made.believed.with_term(free(get("displacement_damping"))), made.record)
    truth = left_by(made.believed.with_term(free(get("van_der_pol_damping"))), made.record)
    assert 0.003 < dependence.significant_share(imitator, 1e-3) < 0.03
    assert dependence.significant_share(truth, 1e-2) == 0.0
    assert max(found.gain.explained for found in dependence.families(truth)) < 0.01


def test_a_shape_is_seen_in_noise_as_rarely_as_its_level_says(systems):
    clean = simulate(systems["linear"], force(Excitation(), 2048, 0.02, seed=5), 0.02, Integrator("rk4", 8))
    rng = np.random.default_rng(6)
    noise = 0.2 * np.std(clean["displacement"]) * rng.standard_normal((12, 2048))
    model = systems["linear"].with_values(dict.fromkeys(systems["linear"].values))
    records = [Record(clean.dt, {"force": clean["force"], "displacement": clean["displacement"] + n}) for n in noise]
    alarms = [dependence.significant_share(left_by(model, record), 0.1) > 0.0 for record in records]
    assert np.mean(alarms) <= 0.25  # a tenth is meant: more than three of twelve has a chance of 3 %


def test_few_strong_blocks_do_not_make_a_coefficient_move():
    """Three blocks hold half of the sensitivity's power: their own scatter says little of their errors."""
    rng = np.random.default_rng(7)
    swell = np.ones(64 * constancy.BLOCK)
    swell[: 3 * constancy.BLOCK] = 5.0
    curves = [
        constancy.along_amplitude(swell * rng.standard_normal(len(swell)), rng.standard_normal(len(swell)), 1.0)
        for _ in range(300)
    ]
    assert np.mean([curve.p_value() < 0.01 for curve in curves]) < 0.03


@pytest.fixture(scope="module")
def two_effects():
    made = trials.make_trial(93001, ("quadratic_stiffness", "quadratic_damping"), 0.01, "displacement")
    prepared = prepare_record(made.record)
    comparison = compare(made.believed, prepared)
    base = shape_search.baseline(comparison.fit, prepared)
    terms = [
        free(get(n)) for n in ("quadratic_stiffness", "quadratic_damping", "cubic_stiffness", "bilinear_stiffness")
    ]
    tried = candidates.try_all(terms, base)
    return made, prepared, base, rank(tried, comparison)


def test_both_of_two_effects_are_the_best_set_of_two(two_effects):
    made, _, base, rows = two_effects
    search = set_search.searched(base, rows, [], [r.entry for r in rows], lambda _: True)
    assert set(search.sets(2)[0].names) == set(made.hidden)
    assert not search.sets(3)  # two leave nothing


def test_each_way_of_screening_names_the_two(two_effects):
    made, _, base, rows = two_effects
    offered = {r.name: next(t for t in r.fit.model.terms if t.name == r.name) for r in rows}
    for found in (
        set_screening.by_sensitivities(None, offered, base, [2], 1),
        set_screening.by_the_reverse_system(offered, base, [2], 1),
    ):
        assert found[2][0].names == set(made.hidden)
        assert all(value is not None for value in found[2][0].model.values.values())


def test_a_candidate_whose_fits_all_lost_the_motion_begins_in_pieces():
    made = trials.make_trial(97072, ("quintic_stiffness",), 0.05, "displacement")
    prepared = prepare_record(made.record)
    fit = fit_model(made.believed, prepared)
    tried = candidates.attempt(free(get("quintic_stiffness")), shape_search.baseline(fit, prepared))
    assert tried is not None
    size = np.std(made.record["displacement"])
    assert np.std(fit.residual) > 0.8 * size
    assert np.std(tried.prediction.residual) < 0.3 * size


@pytest.mark.parametrize("end", ["an error", "no number"])
def test_shapes_whose_derivatives_diverge_pass_through_the_linear_system(monkeypatch, systems, records, end):
    """Two trials (560253, 780255) ended so: what a seventh power adds grew without end, the motion not."""
    prepared = prepare_record(records["duffing"])
    base = shape_search.baseline(fit_model(systems["linear"].with_values({"c": None, "k": None}), prepared), prepared)
    exact = dependence.unexplained(base)
    real = dependence.with_states

    def diverging(fit, prepared):
        if len(fit.keys) == len(base.fit.keys):
            return real(fit, prepared)
        if end == "an error":
            raise DivergenceError("the free run diverged", 0.0)
        return np.full((len(fit.residual), len(fit.keys) + 2), np.nan)

    monkeypatch.setattr(dependence, "with_states", diverging)
    passed = dependence.unexplained(base)
    assert exact.shapes
    assert not passed.shapes
    found, again = ({f.family: f.gain.explained for f in dependence.families(left)} for left in (exact, passed))
    assert found["displacement"] > 0.5
    assert again["displacement"] > 0.5
