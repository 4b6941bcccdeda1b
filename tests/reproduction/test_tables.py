"""Tables: columns, verdicts, exact functions, and files that are never half written."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from study.identify.estimators.base import Identified, Parameter
from study.identify.frequency_domain.coefficients import Responses
from study.reproduction import tables
from study.reproduction.cases import identify_case
from study.reproduction.config import load_config
from study.support.errors import StudyError

CONFIG = load_config(Path(__file__).parents[2] / "config")
JUDGED = CONFIG.identification_settings("duffing").model_copy(update={"relative": {"k": 0.01}, "absolute": {"k": 2.0}})


@pytest.fixture(scope="module")
def found(systems, records):
    """What is found in the combined system's record."""
    return identify_case(systems["duffing_van_der_pol"], records["duffing_van_der_pol"], settings())


def settings():
    return CONFIG.identification_settings("duffing_van_der_pol")


@pytest.mark.parametrize(
    ("true", "value", "error", "within"),
    [
        (100.0, 100.9, 0.009, True),
        (100.0, 98.9, -0.011, False),
        (-100.0, -101.1, 0.011, False),
        (0.0, 1.9, math.nan, True),
        (0.0, -2.1, math.nan, False),
        (100.0, math.nan, math.nan, False),
    ],
)
def test_verdict(true, value, error, within):
    judged = tables.judge_estimate("k", true, value, JUDGED)
    assert judged["relative_error"] == pytest.approx(error, nan_ok=True)
    assert judged["tolerance"] == (0.01 if true else 2.0)
    assert judged["within_tolerance"] is within


def test_what_has_no_tolerance_is_not_met():
    assert tables.judge_estimate("own", 1.0, 1.0, JUDGED)["within_tolerance"] is False


def test_parameters_in_long_form(systems, found):
    table = tables.parameter_table("x", systems["duffing_van_der_pol"], found, settings())
    assert list(table.columns) == [
        "case", "estimator", "parameter", "true", "estimate", "standard_error",
        "relative_error", "tolerance", "within_tolerance", "note",
    ]  # fmt: skip
    others = [name for name in settings().estimators if name != "miso_free_shape"]  # this system has no such thing
    assert list(table["estimator"].unique()) == others
    own = table[table["estimator"] == "miso"].set_index("parameter")
    assert list(own.index) == ["m", "c", "k", "f_n", "zeta", "k3", "c3"]
    assert own["true"]["k3"] == 2.0e7
    assert own["within_tolerance"].all()
    assert not table[table["estimator"] == "siso"].set_index("parameter")["within_tolerance"]["k"]


def test_a_system_without_stiffness_has_no_row_for_its_frequency(systems):
    found = {"siso": Identified((), None, (Parameter("k", 1.0, 0.1), Parameter("f_n", 2.0, 0.1)))}
    table = tables.parameter_table("extreme", systems["extreme"], found, settings())
    assert list(table["parameter"]) == ["k"]


def test_frequency_responses_stand_beside_the_exact_function(systems, found):
    table = tables.response_table(systems["duffing_van_der_pol"], found)
    assert {"siso", "miso"} <= set(table["estimator"]) <= set(settings().estimators) - {"miso_hand_read"}
    second = table[(table["estimator"] == "miso") & (table["input"] == 2)]
    exact = 2e7 + 2e6 / 3.0 * 2j * np.pi * second["frequency"].to_numpy()
    np.testing.assert_allclose(second["exact_real"] + 1j * second["exact_imag"], exact)
    band = second[(second["frequency"] > 1.0) & (second["frequency"] < 6.0)]
    off = np.hypot(band["real"] - band["exact_real"], band["imag"] - band["exact_imag"]) / band["standard_error"]
    assert 0.5 < np.sqrt(np.mean(off**2)) < 2.0, "the errors are of the size of their standard errors"


def test_coherences_name_their_terms(found):
    table = tables.coherence_table(found)
    own = table[table["estimator"] == "miso"]
    assert set(own["terms"]) == {
        "inertia + linear damping + linear stiffness", "cubic stiffness + van der pol damping"
    }  # fmt: skip
    last = own[own["input"] == 2]["cumulative"]
    assert last.between(0.0, 1.0 + 1e-12).all()
    assert (last.to_numpy() >= own[own["input"] == 1]["cumulative"].to_numpy() - 1e-12).all()


def test_noise_spectra_are_what_the_inputs_leave_of_the_force(found):
    table = tables.noise_spectra(found)
    assert list(table) == tables.NOISE_COLUMNS
    own, result = table[table["estimator"] == "miso"], found["miso"].responses
    np.testing.assert_allclose(own["noise"], (1.0 - result.multiple) * result.output, atol=1e-12 * result.output.max())
    assert set(table["estimator"]) == {name for name, f in found.items() if f.responses is not None}


def test_an_estimator_has_what_it_has(systems, found):
    """Parameters alone, responses without coherences, or both."""
    bare = {"a": Identified(found["miso"].inputs, None, found["miso"].parameters)}
    assert len(tables.parameter_table("x", systems["duffing_van_der_pol"], bare, settings())) == 7
    whole = tables.response_table(systems["duffing_van_der_pol"], found)
    assert list(tables.response_table(systems["duffing_van_der_pol"], bare)) == list(whole)
    assert list(tables.coherence_table(bare)) == list(tables.coherence_table(found))
    assert list(tables.noise_spectra(bare)) == tables.NOISE_COLUMNS
    own = found["miso"].responses
    plain = Responses(own.frequency, own.response, own.covariance, own.noise)
    curves = {"a": Identified(found["miso"].inputs, plain, ())}
    assert len(tables.response_table(systems["duffing_van_der_pol"], curves)) == 2 * len(own.frequency)
    assert tables.coherence_table(curves).empty


def test_csv_has_twelve_digits_and_the_same_bytes_each_time(tmp_path):
    table = pd.DataFrame({"a": [1.0 / 3.0, 2e7, math.nan], "b": [True, False, True]})
    for name in ("one.csv", "two.csv"):
        tables.write_table(table, tmp_path / "new" / name)
    assert (tmp_path / "new" / "one.csv").read_bytes() == b"a,b\n0.333333333333,True\n20000000,False\n,True\n"
    assert (tmp_path / "new" / "one.csv").read_bytes() == (tmp_path / "new" / "two.csv").read_bytes()


def test_a_table_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    tables.write_table(pd.DataFrame({"a": [1]}), path)

    def full(_, target, **__):
        target.write_text("a\n")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pd.DataFrame, "to_csv", full)
    with pytest.raises(StudyError, match="No space left"):
        tables.write_table(pd.DataFrame({"a": [2]}), path)
    assert path.read_text() == "a\n1\n"
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]
