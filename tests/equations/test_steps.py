"""Machine code of free runs, against the loop over instructions that every other evaluation uses."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from study.equations import kernels
from study.equations.free_run import FreeRun, prepare
from study.equations.model import Model, ModelTerm, free
from study.equations.place import Place
from study.equations.term import Component, Term
from study.equations.terms import get
from study.records.record import Record, Sensor, record_of
from tests.equations.test_free_run import EFFECTS, LINEAR, numbers, with_effect

Floats = NDArray[np.float64]
Make = Callable[[str, Mapping[str, Mapping[str, float]]], Model]
DT = 0.01


def slopes(run: FreeRun, values: dict[str, float], time: float, row: int, state: Floats) -> Floats:
    """Derivatives of a state beside its sensitivities, shape (states, columns), one register after the other."""
    motion, states = run.motion, run.states
    program = replace(motion.program.with_inputs(values), outputs=motion.slots.ravel())
    columns = dict(zip(program.inputs, [time, *run.drive[row], *state[:, 0]], strict=False))
    out = kernels.evaluate(program, {name: np.array([x]) for name, x in columns.items()}, 1)
    slope, by_state, by_key = np.split(out.reshape(motion.slots.shape), [1, 1 + states], axis=1)
    result = np.zeros_like(state)
    result[0] = state[1]
    result[1:, 0] = slope[:, 0]
    result[1:, 1 : 1 + by_key.shape[1]] = by_key
    result[1:, 1:] += by_state @ state[:, 1:]
    return result


def runge_kutta(run: FreeRun, values: dict[str, float], state: Floats) -> Floats:
    h = run.dt / run.steps
    for step in range(run.steps * (run.samples - 1)):
        k1 = slopes(run, values, step * h, 2 * step, state)
        k2 = slopes(run, values, step * h + h / 2, 2 * step + 1, state + h / 2 * k1)
        k3 = slopes(run, values, step * h + h / 2, 2 * step + 1, state + h / 2 * k2)
        k4 = slopes(run, values, step * h + h, 2 * step + 2, state + h * k3)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return state


@pytest.mark.parametrize("effect", [name for name in EFFECTS if "friction" not in name])
def test_steps_are_those_of_the_instructions_one_by_one(make_model: Make, effect: str) -> None:
    model = with_effect(make_model, effect)
    rng = np.random.default_rng(1)
    record = Record(DT, {"force": 0.3 * rng.standard_normal(6), "displacement": np.zeros(6)}, {}, "steps")
    run = prepare(model, record, tuple(model.values))
    values = numbers(model)
    initial = np.array([0.003, -0.02, *([0.1] if run.states > 2 else [])])
    begin = np.zeros((run.states, 1 + len(values) + run.states))
    begin[:, 0] = initial
    begin[:, 1 + len(values) :] = np.eye(run.states)
    end = runge_kutta(run, values, begin)
    response, jacobian = (x[:, 0] for x in run.respond(values, initial, run.states))
    assert response[-1] == pytest.approx(end[0, 0], rel=1e-12)
    np.testing.assert_allclose(jacobian[-1], end[0, 1:], rtol=1e-10, atol=1e-13 * float(np.max(np.abs(end[0, 1:]))))


def test_a_rate_that_is_a_state_is_read_before_the_step_overwrites_it(make_model: Make) -> None:
    """dz/dt = v: its slope, and what multiplies the velocity's derivative, lie in registers that a stage writes to."""
    term = Term("travel", (Component("q", "z"),), "", "", "", state="v")
    model = make_model("travelled", LINEAR).with_term(free(term).with_values({"q": 40.0}))
    record = Record(DT, {"force": np.sin(np.arange(200.0)), "displacement": np.zeros(200)}, {}, "travelled")
    stiffer = make_model("stiffer", {**LINEAR, "linear_stiffness": {"k": LINEAR["linear_stiffness"]["k"] + 40.0}})
    motion, slopes = (
        prepare(m, record, ("m", "c")).respond(numbers(m), (1e-3, 0.02, 1e-3)[: 2 + len(m.states)], 2)
        for m in (model, stiffer)
    )
    np.testing.assert_allclose(motion[0], slopes[0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(motion[1][..., :2], slopes[1][..., :2], rtol=1e-9, atol=1e-12)


def test_wide_rows_hold_the_numbers_of_narrow_ones() -> None:
    """Beyond twelve columns a row goes by way of the memory; every derivative stays the same to the last bit."""
    names = ("a", "b", "c", "d")
    entries = [ModelTerm(get("inertia"), (1.0,), (), Place("at", (name,))) for name in names]
    for below, name in zip(("ground", *names[:-1]), names, strict=True):
        place = Place("between", (below, name))
        entries += [
            ModelTerm(get(t), (v,), (), place) for t, v in (("linear_stiffness", 300.0), ("cubic_damping", 3.0))
        ]
    model = Model("chain", tuple(entries), names, (("shaker", "b"),))
    record = record_of(DT, {"shaker": np.sin(np.arange(60.0))}, {})
    keys, sensors = tuple(model.values), [Sensor("d", "displacement"), Sensor("a", "acceleration")]
    start = 1e-3 * np.arange(8.0)
    response, jacobian = prepare(model, record, keys, sensors=sensors).respond(numbers(model), start, 8)
    assert jacobian.shape == (60, 2, len(keys) + 8)
    for i, key in enumerate(keys):
        alone, own = prepare(model, record, (key,), sensors=sensors).respond(numbers(model), start)
        np.testing.assert_array_equal(alone, response)
        np.testing.assert_array_equal(own[..., 0], jacobian[..., i])
