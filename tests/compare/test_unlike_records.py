"""One fit to several records says which of them want another coefficient, or another zero, than the others."""

import re

import numpy as np
import pytest

from study.equations.free_run import predict_response
from study.equations.model import Model, free
from study.equations.terms import get
from study.records.record import SI_UNITS, Record
from study.way_in.compare_records import compare_records

NAMES = ("inertia", "linear_damping", "linear_stiffness")
BELIEVED = Model("cart", tuple(free(get(n)) for n in NAMES)).with_values({"m": 1.0})


def decay(name: str, *, k: float = 700.0, zero: float = 0.0, seed: int = 1) -> Record:
    model = BELIEVED.with_values({"m": 1.0, "c": 0.4, "k": k})
    record = Record(0.01, {"force": np.zeros(1200)}, dict(SI_UNITS), name)
    u = predict_response(model, record, steps_per_sample=8, initial=(0.02, 0.0))
    return record.with_channels({"displacement": u + zero + 2e-5 * np.random.default_rng(seed).standard_normal(len(u))})


def notes(*records: Record) -> str:
    return " ".join(compare_records(records, BELIEVED).comparison.notes)


def test_two_assemblies_want_a_stiffness_each():
    said = notes(decay("first", k=692.6), decay("second", k=703.6, seed=2))
    assert "the records ask for different values of k: 69" in said
    assert "--each-record linear_stiffness" in said


def test_two_runs_have_a_zero_each():
    said = notes(decay("first", zero=4e-4), decay("second", zero=-3e-4, seed=2))
    assert re.search(r"each record has a zero of its own: 0.000[34]\d* m in first and -0.000[23]\d* m in second", said)


@pytest.mark.parametrize("seed", range(4))
def test_alike_records_want_nothing_of_their_own(seed: int):
    said = notes(decay("first", seed=seed), decay("second", seed=seed + 20), decay("third", seed=seed + 40))
    assert "each record" not in said
    assert "different values" not in said
