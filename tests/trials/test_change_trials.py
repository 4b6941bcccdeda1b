"""Trials of coefficients that change: their orders, what is counted right, and the table that docs keep."""

from collections import Counter
from pathlib import Path

import pandas as pd
import pytest

from study.trials.kept import CHANGES, KEPT_TABLES, differing_trials
from study.trials.pages import blocks
from study.trials.rates import target_summary
from study.trials.runs import change_orders, run_trial, table_of
from study.trials.varying import KINDS_OF_CHANGES, make_varying_trial

KEPT = Path(__file__).parents[2] / "docs" / "trials_of_changes.csv"


def test_every_kind_is_asked_as_often():
    every = change_orders(each=4)
    assert {table_of(order) for order in every} == {CHANGES}
    assert len({order.seed for order in every}) == len(every)
    assert set(Counter(order.test for order in every).values()) == {4}


@pytest.mark.parametrize("kind", KINDS_OF_CHANGES)
def test_a_trial_is_the_same_record_again_and_hides_what_its_kind_says(kind: str):
    one, again = (make_varying_trial(kind, 7, samples=256) for _ in range(2))
    assert (one.record["displacement"] == again.record["displacement"]).all()
    assert any("_over_" in name for name in one.hidden) == (kind not in ("nonlinear", "nothing"))
    assert all(value is None for value in one.believed.values.values())


def test_nothing_is_said_of_a_linear_mass_along_which_nothing_changes():
    order = next(order for order in change_orders() if order.test == "nothing")
    found = run_trial(order)
    assert tuple(found) == KEPT_TABLES[CHANGES].columns
    assert (found["hidden"], found["named"], found["right"], found["changes"]) == ("none", "", 1, 0)


def row(test: str, right: int, changes: int, held: int = 0, asked: int = 0) -> dict[str, object]:
    given = {"test": test, "seed": 1, "right": right, "alike": right, "changes": changes, "held": held, "asked": asked}
    return {column: ({"noise": 0.01} | given).get(column, "") for column in KEPT_TABLES[CHANGES].columns}


def test_rates_are_of_the_trials_that_they_name(tmp_path: Path):
    rows = [row("drift", 1, 1, 9, 9)] * 3 + [row("step", 0, 1)] + [row("nothing", 1, 0)] * 4 + [row("nonlinear", 0, 1)]
    pd.DataFrame(rows).to_csv(tmp_path / "rows.csv", index=False)
    table = pd.read_csv(tmp_path / "rows.csv")
    found = target_summary(table, CHANGES).set_index("reach")
    assert found.loc["what is missing named rightly, where a coefficient changes", "value"] == pytest.approx(0.75)
    assert found.loc["no change named where nothing varies", "value"] == pytest.approx(0.8)
    assert found.loc["95 % bands, and moments of steps, that hold the truth", "value"] == pytest.approx(1.0)
    assert "trials" in blocks(table, CHANGES)


def test_the_kept_table_is_of_the_first_trials():
    kept = pd.read_csv(KEPT)
    assert tuple(kept.columns) == KEPT_TABLES[CHANGES].columns
    orders = change_orders()[: len(kept)]
    assert kept["seed"].tolist() == [order.seed for order in orders]
    assert kept["test"].tolist() == [order.test for order in orders]


@pytest.mark.long
@pytest.mark.parametrize("at", [1, 2, 4])
def test_a_row_of_the_kept_table_comes_out_again(at: int, tmp_path: Path):
    pd.DataFrame([run_trial(change_orders()[at])]).to_csv(tmp_path / "own.csv", index=False)
    assert differing_trials(pd.read_csv(tmp_path / "own.csv"), pd.read_csv(KEPT), CHANGES) == []
