"""Trials like real rigs: what is drawn, how large each effect is, and how sets are scored."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from study.diagnose.confirmed_faults import diagnose_accounted
from study.diagnose.held_out import held_out_of
from study.equations.model import free
from study.equations.place import Place
from study.equations.terms import LIBRARY, get
from study.support.errors import StudyError
from study.support.thresholds import K
from study.trials import make_trial, rates
from study.trials.effect_sets import Truth, truth_of
from study.trials.findings import compared
from study.trials.kept import KEPT_TABLES, LIKE_RIGS, differing_trials
from study.trials.rigs import ALIKE, RANGES, RIG_KINDS, RIG_NOISES
from study.trials.runs import rig_orders, run_trial
from study.way_in.compare_records import compare_records

KEPT = Path(__file__).parents[2] / "docs" / "trials_like_rigs.csv"


def test_there_are_as_many_as_were_asked_for_and_a_fifth_are_structures() -> None:
    orders = rig_orders()
    assert len(orders) >= 250
    assert len({order.seed for order in orders}) == len(orders)
    assert sum(order.test == "rig_structure" for order in orders) == len(orders) // 5
    assert {order.test for order in orders} == set(RIG_KINDS)


@pytest.mark.parametrize("test", RIG_KINDS)
def test_each_kind_hides_what_it_says_and_is_the_same_again(test: str) -> None:
    one, again = (make_trial(3, ("coulomb_friction", "directional_damping"), test=test) for _ in range(2))
    assert all(np.array_equal(one.record[channel], again.record[channel]) for channel in one.channels)
    assert one.truth == again.truth
    low, high = RANGES.kept
    assert all(low <= share <= high for share in one.shares)
    assert one.noise in RIG_NOISES
    known = {entry.name for entry in one.believed.terms}
    left = {entry.name for entry in one.truth.terms} - known - set(one.hidden)
    assert len(left) == ("remainder" in one.about)
    assert known.isdisjoint(one.hidden)


@pytest.mark.parametrize("test", RIG_KINDS)
def test_none_to_four_effects_are_drawn_and_no_two_that_differ_little(test: str) -> None:
    rng = np.random.default_rng(1)
    drawn = [tuple(RIG_KINDS[test].drawn(rng)) for _ in range(300)]
    assert {len(names) for names in drawn} == {0, 1, 2, 3, 4}
    assert all(len(set(names)) == len(names) for names in drawn)
    assert all(len(set(names) & set(alike)) < 2 for names in drawn for alike in ALIKE)
    assert {name for names in drawn for name in names} == set(RIG_KINDS[test].possible)
    alone = [names for names in drawn if "constant_force" in names and all(get(n).placeless for n in names)]
    assert not alone or test == "rig_axis", "an offset of the sensor, where nothing knows the place"


def test_an_effect_that_is_left_out_leaves_the_error_that_was_asked_for() -> None:
    """... when everything else is fitted again: the linear estimate of it holds."""
    trial = make_trial(4, ("quadratic_damping", "cubic_stiffness"), RIG_NOISES[0], test="rig_noise")
    for name, share in zip(trial.hidden, trial.shares, strict=True):
        without = trial.completed.without_term(name)
        assert compare_records([trial.record], without).comparison.prediction.error == pytest.approx(share, rel=0.35)


@pytest.fixture(scope="module")
def swings() -> Truth:
    trial = make_trial(9, ("quadratic_damping", "quadratic_stiffness"), RIG_NOISES[0], test="rig_decay")
    return truth_of(trial)


def test_effects_that_are_one_along_a_motion_count_as_one(swings: Truth) -> None:
    entries = [free(get(name)) for name in ("displacement_damping", "quadratic_stiffness", "cubic_stiffness")]
    assert swings.same(entries[0], "quadratic_damping")
    assert not swings.same(entries[2], "quadratic_damping")
    assert not swings.same(entries[1], "quadratic_damping"), "it is the other one, whatever it looks like"
    assert swings.found(entries[:2]) == (2, 0)
    assert swings.found(entries[1:]) == (1, 1)
    assert swings.found(entries) == (2, 0)
    assert swings.found([entries[0], free(get("quadratic_damping"))]) == (1, 1), "one for each, not one for two"
    assert swings.found([]) == (0, 2)
    assert swings.found(entries[:1], ("quadratic_stiffness",)) == (1, 0)
    assert swings.found(entries[:2], ("quadratic_stiffness",)) == (2, 0), "an offset beside it takes it from nobody"


def test_what_is_the_remainder_along_a_motion_is_there_but_need_not_be_named(swings: Truth) -> None:
    hidden, added = "quadratic_stiffness", dict(swings.added)
    truth = replace(swings, added={hidden: added[hidden]}, remainder={"remainder": added["quadratic_damping"]})
    damping, stiffness, another = (free(get(name)) for name in ("displacement_damping", hidden, "cubic_stiffness"))
    assert truth.found([stiffness, damping]) == (2, 0)
    assert truth.found([stiffness]) == (1, 0)
    assert truth.found([damping]) == (1, 1), "what is hidden is left"
    assert truth.found([stiffness, another]) == (1, 0)


def test_an_effect_at_another_place_is_another_one() -> None:
    hidden = ("cubic_stiffness",)
    for seed in range(1, 20):
        trial = make_trial(seed, hidden, RIG_NOISES[0], "displacement", test="rig_structure")
        if "remainder" not in trial.about:
            break
    truth, (true,) = truth_of(trial), trial.effects
    elsewhere = next(t.place for t in trial.truth.terms if t.term.name == "linear_stiffness" and t.place != true.place)
    assert truth.same(replace(true, coefficients=(None,)), true.name)
    turned = Place("between", true.place.ends[::-1])
    assert truth.same(free(true.term, turned), true.name)
    assert not truth.same(free(true.term, elsewhere), true.name)


def test_a_row_has_the_columns_of_its_table() -> None:
    order = next(order for order in rig_orders() if order.test == "rig_component")
    row = run_trial(order)
    assert tuple(row) == KEPT_TABLES[LIKE_RIGS].columns
    assert row["trouble"] == ""
    assert row["error_true"] < row["error_before"]


def test_the_kept_table_is_of_these_trials() -> None:
    kept = pd.read_csv(KEPT)
    assert tuple(kept.columns) == KEPT_TABLES[LIKE_RIGS].columns
    assert list(zip(kept["test"], kept["seed"], strict=True)) == [(order.test, order.seed) for order in rig_orders()]


@pytest.mark.long
@pytest.mark.parametrize("seed", [780005, 780006, 780007])
def test_a_row_of_the_kept_table_comes_out_again(seed: int, tmp_path: Path) -> None:
    order = next(order for order in rig_orders() if order.seed == seed)
    pd.DataFrame([run_trial(order)]).to_csv(tmp_path / "own.csv", index=False)
    assert differing_trials(pd.read_csv(tmp_path / "own.csv"), pd.read_csv(KEPT), LIKE_RIGS) == []


def test_how_far_the_true_set_is_behind_the_best() -> None:
    trial = make_trial(2, ("cubic_stiffness",), RIG_NOISES[0], test="rig_component")
    truth, offered = truth_of(trial), ("cubic_stiffness", "quadratic_damping")
    begun = compared(trial, trial.believed)
    found = diagnose_accounted(begun, without=[name for name in LIBRARY if name not in offered]).diagnosis
    assert found.answer is not None
    assert found.answer.names == trial.hidden
    assert abs(truth.behind(found)) < K
    assert truth.behind(replace(found, sets=(), candidates=())) < 0.0, "the model as given leaves more"
    astray = replace(truth, held_out=held_out_of(found.comparison))
    assert astray.behind(found) > K


def test_the_true_set_is_held_against_the_best_without_the_remainder() -> None:
    for seed in range(1, 20):
        trial = make_trial(seed, ("cubic_stiffness",), RIG_NOISES[0], test="rig_component")
        if "remainder" in trial.about:
            break
    truth = truth_of(trial)
    assert truth.remainder
    assert np.std(truth.held_out.judged) > 1.1 * np.std(truth.prediction.residual)


def test_rates_are_of_what_they_say() -> None:
    rows = [
        {
            "hidden": "a+b",
            "named": "a+b",
            "named_count": 2,
            "there": 2,
            "right": 1,
            "holds": 1,
            "true_behind": 0.0,
            "seconds": 60.0,
        },
        {
            "hidden": "a+b",
            "named": "a",
            "named_count": 1,
            "there": 1,
            "right": 0,
            "holds": 0,
            "remainder": "x",
            "true_behind": 1.1 * K,
        },
        {"hidden": "a+b+c", "named": "a+d", "named_count": 2, "there": 1, "right": 0, "holds": 1, "true_behind": -K},
        {"hidden": "none", "named": "", "named_count": 0, "there": 0, "right": 1, "holds": 1},
        {"hidden": "none", "named": "a", "named_count": 1, "there": 0, "right": 0, "holds": 0},
        {"hidden": "a+b", "trouble": "not diagnosed"},
        {"hidden": "", "trouble": "could not be drawn"},
    ]
    table = pd.DataFrame(rows, columns=list(KEPT_TABLES[LIKE_RIGS].columns))
    found = rates.target_summary(table, LIKE_RIGS).set_index("reach")
    values = {what: (int(row["trials"]), float(row["value"])) for what, row in found.iterrows()}
    assert values == {
        "the right set, two effects": (3, pytest.approx(1 / 3)),
        "the right set, three effects": (1, 0.0),
        "named effects that are truly there": (4, pytest.approx(4 / 6)),
        "nothing named where nothing is missing": (2, 0.5),
        "the true set in the list of those that the record cannot tell apart": (4, 0.5),
        "... beside a remainder": (1, 0.0),
        "... where the record cannot tell it from the best": (3, pytest.approx(2 / 3)),
        "... and a set is named": (2, 1.0),
        "diagnosed within 60 s of one core": (6, pytest.approx(1 / 6)),
    }


def test_a_kind_refuses_what_it_cannot_show() -> None:
    with pytest.raises(StudyError, match="'constant_force' cannot be hidden in rig_component"):
        make_trial(1, ("constant_force",), test="rig_component")
