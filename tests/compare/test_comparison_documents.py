"""What is written of a comparison, and what cannot be compared."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from study.compare import along_time
from study.compare.comparison import Comparison, across_records, compare
from study.compare.comparison_report import as_json, comparison_document, comparison_summary, tables
from study.compare.comparison_sentences import comparison_in_words
from study.equations.model import Model, ModelTerm, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.records.excitation import Excitation, force
from study.records.plan import Plan
from study.records.prepared import prepare_record
from study.records.record import Record
from study.support.errors import StudyError
from study.trials import make_trial

Floats = NDArray[np.float64]
LINEAR = ("inertia", "linear_damping", "linear_stiffness")
VALUES = {"m": 1.0, "c": 3.77, "k": 355.3}
DT = 0.02


def model(*more: str, **values: float) -> Model:
    """A linear oscillator and some terms; what is not given is to be fitted."""
    return Model("believed", tuple(free(get(n)).with_values(values) for n in (*LINEAR, *more)))


def compared(
    believed: Model, record: Record, plan: Plan | None = None, cutoff: float | None = None
) -> Comparison:  # fmt: skip
    return compare(believed, prepare_record(record, plan, cutoff))


@cache
def trial(hidden: str, seed: int, noise_share: float) -> Comparison:
    made = make_trial(seed, hidden=[hidden] if hidden else [], noise=noise_share)
    return compared(made.believed, made.record)


def drive(seed: int = 1, samples: int = 8192, level: float = 1.0) -> Floats:
    return force(Excitation(level=level), samples, DT, seed)


def measured(truth: Model, history: Floats, share: float = 0.05, seed: int = 3) -> Record:
    """A record of force and displacement with white noise of this share of its rms."""
    record = simulate(truth, history, DT, Integrator("rk4", 4))
    u = record["displacement"]
    noisy = u + share * np.std(u) * np.random.default_rng(seed).standard_normal(len(u))
    return Record(DT, {"force": history, "displacement": noisy}, name=f"seed_{seed}")


# ---- units


SCALES = [(1e-3, 1e3, "kN", "mm"), (1.0, 1.0, "V", "V"), (0.2248089, 39.37008, "lbf", "in")]


@pytest.mark.parametrize(("per_force", "per_length", "force_unit", "length_unit"), SCALES)
def test_units_change_neither_errors_nor_sentences(
    per_force: float, per_length: float, force_unit: str, length_unit: str
) -> None:
    record = measured(model("quadratic_damping", **VALUES, c2=400.0), drive(), 0.02)
    units = {"force": force_unit, "displacement": length_unit}
    scaled = Record(
        DT, {"force": record["force"] * per_force, "displacement": record["displacement"] * per_length}, units
    )
    one, other = compared(model(), record), compared(model(), replace(scaled, name=record.name))
    assert other.prediction.error == pytest.approx(one.prediction.error, rel=1e-6)
    assert other.forces[0].total == pytest.approx(one.forces[0].total, rel=1e-6)
    assert other.prediction.floor == pytest.approx(one.prediction.floor, rel=1e-6)
    assert comparison_in_words(other) == comparison_in_words(one)
    assert {c.key: c.unit for c in other.coefficients}["k"] == f"{force_unit}/{length_unit}"


def test_records_in_different_units_are_not_held_against_each_other() -> None:
    record = measured(model(**VALUES), drive(), 0.05)
    other = replace(record, units={"force": "kN", "displacement": "m"}, name="other")
    with pytest.raises(StudyError, match="the same unit"):
        across_records([compared(model(), record), compared(model(), other)])


# ---- documents


def test_the_document_has_the_fields_of_the_issue_and_is_plain_json() -> None:
    import json

    comparison = trial("quadratic_damping", 41, 0.0)
    content = json.loads(as_json(comparison_document([comparison])))
    assert set(content) >= {"model", "error", "noise_floor", "coefficients", "where", "says"}
    assert content["error"]["response"] == comparison.prediction.error
    assert content["error"]["force"] == comparison.forces[0].total
    assert set(content["where"]) == {"frequency", "amplitude", "time", "level"}
    assert content["where"]["frequency"][0]["of"] == "response"
    assert content["where"]["amplitude"][0]["of"] == "velocity"
    assert len(content["where"]["time"]) == along_time.STRETCHES
    for row in content["coefficients"]:
        assert row["interval"][0] < row["value"] < row["interval"][1]


def test_tables_name_their_record_and_hold_no_text_of_numpy() -> None:
    comparison = trial("quadratic_damping", 41, 0.0)
    made = tables([comparison, comparison], across_records([comparison, comparison]))
    for name, content in made.items():
        head, *rows = content.decode().splitlines()
        assert "record" in head.split(","), name
        assert rows, name
        assert "np." not in content.decode()


def test_a_fit_that_did_not_arrive_says_so() -> None:
    comparison = trial("quadratic_damping", 41, 0.0)
    stopped = replace(comparison, fit=replace(comparison.fit, converged=False, message="still falling"))
    assert "did not arrive at a minimum (still falling)" in comparison_in_words(stopped)


def test_models_that_cannot_run_are_refused_in_one_sentence() -> None:
    record = measured(model(**VALUES), drive(), 0.05)
    with pytest.raises(StudyError, match="no inertia"):
        compared(Model("bare", (free(get("linear_damping")), free(get("linear_stiffness")))), record)
    unstable = Model(
        "runaway", tuple(ModelTerm(get(n), (v,), ()) for n, v in zip(LINEAR, (1.0, -50.0, 355.0), strict=True))
    )
    with pytest.raises(StudyError):
        compared(unstable, record)


def test_a_model_that_runs_away_is_compared_all_the_same() -> None:
    made = make_trial(7_000_122, ("displacement_damping", "quadratic_damping"), 0.0, "acceleration")
    comparison = compared(made.believed, made.record)
    assert comparison.prediction.diverged
    assert comparison.prediction.error == pytest.approx(1.0)
    assert "mean nothing" in comparison_in_words(comparison)
    assert "100 %" in comparison_summary([comparison])
    assert all(b"nan" not in content for content in tables([comparison]).values())
