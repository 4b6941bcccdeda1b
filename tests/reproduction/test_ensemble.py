"""Many seeds at once: order, rates, and runs that diverge."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from study.reproduction import ensemble, study_pages
from study.reproduction.config import load_config
from study.reproduction.settings import IntegratorSettings
from study.support import document

CONFIG = load_config(Path(__file__).parents[2] / "config")


def told(case, **record):
    return CONFIG.record_settings(case).model_copy(update=record), CONFIG.identification_settings(case)


def rows(*within, parameter="k", estimate=355.0):
    return pd.DataFrame(
        {"case": "a", "estimator": "miso", "parameter": parameter, "true": 355.3, "estimate": estimate,
         "standard_error": 0.5, "tolerance": 0.01, "within_tolerance": within, "seed": range(len(within))}
    )  # fmt: skip


def test_one_worker_or_two_give_the_same_table(systems):
    one, two = (
        ensemble.estimates(systems["duffing"], *told("duffing"), range(1, 4), workers=workers) for workers in (1, 2)
    )
    pd.testing.assert_frame_equal(one, two)
    assert sorted(one["seed"].unique()) == [1, 2, 3]
    assert one.groupby(["estimator", "parameter"])["estimate"].nunique().min() == 3


@pytest.mark.long
def test_standard_errors_do_not_promise_too_much(systems):
    """Without noise all that is left is leakage, which the Bendat-Piersol formulas count as if it were noise:

    standard errors come out up to three times the scatter, and must not come out below it.
    """
    found = ensemble.tolerance_rates(ensemble.estimates(systems["duffing"], *told("duffing"), range(100, 124)))
    own = found[found["estimator"] == "miso"].set_index("parameter")
    assert (own["within_tolerance"] == 1.0).all()
    assert own["error_to_scatter"].between(0.9, 4.5).all()
    assert (own["rate_error"] == 0.0).all()


def test_rates():
    found = ensemble.tolerance_rates(rows(True, True, True, False, estimate=[355.0, 356.0, 355.0, 390.0])).iloc[0]
    assert found["within_tolerance"] == 0.75
    assert found["rate_error"] == pytest.approx(math.sqrt(0.75 * 0.25 / 4))
    assert found["mean"] == 364.0
    assert found["scatter"] == pytest.approx(np.std([355.0, 356.0, 355.0, 390.0], ddof=1))
    assert (found["seeds"], found["found"]) == (4, 4)


def test_a_seed_without_an_estimate_does_not_meet_the_tolerance():
    table = pd.concat([rows(True, True, True, True), rows(True, True, parameter="f_n")])
    found = ensemble.tolerance_rates(table).set_index("parameter")
    assert found["within_tolerance"]["k"] == 1.0
    assert found["within_tolerance"]["f_n"] == 0.5
    assert found["found"]["f_n"] == 2


def test_a_run_that_diverges_counts_as_missed(systems):
    """The report's own setting, one step a sample, at a level where some of the Van der Pol runs diverge."""
    record, identification = told(
        "van_der_pol", level=2.0, integrator=IntegratorSettings(method="abm4", steps_per_sample=1)
    )
    table = ensemble.estimates(systems["van_der_pol"], record, identification, range(1, 9))
    lost = table[table["parameter"] == "diverged"]
    assert 0 < len(lost) < 8, "some diverge, not all"
    assert (lost["estimate"] > 0.0).all(), "with the time at which they do"
    found = ensemble.tolerance_rates(table)
    assert (found["found"] == 8 - len(lost)).all()
    assert (found["within_tolerance"] <= (8 - len(lost)) / 8).all()


def test_page_names_what_is_met_too_seldom():
    table = pd.concat(
        [
            ensemble.tolerance_rates(rows(*[True] * 99, False)),
            ensemble.tolerance_rates(rows(True, False, parameter="c")),
        ]
    )

    def page(noise):
        results = study_pages.Results({"monte_carlo": table}, {"a": noise})
        return document.markdown(study_pages.titled("monte_carlo", results))

    quiet = page(0.0)
    assert "1 of 2 MI/SO estimates of noise-free cases meet" in quiet
    assert "- a: c in 50.0" in quiet
    assert ": k in" not in quiet
    assert "0 of 0" in page(0.1), "cases with noise are not judged"
