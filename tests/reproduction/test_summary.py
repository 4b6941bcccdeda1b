"""The page that a reader opens first, and documents as Markdown and as HTML."""

from html.parser import HTMLParser

import pandas as pd
import pytest

from study.reproduction import study_pages
from study.support import document

PARAMETERS = pd.DataFrame(
    [
        ("quiet", "siso", "k", 355.3, 500.0, 4.0, 0.407, 0.005, False),
        ("quiet", "miso", "k", 355.3, 355.0, 0.3, -0.0008, 0.005, True),
        ("quiet", "miso", "k3", 0.0, 10.0, 20.0, None, 1e5, True),
        ("noisy", "miso", "k", 355.3, 300.0, 4.0, -0.155, 0.005, False),
    ],
    columns=["case", "estimator", "parameter", "true", "estimate", "standard_error", "relative_error", "tolerance",
             "within_tolerance"],
)  # fmt: skip
CLAIMS = pd.DataFrame(
    [
        ("a", "Section 1", "|A_1| <is> flat", "500 N/m", "512 +- 3; more", "c", "reproduced", ""),
        ("b", "Section 2", "All is well", "as stated", "x", "c", "partly", "because of b"),
        ("c", "Section 3", "Nothing is", "as stated", "y", "c", "not reproduced", "because of c"),
    ],
    columns=["id", "where", "claim", "reported", "measured", "criterion", "verdict", "why"],
)
READING = pd.DataFrame(
    [("k", 500.0, 512.0, 3.0, 594.0, 5.0, "raw")],
    columns=["quantity", "reported", "raw_mean", "raw_standard_error", "filtered_mean", "filtered_standard_error",
             "nearer"],
)  # fmt: skip
ERRORS = pd.DataFrame(
    [
        ("quiet", "miso", "k", "relative", 0.02, 1.0, 0.01, 0.02, 4),
        ("quiet", "output_error", "k", "relative", 0.0004, 50.0, 0.0, 0.001, 4),
    ],
    columns=["case", "estimator", "parameter", "kind", "median_error", "gain", "bias", "scatter", "seeds"],
)
TIMES = pd.DataFrame(
    [("record", "quiet", 1.0), ("record", "noisy", 2.0), ("claims", "", 4.0)], columns=["stage", "case", "seconds"]
)
STRUCTURES = pd.DataFrame(
    [
        ("two", "miso", "k[a-b]", 100.0, 101.0, 1.0, 0.01, 0.02, True),
        ("two", "miso", "k3[a-b]", 1e6, 2e6, 1e4, 1.0, 0.02, False),
        ("two", "siso", "k[a-b]", 100.0, 150.0, 1.0, 0.5, 0.02, False),
    ],
    columns=list(PARAMETERS.columns),
)
STRUCTURE_CLAIMS = pd.DataFrame(
    [
        ("two", "MI/SO is right", "k within 2 %; k3 within 2 %", "k +1 %; k3 +100 %", "partly"),
        ("two", "SI/SO is wrong", "off by 10 %", "50 %", "holds"),
    ],
    columns=["case", "claim", "criterion", "measured", "verdict"],
)


def study(parameters=PARAMETERS, claims=CLAIMS, noise=(("quiet", 0.0), ("noisy", 0.05)), **more):
    """Small tables, as the study writes them."""
    tables = {
        "case_parameters": parameters, "claims": claims, "excitation_reading": READING, "estimators": ERRORS,
        "times": TIMES, "structures": STRUCTURES, "structure_claims": STRUCTURE_CLAIMS,
        **more,
    }  # fmt: skip
    return study_pages.Results(tables, dict(noise), "raw", {"two": "Two <masses>"})


@pytest.fixture
def results():
    return study()


def flat(text):
    return " ".join(text.split())


def test_the_verdict_opens_the_page_and_the_reasons_follow(results):
    page = document.markdown(study_pages.titled("summary", results))
    assert "1 of 3 statements are reproduced" in "".join(page.splitlines()[:4])
    order = [page.index(words) for words in ("because of c", "500 N/m", "Parameters by case", "Run times")]
    assert order == sorted(order)


def test_the_errors_of_the_estimators_have_a_page_of_their_own(results):
    page = flat(document.markdown(study_pages.titled("estimators", results)))
    assert "| quiet | k | 2 % | 0.04 % (x 50) |" in page
    assert "![Errors of the estimators by parameter and case](../figures/estimators.png)" in page
    assert "Errors of the estimators by parameter" not in document.markdown(study_pages.titled("summary", results))


def test_counts_are_counted(results):
    page = flat(document.markdown(study_pages.titled("summary", results)))
    assert "**1 of 3 statements are reproduced**, 1 partly, 1 not." in page
    assert "Without noise, MI/SO recovers 2 of 2 parameters of 1 cases" in page
    assert "With noise on the displacement, 0 of 1 parameters of 1 cases" in page


def test_a_study_without_noise_does_not_speak_of_it():
    quiet = study(PARAMETERS[:3], noise=(("quiet", 0.0),))
    assert "With noise" not in document.markdown(study_pages.verdict_blocks(quiet))


def test_parameters_stand_side_by_side(results):
    page = flat(document.markdown(study_pages.parameter_blocks(results)))
    assert "| case | parameter | true | tolerance | siso | miso |" in page
    assert "| quiet | k | 355.3 | 0.5 % | **500 ± 4 (+41 %)** | 355 ± 0.3 (-0.08 %) |" in page
    assert "| quiet | k3 | 0 | 100000 | | 10 ± 20 |" in page


def test_failing_claims_come_with_their_reasons_the_worst_first(results):
    page = document.markdown(study_pages.failing_claims(results))
    assert page.index("because of c") < page.index("because of b")
    assert "flat" not in page


def test_numbers_show_what_was_stated_with_a_number(results):
    page = flat(document.markdown(study_pages.numbers(results)))
    assert "| 500 N/m | 512 +- 3 … | reproduced |" in page
    assert "All is well" not in page


@pytest.mark.parametrize(
    ("reported", "shown"),
    [
        ("500 N/m", "a 1 …"),
        ("as stated", "a 1 …"),
        ("2 Hz, 4 Hz", "a 1; b 2 …"),
        ("0.2 N^2, 0.5 N^2, 1 N^2, 2 N^2", "a 1; b 2; c 3"),
    ],
)
def test_as_many_parts_are_shown_as_the_report_gives_numbers(reported, shown):
    row = CLAIMS.iloc[[0]].assign(reported=reported, measured="a 1; b 2; c 3")
    assert f"| {reported} | {shown} | reproduced |" in flat(document.markdown([study_pages.statements(row)]))


def test_run_times_add_up(results):
    page = flat(document.markdown(study_pages.run_times(results)))
    assert "| record | 2 | 3.0 | 2.0 |" in page
    assert "| all | 3 | 7.0 | |" in page


class Tags(HTMLParser):
    """Sees to it that every tag is closed in its turn."""

    def __init__(self):
        super().__init__()
        self.open, self.words = [], []

    def handle_starttag(self, tag, attrs):
        assert not any(name in ("src", "href") for name, _ in attrs), "nothing is fetched"
        if tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def test_html_is_whole_and_escapes_what_it_shows(results):
    tags = Tags()
    tags.feed(document.document_page("A <title>", study_pages.titled("summary", results)))
    assert tags.open == []
    assert "|A_1| <is> flat" in tags.words
    assert "claims.md" in " ".join(tags.words), "links become words"


def test_markdown_keeps_bars_within_their_cell(results):
    assert r"\|A_1\| <is> flat" in document.markdown(study_pages.numbers(results))


def test_an_empty_table_says_so():
    assert document.markdown([document.table(["a"], [])]) == "None.\n"


def test_structures_stand_in_the_verdict_and_have_a_section(results):
    page = flat(document.markdown(study_pages.titled("summary", results)))
    verdict = page[: page.index("What is not reproduced")]
    assert "1 of 2 claims hold; MI/SO recovers 1 of 2 coefficients of 1 cases" in verdict
    section = page[page.index("Structures of several coordinates", page.index("Parameters by case")) :]
    assert "**partly**: MI/SO is right" in section
    assert "k3 within 2 %: k3 +100 %" in section
    assert "| siso | k[a-b] | 100 | 150 |" in section
    missing = page[page.index("What is not reproduced") : page.index("The report's numbers")]
    assert "MI/SO is right" in missing
    assert "SI/SO is wrong" not in missing
