"""A free decay that is touched, or stopped, before it has died away: its end is no motion of the structure."""

import numpy as np
import pytest

from study.equations.free_run import predict_response
from study.equations.model import Model, free
from study.equations.terms import get
from study.records.record import SI_UNITS, Record
from study.way_in.compare_records import compare_records

DT, FORCE_FREE, NOISE = 0.01, np.zeros(3000), 2e-5
DAMPED = {
    "linear_damping": {"c": 0.12}, "coulomb_friction": {"fc": 0.03}, "quadratic_damping": {"c2": 2.0},
    "cubic_damping": {"cv3": 40.0},
}  # fmt: skip


def decay(damping: str) -> Record:
    """Of a mass of 1 kg at 2 Hz, let go at 10 mm."""
    given = {"m": 1.0, "k": 158.0, **DAMPED[damping]}
    names = ("inertia", "linear_stiffness", damping)
    model = Model("rig", tuple(free(get(n)).with_values({k: given[k] for k in get(n).keys}) for n in names))
    record = Record(DT, {"force": FORCE_FREE}, dict(SI_UNITS), "decay")
    u = predict_response(model, record, steps_per_sample=8, initial=(0.01, 0.0))
    return record.with_channels({"displacement": u + NOISE * np.random.default_rng(3).standard_normal(len(u))})


def touched(record: Record, at: int) -> Record:
    """The same, held from a sample on where it then is, within a tenth of a period."""
    u = record["displacement"].copy()
    u[at:] = u[at] * np.exp(-np.arange(len(u) - at) / 5) + NOISE * np.random.default_rng(4).standard_normal(len(u) - at)
    return record.with_channels({"displacement": u})


def notes(record: Record, damping: str) -> str:
    model = Model("rig", tuple(free(get(n)) for n in ("inertia", "linear_stiffness", damping)))
    held = model.with_values({"m": 1.0})
    return " ".join(compare_records([record], held).comparison.prepared.notes)


@pytest.mark.parametrize("damping", list(DAMPED))
def test_what_damping_ends_does_not_break_off(damping: str):
    assert "breaks off" not in notes(decay(damping), damping)


@pytest.mark.parametrize("at", [510, 640, 777])
def test_the_end_of_a_decay_that_was_touched_is_left_out_and_told(at: int):
    record = decay("linear_damping")
    told = notes(touched(record, at), "linear_damping")
    assert "decay: the motion breaks off at" in told
    when = float(told.split("breaks off at ")[1].split(" s,")[0])
    assert abs(when - at * DT) < 0.5  # a period


def test_a_touched_decay_gives_the_damping_that_the_whole_one_gives():
    """With its end it would be another."""
    model = Model("rig", tuple(free(get(n)) for n in ("inertia", "linear_stiffness", "linear_damping")))
    held = model.with_values({"m": 1.0})
    whole, cut = (
        next(c for c in compare_records([r], held).comparison.coefficients if c.key == "c")
        for r in (decay("linear_damping"), touched(decay("linear_damping"), 640))
    )
    assert cut.interval[0] < 0.12 < cut.interval[1]
    assert cut.value == pytest.approx(whole.value, rel=0.02)
