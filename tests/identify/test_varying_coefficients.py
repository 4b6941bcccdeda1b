"""Coefficients that vary, fitted in free run: curves, lines, steps, their smoothness and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from study.equations.model_file import parse_model
from study.equations.simulate import Integrator, simulate
from study.identify.time_domain.smoothness import smoothness
from study.records.excitation import Excitation, force
from study.records.record import Record
from study.support.errors import StudyError
from study.way_in.compare_records import compare_records

DT = 0.02
TRUE = "name: rig\nterms:\n  - {term: inertia, value: 1.0}\n  - {term: linear_damping, value: 1.6}\n"
BASE = "name: rig\nterms:\n  - inertia\n  - linear_damping\n  - linear_stiffness\n"


def recorded(terms, samples, noise, seed, **channels):
    model = parse_model(TRUE + "".join(f"  - {term}\n" for term in terms), Path("true.yaml"))
    acting = force(Excitation(), samples, DT, seed)
    made = simulate(model, acting, DT, Integrator("rk4", 8), extra=channels)
    shown = made["displacement"]
    shown = shown + noise * np.std(shown) * np.random.default_rng(seed).standard_normal(samples)
    return Record(DT, {"force": acting, "displacement": shown, **channels})


def fitted(record, entry):
    return compare_records([record], parse_model(f"{BASE}  - {entry}\n", Path("rig.yaml"))).comparison


def test_a_channel_that_schedules_the_stiffness_is_fitted_with_a_band_that_holds_it():
    time = DT * np.arange(4096)
    warmth = 20.0 + 10.0 * np.sin(2.0 * np.pi * time / 61.0)
    terms = "{term: linear_stiffness, value: 355.0}", "{term: sched, force: u*tanh((warmth-20)/6), value: -60.0}"
    found = fitted(recorded(terms, 4096, 0.03, 4, warmth=warmth), "{term: linear_stiffness, varies_with: warmth}")
    entry = found.fit.model.terms[-1]
    variation = entry.term.variation
    assert len(variation.knots) == 10
    assert found.prediction.error < 1.2 * found.prediction.floor
    at = [found.fit.keys.index(key) for key in ("k", *entry.symbols)]
    places = np.linspace(variation.knots[0], variation.knots[-1], 9)
    rows = np.hstack([np.ones((9, 1)), variation.basis(places)])
    errors = rows @ found.fit.values[at] - (355.0 - 60.0 * np.tanh((places - 20.0) / 6.0))
    spread = np.sqrt(np.diag(rows @ found.found.covariance[np.ix_(at, at)] @ rows.T))
    assert np.all(np.abs(errors) < 3.5 * spread)
    assert np.all(spread < 3.0)
    assert 3.0 < smoothness(found.fit, found.prepared)[0].unknowns <= 9.0


def test_what_drifts_evenly_takes_few_unknowns_however_many_knots():
    drift = "{term: linear_stiffness, varies_with: time, shape: line, knots: [0, 163.84], changes: [0, -60.0]}"
    record = recorded(("{term: linear_stiffness, value: 355.0}", drift), 8192, 0.2, 3)
    found = fitted(record, "{term: linear_stiffness, varies_with: time}")
    assert len(found.fit.model.terms[-1].term.variation.knots) == 12
    assert smoothness(found.fit, found.prepared)[0].unknowns < 4.0
    line = fitted(record, "{term: linear_stiffness, varies_with: time, shape: line}")
    change, key = line.fit.model.values["k_time"], line.found.error("k_time")
    assert abs(change + 60.0) < 3.5 * key


def test_a_step_is_dated():
    step = "{term: linear_damping, varies_with: time, shape: step, lasts: 0.1, step_at: 47.3, changes: 0.8}"
    record = recorded(("{term: linear_stiffness, value: 355.0}", step), 4096, 0.02, 5)
    found = fitted(record, "{term: linear_damping, varies_with: time, shape: step}")
    moment = "linear_damping_step_over_time.step_at"
    assert abs(found.fit.model.values[moment] - 47.3) < 3.5 * found.found.error(moment)
    assert found.found.error(moment) < 2.0
    assert next(c.unit for c in found.coefficients if c.key == moment) == "s"
    assert next(c.unit for c in found.coefficients if c.key == "c_step_time") == "N s/m"


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("{term: linear_stiffness, varies_with: still}", "still is 2 all along the record"),
        ("{term: linear_stiffness, varies_with: pin}", "no channel 'pin', with which linear_stiffness varies"),
        (
            "{term: linear_stiffness, varies_with: time, knots: [0, 5, 10], changes: [0, 1, 2]}",
            "has knots from 0 to 10, and time of record goes from 0.16 to 20.3",
        ),
    ],
)
def test_a_schedule_that_the_record_does_not_bear_is_refused(entry, words):
    record = recorded(("{term: linear_stiffness, value: 355.0}",), 1024, 0.0, 1, still=np.full(1024, 2.0))
    with pytest.raises(StudyError, match=words):
        fitted(record, entry)


def test_a_curve_is_one_input_of_the_reverse_system_however_short_the_record():
    time = DT * np.arange(1024)
    warmth = 20.0 + 10.0 * np.sin(2.0 * np.pi * time / 11.0)
    terms = "{term: linear_stiffness, value: 355.0}", "{term: sched, force: u*(warmth-20)/10, value: -60.0}"
    found = fitted(recorded(terms, 1024, 0.01, 4, warmth=warmth), "{term: linear_stiffness, varies_with: warmth}")
    assert [item.terms for item in found.forces[0].inputs][1:] == [("linear_stiffness_over_warmth",)]
    assert len(found.fit.model.terms[-1].symbols) == 9
    assert found.prediction.error < 1.2 * found.prediction.floor


def test_without_noise_the_band_has_what_the_knots_leave_out():
    time = DT * np.arange(4096)
    warmth = 20.0 + 10.0 * np.sin(2.0 * np.pi * time / 61.0)
    terms = "{term: linear_stiffness, value: 355.0}", "{term: sched, force: u*tanh((warmth-20)/2), value: -60.0}"
    found = fitted(recorded(terms, 4096, 0.0, 4, warmth=warmth), "{term: linear_stiffness, varies_with: warmth}")
    (one,) = found.varying
    away = np.abs(one.value - (355.0 - 60.0 * np.tanh((one.at - 20.0) / 2.0)))
    assert np.mean(away <= 1.96 * one.error) > 0.9
    assert np.max(one.error) < 10.0


def test_a_step_within_a_judged_block_is_dated_by_it():
    step = "{term: linear_stiffness, varies_with: time, shape: step, lasts: 0.05, step_at: 40.0, changes: 30.0}"
    record = recorded(("{term: linear_stiffness, value: 355.0}", step), 4096, 0.02, 5)
    found = fitted(record, "{term: linear_stiffness, varies_with: time, shape: step}")
    (one,) = found.varying
    moment, error = one.step
    assert abs(moment - 40.0) < 3.0 * error
    assert error < 0.5
