"""The study as one page for a browser, and the claims' page."""

import re
from html.parser import HTMLParser

import pandas as pd
import pytest

from study.reproduction import study_pages, whole_page
from study.reproduction.study_pages import TABLE_WIDTH, conditions, shortened
from study.support import document
from study.support.document import Picture
from tests.reproduction.test_summary import CLAIMS, study

PNG = bytes.fromhex("89504e470d0a1a0a") + b"picture"
LONG = pd.DataFrame(
    [
        ("long", "Section 5.3", "Many things hold", "1 N, 2 N, 3 N",
         "; ".join(f"level {i} {'x' * 90}" for i in range(9)),
         "; ".join(f"condition {i}" for i in range(9)), "partly", "because of much"),
    ],
    columns=list(CLAIMS.columns),
)  # fmt: skip


NO_CLAIMS = pd.DataFrame([], columns=["chapter", *CLAIMS.columns])


@pytest.fixture
def page(monkeypatch):
    monkeypatch.setattr(whole_page, "CHAPTERS", {})
    pictures = [
        Picture("A <system>", "Figure 21", "its path", PNG),
        Picture("Another", "Figure 22", "its other path", PNG),
        Picture("A <system>", "Figure 23", "its coherence", PNG),
    ]
    results = study(claims=pd.concat([CLAIMS, LONG], ignore_index=True), part_two_claims=NO_CLAIMS)
    return whole_page.study_page(results, pictures).decode()


class Outline(HTMLParser):
    def __init__(self):
        super().__init__()
        self.headings, self.sources, self.inside = [], [], ""

    def handle_starttag(self, tag, attrs):
        self.sources += [value for name, value in attrs if name in ("src", "href")]
        self.inside = tag

    def handle_data(self, data):
        if self.inside in ("h2", "h3"):
            self.headings.append(data)

    def handle_endtag(self, _tag):
        self.inside = ""


def test_the_verdict_comes_first_then_pictures_by_system(page):
    outline = Outline()
    outline.feed(page)
    assert outline.headings[:4] == ["Verdict", "Figures", "A <system>", "Another"]
    assert page.index("1 of 4 statements") < page.index("Figure 21")
    assert page.index("Figure 23") < page.index("Figure 22"), "pictures of a system stand together"


def test_the_page_asks_for_nothing_from_anywhere(page):
    outline = Outline()
    outline.feed(page)
    assert all(source.startswith(("#", "data:")) for source in outline.sources)
    assert "://" not in re.sub(r"base64,[A-Za-z0-9+/=]+", "", page)
    assert "|A_1| &lt;is&gt; flat" in page


def test_a_claim_has_one_line_and_its_conditions_are_folded():
    results = study(claims=pd.concat([CLAIMS, LONG], ignore_index=True))
    text = document.markdown(study_pages.titled("claims", results))
    lines = [line for line in text.splitlines() if line.startswith("| [")]
    assert len(lines) == 4
    assert all(len(cell) <= TABLE_WIDTH + 10 for line in lines for cell in line.split("|") if cell.strip())
    assert text.count("<details>") == 4
    assert '<a id="long"></a>' in text
    assert "(#long)" in text
    assert "condition 8: level 8" in text


def test_every_part_of_what_was_measured_stands_in_the_fold():
    row = {str(key): value for key, value in LONG.iloc[0].to_dict().items()}
    fold = document.markdown([conditions(row)])
    assert all(f"level {i} " in fold for i in range(9))
    assert "Why: because of much" in fold
    uneven = document.markdown([conditions({**row, "criterion": "one condition; with a stop"})])
    assert "must hold: with a stop" in uneven
    assert "measured: level 8" in uneven


def test_what_does_not_fit_a_line_is_cut_between_words_and_says_so():
    assert shortened({"reported": "1, 2", "measured": "a 1; b 2"}) == "a 1; b 2"
    assert shortened({"reported": "1, 2", "measured": f"a 1; {'b' * TABLE_WIDTH}"}) == "a 1 …"
    long = shortened({"reported": "1", "measured": "word " * 60})
    assert long.endswith("word …")
    assert len(long) <= TABLE_WIDTH + 2
