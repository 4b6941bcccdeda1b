"""A diagnosis that names a set of effects, and what it says of the others that the record cannot tell from it."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from study import cli
from study.diagnose import verdict
from study.diagnose.adding import added_candidate
from study.diagnose.confirmed_faults import Diagnosed, diagnose_accounted
from study.diagnose.diagnosis_report import diagnosis_fields, set_table
from study.diagnose.diagnosis_sentences import diagnosis_sentences
from study.diagnose.verdict import MISSING, NOTHING, PARTLY_KNOWN, SEVERAL, UNKNOWN, Diagnosis
from study.equations.terms import LIBRARY
from study.support import work
from study.trials.draw import Trial, make_trial
from study.trials.findings import compared
from study.trials.runs import rig_orders
from study.trials.sealed import write_trial
from study.way_in.compare_records import compare_records

HIDDEN = ("quadratic_stiffness", "coulomb_friction", "cubic_damping")
OFFERED = (*HIDDEN, "cubic_stiffness", "quadratic_damping", "constant_force")
NOTHING_YET: Any = None


def found(kind: str, *sets: str) -> Diagnosis:
    """A diagnosis of this verdict with sets of effects of one letter each, the answer first."""
    rows: Any = tuple(SimpleNamespace(names=tuple(names)) for names in sets)
    return Diagnosis(kind, NOTHING_YET, (), 9, 0.0, rows, ())


def test_how_often_each_effect_is_in_the_sets_is_counted_the_most_frequent_first():
    assert found(SEVERAL, "ab", "bc", "bd", "cd", "c").included == {"b": 3, "c": 3, "d": 2, "a": 1}
    assert list(found(SEVERAL, "ab", "cb").included) == ["b", "a", "c"]
    assert found(NOTHING).included == {}


def test_alike_are_effects_that_stand_in_the_place_of_one_of_the_answer():
    diagnosis = found(SEVERAL, "ab", "cb", "db", "ae", "cd", "abf", "c")
    assert diagnosis.alike == {"a": ("c", "d"), "b": ("e",)}


def test_of_a_single_effect_those_that_do_as_much_are_alike():
    assert found(MISSING, "a", "b", "c", "bc").alike == {"a": ("b", "c")}


@pytest.mark.parametrize("kind", [NOTHING, UNKNOWN])
def test_without_an_answer_nothing_is_alike(kind: str):
    diagnosis = found(kind, "ab", "cb")
    assert diagnosis.answer is None
    assert diagnosis.alike == {}


@pytest.mark.parametrize("kind", [MISSING, SEVERAL, PARTLY_KNOWN])
def test_the_answer_is_the_first_of_the_sets(kind: str):
    diagnosis = found(kind, "ab", "cb")
    assert diagnosis.answer is diagnosis.sets[0]


def a_set(names: str, error: float) -> Any:
    prediction = SimpleNamespace(error=error, above_noise=0.0)
    return SimpleNamespace(names=tuple(names), entries=tuple(names), prediction=prediction, fit=None)


@pytest.mark.parametrize(("left", "kept"), [(0.03, "abc"), (0.05, "ab"), (0.2, "a")])
def test_an_effect_explains_more_than_what_is_left_or_goes(monkeypatch: pytest.MonkeyPatch, left: float, kept: str):
    errors = {"abc": 0.06, "ab": 0.0721, "ac": 0.2, "bc": 0.3, "a": 0.15, "b": 0.4, "c": 0.5}  # c explains 4 %, b 13 %
    sets = {frozenset(names): a_set(names, error) for names, error in errors.items()}
    search: Any = SimpleNamespace(tried=sets, without=lambda names, name: sets.get(names - {name}))
    monkeypatch.setattr(verdict, "_left", lambda *_: left)
    rows: Any = list(sets.values())
    comparison: Any = SimpleNamespace(prediction=SimpleNamespace(error=0.5))
    answer, beside = verdict._material(sets[frozenset("abc")], left, rows, search, comparison)
    assert "".join(answer.names) == kept
    assert beside == left


@pytest.mark.parametrize(("before", "kept"), [(0.3, "a"), (0.02, "ab")])
def test_an_effect_that_explains_next_to_nothing_goes(monkeypatch: pytest.MonkeyPatch, before: float, kept: str):
    """It explains 0.5 % of the response: of 30 % that are unexplained that is next to nothing, of 2 % it is not."""
    sets = {frozenset(names): a_set(names, error) for names, error in {"ab": 0.01, "a": 0.01118, "b": before}.items()}
    search: Any = SimpleNamespace(tried=sets, without=lambda names, name: sets.get(names - {name}))
    monkeypatch.setattr(verdict, "_left", lambda *_: 0.0)
    rows: Any = list(sets.values())
    comparison: Any = SimpleNamespace(prediction=SimpleNamespace(error=before))
    answer, _ = verdict._material(sets[frozenset("ab")], 0.0, rows, search, comparison)
    assert "".join(answer.names) == kept


def test_a_set_that_others_were_taken_out_of_is_held_against_those_of_its_size(monkeypatch: pytest.MonkeyPatch):
    """Only against those that come near it with no more unknowns and are physical; the best of them is the answer."""
    fitted = {
        "ab": (0.1, 2, ""), "cb": (0.099, 2, ""), "db": (0.3, 2, ""), "eb": (0.099, 4, ""),
        "fb": (0.099, 2, "a mass is positive"), "c": (0.1, 1, ""), "abc": (0.05, 3, ""),
    }  # fmt: skip
    tried: list[Any] = []
    for names, (error, unknowns, unphysical) in fitted.items():
        row = a_set(names, error)
        row.prediction.residual, row.unknowns, row.unphysical = error, unknowns, unphysical
        tried.append(row)
    search: Any = SimpleNamespace(
        tried={frozenset(row.names): row for row in tried},
        sets=lambda size: [row for row in tried if len(row.names) == size],
    )
    monkeypatch.setattr(verdict.statistics, "worse", lambda one, other: 100.0 * (one - other))
    monkeypatch.setattr(verdict, "with_best_settled", lambda rows, _: rows)
    monkeypatch.setattr(verdict, "rank", lambda rows, *_: sorted(rows, key=lambda row: row.prediction.error))
    comparison: Any = SimpleNamespace(prepared=None)
    rows = verdict._as_simple(tried[0], search, comparison)
    assert ["".join(row.names) for row in rows] == ["cb", "ab"]


@pytest.mark.parametrize(
    ("sets", "explained", "unphysical", "core"),
    [
        (("abc", "abd", "abf"), 0.95, "", "ab"),
        (("abc", "ad"), 0.95, "", "a"),
        (("abc", "d"), 0.9, "", None),  # they have nothing alike
        (("abc", "abd"), 0.8, "", None),  # what they have alike does not explain nearly all
        (("abc", "abd"), 0.9, "a mass is positive", None),
    ],
)
def test_what_all_good_sets_have_is_a_set_of_its_own(
    monkeypatch: pytest.MonkeyPatch, sets: tuple[str, ...], explained: float, unphysical: str, core: str | None
):
    tried = {frozenset(names): a_set(names, 0.1) for names in ("ab", "ac", "bc", "a", "b", "c", *sets)}
    search: Any = SimpleNamespace(tried=tried, without=lambda names, name: tried.get(names - {name}))
    monkeypatch.setattr(verdict, "with_best_settled", lambda rows, _: rows)
    monkeypatch.setattr(verdict, "rank", lambda rows, *_: [
        SimpleNamespace(**vars(row), gain=SimpleNamespace(explained=explained), unphysical=unphysical) for row in rows
    ])  # fmt: skip
    comparison: Any = SimpleNamespace(prepared=None)
    found = verdict._necessary([a_set(names, 0.1) for names in sets], search, [], comparison, 9)
    assert ("".join(found.names) if found else None) == core


def test_an_effect_that_was_settled_alone_is_not_settled_again_as_what_all_sets_have(monkeypatch: pytest.MonkeyPatch):
    """Of a structure at its limit of work that took 3e9 operations for the second time."""
    tried = {frozenset(names): a_set(names, 0.1) for names in ("a", "c", "d", "ac", "ad")}
    search: Any = SimpleNamespace(tried=tried, without=lambda names, name: tried.get(names - {name}))
    asked: list[Any] = []
    monkeypatch.setattr(verdict, "with_best_settled", lambda rows, _: asked.extend(rows) or rows)
    monkeypatch.setattr(
        verdict, "rank", lambda *_: [SimpleNamespace(gain=SimpleNamespace(explained=0.95), unphysical="")]
    )
    comparison: Any = SimpleNamespace(prepared=None)
    row: Any = a_set("a", 0.09)
    assert verdict._necessary([a_set("ac", 0.1), a_set("ad", 0.1)], search, [row], comparison, 9)
    assert asked == [row]
    assert asked[0] is row


@pytest.fixture(scope="module")
def rig() -> Trial:
    return make_trial(105, HIDDEN, 0.02**2, "displacement", test="like_the_report")


@pytest.fixture(scope="module")
def of_three(rig: Trial) -> Diagnosed:
    compared = compare_records([rig.record], rig.believed)
    return diagnose_accounted(compared, without=[name for name in LIBRARY if name not in OFFERED])


@pytest.mark.long
def test_three_hidden_effects_are_named_together_with_their_coefficients(rig: Trial, of_three: Diagnosed):
    diagnosis = of_three.diagnosis
    assert diagnosis.verdict == SEVERAL
    assert diagnosis.answer is not None
    assert set(diagnosis.answer.names) == set(HIDDEN)
    assert diagnosis.left == 0.0
    assert [row.name for row in diagnosis.candidates[:3]] == list(diagnosis.answer.names)
    true = rig.truth.numbers()
    for effect in diagnosis.answer.effects:
        assert abs(effect.coefficient - true[effect.entry.symbols[0]]) < 3.0 * effect.error
        assert effect.error < 0.02 * abs(effect.coefficient)
        assert effect.idle == ""


@pytest.mark.long
@pytest.mark.parametrize("seed", [780065, 780084], ids=["blows", "stepped"])
def test_what_grows_astray_from_wrong_effects_is_found_beside_all_of_them(seed: int):
    """Curved springs stood for a loop, and others for a force that is periodic in position."""
    order = next(one for one in rig_orders() if one.seed == seed)
    trial = make_trial(order.seed, order.hidden, order.noise, order.response, test=order.test)
    answer = diagnose_accounted(compared(trial, trial.believed)).diagnosis.answer
    assert answer is not None
    assert set(answer.names) == set(trial.hidden)


@pytest.mark.long
def test_what_no_effect_explained_alone_is_no_noise_on_the_force_beside_the_set(of_three: Diagnosed):
    assert [fault.fault for fault in of_three.accounted.faults] == ["force_noise"]
    assert of_three.faults == ()


@pytest.mark.long
def test_sentence_table_and_fields_hold_the_set(of_three: Diagnosed):
    diagnosis = of_three.diagnosis
    names = diagnosis.answer.names if diagnosis.answer else ()
    said = diagnosis_sentences(diagnosis)
    assert said[0].endswith(" are missing.")
    assert all(words in said[0].lower() for words in ("quadratic stiffness", "coulomb friction", "cubic damping"))
    assert "falls from 19.6 % to 2.03 %" in said[1]
    table = set_table(diagnosis)
    assert ", ".join(names) in table
    assert "2.03 %" in table
    fields = diagnosis_fields(diagnosis)
    assert fields["verdict"] == "missing_effects"
    assert [effect["term"] for effect in fields["sets"][0]["effects"]] == list(names)
    assert fields["sets"][0]["distance"] == 0.0
    assert fields["in_sets"] == dict.fromkeys(names, 1)


@pytest.mark.long
def test_a_set_that_is_added_leaves_what_was_promised(of_three: Diagnosed):
    diagnosis = of_three.diagnosis
    assert diagnosis.answer is not None
    after = added_candidate(diagnosis.comparison, diagnosis.answer)
    assert after.prediction.error == pytest.approx(diagnosis.answer.response_error, rel=0.03)
    assert {term.name for term in after.model.terms} >= set(HIDDEN)


@pytest.mark.long
def test_a_table_of_sets_is_for_sets_alone(of_three: Diagnosed):
    diagnosis = of_three.diagnosis
    assert set_table(replace(diagnosis, verdict=MISSING, sets=diagnosis.candidates[:1])) == ""


@pytest.mark.long
def test_a_search_ends_after_its_work_and_says_so_unless_it_is_thorough(
    rig: Trial, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """What was fitted by then is told; the limit is as low as can be here."""
    record, model, _ = write_trial(rig, tmp_path)
    words = ["diagnose", str(record), "--model", str(model), "--out", str(tmp_path / "found")]
    words += [word for name in LIBRARY if name not in HIDDEN for word in ("--without", name)]
    monkeypatch.setattr(work, "MOST", (1, 0))
    assert cli.main(words) == 0
    assert f"The search was ended {work.ENDED} at sets of 1: what is said is the best so far." in spoken(capsys)
    assert cli.main([*words, "--thorough"]) == 0
    told = spoken(capsys)
    assert "was ended" not in told
    assert "Quadratic stiffness" in told


def spoken(capsys: pytest.CaptureFixture[str]) -> str:
    """What was printed, in one line."""
    return " ".join(capsys.readouterr().out.split())
