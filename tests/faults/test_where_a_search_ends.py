"""Where a search for faults ends that need not go on; no record is fitted here."""

from types import SimpleNamespace
from typing import Any

import pytest

from study.faults import accounting, leftover, search
from study.faults.fault import Fault
from study.faults.leftover import FittedResidual
from study.faults.search import SearchEnd, SearchStage, search_faults
from study.support.errors import DivergenceError
from study.support.thresholds import TOLERANCE

DRIFT, OFFSET = Fault("drift", "displacement", 1e-3, 1e-5), Fault("offset", "displacement", 1e-3, 1e-5)
LATE, NOISE = Fault("delay", "displacement", 1.0, 0.01), Fault("force_noise", "force", 1.0, 0.1)
ASKED = [(fault.fault, fault.channel) for fault in (DRIFT, OFFSET, LATE, NOISE)]


class Model:
    def __init__(self, *effects: str):
        self.terms = [SimpleNamespace(name=name) for name in effects]

    def __contains__(self, name: str) -> bool:
        return name in {term.name for term in self.terms}


def left(power: float, *effects: str) -> Any:
    return SimpleNamespace(relative_power=power, fit=SimpleNamespace(model=Model(*effects)))


def stage(faults: tuple[Fault, ...], power: float, *effects: str) -> SearchStage:
    plain = left(power)
    return SearchStage(None, faults, plain, left(power / 2.0, *effects) if effects else plain)


PASSED = (stage((), 1.0), stage((DRIFT,), 0.5), stage((DRIFT,), 0.5, "cubic_damping"))


def searched(
    monkeypatch: pytest.MonkeyPatch, stages: list[SearchStage], faults: tuple[Fault, ...] = ()
) -> tuple[SearchEnd, SearchEnd, int]:
    """Where a search with these stages ends, where the one before it has, and how many of the stages were asked for."""
    asked = 0

    def made(*_: Any):
        nonlocal asked
        for one in stages:
            asked += 1
            yield one

    monkeypatch.setattr(search, "_stages", made)
    monkeypatch.setattr(search, "searched_part", lambda given: given)
    monkeypatch.setattr(search, "_needed", lambda stage, *_: stage)
    before = SearchEnd((DRIFT, OFFSET), None, None, PASSED)
    return search_faults(None, None, faults, ASKED, before), before, asked


def test_a_search_that_arrives_where_another_has_passed_ends_as_that(monkeypatch):
    again = Fault("drift", "displacement", 1.01e-3, 1e-5)
    end, before, asked = searched(monkeypatch, [stage((), 0.9), stage((again,), 0.5003), stage((again, LATE), 0.3)])
    assert end is before
    assert asked == 2


def test_where_it_begins_it_stands_nowhere_yet(monkeypatch):
    """Before a fault is corrected a drift may be nearly all that is left, whatever the values of the model are."""
    end, _, asked = searched(monkeypatch, [stage((), 1.0), stage((LATE,), 0.3)])
    assert end.faults == (LATE,)
    assert asked == 2


@pytest.mark.parametrize(
    "other",
    [
        stage((DRIFT,), 0.5 * (1.0 + 2.0 * TOLERANCE)),  # beside which another amount is left
        stage((Fault("drift", "displacement", 2e-3, 1e-5),), 0.5),  # of another value
        stage((DRIFT, OFFSET), 0.5),
        stage((DRIFT, NOISE), 0.5),  # named, and not corrected
        stage((DRIFT,), 0.5, "quadratic_damping"),
        stage((), 0.5),
    ],
)
def test_elsewhere_it_goes_on_to_its_own_end(monkeypatch, other):
    end, before, asked = searched(monkeypatch, [stage((), 0.9), other, stage((LATE,), 0.3)])
    assert end is not before
    assert end.faults == (LATE,)
    assert asked == 3


@pytest.mark.parametrize(("needless", "expected"), [(True, 2), (False, 3)])
def test_it_ends_where_effects_have_made_needless_what_it_began_with(monkeypatch, needless, expected):
    monkeypatch.setattr(search, "_without_needless", lambda *_: PASSED[0] if needless else None)
    stages = [stage((LATE,), 0.9), stage((LATE,), 0.8, "cubic_damping"), stage((LATE, OFFSET), 0.3, "cubic_damping")]
    end, before, asked = searched(monkeypatch, stages, (LATE,))
    assert (end is before) == needless
    assert asked == expected


def test_what_it_did_not_begin_with_is_asked_for_at_its_end_alone(monkeypatch):
    monkeypatch.setattr(search, "_without_needless", lambda *_: pytest.fail("nothing is asked for"))
    end, *_ = searched(monkeypatch, [stage((LATE,), 0.8, "cubic_damping")])
    assert end.faults == (LATE,)


def test_after_noise_on_the_force_nothing_else_is_looked_for(monkeypatch):
    following = iter([stage((DRIFT,), 0.5), stage((DRIFT, NOISE), 0.5)])
    monkeypatch.setattr(search, "corrected", lambda given, _: given)
    monkeypatch.setattr(search, "leftover", lambda *_: left(1.0))
    monkeypatch.setattr(search, "_next", lambda *_: next(following))
    stages = list(search._stages(None, "fit", "fit", (), ASKED))
    assert [len(one.faults) for one in stages] == [0, 1, 2]


def test_noise_on_the_force_that_was_known_from_the_start_ends_nothing(monkeypatch):
    following = iter([stage((NOISE,), 1.0, "cubic_damping"), stage((NOISE, DRIFT), 0.5, "cubic_damping"), None])
    monkeypatch.setattr(search, "corrected", lambda given, _: given)
    monkeypatch.setattr(search, "leftover", lambda *_: left(1.0))
    monkeypatch.setattr(search, "_next", lambda *_: next(following))
    assert len(list(search._stages(None, "fit", "fit", (NOISE,), ASKED))) == 3


@pytest.mark.parametrize("fits", [(None, None), (None, "rich"), ("fit", None)])
def test_a_search_whose_models_do_not_run_has_no_stages(monkeypatch, fits):
    monkeypatch.setattr(search, "corrected", lambda given, _: given)
    monkeypatch.setattr(search, "leftover", lambda *_: left(1.0))
    assert not list(search._stages(None, *fits, (), ASKED))


@pytest.mark.parametrize(("above_noise", "asked"), [(0.5 * TOLERANCE, False), (2.0 * TOLERANCE, True), (None, True)])
def test_nothing_lies_beneath_what_leaves_noise_alone(monkeypatch, above_noise, asked):
    found = None if above_noise is None else SimpleNamespace(prediction=SimpleNamespace(above_noise=above_noise))
    looked = list[str]()
    monkeypatch.setattr(accounting, "leftover", lambda *_: found)
    monkeypatch.setattr(accounting, "corrected", lambda given, _: given)
    monkeypatch.setattr(accounting, "slow_response", lambda _, channel, *__: looked.append(channel))
    fit = SimpleNamespace(converged=True)
    monkeypatch.setattr(accounting, "has_lost_the_motion", lambda *_: False)
    plain = SearchEnd((), None, None)
    assert accounting._beneath_too(None, None, fit, (), [("drift", "displacement")], plain) is plain
    assert looked == ["displacement"] * asked


def test_what_runs_away_along_all_of_a_record_leaves_the_search_as_it_was(monkeypatch):
    """A fit that follows the part that was searched, read less late: before, the comparison ended with its sentence."""

    def runs_away(*_):
        raise DivergenceError("the free run diverges", 0.0)

    monkeypatch.setattr(accounting, "leftover", lambda *_: left(1.0))
    monkeypatch.setattr(accounting, "corrected", lambda given, _: given)
    monkeypatch.setattr(accounting, "_on_all", runs_away)
    plain = SearchEnd((), None, None)
    assert accounting._begun_late(LATE, None, None, (), ASKED, plain) is plain


def test_the_effect_that_explains_most_is_searched_for_once(monkeypatch):
    times = list[FittedResidual]()
    monkeypatch.setattr(leftover, "_beside_the_best", times.append)
    rich = FittedResidual(None, None)
    assert rich.missing is None
    assert rich.missing is None
    assert times == [rich]
