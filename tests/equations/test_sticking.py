"""Friction whose size depends on the motion, stepped exactly where it holds and lets go: against SciPy's events."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from study.equations.free_run import predict_response
from study.equations.model import Model
from study.records.record import Record

Floats = NDArray[np.float64]
Make = Callable[[str, Mapping[str, Mapping[str, float]]], Model]
DT, SAMPLES = 0.02, 600
TIME = np.arange(0.0, SAMPLES) * DT
C, K, RELEASED = 1.0, 355.3, 0.004  # of a mass of one, and where it is let go
CASES: dict[str, dict[str, dict[str, float]]] = {
    "stick_slip": {"coulomb_friction": {"fc": 0.15}, "stribeck_friction": {"fs": 0.25, "stribeck_friction.v_s": 0.02}},
    "falls_to_nothing": {"stribeck_friction": {"fs": 0.4, "stribeck_friction.v_s": 0.02}},
    "holds_itself": {"load_dependent_friction": {"fu": 400.0}},  # beyond the spring's 355
    "with_the_load": {"coulomb_friction": {"fc": 0.1}, "load_dependent_friction": {"fu": 100.0}},
}


def applied(time: Floats) -> Floats:
    """Two sines that close on themselves, so that nothing is lost between the samples."""
    turn = 2.0 * np.pi / (SAMPLES * DT)
    return np.asarray(0.9 * np.sin(3 * turn * time) + 0.35 * np.sin(16 * turn * time + 1.0), dtype=np.float64)


def by_events(friction: Callable[[float, float], float]) -> Floats:
    """Displacement and velocity where phases of slip and of rest are integrated one by one, shape (samples, 2)."""
    out, state, now, side = np.zeros((SAMPLES, 2)), np.array([RELEASED, 0.0]), 0.0, 0.0
    out[0] = state

    def push(time: float, u: float) -> float:
        return float(applied(np.array(time))) - K * u

    def spare(time: float, y: Floats) -> float:
        return abs(push(time, y[0])) - friction(y[0], 0.0)

    while now < TIME[-1] - 1e-12:
        if side == 0.0 and spare(now, state) > 0.0:
            side = float(np.sign(push(now, state[0])))

        def rate(time: float, y: Floats, side: float = side) -> list[float]:
            resisting = C * y[1] + side * friction(y[0], abs(y[1]))
            return [y[1], push(time, y[0]) - resisting] if side else [0.0, 0.0]

        def turns(time: float, y: Floats, side: float = side, begun: float = now) -> float:
            return (y[1] if time > begun + 1e-4 else side) if side else spare(time, y)

        turns.terminal, turns.direction = True, -side or 1.0  # type: ignore[attr-defined]
        found = solve_ivp(
            rate, (now, TIME[-1]), state, events=turns, rtol=1e-9, atol=1e-12, max_step=0.01, dense_output=True
        )  # fmt: skip
        first, last = np.searchsorted(TIME, [now + 1e-12, found.t[-1] + 1e-12])
        if last > first and found.sol is not None:
            out[first:last] = np.asarray(found.sol(TIME[first:last])).T
        now, state = float(found.t[-1]), np.array([found.y[0, -1], 0.0])
        side = float(np.sign(push(now + 1e-9, state[0]))) if side == 0.0 else 0.0
    return out


@pytest.mark.parametrize("name", CASES)
def test_friction_holds_and_lets_go_where_it_should(name: str, make_model: Make) -> None:
    values = {key: value for own in CASES[name].values() for key, value in own.items()}
    dry, peak, load = (values.get(key, 0.0) for key in ("fc", "fs", "fu"))
    falling = values.get("stribeck_friction.v_s", 1.0)
    exact = by_events(lambda u, speed: dry + peak * np.exp(-((speed / falling) ** 2)) + load * abs(u))
    linear = {"inertia": {"m": 1.0}, "linear_damping": {"c": C}, "linear_stiffness": {"k": K}}
    model, record = make_model(name, {**linear, **CASES[name]}), Record(DT, {"force": applied(TIME)})
    u, v = (
        predict_response(model, record, response=r, steps_per_sample=16, initial=(RELEASED, 0.0))
        for r in ("displacement", "velocity")
    )
    assert np.linalg.norm(u - exact[:, 0]) < 2e-5 * np.linalg.norm(exact[:, 0])
    held = exact[:, 1] == 0.0
    assert np.mean(held) > 0.3
    assert np.mean(np.abs(v[held]) < 1e-12 * np.std(v)) > 0.99
