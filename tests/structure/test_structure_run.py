"""Free runs of structures against independent solutions, and their exact derivatives."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from study.equations.free_run import prepare
from study.equations.linear_part import modes_of
from study.equations.model import Model, ModelTerm
from study.equations.model_file import read_model
from study.equations.place import HERE, Place
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.records.record import Sensor

ROOT = Path(__file__).parents[2]


def at(name, where, *values):
    return ModelTerm(
        get(name), values[: len(get(name).symbols)], values[len(get(name).symbols) :], Place("at", (where,))
    )


def between(name, first, second, *values):
    return replace(at(name, first, *values), place=Place("between", (first, second)))


def two_masses(*more, coupling=0.0):
    terms = [
        at("inertia", "a", 2.0), at("inertia", "b", 1.0),
        between("linear_stiffness", "ground", "a", 300.0), between("linear_stiffness", "a", "b", 200.0),
        between("linear_damping", "ground", "a", 1.0), between("linear_damping", "a", "b", 0.6),
    ]  # fmt: skip
    if coupling:
        terms.append(ModelTerm(get("inertia"), (coupling,), (), Place("couples", ("a", "b"))))
    return Model("two", (*terms, *more), ("a", "b"), (("shaker", "a"),))


def slow_force(samples, dt, size=30.0):
    """A force that closes on itself and is the same whoever interpolates it."""
    t = dt * np.arange(samples)
    period = samples * dt
    return size * sum(np.sin(2.0 * np.pi * k / period * t + k**2) for k in (3, 7, 12, 19, 25))


def force_at(t, samples, dt, size=30.0):
    return size * sum(np.sin(2.0 * np.pi * k / (samples * dt) * t + k**2) for k in (3, 7, 12, 19, 25))


N, DT = 600, 0.02


def test_motion_agrees_with_scipy():
    model = two_masses(between("cubic_stiffness", "a", "b", 4e4), at("quadratic_damping", "b", 3.0), coupling=0.5)
    record = simulate(model, {"shaker": slow_force(N, DT)}, DT, Integrator("rk4", 8), initial=(0.01, -0.02, 0.1, 0.0))
    mass = np.array([[2.0, 0.5], [0.5, 1.0]])

    def slope(t, x):
        u, v = x[:2], x[2:]
        d, dv = u[1] - u[0], v[1] - v[0]
        spring = 200.0 * d + 0.6 * dv + 4e4 * d**3
        drag = 3.0 * v[1] * abs(v[1])
        f = [force_at(t, N, DT) - 300.0 * u[0] - v[0] + spring, -spring - drag]
        return [*v, *np.linalg.solve(mass, f)]

    times = DT * np.arange(N)
    solved = solve_ivp(slope, (0.0, times[-1]), [0.01, -0.02, 0.1, 0.0], "DOP853", times, rtol=1e-11, atol=1e-14).y
    for i, sensor in enumerate([Sensor("a", "displacement"), Sensor("b", "displacement"), Sensor("a", "velocity")]):
        assert np.max(np.abs(record.motions[sensor] - solved[i])) < 1e-5 * np.std(solved[i])


def test_friction_at_two_places_agrees_with_a_steep_slope_through_zero():
    """Both places stop and let go, sometimes while the other is held; the reference is stiff instead of cut."""
    model = two_masses(between("coulomb_friction", "a", "b", 6.0), between("coulomb_friction", "ground", "a", 25.0))
    record = simulate(model, {"shaker": slow_force(N, DT)}, DT, Integrator("rk4", 8))
    steep = 1e-6

    def slope(t, x):
        u, v = x[:2], x[2:]
        joint = 200.0 * (u[1] - u[0]) + 0.6 * (v[1] - v[0]) + 6.0 * np.tanh((v[1] - v[0]) / steep)
        base = 300.0 * u[0] + v[0] + 25.0 * np.tanh(v[0] / steep)
        return [*v, (force_at(t, N, DT) - base + joint) / 2.0, -joint / 1.0]

    times = DT * np.arange(N)
    solved = solve_ivp(slope, (0.0, times[-1]), np.zeros(4), "Radau", times, rtol=1e-7, atol=1e-9).y
    held = np.abs(record.motions[Sensor("a", "velocity")]) < 1e-12
    assert 0.02 < np.mean(held) < 0.9
    for i, sensor in enumerate([Sensor("a", "displacement"), Sensor("b", "displacement")]):
        assert np.max(np.abs(record.motions[sensor] - solved[i])) < 2e-4 * np.std(solved[i])


@pytest.mark.parametrize(
    "more",
    [
        (between("cubic_stiffness", "a", "b", 4e4), at("quadratic_damping", "b", 3.0)),
        (between("coulomb_friction", "a", "b", 6.0), between("coulomb_friction", "ground", "a", 25.0)),
        (between("hysteresis", "a", "b", 80.0, 20.0, 5.0), at("relaxation", "b", 50.0, 0.1)),
    ],
    ids=["springs", "friction", "memory"],
)
def test_derivatives_are_those_of_the_run(more):
    model = two_masses(*more, coupling=0.4)
    force = slow_force(300, DT)
    record = simulate(model, {"shaker": force}, DT, Integrator("rk4", 8))
    keys, start = tuple(model.values), np.array([0.01, -0.02, 0.1, 0.05])
    sensors = [Sensor("a", "displacement"), Sensor("b", "acceleration")]
    run = prepare(model, record, keys, sensors=sensors, steps_per_sample=4)
    values = model.numbers()
    _, jacobian = run.respond(values, start, run.states)
    for i, key in enumerate(keys):
        h = 1e-6 * values[key]
        up, down = (run.respond(values | {key: values[key] + s}, start)[0] for s in (h, -h))
        slope = (up - down) / (2.0 * h)
        away = np.abs(slope - jacobian[:, :, i]) / np.std(slope, axis=0)
        assert np.quantile(away, 0.98) < 1e-3  # an acceleration jumps at a switch, whose sample may fall on either side
    step = np.array([0.0, 1e-7, 0.0, 0.0])
    slope = (run.respond(values, start + step)[0] - run.respond(values, start - step)[0]) / 2e-7
    assert np.quantile(np.abs(slope - jacobian[:, :, len(keys) + 1]) / np.std(slope), 0.98) < 1e-3


def test_one_coordinate_moves_as_a_model_without_coordinates():
    terms = [
        at("inertia", "mass", 1.0), at("linear_damping", "mass", 3.77), at("linear_stiffness", "mass", 355.3),
        at("coulomb_friction", "mass", 0.4), at("one_sided_contact", "mass", 900.0, 0.01),
    ]  # fmt: skip
    structure = Model("one", tuple(terms), ("mass",), (("shaker", "mass"),))
    plain = Model("one", tuple(replace(t, place=HERE) for t in terms))
    force = slow_force(N, DT, 3.0)
    from study.equations.free_run import predict_response

    record = simulate(plain, force, DT, Integrator("rk4", 8))
    wanted = predict_response(plain, record, steps_per_sample=8)
    found = simulate(structure, {"shaker": force}, DT, Integrator("rk4", 8)).motions[Sensor("mass", "displacement")]
    assert np.max(np.abs(found - wanted)) < 1e-7 * np.std(wanted)


def test_modes_of_a_chain_are_those_in_closed_form():
    """Equal masses and springs between two walls: omega_j = 2 sqrt(k/m) sin(j pi / (2 (n + 1)))."""
    n, m, k = 5, 2.0, 800.0
    names = [f"x{i}" for i in range(n)]
    terms = [at("inertia", name, m) for name in names]
    terms += [between("linear_stiffness", a, b, k) for a, b in zip(["ground", *names], [*names, "ground"], strict=True)]
    terms += [
        between("linear_damping", a, b, 0.002 * k) for a, b in zip(["ground", *names], [*names, "ground"], strict=True)
    ]
    keys = (*(f"k[{t.place.label}]" for t in terms if t.term.name == "linear_stiffness"),)
    modes = modes_of(Model("chain", tuple(terms), tuple(names)), keys, np.full((len(keys),) * 2, (0.01 * k) ** 2))
    j = np.arange(1, n + 1)
    omega = 2.0 * np.sqrt(k / m) * np.sin(j * np.pi / (2 * (n + 1)))
    np.testing.assert_allclose(2.0 * np.pi * modes.frequency, omega, rtol=1e-12)
    np.testing.assert_allclose(modes.damping, 0.001 * omega, rtol=1e-9)  # damping in proportion to stiffness
    np.testing.assert_allclose(modes.frequency_error / modes.frequency, 0.005, rtol=1e-9)  # all springs 1 % stiffer
    exact = np.sin(np.outer(j, j) * np.pi / (n + 1))
    np.testing.assert_allclose(
        np.abs(np.sum(modes.shape * exact, axis=1)), np.linalg.norm(modes.shape, axis=1) * np.sqrt((n + 1) / 2)
    )
    assert np.all(modes.shape_error < 1e-9)  # which leaves the shapes as they are


def test_errors_of_modes_are_those_of_the_scatter():
    model = two_masses(coupling=0.3)
    keys = ("m[a]", "k[a-b]", "c[a-b]", "c[ground-a]")
    values = model.numbers()
    deviations = np.array([0.01 * values[key] for key in keys])
    modes = modes_of(model, keys, np.diag(deviations**2))
    rng = np.random.default_rng(3)
    middle = np.array([values[key] for key in keys])
    samples = middle + deviations * rng.standard_normal((1500, 4))
    drawn = [modes_of(model.with_values(dict(zip(keys, x.tolist(), strict=True)))) for x in samples]
    for name in ("frequency", "damping", "shape"):
        scatter = np.std([getattr(d, name) for d in drawn], axis=0)
        np.testing.assert_allclose(getattr(modes, f"{name}_error"), scatter, rtol=0.12, atol=1e-9)


def test_a_structure_that_nothing_ties_down_has_a_rigid_mode():
    free = [at("inertia", "a", 1.0), at("inertia", "b", 2.0), between("linear_stiffness", "a", "b", 50.0)]
    modes = modes_of(Model("free", tuple(free), ("a", "b"), (("shaker", "a"),)))
    assert modes.rigid == 1
    np.testing.assert_allclose(modes.frequency, [0.0, np.sqrt(50.0 * 1.5) / (2.0 * np.pi)])


def test_the_frame_is_a_model():
    assert modes_of(read_model(ROOT / "models" / "structures" / "frame.yaml")).rigid == 0


def test_the_damping_of_what_does_not_oscillate_and_its_error_are_those_in_closed_form():
    values = {"m": 2.0, "c": 90.0, "k": 300.0}
    terms = [
        ModelTerm(get(n), (x,), ())
        for n, x in zip(("inertia", "linear_damping", "linear_stiffness"), values.values(), strict=True)
    ]
    variance = np.diag([1e-4, 0.09, 1.0])
    modes = modes_of(Model("slow", tuple(terms)), tuple(values), variance)
    ratio = 90.0 / (2.0 * np.sqrt(600.0))
    slopes = ratio * np.array([-0.5 / 2.0, 1.0 / 90.0, -0.5 / 300.0])
    np.testing.assert_allclose(modes.damping, ratio)
    np.testing.assert_allclose(modes.damping_error, np.sqrt(slopes @ variance @ slopes))
