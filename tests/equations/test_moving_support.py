"""A coordinate without inertia has a prescribed motion: supports that move, and the force that this takes."""

import numpy as np
import pytest

from study.equations.free_run import prepare
from study.equations.model import Model, ModelTerm
from study.equations.place import HERE, Place
from study.equations.terms import get
from study.records.record import MOTIONS, Record, Sensor, record_of

N, DT, MASS = 800, 0.02, 1.5
LINK = Place("between", ("base", "a"))
EFFECTS = {
    "linear_stiffness": (300.0,), "linear_damping": (2.0,), "cubic_stiffness": (4e4,), "relaxation": (80.0, 0.1),
    "coulomb_friction": (3.0,),
}  # fmt: skip


def sines(orders, size):
    """A motion that closes on itself: displacement, velocity, acceleration."""
    angles = [(k, 2.0 * np.pi * k / (N * DT) * np.arange(N) * DT + k**2) for k in orders]
    rates = {k: 2.0 * np.pi * k / (N * DT) for k in orders}
    return [
        size * sum(np.sin(x) for _, x in angles),
        size * sum(rates[k] * np.cos(x) for k, x in angles),
        -size * sum(rates[k] ** 2 * np.sin(x) for k, x in angles),
    ]


def made(*effects, support=True):
    """A mass on a support that moves; seen from there it is a single mass."""
    place = LINK if support else HERE
    terms = [
        ModelTerm(get(n), EFFECTS[n][: len(get(n).symbols)], EFFECTS[n][len(get(n).symbols) :], place) for n in effects
    ]
    mass = ModelTerm(get("inertia"), (MASS,), (), Place("at", ("a",)) if support else HERE)
    return Model("m", (mass, *terms), ("base", "a"), (("shaker", "a"),)) if support else Model("m", (mass, *terms))


def runs(effects, sensors):
    """The structure under its force and the motion of its support, and the single mass seen from that."""
    base, force = sines((3, 8, 13, 21), 4e-3), sines((5, 11, 17), 8.0)[0]
    motions = {Sensor("base", m): x for m, x in zip(MOTIONS, base, strict=True)}
    shaken = record_of(DT, {"shaker": force}, motions)
    seen = Record(DT, {"force": force - MASS * base[2]})
    model, alone = made(*effects), made(*effects, support=False)
    keys = tuple(k for k in model.values if k != "m[a]")
    own = tuple(k for k in alone.values if k != "m")
    return (
        base, force, model, prepare(model, shaken, keys, sensors=sensors, steps_per_sample=16),
        prepare(alone, seen, own, sensors=[Sensor("", m) for m in MOTIONS], steps_per_sample=16),
    )  # fmt: skip


@pytest.mark.parametrize("effects", [tuple(EFFECTS)[:4], tuple(EFFECTS)], ids=["smooth", "friction"])
def test_a_support_that_moves_is_a_force_on_the_mass_seen_from_it(effects):
    wanted = [Sensor("a", m) for m in MOTIONS] + [Sensor("base", "force")]
    base, force, model, shaken, alone = runs(effects, wanted)
    values = {k: model.values[k] for k in shaken.keys}
    first = np.array([0.0, 0.0])
    response, jacobian = shaken.respond(values, np.array([base[0][0], base[1][0]]), 2)
    relative, slopes = alone.respond(dict(zip(alone.keys, values.values(), strict=True)), first, 2)
    for i in range(3):
        expected = relative[:, i] + base[i]
        assert np.max(np.abs(response[:, i] - expected)) < 1e-7 * np.max(np.abs(expected))
        np.testing.assert_allclose(jacobian[:, i], slopes[:, i], atol=1e-6 * np.max(np.abs(slopes[:, i])))
    pushed = MASS * response[:, 2] - force  # the support has no mass: with the force it accelerates the mass alone
    np.testing.assert_allclose(response[:, 3], pushed, atol=1e-9 * np.max(np.abs(pushed)))
    np.testing.assert_allclose(
        jacobian[:, 3], MASS * jacobian[:, 2], atol=1e-7 * np.max(np.abs(jacobian[:, 2])), err_msg="of the force"
    )


def test_an_inertia_between_a_support_and_a_mass_feels_the_acceleration_of_both():
    """b (a_mass - a_base) and m a_mass: the mass m + b, driven by b times the support's acceleration besides."""
    base = sines((3, 8), 4e-3)
    motions = {Sensor("base", m): x for m, x in zip(MOTIONS, base, strict=True)}
    spring, inerter = (
        ModelTerm(get("linear_stiffness"), (300.0,), (), LINK),
        ModelTerm(get("inertia"), (0.7,), (), LINK),
    )
    mass = ModelTerm(get("inertia"), (MASS,), (), Place("at", ("a",)))
    model = Model("m", (mass, spring, inerter), ("base", "a"), ())
    wanted = [Sensor("a", "displacement"), Sensor("base", "force"), Sensor("a", "acceleration")]
    response = prepare(model, record_of(DT, {}, motions), sensors=wanted, steps_per_sample=8).respond({}, np.zeros(2))[
        0
    ]
    plain = Model("p", (ModelTerm(get("inertia"), (MASS + 0.7,), ()), ModelTerm(get("linear_stiffness"), (300.0,), ())))
    driven = Record(DT, {"force": 300.0 * base[0] + 0.7 * base[2]})
    expected = prepare(plain, driven, steps_per_sample=8).respond({}, np.zeros(2))[0][:, 0]
    assert np.max(np.abs(response[:, 0] - expected)) < 1e-9 * np.max(np.abs(expected))
    np.testing.assert_allclose(response[:, 1], MASS * response[:, 2], atol=1e-9 * np.max(np.abs(response[:, 1])))
