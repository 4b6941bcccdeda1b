"""Free runs with exact derivatives."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from study.equations import kernels
from study.equations.free_run import FreeRun, predict_response, prepare
from study.equations.model import Model, ModelTerm, free
from study.equations.place import Place
from study.equations.terms import LIBRARY, custom, get
from study.records.outputs import alone
from study.records.record import FORCE, MOTIONS, Record, Sensor
from study.support import work
from study.support.errors import StudyError

Floats = NDArray[np.float64]
Make = Callable[[str, Mapping[str, Mapping[str, float]]], Model]
DT = 0.02
LINEAR = {"inertia": {"m": 1.0}, "linear_damping": {"c": 3.77}, "linear_stiffness": {"k": 355.3}}
EFFECTS: dict[str, dict[str, float]] = {
    "inertia": {},
    "linear_damping": {},
    "linear_stiffness": {},
    "quadratic_stiffness": {"k2": 1e4},
    "signed_quadratic_stiffness": {"k2s": 5e4},
    "cubic_stiffness": {"k3": 2e7},
    "quintic_stiffness": {"k5": 1e12},
    "van_der_pol_damping": {"c3": 2e6},
    "displacement_damping": {"cu": 2e3},
    "quadratic_damping": {"c2": 60.0},
    "cubic_damping": {"cv3": 1e3},
    "coulomb_friction": {"fc": 0.2},
    "dead_band": {"kg": -300.0, "dead_band.u_g": 0.0025},
    "bilinear_stiffness": {"kb": 100.0},
    "one_sided_contact": {"kc": 300.0, "one_sided_contact.gap": 0.002},
    "periodic_stiffness": {"km_cos": 150.0, "km_sin": 50.0, "periodic_stiffness.f_m": 1.0},
    "relaxation": {"kr": 200.0, "relaxation.tau": 0.05},
    "hysteresis": {"kz": 200.0, "hysteresis.beta": 300.0, "hysteresis.gamma": 100.0},
    "constant_force": {"f0": 0.2},
    "harmonic_force": {"fh_cos": 0.3, "fh_sin": 0.2, "harmonic_force.f": 4.0},
    "stribeck_friction": {"fs": 0.2, "stribeck_friction.v_s": 0.03},
    "load_dependent_friction": {"fu": 40.0},
    "directional_damping": {"cd": 1.5},
    "directional_quadratic_damping": {"cd2": 30.0},
    "pendulum_stiffness": {"kp": 90.0},
    "cogging": {"fp_cos": 0.1, "fp_sin": -0.2, "cogging.pitch": 0.004},
}


def with_effect(make_model: Make, name: str) -> Model:
    return make_model(name, {**LINEAR, **({name: EFFECTS[name]} if EFFECTS[name] else {})})


def numbers(model: Model) -> dict[str, float]:
    return {key: float(value) for key, value in model.values.items() if value is not None}


def central_differences(run: FreeRun, values: dict[str, float], initial: Floats, step: float) -> Floats:
    """Columns of the Jacobian by keys, then by the initial state."""
    point = np.array([*values.values(), *initial])
    columns: list[Floats] = []
    for i, value in enumerate(point):
        ends: list[Floats] = []
        for sign in (1.0, -1.0):
            moved = point.copy()
            moved[i] = value * (1.0 + sign * step)
            ends.append(run.respond(dict(zip(values, moved, strict=False)), moved[len(values) :])[0][:, 0])
        columns.append((ends[0] - ends[1]) / (2.0 * step * value))
    return np.stack(columns, axis=1)


def test_every_effect_of_the_library_is_tried() -> None:
    assert set(EFFECTS) == set(LIBRARY)


@pytest.mark.parametrize("response", MOTIONS)
@pytest.mark.parametrize("name", EFFECTS)
def test_jacobian_equals_central_differences(name: str, response: str, make_model: Make, report_force: Floats) -> None:
    model = with_effect(make_model, name)
    values = numbers(model)
    initial = np.array([1e-3, 0.02, 5e-4])[: 2 + len(model.states)]
    record = Record(DT, {"force": report_force[:1024]})
    run = prepare(model, record, tuple(values), sensors=alone(response).sensors)
    jacobian = run.respond(values, initial, len(initial))[1][:, 0]
    errors: list[Floats] = []
    for step in (1e-4, 1e-5, 1e-6, 1e-7):  # a step across a kink of the force is no derivative: another one is
        differences = central_differences(run, values, initial, step)
        errors.append(np.linalg.norm(jacobian - differences, axis=0) / np.linalg.norm(differences, axis=0))
    error = np.min(errors, axis=0)
    # Two steps a sample carry the jump at a switch of friction to the order of the step only.
    jumps = any("sgn(v)" in component.shape for component in LIBRARY[name].components)
    assert np.max(error) < (0.02 if jumps else 2e-6)


@pytest.fixture
def rubbing(make_model: Make) -> Model:
    return make_model(
        "rubbing", {"inertia": {"m": 1.0}, "linear_stiffness": {"k": 355.3}, "coulomb_friction": {"fc": 0.3}}
    )


def test_friction_stops_the_mass_where_it_should(rubbing: Model) -> None:
    """Each half cycle costs 2 fc / k of amplitude, and the mass stays where |k u| <= fc: an exact solution."""
    k, fc, begin = 355.3, 0.3, 0.01
    halves = int(np.ceil((begin - fc / k) / (2.0 * fc / k)))
    end = (-1.0) ** halves * (begin - 2.0 * halves * fc / k)
    run = prepare(rubbing, Record(DT, {"force": np.zeros(200)}), ("m", "k", "fc"), steps_per_sample=8)
    response, jacobian = (x[:, 0] for x in run.respond({"m": 1.0, "k": k, "fc": fc}, (begin, 0.0), 2))
    assert response[-1] == pytest.approx(end, rel=1e-5)
    assert np.ptp(response[-50:]) == 0.0
    sign = (-1.0) ** halves
    exact = [0.0, sign * 2.0 * halves * fc / k**2, -sign * 2.0 * halves / k, sign]
    np.testing.assert_allclose(jacobian[-1, :4], exact, rtol=1e-4, atol=1e-9)


def test_a_mass_that_friction_holds_has_no_acceleration_to_the_last_bit(rubbing: Model) -> None:
    """What stands still is told from a channel that dropped out by it; with a force too small to move the mass."""
    drive = 0.05 * np.random.default_rng(1).standard_normal(300)
    run = prepare(rubbing, Record(DT, {"force": drive}), sensors=alone("acceleration").sensors, steps_per_sample=8)
    assert not np.any(run.respond({}, (0.0, 0.0))[0])
    ends = tuple(replace(t, place=Place("at", ("first",))) for t in rubbing.terms)
    tied = ModelTerm(get("linear_stiffness"), (90.0,), (), Place("between", ("first", "second")))
    terms = (*ends, tied, replace(ends[0], place=Place("at", ("second",))))
    two = Model("two", terms, ("first", "second"), (("force", "second"),))
    sensors = [Sensor(c, "acceleration") for c in two.coordinates]
    found = prepare(two, Record(DT, {"force": drive}), sensors=sensors, steps_per_sample=8).respond({}, np.zeros(4))[0]
    held = found[:, 0] == 0.0
    assert np.count_nonzero(held) > 50
    assert not np.any((found[:, 0] != 0.0) & (np.abs(found[:, 0]) < 1e-12 * np.std(found[:, 1])))


def test_friction_keeps_the_order_of_the_integrator(make_model: Make, report_force: Floats) -> None:
    model = with_effect(make_model, "coulomb_friction").with_values({"fc": 0.4})
    record = Record(DT, {"force": report_force[:2048]})
    reference = predict_response(model, record, steps_per_sample=64)
    coarse, fine = (
        np.linalg.norm(predict_response(model, record, steps_per_sample=steps) - reference) / np.linalg.norm(reference)
        for steps in (4, 8)
    )
    assert coarse < 1e-4
    assert coarse / fine > 2.0**3


def test_free_run_is_the_simulation(systems: dict[str, Model], records: dict[str, Record]) -> None:
    for name, model in systems.items():  # the extreme system multiplies differences of rounding
        record = records[name].part(0, 2048)
        for response in MOTIONS:
            again = predict_response(model, records[name], response=response, steps_per_sample=8, span=(0, 2048))
            np.testing.assert_allclose(again, record[response], rtol=0.0, atol=1e-8 * np.std(record[response]))


def test_free_run_starts_anywhere(systems: dict[str, Model], records: dict[str, Record]) -> None:
    record = records["mathieu"]
    state = (record["displacement"][700], record["velocity"][700])
    again = predict_response(systems["mathieu"], record, steps_per_sample=8, span=(700, 1500), initial=state)
    np.testing.assert_allclose(again, record["displacement"][700:1500], rtol=0.0, atol=1e-12)


def test_pieces_are_free_runs_of_their_own(systems: dict[str, Model], records: dict[str, Record]) -> None:
    model, record = systems["mathieu"], records["mathieu"]
    values, cuts = numbers(model), (300, 450)
    states = np.stack([record["displacement"][[200, *cuts]], record["velocity"][[200, *cuts]]], axis=1)
    run = prepare(model, record, tuple(values), steps_per_sample=8, span=(200, 700), restarts=cuts)
    response, jacobian = (x[:, 0] for x in run.respond(values, states, 2))
    np.testing.assert_allclose(response, record["displacement"][200:700], rtol=0.0, atol=1e-12)
    differences = central_differences_of_a_state(run, values, states)
    np.testing.assert_allclose(jacobian[:, len(values) + 2], differences, atol=1e-7)
    assert not np.any(jacobian[:100, len(values) + 2 :])
    with pytest.raises(StudyError, match="2 initial states were given; 3 segments need one each"):
        run.respond(values, states[:2])


def test_the_latest_runs_of_a_thread_are_kept(
    systems: dict[str, Model], records: dict[str, Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    model, record, runs = systems["duffing"], records["duffing"], list[FreeRun]()
    made = FreeRun._integrate  # pyright: ignore[reportPrivateUsage]
    monkeypatch.setattr(FreeRun, "_integrate", lambda run, *told: runs.append(run) or made(run, *told))

    def respond(
        begin: float, span: tuple[int, int] = (0, 2000), steps: int = 2, record: Record = record
    ) -> tuple[Floats, Floats, int]:
        run = prepare(model, record, tuple(model.values), span=span, steps_per_sample=steps)
        with work.limited_to(1.0):
            return *run.respond(numbers(model), (begin, 0.0), 2), work.done()

    first, slopes, operations = respond(0.001)
    slopes *= 2.0  # whoever gets a run may write to it
    again, same, counted = respond(0.001)
    assert len(runs) == 1
    assert counted == operations > 0  # where a search ends does not turn on what was kept
    np.testing.assert_array_equal(again, first)
    np.testing.assert_array_equal(2.0 * same, slopes)
    for other in (respond(0.002), respond(0.001, steps=4), respond(0.001, (10, 2010)), respond(0.001, (0, 1990))):
        assert len(other[0]) != len(first) or not np.array_equal(other[0], first)
    assert len(runs) == 5
    respond(0.001)
    assert len(runs) == 6  # four have been made since
    long = Record(DT, {"force": np.zeros(1 << 18)})  # whose force would stay with the run
    for _ in range(2):
        respond(0.001, record=long)
    assert len(runs) == 8


EVERY_OPERATION = (
    "sin(u)*cos(v) + exp(-v*v)*log(1 + u*u) + sqrt(abs(u)) + tanh(v) + max(u, v)*min(u, v) - sgn(u)/(2 + v*v)"
    " + max(0.01 + u*u, 0)**1.5"
)


@pytest.mark.parametrize("name", [*EFFECTS, "every operation", "two masses", "a moved end"])
@pytest.mark.parametrize("columns", ["value", "all", "more than at once"])
def test_two_motions_at_once_are_those_of_one_after_the_other(
    name: str, columns: str, make_model: Make, report_force: Floats
) -> None:
    """To the last bit, with as many operations, and failing where the first of them would have."""
    if name in EFFECTS:
        model = with_effect(make_model, name)
    else:
        model = make_model(name, LINEAR).with_term(free(custom("own", EVERY_OPERATION)).with_values({"q_own": 2.0}))
    if name in ("two masses", "a moved end"):
        ends = tuple(replace(t, place=Place("at", (end,))) for t in model.terms for end in ("first", "second"))
        tied = ModelTerm(get("cubic_stiffness"), (1e7,), (), Place("between", ("first", "second")))
        model = Model("two", (*ends, tied), ("first", "second"), (("force", "second"),))
    keys = tuple(model.values) if columns != "value" else ()
    sensors = [Sensor(c, motion) for c in model.coordinates for motion in (MOTIONS[0], MOTIONS[2])]
    channels = {"force": report_force[:400]}
    if name == "a moved end":  # the force there is computed for what is observed alone
        model, keys = replace(model, terms=model.terms[1:]), tuple(key for key in keys if key != "m[first]")
        sensors = [Sensor("first", FORCE), sensors[2]]
        channels |= {str(Sensor("first", motion)): 0.01 * report_force[400:800] for motion in MOTIONS}
    run = prepare(model, Record(DT, channels), keys, sensors=sensors, restarts=(60, 121, 260, 262))
    known = run.motion.program.with_inputs({key: numbers(model)[key] for key in keys})
    motion = replace(run.motion, program=known)
    assert (motion.split < len(known.code)) == (name == "a moved end")
    bounds, begins = np.array([0, *run.cuts, 400]), run.times(np.array([0, *run.cuts]))
    states = np.zeros((5, run.states, 1 + len(keys) + 9 * (columns == "more than at once")))
    states[:, :, 0] = np.random.default_rng(3).normal(0.0, 0.003, (5, run.states))

    def integrated(begun: Floats, each: bool) -> tuple[int, int, bytes, bytes]:
        out, arrived, operations, failed = np.zeros((400, len(sensors), states.shape[2])), begun.copy(), 0, -1
        for i in range(5) if each else [0]:
            part, own = slice(i, i + 1 if each else None), arrived[i : i + 1] if each else arrived
            ends = bounds[i : i + 2] if each else bounds
            failed, made = kernels.integrate(motion, begins[part], DT, 2, run.drive, ends, own, out)
            operations += made
            if failed >= 0:
                return failed, operations, b"", b""
        return failed, operations, out.tobytes(), arrived.tobytes()

    assert (found := integrated(states, each=False)) == integrated(states, each=True)
    assert found[0] == -1
    for lost in range(5):  # where a motion runs away, or is nothing to begin with
        away = states.copy()
        away[lost:, 0, 0] = np.nan
        assert (found := integrated(away, each=False)) == integrated(away, each=True)
        assert found[0] >= 0


def central_differences_of_a_state(run: FreeRun, values: dict[str, float], states: Floats) -> Floats:
    """Derivative of the response by the displacement at which the second piece begins."""
    moved, step = [], np.zeros_like(states)
    step[1, 0] = 1e-7
    for sign in (1.0, -1.0):
        moved.append(run.respond(values, states + sign * step)[0][:, 0])
    return (moved[0] - moved[1]) / 2e-7
