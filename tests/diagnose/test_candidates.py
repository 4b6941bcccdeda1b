"""Candidates that are tried one by one: all of them, or those that promise most where all work is done."""

from types import SimpleNamespace
from typing import Any

import pytest

from study.diagnose import candidates, verdict
from study.diagnose.candidates import MOST_PROMISING, SETTLED, FittedCandidate, try_all, with_best_settled
from study.diagnose.ranking import rank
from study.equations.model import ModelTerm, free
from study.equations.terms import LIBRARY
from study.identify.time_domain.shape_search import Start
from study.support import work
from study.trials import make_trial
from study.way_in.compare_records import compare_records

ENTRIES = [free(term) for term in LIBRARY.values()][: 2 * MOST_PROMISING]


def tried(monkeypatch: pytest.MonkeyPatch, done: bool) -> list[str]:
    """Names of what is fitted beside a single mass, where the last of the entries promises most; nothing runs here."""

    def starts_of(entries: list[ModelTerm], _: Any) -> list[list[Start]]:
        return [[Start((), (), float(i))] if i else [] for i in range(len(entries))]

    monkeypatch.setattr(candidates, "starts_of", starts_of)
    monkeypatch.setattr(candidates, "attempt", lambda entry, *_: SimpleNamespace(entry=entry))
    base: Any = SimpleNamespace(several=False)
    with work.limited_to(0 if done else 1):
        return [candidate.entry.name for candidate in try_all(ENTRIES, base)]


def test_every_candidate_of_a_single_mass_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    assert tried(monkeypatch, done=False) == [entry.name for entry in ENTRIES]


def test_where_all_work_is_done_those_that_promise_most_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    assert tried(monkeypatch, done=True) == [entry.name for entry in ENTRIES[-MOST_PROMISING:]]


def test_where_nothing_that_is_tried_has_a_finite_motion_nothing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    trial = make_trial(6, ("cubic_stiffness",), 1e-4)
    comparison = compare_records([trial.record], trial.believed).comparison
    monkeypatch.setattr(candidates, "attempt", lambda *_: None)
    monkeypatch.setattr(work, "MOST", (0, 0))
    found = verdict.diagnose(comparison)
    assert found.verdict == verdict.UNKNOWN
    assert (found.candidates, found.sets) == ((), ())
    assert found.ended == f"{work.ENDED} at single effects"


def test_the_search_for_faults_leaves_half_of_the_work_to_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    limits: list[float] = []
    counted = work.limited_to

    def limited_to(most: float) -> Any:
        limits.append(most)
        return counted(most)

    monkeypatch.setattr(work, "limited_to", limited_to)
    trial = make_trial(6, ("cubic_stiffness",), 1e-4)
    found = compare_records([trial.record], trial.believed)
    assert limits == [work.most_for(len(found.given.record)) / 2.0]
    assert found.work_left >= limits[0]


@pytest.mark.parametrize(("done", "settled"), [(False, SETTLED), (True, 1)])
def test_the_best_are_settled_once_and_where_all_work_is_done_the_best_alone(
    monkeypatch: pytest.MonkeyPatch, done: bool, settled: int
) -> None:
    errors = [0.5, 0.3, 0.1, 0.4, 0.2, 0.6]
    made: list[float] = []

    def finished(fit: Any, _: Any) -> Any:
        made.append(fit)
        return fit

    def judged(_: Any, fit: Any, __: Any) -> FittedCandidate:
        return FittedCandidate((), fit, SimpleNamespace(error=fit))  # type: ignore[arg-type]

    prepared: Any = None
    monkeypatch.setattr(candidates, "with_all_knots", lambda fit, _: fit)
    monkeypatch.setattr(candidates, "finished", finished)
    monkeypatch.setattr(candidates, "judged_candidate", judged)
    monkeypatch.setattr(FittedCandidate, "unphysical", "")
    monkeypatch.setattr(FittedCandidate, "term", SimpleNamespace(effort=1.0))
    with work.limited_to(0 if done else 1):
        once = with_best_settled([judged((), error, prepared) for error in errors], prepared)
        again = with_best_settled(once, prepared)
    assert [c.prediction.error for c in once] == sorted(errors)
    assert sorted(made) == sorted(errors)[:settled]
    assert again == once


def test_what_was_ranked_is_not_measured_again(monkeypatch: pytest.MonkeyPatch) -> None:
    trial = make_trial(6, ("cubic_stiffness",), 1e-4)
    comparison = compare_records([trial.record], trial.believed).comparison
    base = verdict.search_base(comparison)
    tried = [candidates.attempt(free(LIBRARY[name]), base) for name in ("cubic_stiffness", "quadratic_damping")]
    rows = rank([c for c in tried if c is not None], comparison)
    monkeypatch.setattr("study.diagnose.ranking.ranked_candidate", None)
    again = rank(rows[::-1], comparison)
    assert [row.name for row in again] == [row.name for row in rows] == ["cubic_stiffness", "quadratic_damping"]
    assert [(r.p_value, r.gain, r.distance) for r in again] == [(r.p_value, r.gain, r.distance) for r in rows]
