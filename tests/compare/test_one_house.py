"""A single mass is a structure with one coordinate: the same record, compared once without and once with a name."""

from dataclasses import replace

import numpy as np
import pytest

from study.compare.comparison import Comparison, compare
from study.equations.model import Model, free
from study.equations.place import Place
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.records.excitation import Excitation, force
from study.records.prepared import prepare_record
from study.records.record import Record, Sensor, record_of

DT = 0.02
VALUES = {"m": 1.0, "c": 3.77, "k": 355.3, "k3": 4e5}
LINEAR = ("inertia", "linear_damping", "linear_stiffness")


@pytest.fixture(scope="module")
def pair() -> tuple[Comparison, Comparison]:
    """A hardening spring believed linear, as a single mass and as a structure whose one coordinate is ``x``."""
    truth = Model("hard", tuple(free(get(n)).with_values(VALUES) for n in (*LINEAR, "cubic_stiffness")))
    drive, rng = force(Excitation(level=1.0), 4096, DT, 1), np.random.default_rng(2)
    u = simulate(truth, drive, DT, Integrator("rk4", 4))["displacement"]
    u = u + 0.01 * np.std(u) * rng.standard_normal(len(u))
    alone = Model("believed", tuple(free(get(n)) for n in LINEAR))
    there = Place("at", ("x",))
    named = Model("believed", tuple(replace(t, place=there) for t in alone.terms), ("x",), (("shaker", "x"),))
    single = Record(DT, {"force": drive, "displacement": u})
    structure = record_of(DT, {"shaker": drive}, {Sensor("x", "displacement"): u})
    return compare(alone, prepare_record(single)), compare(named, prepare_record(structure))


def test_coefficients_errors_and_modes_are_the_same(pair: tuple[Comparison, Comparison]) -> None:
    one, other = pair
    assert other.prediction.error == pytest.approx(one.prediction.error, rel=1e-5)
    assert other.prediction.floor == pytest.approx(one.prediction.floor, rel=1e-3)
    for a, b in zip(one.coefficients, other.coefficients, strict=True):
        assert b.key == f"{a.key}[x]"
        assert (b.place.label, b.unit, b.term) == ("x", a.unit, a.term)
        assert abs(b.value - a.value) < 0.05 * (a.error or 0.0)
        assert b.error == pytest.approx(a.error, rel=1e-2)
    assert other.modes.frequency == pytest.approx(one.modes.frequency, rel=1e-4)
    assert other.modes.damping_error == pytest.approx(one.modes.damping_error, rel=1e-2)


def test_the_missing_force_and_what_it_grows_with_are_the_same(pair: tuple[Comparison, Comparison]) -> None:
    one, other = pair
    size = float(np.std(one.missing_force.force))
    assert np.max(np.abs(other.missing_force.force - one.missing_force.force)) < 0.02 * size
    assert other.place == Place("between", ("ground", "x"))
    assert one.growths is not None
    assert other.growths is not None
    best, again = one.growths.ways[0], other.growths.ways[0]
    assert (best.of, best.parity) == (again.of, again.parity) == ("displacement", "odd")
    assert best.power == pytest.approx(3.0, abs=0.3)
    assert again.power == pytest.approx(best.power, abs=0.1)
    assert again.share == pytest.approx(best.share, abs=0.03)
