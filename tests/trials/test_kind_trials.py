"""The kept table of trials by kind of test: its first rows come out again, and its rates are those of the page."""

from pathlib import Path

import pandas as pd
import pytest

from study.support.document import markdown
from study.trials import kind_rates
from study.trials.kind_runs import COLUMNS, FIRST_SEED, run_test
from study.trials.likelihoods import log_likelihood_ratio, second_places

DOCS = Path("docs")


def kept() -> pd.DataFrame:
    return pd.read_csv(DOCS / "trials_by_test.csv")


@pytest.mark.parametrize("test", ["free_decay", "base", "axis", "blows"])
def test_the_first_row_of_each_kind_is_what_this_code_gives(test: str):
    table = kept()
    before = table[(table["test"] == test) & (table["seed"] == FIRST_SEED)].iloc[0]
    own = pd.Series(run_test(test, FIRST_SEED))
    for column in kind_rates.EXACT:
        expected = "" if pd.isna(before[column]) else before[column]
        assert own[column] == expected, column
    assert own["error_before"] == pytest.approx(before["error_before"], rel=0.01, abs=1e-6)


def test_the_rates_of_the_page_are_those_of_the_table():
    assert tuple(kept().columns) == COLUMNS
    assert markdown(kind_rates.rate_blocks(kept())).strip() in (DOCS / "kinds_of_tests.md").read_text()


def test_a_row_that_could_not_be_diagnosed_counts_as_failed():
    table = kept()
    worse = pd.concat([table, table[table["hidden"] != "none"].head(1).assign(right=None, trouble="it diverged")])
    before, after = (markdown(kind_rates.rate_blocks(t)) for t in (table, worse))
    failed = int(table["trouble"].notna().sum())
    assert f"; {failed} could not be diagnosed" in before
    assert f"; {failed + 1} could not be diagnosed" in after


def test_the_whole_record_of_a_decay_tells_two_laws_of_damping_no_better():
    """The likelihoods that the page has beside the trials, of the first of these; of another law they tell a lot."""
    first = second_places(kept()).iloc[0]
    ratio = log_likelihood_ratio(int(first["seed"]), first["hidden"], first["first"])
    page = (DOCS / "kinds_of_tests.md").read_text()
    line = next(row for row in page.splitlines() if row.startswith(f"| {first['seed']} "))
    assert float(line.split("|")[-2]) == pytest.approx(ratio, abs=0.02)
    assert log_likelihood_ratio(int(first["seed"]), first["hidden"], "quintic_stiffness") > 20.0
