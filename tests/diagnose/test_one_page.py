"""A diagnosis on one page: what stands on it, and that it is one sheet."""

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties

from study.diagnose import one_page_files
from study.diagnose.diagnosis_files import all_names
from study.diagnose.one_page import equation_in_symbols, one_page
from study.diagnose.verdict import diagnose
from study.figures import page
from study.records.record import Record, Stretch
from study.trials import make_trial
from study.way_in.compare_records import compare_records


def page_of(noise):
    trial = make_trial(901, hidden=["quadratic_damping"], noise=noise, response="displacement")
    without = ("hysteresis", "relaxation", "periodic_stiffness", "harmonic_force", "cogging")
    return one_page(diagnose(compare_records([trial.record], trial.believed).comparison, without=without))


@pytest.fixture(scope="module")
def content():
    return page_of(0.01)


def test_the_page_says_what_is_missing_before_and_after(content):
    assert content.headline == "Quadratic damping is missing from the equation"
    assert content.equation == "m d^2u/dt^2 + c v + k u = F(t)"
    assert content.completed == "m d^2u/dt^2 + c v + k u + c2 v|v| = F(t)"
    assert content.after.prediction.error < content.before.prediction.error
    assert [row[0] for row in content.coefficients] == ["m", "c", "k", "c2"]
    assert "were tried" in content.says[1]
    assert "is missing" in content.says[0]
    assert "interval" not in content.says[0]  # the table has the one of the finished fit, and no second one is shown


def test_it_is_one_sheet_whatever_its_length(content, monkeypatch):
    files = one_page_files.one_page_files(content)
    assert len(re.findall(rb"/Type /Page\b", files["report.pdf"])) == 1
    assert files == one_page_files.one_page_files(content)  # the same bytes again
    text = files["report.html"].decode()
    assert "v|v|" in text
    assert "<sup>2</sup>" in text
    assert "http" not in text.replace("http://www.w3.org", "")
    monkeypatch.setattr(one_page_files._Sheet, "most", 3)
    assert one_page_files._first(content.coefficients)[-1][0] == "and 2 more"


def test_no_legend_covers_a_curve_and_no_curve_touches_the_frame():
    content = page_of(0.0)  # what is left lies far below what was: the ordinate spans many decades
    figure = Figure(figsize=(7.0, 2.5))
    panels = figure.subplots(1, 2)
    one_page_files.draw(list(panels), content)
    figure.subplots_adjust(left=0.13, right=0.99, bottom=0.17, top=0.84)
    FigureCanvasAgg(figure).draw()
    for panel in panels:
        covered, frame = panel.get_legend().get_window_extent(), panel.get_window_extent()
        for line in panel.get_lines():
            drawn = line.get_transform().transform(line.get_xydata())
            inside = drawn[(drawn[:, 0] >= frame.x0) & (drawn[:, 0] <= frame.x1)]
            assert not any(covered.contains(x, y) for x, y in inside)
            assert np.min(inside[:, 1]) > frame.y0 + 2.0
            assert np.max(inside[:, 1]) < frame.y1


def test_an_option_keeps_to_one_line(content):
    noted = replace(content, notes=("if u^2 was meant: --unit displacement=mm",))
    text = one_page_files.as_html(noted, b"").decode()
    assert 'u<sup>2</sup> was meant: <span class="option">--unit</span> displacement=mm' in text.lower()


def test_of_records_with_the_same_times_the_one_that_is_shown_is_drawn():
    time, wave = np.tile(np.arange(0.0, 3.0, 0.1), 3), np.arange(90.0) % 31.0
    shown = slice(34, 40)
    same = one_page_files.same_motion(time, wave, time[shown], wave[shown])
    np.testing.assert_array_equal(same, np.arange(34, 40))
    assert len(one_page_files.same_motion(time, wave, np.array([7.0]), np.array([0.0]))) == 0


def test_lines_are_no_wider_than_the_sheet():
    font = FontProperties(size=9.0)
    words = "the error of the response falls from 69.2 % to 0.342 % " * 5
    wide = one_page_files.lines(words, font, 6.0)
    assert " ".join(wide) == words.strip()
    widths = [page.text_width(line, font) for line in wide]
    assert max(widths) <= 6.0
    assert min(widths[:-1]) > 5.0


def test_a_decay_has_no_force_and_several_records_their_names(systems):
    assert equation_in_symbols(systems["linear"], free=True).endswith("k u = 0")
    records = [Record(0.1, {"force": np.zeros(40)}, name=name) for name in "abcde"]
    strung = [replace(records[0], stretches=tuple(Stretch(r, 0, 40) for r in records[:n])) for n in (0, 3, 5)]
    assert [all_names(record) for record in strung] == ["a", "a, b and c", "a, b and 3 more"]
