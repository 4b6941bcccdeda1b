"""What the report states: the table itself, its bounds, and Table 1 against its second writing."""

from pathlib import Path

import pytest

from study.reproduction.claims import reported
from study.reproduction.claims.claims_table import CLAIMS, NUMBERS, claim_names
from study.reproduction.claims.conditions import COHERENCES, ESTIMATES, PATTERNS
from study.reproduction.claims.dead_band import QUOTED
from study.support.errors import StudyError
from tests.conftest import LINEAR, TABLE_1

ROOT = Path(__file__).parents[2]
HEADING = "id\twhere\twhat\tvalue\tunit\tsystems\tlevels\tholds_if\twhy\n"
BARE = 4 * "\t"  # no conditions


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
    assert {source for _, source, *_ in QUOTED} >= set(quoted)


def test_a_system_of_table_1_without_a_model_is_named(stated: reported.Reported, tmp_path: Path) -> None:
    reported.check_systems(stated, ROOT / "models")
    with pytest.raises(StudyError, match=r"names a system that is not in models/"):
        reported.check_systems(stated, tmp_path / "models")


def table() -> str:
    return (ROOT / "config" / "reported.tsv").read_text(encoding="utf-8").removeprefix(HEADING)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("averages\t", "averges\t", "no claim asks for 'averges'; 'averages' is near it"),
        ("averages\t", "zzz\t", "no claim asks for 'zzz'; expected conditions in holds_if, or a function of that name"),
        ("siso_stiffness\t", "siso_stifness\t", "has no row 'siso_stiffness', which the claims ask for"),
        ("limit.read_off\t", "limit.read_of\t", "no claim asks for 'limit.read_of'; 'limit.read_off' is near it"),
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
        reported.check_complete(found, tmp_path / "reported.tsv", CLAIMS, NUMBERS)
    assert said in str(caught.value)


def test_every_row_is_asked_for(stated: reported.Reported) -> None:
    reported.check_complete(stated, ROOT / "config" / "reported.tsv", CLAIMS, NUMBERS)
    assert len(claim_names(stated)) == 90, "89 of the report, and one beside it"


def test_what_a_condition_may_be_about_can_be_measured() -> None:
    assert set(reported.READERS) == set(ESTIMATES)
    assert set(reported.MEASURES) == {*COHERENCES, *PATTERNS, "Gaussian", "histogram"}


def test_a_condition_is_read_word_by_word(tmp_path: Path) -> None:
    words = "k c recovered; SI/SO k c off by 0.1; linear coherence at the lowest level at least 0.9"
    row = load(tmp_path, f"a\tp. 1\twhat\t\t\tduffing mathieu\tlowest\t{words}\tas it is\n")["a"]
    assert (row.systems, row.levels, row.why) == (("duffing", "mathieu"), ("lowest",), "as it is")
    assert row.holds_if == (
        ("k c", "recovered", ""), ("SI/SO k c", "off by", "0.1"),
        ("linear coherence at the lowest level", "at least", "0.9"),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        ("duffing\t\tSI/SO k is right\t", "holds_if 'SI/SO k is right' is no condition; expected a subject and one of"),
        ("duffing\t\tSI/SO k within\t", "holds_if 'SI/SO k within' is no condition"),
        ("duffing\t\tSI/SO k rises 3\t", "holds_if 'SI/SO k rises 3' is no condition"),
        ("duffing\t\tweather within 0.1\t", "holds_if 'weather within 0.1' is about nothing known; expected SI/SO"),
        ("duffing\t\tk k33 recovered\t", "holds_if 'k k33 recovered' names 'k33'; expected some of m, c, k,"),
        ("duffing\t\tSI/SO k3 rises\t", "holds_if 'SI/SO k3 rises' names 'k3'; expected some of m, c, k, f_n, zeta"),
        ("dufing\t\tk recovered\t", "names 'dufing'; expected some of linear, duffing"),
        ("duffing\tloud\tk recovered\t", "names 'loud'; expected some of lowest, second"),
        ("duffing\t\t\t", "has conditions or systems without the other; expected both or neither"),
        ("\t\tk recovered\t", "has conditions or systems without the other; expected both or neither"),
    ],
)
def test_a_condition_that_is_none_is_named(tmp_path: Path, cells: str, said: str) -> None:
    with pytest.raises(StudyError, match=r"reported\.tsv, row 2 \(id 'a'\)") as caught:
        load(tmp_path, f"a\tp. 1\twhat\t\t\t{cells}\n")
    assert said in str(caught.value)


def test_numbers_of_a_claim_come_with_units(stated: reported.Reported) -> None:
    assert stated.numbers("mathieu_fast") == "5 Hz, 2 Hz, 3 Hz, 8 Hz"
    assert stated.numbers("linear_coherence") == "as stated"
    assert stated.numbers("table_1") == "as tabulated"


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("a\tp. 1\twhat\tmany\tHz\n", "value is 'many'; expected a number"),
        ("a\tp. 1\twhat\t1\tHz\na\tp. 2\twhat\t2\tHz\n", "'a' stands twice"),
        ("a\tp. 1\twhat\t1\n", "has 8 cells"),
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
        load(tmp_path, rows.replace("\n", f"{BARE}\n"))
    assert said in str(caught.value)


def test_missing_statements_and_values_are_named(tmp_path: Path) -> None:
    found = load(tmp_path, f"a\tp. 1\twhat\t\tHz{BARE}\n")
    with pytest.raises(StudyError, match="no value for 'a'"):
        found.value("a")
    with pytest.raises(StudyError, match="no row 'b'"):
        found.value("b")
