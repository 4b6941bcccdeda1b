"""Two masses in motions many times the linear range: one free run loses them, segments with own states do not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.compare.comparison import compare
from study.diagnose.adding import added
from study.equations.model import Model, free
from study.equations.model_file import parse_model
from study.equations.place import Place
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.identify.time_domain.motion_start import motion_start
from study.identify.time_domain.shooting import needed_restarts
from study.records.excitation import Excitation, force
from study.records.prepared import Prepared
from study.records.record import Record, Sensor, record_of
from study.records.record_layout import Layout
from study.records.states import starting_states
from study.way_in.compare_records import made_ready

PAIR = """
name: pair
coordinates: [a, b]
forces: {shaker: a}
terms:
  - {term: inertia, at: a, value: 1.0}
  - {term: inertia, at: b, value: 0.6}
  - {term: linear_stiffness, between: [ground, a], value: 900.0}
  - {term: linear_stiffness, between: [a, b], value: 700.0}
  - {term: linear_damping, between: [ground, a], value: 1.2}
  - {term: linear_damping, between: [a, b], value: 0.8}
"""
LINEAR = parse_model(PAIR, Path("pair.yaml"))
BELIEVED = LINEAR.with_values(dict.fromkeys(LINEAR.values))
GROUND = Place("between", ("ground", "a"))
SENSORS = tuple(Sensor(c, "displacement") for c in "ab")
N, DT, NOISE = 4096, 0.02, 0.005


def with_cubic(place: Place) -> Model:
    return LINEAR.with_term(replace(free(get("cubic_stiffness"), place), coefficients=(1e5,)))


def shaken(model: Model, level: float, noise: float = NOISE) -> Record:
    drive, rng = force(Excitation(level=level, cutoff=12.5), N, DT, 1), np.random.default_rng(2)
    made = simulate(model, {"shaker": drive}, DT, Integrator("rk4", 16), sensors=SENSORS)
    motions = {s: made[s] + noise * np.std(made[s]) * rng.standard_normal(N) for s in SENSORS}
    return record_of(DT, {"shaker": drive}, motions, name="pair")


def ready(record: Record, model: Model = BELIEVED) -> Prepared:
    return made_ready([record], model, Layout())[1]


@pytest.fixture(scope="module")
def wild() -> Prepared:
    """A motion in which the hardening spring to the ground takes several times the force of the linear one."""
    return ready(shaken(with_cubic(GROUND), 1e5))


@pytest.mark.parametrize("begun", ["added", "from nothing"])
def test_a_chaotic_motion_is_followed_as_the_true_model_does(wild: Prepared, begun: str) -> None:
    truth = compare(with_cubic(GROUND), wild).prediction
    cubic = free(get("cubic_stiffness"), GROUND)
    if begun == "added":
        linear = compare(BELIEVED, wild)
        assert linear.prediction.error > 0.5
        found = added(linear, cubic)
    else:
        found = compare(BELIEVED.with_term(cubic), wild)
    assert found.fit.restarts, "a disturbance grows: one free run of any model loses it"
    assert found.prediction.error < 1.05 * truth.error
    assert truth.error < 1.1 * NOISE
    for key, value in with_cubic(GROUND).numbers().items():
        assert found.fit.model.numbers()[key] == pytest.approx(value, rel=0.01)


def test_the_equations_along_the_motion_give_all_coefficients() -> None:
    truth = with_cubic(GROUND)
    prepared = ready(shaken(truth, 1000.0, noise=0.0))
    model = truth.with_values(dict.fromkeys(truth.values))
    for key, value in motion_start(model, prepared, ()).items():
        assert value == pytest.approx(truth.numbers()[key], rel=0.02)
    held = motion_start(model.with_values({"m[b]": 0.6}), prepared, ("m[b]",))
    assert "m[b]" not in held
    assert held["k3[ground-a]"] == pytest.approx(1e5, rel=0.02)


def test_modes_far_apart_are_no_growth() -> None:
    """One is ten times as fast and hardly moves: in a period of the slow one its disturbances stay what they are."""
    values = {"m[a]": 1.0, "m[b]": 0.01, "k[ground-a]": 100.0, "k[a-b]": 90.0, "c[ground-a]": 0.0, "c[a-b]": 0.0}
    model = LINEAR.with_values(values)
    record = shaken(model, 1.0, noise=0.0)
    prepared = ready(record)
    restarts = tuple(range(31, 2000, 31))
    states = starting_states(record, prepared.outputs, (0, *restarts), coordinates=model.coordinates)
    assert needed_restarts(model, record, states, (0, 2000), restarts, 8) == ()
