"""Trials of the test that is proposed after a tie."""

from collections import Counter
from pathlib import Path

import pandas as pd
import pytest

from study.trials.kept import KEPT_TABLES, NEXT_TESTS, differing_trials
from study.trials.pages import blocks
from study.trials.rates import target_summary
from study.trials.runs import PLANNED, next_test_orders, run_trial, table_of

KEPT = Path(__file__).parents[2] / "docs" / f"{NEXT_TESTS}.csv"


def test_each_damper_is_hidden_as_often_in_each_test():
    every = next_test_orders(48, settled=0)
    assert {table_of(order) for order in every} == {NEXT_TESTS}
    assert len({order.seed for order in every}) == len(every)
    assert set(Counter((order.test, order.hidden) for order in every).values()) == {4}


def test_what_a_promise_was_settled_on_does_not_prove_it():
    assert [order.seed for order in next_test_orders(15)] == [640_014, 640_015]


def row(promise: object, decided: object, random: object = "") -> dict[str, object]:
    given = {"test": "base", "seed": 1, "promise": promise, "decided": decided, "random_decided": random}
    return {column: given.get(column, "") for column in KEPT_TABLES[NEXT_TESTS].columns}


def test_a_promise_is_held_against_what_came_of_it(tmp_path):
    rows = [row(0.97, 1, 0)] * 9 + [row(0.99, 0, 1)] + [row(0.85, 1, 0)] * 4 + [row(0.1, "")] * 3 + [row("", "")]
    pd.DataFrame(rows).to_csv(tmp_path / "rows.csv", index=False)
    table = pd.read_csv(tmp_path / "rows.csv")
    found = target_summary(table, NEXT_TESTS).set_index("reach")
    sure = found.loc["ties that end in the right effect, where 95 % or more was promised"]
    assert (sure["trials"], sure["value"], sure["reached"]) == (10, pytest.approx(0.9), "yes")
    assert found.loc["... where 80 to 95 % was promised", "trials"] == 4
    assert found.loc["ties of which it is said that no allowed test is likely to decide", "value"] == pytest.approx(
        3 / 17
    )
    left = found.loc["ties left undecided, where 80 % or more was promised"]
    assert (left["trials"], left["value"]) == (14, pytest.approx(1 / 14))
    assert found.loc["... after a random test that is allowed and as long", "value"] == pytest.approx(13 / 14)
    one = found.loc["ties that one of these two tests decides and the other does not: decided by the proposed one"]
    assert (one["trials"], one["value"]) == (14, pytest.approx(13 / 14))
    assert "trials" in blocks(table, NEXT_TESTS)


@pytest.mark.long
def test_a_tie_on_a_shake_table_ends_in_the_right_effect():
    order = next_test_orders(1, settled=0)[0]
    found = run_trial(order)
    assert order.kind == PLANNED
    assert found["trouble"] == ""
    assert found["promise"] > 0.8
    assert found["decided"] == 1.0


def test_the_kept_table_is_that_of_the_orders() -> None:
    kept = pd.read_csv(KEPT)
    assert tuple(kept.columns) == KEPT_TABLES[NEXT_TESTS].columns
    assert list(zip(kept["test"], kept["seed"], strict=True)) == [(o.test, o.seed) for o in next_test_orders()]


@pytest.mark.long
@pytest.mark.parametrize("seed", [640_014, 640_017])
def test_a_row_of_the_kept_table_comes_out_again(seed: int, tmp_path: Path) -> None:
    order = next(order for order in next_test_orders() if order.seed == seed)
    pd.DataFrame([run_trial(order)]).to_csv(tmp_path / "own.csv", index=False)
    assert differing_trials(pd.read_csv(tmp_path / "own.csv"), pd.read_csv(KEPT), NEXT_TESTS) == []
