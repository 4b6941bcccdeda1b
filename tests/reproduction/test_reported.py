"""What the report states: the table itself, its bounds, and Table 1 against its second writing."""

from pathlib import Path

import pytest

from study.reproduction.claims import reported
from study.reproduction.claims.excitation_reading import quantities
from study.support.errors import StudyError
from tests.conftest import LINEAR, TABLE_1

ROOT = Path(__file__).parents[2]
HEADING = "id\twhere\twhat\tvalue\tunit\n"


@pytest.fixture(scope="module")
def stated() -> reported.Reported:
    return reported.load_reported(ROOT / "config" / "reported.tsv")


def load(folder: Path, rows: str) -> reported.Reported:
    path = folder / "reported.tsv"
    path.write_text(HEADING + rows, encoding="utf-8")
    return reported.load_reported(path)


@pytest.mark.parametrize("system", TABLE_1)
def test_table_1_is_the_one_the_tests_know(stated: reported.Reported, system: str) -> None:
    values = {key: v for term in {**LINEAR, **TABLE_1[system]}.values() for key, v in term.items()}
    renamed = {"km_cos": "k_m", "dead_band.u_g": "u_g", "periodic_stiffness.f_m": "f_m"}
    for key, value in values.items():
        if key in ("kg", "km_sin"):
            continue
        assert stated.table_1(system, renamed.get(key, key)) == pytest.approx(value)
    assert stated.table_1("dead_band", "k_dead_band") == stated.table_1("dead_band", "k")


def test_the_numbers_the_report_quotes(stated: reported.Reported) -> None:
    quoted = {"siso_stiffness": 500.0, "siso_frequency": 3.6, "duffing_share": 0.9, "dead_band_share": 0.65}
    assert {name: stated.value(name) for name in quoted} == quoted
    assert {q.reported for q in quantities(stated)} >= set(quoted)


def test_a_system_of_table_1_without_a_model_is_named(stated: reported.Reported, tmp_path: Path) -> None:
    reported.check_systems(stated, ROOT / "models")
    with pytest.raises(StudyError, match=r"names a system that is not in models/"):
        reported.check_systems(stated, tmp_path / "models")


def table() -> str:
    return (ROOT / "config" / "reported.tsv").read_text(encoding="utf-8").removeprefix(HEADING)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("siso_stiffness\t", "siso_stifness\t", "no claim asks for 'siso_stifness'; 'siso_stiffness' is near it"),
        ("siso_stiffness\t", "zzz\t", "no claim asks for 'zzz'; a new claim's row is listed in"),
        ("table_1.duffing.k3\t", "", "has no row 'table_1.duffing.k3', which the claims ask for"),
        ("\t500\t", "\t\t", "'siso_stiffness' has no value; expected the number that the report states"),
    ],
)
def test_the_rows_are_those_that_the_claims_ask_for(tmp_path: Path, old: str, new: str, said: str) -> None:
    lines = table().splitlines(keepends=True)
    (hit,) = (i for i, line in enumerate(lines) if old in line)
    lines[hit] = lines[hit].replace(old, new) if new else ""
    found = load(tmp_path, "".join(lines))
    with pytest.raises(StudyError) as caught:
        reported.check_complete(found, tmp_path / "reported.tsv")
    assert said in str(caught.value)


def test_every_row_is_asked_for(stated: reported.Reported) -> None:
    reported.check_complete(stated, ROOT / "config" / "reported.tsv")


def test_numbers_of_a_claim_come_with_units(stated: reported.Reported) -> None:
    assert stated.numbers("mathieu_fast") == "5 Hz, 2 Hz, 3 Hz, 8 Hz"
    assert stated.numbers("linear_coherence") == "as stated"
    assert stated.numbers("table_1") == "as tabulated"


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("a\tp. 1\twhat\tmany\tHz\n", "value is 'many'; expected a number"),
        ("a\tp. 1\twhat\t1\tHz\na\tp. 2\twhat\t2\tHz\n", "'a' stands twice"),
        ("a\tp. 1\twhat\t1\n", "has 4 cells"),
        ("A b\tp. 1\twhat\t1\tHz\n", "'A b'"),
        ("a\t\twhat\t1\tHz\n", "where"),
        (
            "noise_random_only.low\tp. 1\twhat\t5\t\n",
            "value is 5; expected a number above 0 and below 1",
        ),
        ("duffing_share\tp. 1\twhat\t90\t\n", "value is 90; expected a number above 0 and below 1"),
        (
            "dead_band_error\tp. 1\twhat\t-0.07\t\n",
            "value is -0.07; expected a number above 0 and below 1",
        ),
        ("levels_invariant.lowest\tp. 1\twhat\t-0.2\tN^2\n", "value is -0.2; expected a number above 0"),
        ("a\tp. 1\twhat\t-3\tHz\n", "value is -3; expected 0 or more"),
        ("table_1.linear.zeta\tp. 1\twhat\t-0.1\t\n", "value is -0.1; expected 0 or more"),
    ],
)
def test_a_bad_row_is_named(tmp_path: Path, rows: str, said: str) -> None:
    with pytest.raises(StudyError, match=r"reported\.tsv") as caught:
        load(tmp_path, rows)
    assert said in str(caught.value)


def test_missing_statements_and_values_are_named(tmp_path: Path) -> None:
    found = load(tmp_path, "a\tp. 1\twhat\t\tHz\n")
    with pytest.raises(StudyError, match="no value for 'a'"):
        found.value("a")
    with pytest.raises(StudyError, match="no row 'b'"):
        found.value("b")
