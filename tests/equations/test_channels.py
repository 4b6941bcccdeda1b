"""Columns beside force and motion: only those that a formula names take part, and no name stands for two things."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from study.equations.equations_of_motion import Equations
from study.equations.formulas import ExpressionError
from study.equations.free_run import needed_steps, predict_response, prepare
from study.equations.model import Model, free
from study.equations.model_file import parse_model
from study.equations.simulate import Integrator, simulate
from study.equations.term import Component, Term
from study.equations.terms import LIBRARY, custom
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.time_domain.free_run_fit import fit_free_run
from study.records.record import Record
from study.support.errors import StudyError

Floats = np.ndarray
Make = Callable[[str, Mapping[str, Mapping[str, float]]], Model]
DT, SAMPLES = 0.02, 600
UNASKED = ("u", "v", "m", "k", "z", "t", "c", "pi", "force2", "q_own", "z:relaxation", "relaxation.tau", "side of v")
LINEAR = {"inertia": {"m": 1.0}, "linear_damping": {"c": 3.77}, "linear_stiffness": {"k": 355.3}}
VARIED = {
    **LINEAR, "van_der_pol_damping": {"c3": 2e4}, "coulomb_friction": {"fc": 0.01},
    "relaxation": {"kr": 90.0, "relaxation.tau": 0.1}, "periodic_stiffness": {
        "km_cos": 20.0, "km_sin": 5.0, "periodic_stiffness.f_m": 0.8,
    },
}  # fmt: skip
OWN = "u*abs(v) + 1e-3*t*cos(pi*t)"


@pytest.fixture(scope="module")
def varied(make_model: Make) -> Model:
    """Memory, friction, time and differentiated shapes, and a formula of all that a formula can always name."""
    return make_model("varied", VARIED).with_term(free(custom("own", OWN)).with_values({"q_own": 0.5}))


@pytest.fixture(scope="module")
def bare(varied: Model, report_force: Floats) -> Record:
    return simulate(varied, report_force[:SAMPLES], DT, Integrator("rk4", 4))


@pytest.fixture(scope="module")
def crowded(bare: Record) -> Record:
    rng = np.random.default_rng(7)
    return bare.with_channels({name: 1e3 * rng.standard_normal(SAMPLES) for name in UNASKED})


def with_channel(model: Model, formula: str, value: float) -> Model:
    return model.with_term(free(custom("drawn", formula)).with_values({"q_drawn": value}))


def test_columns_nobody_asked_for_change_no_bit_of_a_free_run(varied: Model, bare: Record, crowded: Record) -> None:
    keys = ("m", "c3", "relaxation.tau", "q_own")
    values = {key: float(varied.values[key] or 0.0) for key in keys}
    one, other = (prepare(varied, r, keys, steps_per_sample=3) for r in (bare, crowded))
    assert other.drive.shape == one.drive.shape, "what no formula names is not even read"
    np.testing.assert_array_equal(other.motion.program.code, one.motion.program.code)
    for got, expected in zip(other.respond(values, (0.001, 0.0), 3), one.respond(values, (0.001, 0.0), 3), strict=True):
        np.testing.assert_array_equal(got, expected)
    assert needed_steps(varied, crowded) == needed_steps(varied, bare)


def test_columns_nobody_asked_for_change_no_bit_of_a_fit(systems: dict[str, Model], report_force: Floats) -> None:
    made = simulate(systems["duffing"], report_force[:SAMPLES], DT, Integrator("rk4", 4))
    noise = {name: np.random.default_rng(1).standard_normal(SAMPLES) for name in UNASKED}
    one, other = (fit_free_run(systems["duffing"], r, start={"c": 3.0}) for r in (made, made.with_channels(noise)))
    np.testing.assert_array_equal(other.values, one.values)
    assert other.iterations == one.iterations


@pytest.mark.parametrize("name", LIBRARY)
def test_columns_nobody_asked_for_change_no_bit_of_a_reverse_history(name: str, bare: Record, crowded: Record) -> None:
    term = LIBRARY[name]
    model = Model("one", (free(term).with_values({f"{name}.{p.name}": 0.004 for p in term.parameters}),))
    for got, expected in zip(*(histories(reverse_inputs(model), r) for r in (crowded, bare)), strict=True):
        np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize("method", ["rk4", "abm4"])
def test_columns_nobody_asked_for_change_no_bit_of_a_simulation(method: str, varied: Model, crowded: Record) -> None:
    settings = Integrator(method, 4)
    extra = {name: crowded[name] for name in UNASKED}
    plain, fed = (simulate(varied, crowded["force"], DT, settings, extra=e) for e in (None, extra))
    assert set(fed.extra) == set(UNASKED)
    for channel in plain.channels:
        np.testing.assert_array_equal(fed[channel], plain[channel])


def test_an_unused_column_may_have_gaps(systems: dict[str, Model]) -> None:
    gaps = {"note": np.full(50, np.nan)}
    assert np.all(np.isfinite(simulate(systems["linear"], np.ones(50), DT, extra=gaps)["displacement"]))


@pytest.mark.parametrize("name", ["temp", "k", "m", "z", "q_drawn", "force2"])
def test_a_named_column_is_meant_whatever_it_is_called(name: str, varied: Model, crowded: Record) -> None:
    """Also one called as a coefficient, or as the memory that a term of one's own does not have."""
    column = 0.5 + 0.1 * np.sin(np.arange(SAMPLES))
    model, plain = with_channel(varied, f"{name}*u", 50.0), with_channel(varied, "elsewhere*u", 50.0)
    record = crowded.with_channels({name: column, "elsewhere": column})
    np.testing.assert_array_equal(predict_response(model, record), predict_response(plain, record))
    fed = simulate(model, record["force"], DT, Integrator("rk4", 4), extra={name: column, "u": record["u"]})
    same = simulate(plain, record["force"], DT, Integrator("rk4", 4), extra={"elsewhere": column})
    np.testing.assert_array_equal(fed["displacement"], same["displacement"])
    history = histories(reverse_inputs(model), record)[-1]
    np.testing.assert_allclose(history, column * record["displacement"], rtol=1e-15)


@pytest.mark.parametrize("name", ["k", "m", "q_drawn"])
def test_a_model_file_may_name_a_column_that_is_called_as_a_coefficient(name: str, bare: Record) -> None:
    """It means the column, and a record without that column is refused in a sentence that names it."""
    text = "terms: [{{term: inertia, value: 1.0}}, {{term: linear_stiffness, value: 300.0}}, {entry}]"
    entry = '{{term: drawn, force: "{0}*u", value: 50.0}}'
    named, plain = (parse_model(text.format(entry=entry.format(n)), Path("rig.yaml")) for n in (name, "elsewhere"))
    column = 0.5 + 0.1 * np.sin(np.arange(SAMPLES))
    record = bare.with_channels({name: column, "elsewhere": column})
    np.testing.assert_array_equal(predict_response(named, record), predict_response(plain, record))
    with pytest.raises(ExpressionError, match=f"the formula of 'drawn' names '{name}'; it may name t, u, v"):
        predict_response(named, bare)


def test_a_named_column_drives_the_motion_both_ways(systems: dict[str, Model], report_force: Floats) -> None:
    """A stiffness that follows a measured temperature: fitted in free run, and read in reverse."""
    temp = 1.0 + 0.3 * np.sin(0.05 * np.arange(2048))
    model = with_channel(systems["linear"], "temp*u", 120.0)
    unasked = {name: np.full(2048, 1e3) for name in UNASKED}
    record = simulate(model, report_force[:2048], DT, Integrator("rk4", 8), extra={"temp": temp, **unasked})
    fit = fit_free_run(model, record, start={"q_drawn": 60.0}, steps_per_sample=8)
    assert fit.estimate["q_drawn"] == pytest.approx(120.0, rel=1e-7)
    history = histories(reverse_inputs(model), record)[1]
    np.testing.assert_allclose(history, temp * record["displacement"], rtol=1e-15)


def test_u_v_t_and_pi_are_never_columns(varied: Model, bare: Record, crowded: Record) -> None:
    last = [item for item in reverse_inputs(varied) if item.terms == ("own",)]
    u, v, t = bare["displacement"], bare["velocity"], bare.time
    np.testing.assert_allclose(histories(last, crowded)[0], u * np.abs(v) + 1e-3 * t * np.cos(np.pi * t), rtol=1e-12)
    assert custom("own", OWN).channels == ()
    assert custom("own", "temp*u + z*pi").channels == ("temp", "z")


def test_a_memory_is_no_column() -> None:
    assert all(term.channels == () for term in LIBRARY.values())
    odd = Term("odd", (Component("q", "temp*u*z", 1),), "", "", "", state="v - wind*z")
    assert odd.channels == ("temp", "wind")


def test_inputs_of_a_program_are_told_apart(varied: Model) -> None:
    model = with_channel(varied, "k*q_drawn + temp", 1.0)
    made = Equations(model)
    assert len(set(made.graph.names)) == 4 + 3 + 1 + len(model.values)


@pytest.mark.parametrize("channel", ["rain", "force", "displacement", "velocity", "z"])
def test_a_name_that_is_no_column_is_refused_both_ways(channel: str, varied: Model, bare: Record) -> None:
    model = with_channel(varied, f"{channel}*u", 1.0)
    record = bare.with_channels({"wind": bare.time})
    with pytest.raises(ExpressionError, match=f"the formula of 'drawn' names '{channel}'; it may name t, u, v, wind"):
        prepare(model, record)
    with pytest.raises(StudyError, match=f"needs the channel '{channel}'"):
        histories(reverse_inputs(model), record)
    with pytest.raises(ExpressionError, match=channel):
        simulate(model, bare["force"], DT)
