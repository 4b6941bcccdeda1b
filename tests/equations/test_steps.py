"""Machine code of free runs, against the loop over instructions that every other evaluation uses."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from study.equations import kernels
from study.equations.free_run import FreeRun, prepare
from study.equations.model import Model, with_registers
from study.records.record import Record
from tests.equations.test_free_run import EFFECTS, numbers, with_effect

Floats = NDArray[np.float64]
Make = Callable[[str, Mapping[str, Mapping[str, float]]], Model]
DT = 0.01


def slopes(run: FreeRun, values: dict[str, float], time: float, row: int, state: Floats) -> Floats:
    """Derivatives of a state beside its sensitivities, shape (states, columns), one register after the other."""
    variation = run.variation
    states, known = variation.states, variation.slots.shape[1] - variation.states
    program = with_registers(run.program, values)
    point = np.array([[state[0, 0], state[1, 0], time, *run.drive[row], *state[2:, 0]]])
    out = np.empty((1, variation.slots.size))
    columns = np.arange(point.shape[1], dtype=np.int64)
    kernels.evaluate(
        program.code, program.first, program.registers.copy(), columns, point, variation.slots.ravel(), out
    )
    slope, by_state, by_key = np.split(out.reshape(variation.slots.shape), [1, 1 + states], axis=1)
    result = np.zeros_like(state)
    result[0] = state[1]
    result[1:, 0] = slope[:, 0]
    result[1:, 1:known] = by_key
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


@pytest.mark.parametrize("effect", [name for name in EFFECTS if name != "coulomb_friction"])
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
