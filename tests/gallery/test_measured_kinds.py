"""Measured tests without a force or without a mass: a damper, a pendulum. The data lie where STUDY_DATA says."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipk

from study.commands.climb import climb
from study.compare.comparison import compare
from study.compare.prediction import predict
from study.diagnose.designs import LET_GO
from study.diagnose.next_test import next_test
from study.diagnose.separation import own_limits, rivals_of
from study.diagnose.verdict import MISSING, diagnose
from study.equations.model_file import read_model
from study.equations.terms import LIBRARY, get
from study.gallery.gallery_page import Published, found_beside, read_findings
from study.identify.time_domain.fit_model import fit_model
from study.records.readers import ReadOptions, read_record
from study.records.record_layout import Layout, apart
from study.way_in.compare_records import made_ready
from tests.public_records import DATA, needs

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models" / "measured"
AUTHORS = {"4.1": (57.4, 0.768, 0.12), "4.4": (209.7, 1.31, 0.09)}  # Kw in N, Kx in N s/mm, share left of the force
RIVALS = {
    "hysteresis", "coulomb_friction", "quadratic_damping", "cubic_damping", "van_der_pol_damping",
    "displacement_damping", "linear_stiffness", "cubic_stiffness",
}  # fmt: skip


def damper(run, model):
    record = read_record(DATA / "damper" / f"run_{run}.csv", ReadOptions())
    return made_ready([record], read_model(MODELS / f"{model}.yaml"), Layout())


@needs("damper")
@pytest.mark.parametrize("run", list(AUTHORS))
def test_the_authors_model_of_the_damper(run):
    """Of the whole run, one half of which is held out; run_4.4 rests on its one block, so its Kw is not compared."""
    model, prepared = damper(run, "dahl_damper")
    fit = fit_model(model, prepared)
    prediction = predict(fit, prepared)
    squares = np.concatenate([fit.residual**2, prediction.residual**2])
    whole, kx, most = AUTHORS[run]
    assert float(np.sqrt(np.mean(squares)) / prediction.of(0).size) < most
    values = fit.model.numbers()
    if run == "4.1":
        assert values["kz"] / values["hysteresis.beta"] == pytest.approx(whole, rel=0.15)
        assert values["c"] == pytest.approx(kx, rel=0.15)


@pytest.mark.long
@needs("damper")
@pytest.mark.parametrize("run", list(AUTHORS))
def test_the_damper_is_hysteretic_before_it_is_any_polynomial(run):
    model, prepared = damper(run, "viscous_damper")
    *_, prepared = apart(prepared)
    found = diagnose(compare(model, prepared), without=[n for n in LIBRARY if n not in RIVALS and n not in model])
    assert found.verdict == MISSING
    assert found.candidates[0].name == "hysteresis"
    first, second = found.candidates[:2]
    assert first.gain.explained > 1.3 * max(r.gain.explained for r in found.candidates[1:])
    rivals = rivals_of([first, second], prepared)
    found = next_test(rivals, own_limits(rivals.fits, rivals.present, 1.5), rehearsals=0)
    assert found.choice.promise > 0.9, "they differ much, and more stroke shows it"
    assert found.rivals.present.prescribed


def pendulum():
    columns = {"displacement": "angle", "velocity": "angular velocity"}
    record = read_record(DATA / "pendulum" / "single.csv", ReadOptions(columns))
    return made_ready([record], read_model(MODELS / "pendulum.yaml"), Layout())


@needs("pendulum")
def test_the_pendulum_and_the_law_of_its_friction():
    """k/I from periods and amplitudes alone, T = 4 K(sin^2(a/2)) / sqrt(k/I), is the other path to the same value."""
    model, prepared = pendulum()
    errors = []
    for names in ((), ("coulomb_friction",), ("coulomb_friction", "quadratic_damping")):
        tried = model
        for name in names:
            tried = tried.with_term(get(name))
        fit = fit_model(tried, prepared)
        errors.append(predict(fit, prepared).error)
        assert fit.model.numbers()["q_gravity"] == pytest.approx(by_periods(), abs=0.1)
    assert errors[0] > errors[1] > errors[2]


@pytest.mark.long
@needs("pendulum")
def test_more_than_a_decay_is_asked_for_by_its_amplitude():
    """Dry friction and a dead band are a tie on this record: only a decay from further out could tell them apart."""
    model, prepared = pendulum()
    names = {"coulomb_friction", "dead_band"}
    found = diagnose(compare(model, prepared), without=[n for n in LIBRARY if n not in names and n not in model])
    rows = [r for r in found.candidates if r.entry.term.variation is None]  # changes along the record are asked for too
    assert {r.name for r in rows} == names
    rivals = rivals_of(rows, prepared)
    plan = next_test(rivals, own_limits(rivals.fits, rivals.present, 1.5), rehearsals=0)
    assert plan.choice.design.kind == LET_GO
    assert plan.choice.design.level > 1.0


def by_periods() -> float:
    t, angle, _ = np.loadtxt(DATA / "pendulum" / "single.csv", delimiter=",", skiprows=1).T
    up = np.flatnonzero((angle[:-1] < 0.0) & (angle[1:] >= 0.0))
    crossings = t[up] - angle[up] * (t[1] - t[0]) / (angle[up + 1] - angle[up])
    spans = [angle[a:b] for a, b in itertools.pairwise(up)]
    amplitude = 0.5 * np.array([np.max(s) - np.min(s) for s in spans])
    return float(np.mean((4.0 * ellipk(np.sin(0.5 * amplitude) ** 2) / np.diff(crossings)) ** 2))


@pytest.mark.long
@needs("wing")
def test_a_climb_of_a_structure_leaves_what_the_gallery_reads(tmp_path):
    """Each diagnosis is kept, and the structure reached."""
    options = ["--fit", "0:700", "--judge", "700:1200"]
    steps = climb([DATA / "wing" / "model_2.csv"], MODELS / "wing_2.yaml", options, 1, tmp_path)
    found = read_findings(tmp_path, "wing_2")
    assert [s["added"] for s in found.steps] == [s["added"] for s in steps]
    assert found.first["says"]
    assert len(list((tmp_path / "climb").glob("step_*"))) == len(steps)
    model = read_model(tmp_path / "climb" / "wing_2.yaml")
    assert len(model.terms) == 7 + sum(len(s["added"].split(" + ")) for s in steps if s["added"])
    key, value = "k[ground-heave]", 3318.0
    row = Published(record="wing_2", step="given", key=key, quantity="k", unit="", value=value, within="near")
    known = {c["key"]: c["value"] for c in steps[0]["coefficients"]}
    assert found_beside(row, found).found == known[key] > 0.0
