"""A force that is held between its samples makes all responses late by half a sample: no delay of the sensors."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from study.diagnose.force_between import reading_in_words
from study.equations.model import Model, free
from study.equations.place import Place
from study.equations.terms import get
from study.faults.accounting import Accounted
from study.faults.fault import ALL_SENSORS, DELAY, NOTHING_ASKED
from study.faults.imposed import shifted
from study.records.record import Record, Sensor, record_of
from study.way_in.compare_records import compare_records

DT, SAMPLES, NOISE = 0.02, 4096, 0.01
STIFFNESS, DAMPING = 600.0, 1.0  # of each spring, with a mass of 1: twenty samples or so in the longest period
LINEAR = ("linear_damping", "linear_stiffness")


def believed(masses: int) -> Model:
    """One mass on a spring, or two in a row of which the last is shaken."""
    if masses == 1:
        return Model("rig", tuple(free(get(name)) for name in ("inertia", *LINEAR)))
    terms = [free(get("inertia"), Place("at", (c,))) for c in "ab"]
    terms += [free(get(name), Place("between", ends)) for ends in (("ground", "a"), ("a", "b")) for name in LINEAR]
    return Model("pair", tuple(terms), ("a", "b"), (("shaker", "b"),))


def record(masses: int, between: str = "held") -> Record:
    """The exact motion under a force that is held, or goes straight, from sample to sample (SciPy), with noise."""
    path = np.array([[2.0, -1.0], [-1.0, 1.0]]) if masses == 2 else np.eye(1)
    zero, one = np.zeros((masses, masses)), np.eye(masses)
    flow = np.block([[zero, one], [-STIFFNESS * path, -DAMPING * path]])
    acting = np.concatenate([np.zeros(masses), one[-1]])[:, None]
    continuous = flow, acting, np.eye(masses, 2 * masses), np.zeros((masses, 1))
    rng = np.random.default_rng(11)
    drive = rng.standard_normal(SAMPLES)
    _, u, _ = dlsim(cont2discrete(continuous, DT, {"held": "zoh", "straight": "foh"}[between]), drive)
    u += NOISE * np.std(u, axis=0) * rng.standard_normal(u.shape)
    if masses == 1:
        return Record(DT, {"force": drive, "displacement": u[:, 0]}, name="made")
    sensors = (Sensor("a", "displacement"), Sensor("b", "displacement"))
    return record_of(DT, {"shaker": drive}, dict(zip(sensors, u.T, strict=True)), name="made")


def delays(found: Accounted) -> list[tuple[str, float]]:
    return [(fault.channel, fault.value) for fault in found.faults if fault.fault == DELAY]


@pytest.mark.parametrize("masses", [1, 2])
def test_a_force_that_is_held_is_told_as_held_and_not_as_a_delay(masses: int) -> None:
    made = record(masses)
    said = compare_records([replace(made, between="held")], believed(masses)).comparison
    found = compare_records([made], believed(masses))
    assert delays(found) == []
    assert found.given.record.between == "held"
    assert "is held from each sample to the next" in reading_in_words(found.comparison)
    assert found.comparison.prediction.error == pytest.approx(said.prediction.error, rel=0.01)
    for key, value in said.fit.model.numbers().items():
        assert found.comparison.fit.model.numbers()[key] == pytest.approx(value, rel=1e-3)


def test_a_reading_that_a_model_told_is_taken_back_with_what_else_it_told() -> None:
    """A model that lacks an effect may see a hold where there is none: without what it told the record is as given."""
    made = record(1)
    found = compare_records([made], believed(1))
    given = found.read_as_given()
    assert given.given.record.between == made.between == "band_limited"
    assert given.read_as_given() is given
    plain = compare_records([made], believed(1), settings=NOTHING_ASKED).comparison
    again = given.corrected_for(()).comparison
    assert again.record.between == made.between
    assert again.prediction.error == pytest.approx(plain.prediction.error, rel=1e-6)
    assert again.prediction.error > 1.5 * found.comparison.prediction.error


@pytest.mark.parametrize("masses", [1, 2])
def test_a_delay_that_no_hold_makes_stays_one(masses: int) -> None:
    """Of a sensor's filter, under a force that goes straight from sample to sample and is not late."""
    made = record(masses, "straight")
    late = made.with_channels({str(s): shifted(made[s], 0.7) for s in made.sensors})
    found = compare_records([late], believed(masses))
    ((channel, value),) = delays(found)
    assert channel == (ALL_SENSORS if masses == 2 else "displacement")
    assert value == pytest.approx(0.7, abs=0.02)
    assert found.given.record.between == "band_limited"


def test_a_hold_beside_a_delay_is_no_hold_alone() -> None:
    made = record(1)
    late = made.with_channels({"displacement": shifted(made["displacement"], 0.3)})
    found = compare_records([late], believed(1))
    assert delays(found)[0][1] == pytest.approx(0.8, abs=0.02)
