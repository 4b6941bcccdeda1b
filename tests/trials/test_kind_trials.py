"""The kept table of trials by kind of test: its first rows come out again, and its rates are those of the page."""

import math
import re
from pathlib import Path

import pandas as pd
import pytest

from study.support.document import markdown
from study.trials import pages, rates, runs
from study.trials.kept import BY_TEST, KEPT_TABLES, differing_trials
from study.trials.pages import log_likelihood_ratio, second_places

DOCS = Path("docs")


def kept() -> pd.DataFrame:
    return pd.read_csv(DOCS / "trials_by_test.csv")


@pytest.mark.parametrize("test", ["free_decay", "base", "axis", "blows"])
def test_the_first_row_of_each_kind_is_what_this_code_gives(test: str, tmp_path: Path):
    order = next(order for order in runs.orders_of_tests() if order.test == test)
    pd.DataFrame([runs.run_trial(order)]).to_csv(tmp_path / "own.csv", index=False)
    assert differing_trials(pd.read_csv(tmp_path / "own.csv"), kept(), BY_TEST) == []


def test_the_rates_of_the_page_are_those_of_the_table():
    assert tuple(kept().columns) == KEPT_TABLES[BY_TEST].columns
    assert markdown(pages.reached(kept(), BY_TEST)).strip() in (DOCS / "kinds_of_tests.md").read_text()


def test_a_row_that_could_not_be_diagnosed_counts_as_failed():
    table = kept()
    worse = pd.concat([table, table[table["hidden"] != "none"].head(1).assign(right=None, trouble="it diverged")])
    before, after = (markdown(pages.reached(t, BY_TEST)) for t in (table, worse))
    failed = int(table["trouble"].notna().sum())
    assert f", {failed} of which could not be made or diagnosed" in before
    assert f", {failed + 1} of which could not be made or diagnosed" in after
    rates_of = [rates.target_summary(t, BY_TEST).set_index(["group", "reach"])["value"] for t in (table, worse)]
    worsened = worse["test"].iloc[-1]
    assert rates_of[1][worsened, "first or tied"] < rates_of[0][worsened, "first or tied"]


def test_the_whole_record_of_a_decay_tells_two_laws_of_damping_no_better():
    """The likelihood ratio of the first of these is within what the page says; of another law it is large."""
    first = second_places(kept()).iloc[0]
    ratio = log_likelihood_ratio(int(first["seed"]), first["hidden"], first["first"])
    page = (DOCS / "kinds_of_tests.md").read_text()
    largest = re.search(r"the true one is at most ([\d.]+) times as likely", page)
    assert largest
    assert ratio <= 2.0 * math.log(float(largest[1])) + 0.05
    assert log_likelihood_ratio(int(first["seed"]), first["hidden"], "quintic_stiffness") > 20.0
