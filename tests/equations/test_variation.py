"""Coefficients that vary: their functions, their entries in a file, and their exact forces."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.equations import terms
from study.equations.free_run import prepare
from study.equations.model import Model, free
from study.equations.model_file import format_model, parse_model
from study.equations.simulate import Integrator, simulate
from study.equations.variation import Variation, covered, laid, roughness, varying
from study.support.errors import StudyError

LINEAR = "terms:\n  - {term: inertia, value: 1.0}\n  - {term: linear_stiffness, value: 300.0}\n"


def stiffness(**how):
    return varying(Variation(terms.get("linear_stiffness"), **how))


def read(entry, more=""):
    return parse_model(f"name: rig\n{LINEAR}{more}  - {entry}\n", Path("rig.yaml"))


@pytest.mark.parametrize("count", [2, 3, 4, 9])
def test_changes_on_a_line_make_a_line_and_the_curve_is_constant_beyond_its_knots(count):
    knots = np.linspace(2.0, 10.0, count)
    variation = stiffness(along="time", knots=tuple(knots.tolist())).variation
    along = np.linspace(0.0, 12.0, 61)
    curve = variation.basis(along) @ (knots[1:] - knots[0])
    assert np.allclose(curve, np.clip(along, 2.0, 10.0) - 2.0, atol=1e-12)


def test_a_curve_is_twice_smooth_and_passes_the_changes_at_both_ends():
    variation = stiffness(along="time", knots=tuple(np.linspace(0.0, 1.0, 6).tolist())).variation
    amounts = np.array([1.0, -2.0, 0.5, 3.0, -1.0])
    along = np.linspace(0.0, 1.0, 2001)
    curve = variation.basis(along) @ amounts
    assert abs(curve[0]) < 1e-12
    assert curve[-1] == pytest.approx(amounts[-1], abs=1e-12)
    bend = np.diff(curve, 2) / (along[1] - along[0]) ** 2
    assert np.max(np.abs(np.diff(bend))) < 0.02 * np.max(np.abs(bend))  # no jump of the second derivative
    assert np.allclose(bend[[0, -1]], 0.0, atol=0.02 * np.max(np.abs(bend)))  # natural ends


def test_a_step_is_a_ramp_that_lasts_as_long_as_it_says():
    variation = stiffness(along="time", shape="step", lasts=0.5).variation
    found = variation.basis(np.array([0.0, 2.75, 3.0, 3.25, 9.0]), step_at=3.0)[:, 0]
    assert np.allclose(found, [0.0, 0.0, 0.5, 1.0, 1.0])


def test_second_differences_count_the_first_knot_where_nothing_changes():
    term = stiffness(along="time", knots=(0.0, 1.0, 2.0, 3.0))
    assert np.allclose(roughness(term) @ [1.0, 2.0, 3.0], 0.0)
    assert np.allclose(roughness(term) @ [0.0, 0.0, 1.0], [0.0, 1.0])
    assert len(roughness(stiffness(along="time", knots=(0.0, 1.0)))) == 0


@pytest.mark.parametrize("name", [n for n in terms.LIBRARY if n != "inertia"])
def test_what_a_coefficient_changes_by_acts_as_if_it_were_larger(name):
    # All changes at one: beyond the last knot the coefficient is larger by one from the start to the end.
    term = terms.get(name)
    entry = free(term)
    entry = replace(entry, coefficients=(3.0,) * len(entry.coefficients), parameters=(0.5,) * len(entry.parameters))
    base = parse_model(f"{LINEAR}", Path("rig.yaml"))
    base = base if name in base else base.with_term(entry)
    own = next(e for e in base.terms if e.term.name == name)
    change = free(varying(Variation(term, "time", knots=(-2.0, -1.0))))
    change = replace(change, coefficients=(0.7,) * len(change.coefficients), parameters=own.parameters)
    larger = {key: (value or 0.0) + 0.7 for key, value in own.values.items() if key in own.symbols}
    force = np.sin(np.arange(400) * 0.3)
    one, other = (
        simulate(m, force, 0.02, Integrator("rk4", 8))["displacement"]
        for m in (base.with_term(change), base.with_values(larger))
    )
    assert np.allclose(one, other, atol=1e-9 * np.max(np.abs(other)))


def test_derivatives_by_changes_and_by_the_moment_of_a_step_are_exact():
    entries = (
        "{term: linear_stiffness, varies_with: warmth, knots: [0, 1, 2], changes: [0, -20, 40]}",
        ("{term: linear_damping, varies_with: time, shape: step, lasts: 1.0, step_at: 4.0013, changes: 2.0}"),
    )
    model = read(entries[0], f"  - {{term: linear_damping, value: 1.0}}\n  - {entries[1]}\n")
    warmth = 1.0 + np.sin(np.arange(600) * 0.011)
    force = np.random.default_rng(3).standard_normal(600)
    record = simulate(model, force, 0.02, Integrator("rk4", 4), extra={"warmth": warmth})
    keys = ("k_warmth_2", "k_warmth_3", "c_step_time", "linear_damping_step_over_time.step_at")
    run = prepare(model, record, keys, steps_per_sample=4)
    values = {key: model.numbers()[key] for key in keys}
    exact = run.respond(values, (0.0, 0.0))[1][:, 0]
    for i, key in enumerate(keys):
        d = 1e-5 * max(abs(values[key]), 1.0)
        up, down = (run.respond(values | {key: values[key] + s * d}, (0.0, 0.0))[0][:, 0] for s in (1.0, -1.0))
        assert np.allclose(exact[:, i], (up - down) / (2.0 * d), atol=2e-4 * np.max(np.abs(exact[:, i])))


@pytest.mark.parametrize(("side", "expected"), [("v > 0", [2.0, 0.0]), ("v < 0", [0.0, -2.0])])
def test_friction_of_one_direction_acts_in_that_direction_alone(side, expected):
    from study.identify.frequency_domain.inputs import input_history, reverse_inputs
    from study.records.record import Record

    term = varying(Variation(terms.get("coulomb_friction"), "band", knots=(0.0, 2.0), side=side))
    (item,) = reverse_inputs(Model("one", (free(term),)))
    channels = {"displacement": np.zeros(2), "velocity": np.array([3.0, -3.0]), "band": np.array([2.0, 2.0])}
    assert np.allclose(2.0 * input_history(item, Record(0.1, channels)), expected)


ENTRIES = (
    "{term: linear_stiffness, varies_with: time, shape: curve}",
    "{term: linear_stiffness, varies_with: pin, shape: curve, knots: [0.0, 1.0, 2.0], changes: [0.0, 1.0, 2.5]}",
    "{term: linear_stiffness, varies_with: time, shape: line, knots: [0.0, 60.0], changes: [0.0, -35.0]}",
    "{term: linear_stiffness, varies_with: time, shape: step, lasts: 0.1, step_at: 31.2, changes: -35.0}",
    "{term: linear_stiffness, varies_with: band, shape: curve, only: v > 0}",
    "{term: linear_stiffness, varies_with: pin, shape: curve, knots: [0.0, 1.0], changes: [0.0, 2.5], held: false}",
    "{term: linear_stiffness, varies_with: time, shape: step, lasts: 1.0, step_at: 3.0, changes: -3.0, held: false}",
)


@pytest.mark.parametrize("entry", ENTRIES)
def test_an_entry_reads_back_as_it_was_written(entry):
    model = read(entry)
    text = format_model(model)
    assert text.splitlines()[-1] == f"  - {entry}"
    assert parse_model(text, Path("rig.yaml")) == model


def test_two_coefficients_of_one_term_have_changes_by_name():
    more = "  - {term: periodic_stiffness, f_m: 1.0, amplitude: 2.0, phase: 0.0}\n"
    entry = (
        "{term: periodic_stiffness, varies_with: time, shape: line, knots: [0.0, 9.0], f_m: 1.0, "
        "changes: {km_cos: [0.0, 1.0], km_sin: [0.0, 2.0]}}"
    )
    model = read(entry, more)
    assert model.values["km_cos_time"] == 1.0
    assert model.values["km_sin_time"] == 2.0
    assert parse_model(format_model(model), Path("rig.yaml")) == model


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("{term: linear_damping, varies_with: time}", "expected linear_damping without 'varies_with' beside it"),
        ("{term: inertia, varies_with: time}", "another effect to vary"),
        ("{term: linear_stiffness, varies_with: 3}", "expected 'time' or the name of a channel"),
        ("{term: linear_stiffness, varies_with: a b}", "channel of letters, digits"),
        ("{term: linear_stiffness, varies_with: time, shape: wave}", "expected curve, line, step"),
        ("{term: linear_stiffness, varies_with: time, only: t > 0}", "expected one of v > 0, v < 0, u > 0, u < 0"),
        ("{term: linear_stiffness, varies_with: time, knots: [0, 1, 3]}", "equally far apart"),
        ("{term: linear_stiffness, varies_with: time, knots: 4}", "expected numbers such as"),
        ("{term: linear_stiffness, varies_with: time, shape: line, knots: [0, 1, 2]}", "expected 2"),
        ("{term: linear_stiffness, varies_with: time, changes: [0, 1]}", "expected both, or neither"),
        ("{term: linear_stiffness, varies_with: time, knots: [0, 1], changes: [1, 2]}", "the first 0"),
        ("{term: linear_stiffness, varies_with: time, knots: [0, 1], changes: [0]}", "each of the 2 knots"),
        ("{term: linear_stiffness, varies_with: time, shape: step, lasts: -1}", "a while above zero"),
        ("{term: linear_stiffness, varies_with: time, shape: step, knots: [0, 1]}", "varies in a step"),
        ("{term: linear_stiffness, varies_with: time, value: 3}", "unknown key 'value'"),
    ],
)
def test_what_no_coefficient_can_do_is_refused_in_a_sentence(entry, words):
    with pytest.raises(StudyError, match=words):
        read(entry)


def test_what_does_not_change_gives_no_knots_and_what_leaves_them_is_not_covered():
    with pytest.raises(StudyError, match="pin is 2 all along the record; expected one that changes"):
        laid(stiffness(along="pin"), np.full(9, 2.0), 10, 0.1)
    variation = laid(stiffness(along="pin"), np.array([1.0, 4.0]), 4, 0.1).variation
    assert variation.knots == (1.0, 2.0, 3.0, 4.0)
    assert covered(variation, np.array([1.0, 3.9]))
    assert not covered(variation, np.array([1.0, 4.5]))
