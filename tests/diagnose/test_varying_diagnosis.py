"""Coefficients that vary, found: along time, with a channel, in a step; and not where something else is missing."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from study.diagnose import verdict
from study.diagnose.confirmed_faults import diagnose_accounted
from study.diagnose.diagnosis_files import diagnosis_in_words
from study.diagnose.diagnosis_pictures import picture_files
from study.diagnose.verdict import MISSING
from study.equations.model_file import parse_model
from study.identify.time_domain.promised_changes import promised_changes
from study.records.record import Record
from study.records.record_layout import Layout
from study.support import work
from study.support.numbers import percent
from study.trials.draw import make_trial
from study.trials.varying import make_varying_trial
from study.way_in.compare_records import compare_records
from tests.public_records import DATA, needs


def diagnosed(kind, seed, **drawn):
    trial = make_varying_trial(kind, seed, **drawn)
    return trial, diagnose_accounted(compare_records([trial.record], trial.believed)).diagnosis


@pytest.mark.long
def test_a_stiffness_that_drifts_by_a_third_says_so_and_nothing_else():
    trial, found = diagnosed("drift", 4, of="linear_stiffness", change=-0.3, noise=0.01)
    assert found.verdict == MISSING
    assert found.answer.names == trial.hidden == ("linear_stiffness_over_time",)
    (one,) = found.varying
    assert one.symbol == "k"
    assert one.along == "time"
    said = diagnosis_in_words(found)
    assert "The model lacks linear stiffness that changes" in said
    before = compare_records([trial.record], trial.believed).comparison.prediction.error
    assert found.comparison.prediction.error < 0.9 * before
    assert f"where 'study compare' judges, the model leaves {percent(before)}" in said
    assert "varying.png" in picture_files(found, trial.record.name)


@pytest.mark.long
def test_a_channel_is_named_where_it_explains_more_than_time_does():
    trial, found = diagnosed("schedule", 2, of="linear_stiffness", change=0.2, noise=0.01)
    assert found.answer.names == trial.hidden == ("linear_stiffness_over_load",)


@pytest.mark.long
def test_a_schedule_is_seen_beside_a_nonlinearity_that_does_more():
    _, found = diagnosed("schedule_and_nonlinearity", 2, noise=0.01)
    assert set(found.answer.names) == {"linear_stiffness_over_load", "cubic_stiffness"}


def test_a_linear_system_and_a_cubic_one_promise_no_change_to_search_for():
    for kind in ("nothing", "nonlinear"):
        trial = make_varying_trial(kind, 3, noise=0.02, samples=8192)
        found = compare_records([trial.record], trial.believed)
        fit = found.comparison.fit
        seen = promised_changes(fit, found.comparison.prepared, fit.model.terms)
        assert seen is None or not seen.alone
        assert not found.put_off


def test_in_one_decay_nothing_changes_with_time_as_its_amplitude_falls_with_it(monkeypatch: pytest.MonkeyPatch):
    trial = make_trial(630_011, ("quadratic_damping",), 0.002, "displacement", test="free_decay")
    comparison = compare_records([trial.record], trial.believed).comparison
    fit, prepared = comparison.fit, comparison.prepared
    assert prepared.free
    assert promised_changes(fit, prepared, fit.model.terms) is None
    monkeypatch.setattr("study.identify.time_domain.promised_changes._one_run", lambda _: False)
    seen = promised_changes(fit, prepared, fit.model.terms)
    assert seen is not None
    assert any(entry.name == "linear_damping_over_time" for entry in seen.shares)


def grown_and_whole(monkeypatch: pytest.MonkeyPatch, grown: Any, whole: Any, beside: bool) -> tuple[list[bool], Any]:
    """What is asked for, and what stands, where two searches end in these diagnoses; nothing is fitted here."""
    made: list[bool] = []

    def diagnosis(*_: Any, from_above: bool = True, **__: Any) -> Any:
        made.append(from_above)
        return whole if from_above else grown

    comparison: Any = SimpleNamespace()
    seen = SimpleNamespace(comparison=comparison, entries=[])
    monkeypatch.setattr(verdict, "_diagnosis", diagnosis)
    monkeypatch.setattr(verdict.varying_candidates, "suspect", lambda *_: seen)
    monkeypatch.setattr(verdict.varying_candidates, "simplest", lambda _: [])
    monkeypatch.setattr(verdict.candidates, "try_all", lambda *_: [])
    nothing: Any = None
    return made, verdict._changing(nothing, comparison, nothing, [nothing], [], None, beside=beside)


@dataclass(frozen=True)
class Said:
    """Of a diagnosis what is asked here."""

    changes: bool
    ended: str = ""


@pytest.mark.parametrize(
    ("beside", "grown", "asked"),
    [(True, Said(False), [False]), (True, Said(True), [False, True]), (True, Said(True, "by hand"), [False]),
     (False, Said(True), [True])],
)  # fmt: skip
def test_beside_what_is_named_a_change_has_to_gain_before_all_effects_are_asked_for_at_once(
    monkeypatch: pytest.MonkeyPatch, beside: bool, grown: Said, asked: list[bool]
):
    """Nor are they where the user has ended the search."""
    whole = Said(True)
    made, stands = grown_and_whole(monkeypatch, grown, whole, beside)
    assert made == asked
    assert stands is (whole if asked[-1] else grown)


def test_a_change_that_gained_stands_where_asking_for_all_at_once_comes_to_no_end(monkeypatch: pytest.MonkeyPatch):
    _, stands = grown_and_whole(monkeypatch, Said(True), Said(False, "at its limit"), beside=True)
    assert stands == Said(True, "at its limit")


@dataclass(frozen=True)
class Named:
    """A diagnosis that names something, without a change of a coefficient or with one."""

    changes: bool
    ended: str = ""
    verdict: str = MISSING
    sets: tuple[Any, ...] = (SimpleNamespace(fit=None, names=(), prediction=SimpleNamespace(above_noise=1.0)),)
    candidates: tuple[Any, ...] = ()


def diagnosed_unless(monkeypatch: pytest.MonkeyPatch, another: Callable[[Any], bool]) -> tuple[Any, list[Any]]:
    """What stands, and of what it was asked whether what is left has another reason, in ten operations."""
    comparison: Any = SimpleNamespace(
        fit=SimpleNamespace(model=SimpleNamespace(terms=())),
        prepared=SimpleNamespace(record=SimpleNamespace(rotations=())),
    )
    for name, returned in (
        ("search_base", None), ("candidate_entries", []), ("_freed", None), ("_diagnosis", Named(False)),
        ("_where_none_explains_it", []), ("_changing", Named(True)),
    ):  # fmt: skip
        monkeypatch.setattr(verdict, name, lambda *_, r=returned, **__: r)
    monkeypatch.setattr(verdict, "promised_changes", lambda *_: SimpleNamespace(shares=()))
    monkeypatch.setattr(verdict.candidates, "try_all", lambda *_: [])
    monkeypatch.setattr(verdict.varying_candidates, "first_of_all", lambda *_: False)
    monkeypatch.setattr(verdict.varying_candidates, "explains_more", lambda *_: True)
    asked: list[Any] = []
    with work.limited_to(10):
        stands = verdict._diagnosed(comparison, (), (), None, lambda one: bool(asked.append(one)) or another(one))
    return stands, asked


@pytest.mark.parametrize("another", [True, False])
def test_a_change_is_asked_for_unless_what_is_left_has_another_reason(monkeypatch: pytest.MonkeyPatch, another: bool):
    stands, asked = diagnosed_unless(monkeypatch, lambda _: another)
    assert asked == [Named(False)]
    assert stands == Named(not another)


def test_no_change_is_asked_for_where_all_work_is_done(monkeypatch: pytest.MonkeyPatch):
    """Asking for another reason has taken what was left of it."""
    stands, asked = diagnosed_unless(monkeypatch, lambda _: bool(work.add(10)))
    assert asked
    assert not stands.changes
    assert stands.ended == f"{work.ENDED}, before changes were asked for"


def test_where_a_coefficient_seems_to_change_faults_that_look_like_it_are_put_off():
    trial = make_varying_trial("drift", 4, of="linear_stiffness", change=-0.3, noise=0.01)
    found = compare_records([trial.record], trial.believed)
    assert found.put_off
    assert found.faults == ()
    assert any("a coefficient seems to change along the record" in note for note in found.comparison.notes)


def beam():
    entries = ("inertia", "linear_damping", "linear_stiffness", "{term: linear_stiffness, varies_with: pin_location}")
    return parse_model("name: beam\nterms:\n" + "".join(f"  - {entry}\n" for entry in entries), Path("beam.yaml"))


def ten_steps():
    values = np.genfromtxt(DATA / "movable_support" / "ten_steps.csv", delimiter=",", skip_header=1)
    still = np.zeros(len(values))
    channels = {"force": still, "acceleration": values[:, 1], "pin_location": values[:, 3]}
    return Record(0.001, channels, {"acceleration": "V", "pin_location": "V"}, "ten_steps")


@pytest.mark.long
@needs("movable_support")
def test_the_stiffness_of_a_beam_follows_the_pin_of_its_support():
    """Free decays between moves: its frequencies at each place of the pin, out and back, are those of the README."""
    use = ((0.85, 1.83), (2.07, 3.0), (3.25, 4.19), (4.42, 5.4), (5.6, 6.57), (6.77, 7.74), (7.98, 8.92),
           (10.42, 11.29), (11.52, 13.9))  # fmt: skip
    found = compare_records([ten_steps()], beam(), Layout(use=use, cutoff=15.0)).comparison
    (one,) = found.varying
    pins, frequencies = (1.64, 2.08, 2.5, 2.93, 3.36), (28.1, 30.8, 34.0, 37.5, 42.0)
    shown = np.sqrt(np.interp(pins, one.at, one.value)) / (2.0 * np.pi)
    assert np.allclose(shown, frequencies, rtol=0.02)
    assert np.sqrt(one.value[0]) / (2.0 * np.pi) == pytest.approx(26.0, rel=0.02)  # the vaguest


def band_brake(name: str) -> Record:
    values = np.genfromtxt(DATA / "friction_damper" / f"{name}0.015forward.csv", delimiter=",", skip_header=1)
    inch, pound = 25.4, 4.44822
    columns = {
        "displacement": (1, inch),
        "force": (2, 1000.0 * pound),
        "band1_force": (5, pound),
        "band2_force": (6, pound),
    }
    units = {"displacement": "mm", **dict.fromkeys(("force", "band1_force", "band2_force"), "N")}
    return Record(values[1, 0], {c: f * values[:, i] for c, (i, f) in columns.items()}, units, name)


@pytest.mark.long
@needs("friction_damper")
@pytest.mark.parametrize("name", ["harmonic", "step"])
def test_the_friction_of_a_band_brake_follows_one_band_in_each_direction(name: str):
    """While it slips, behind the backlash of a reversal: there the velocity is more than 0.6 of its largest."""
    forward, backward = (
        f"{{term: coulomb_friction, varies_with: {band}, only: {side}}}"
        for band, side in (("band2_force", "v > 0"), ("band1_force", "v < 0"))
    )
    terms = ("coulomb_friction", forward, backward)
    model = parse_model("name: brake\nterms:\n" + "".join(f"  - {term}\n" for term in terms), Path("brake.yaml"))
    found = compare_records([band_brake(name)], model).comparison
    judged = slice(*found.prepared.plan.judge)
    velocity, acting = found.record["velocity"][judged], found.record["force"][judged]
    for sign in (1.0, -1.0):
        slips = sign * velocity > 0.6 * np.max(np.abs(velocity))
        assert 1.0 - np.mean(found.prediction.residual[slips] ** 2) / np.var(acting[slips]) > 0.95


@pytest.mark.long
@needs("friction_damper")
def test_what_a_band_brake_lacks_is_its_bands_and_no_displacement():
    model = parse_model("name: brake\nterms:\n  - coulomb_friction\n", Path("brake.yaml"))
    found = diagnose_accounted(compare_records([band_brake("harmonic")], model)).diagnosis
    assert {"coulomb_friction_forward_over_band2_force", "coulomb_friction_backward_over_band1_force"} <= set(
        found.answer.names
    )
    assert all(name.startswith("coulomb_friction_") for name in found.answer.names)
    assert found.answer.response_error < 0.05
