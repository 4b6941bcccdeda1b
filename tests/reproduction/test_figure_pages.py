"""Whole pages of figures: nothing overlaps, the same bytes each time."""

import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib import style
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba

from study.figures import frequency_response, page, styles
from study.records.record import Record, write_csv
from study.records.spectra import Segments
from study.reproduction.study_figures import CaseFiles, draw_case, force_history
from study.support.errors import StudyError
from tests.reproduction.test_figures import SYSTEMS, coherence_table, one, response_table

ROOT = Path(__file__).parents[2]
SHEET = ROOT / "study" / "figures" / "study.mplstyle"
SEGMENTS = Segments(256)
KINDS = ("linear", "nonlinear", "coherence", "histogram")


@pytest.fixture(autouse=True)
def _sheet():
    with style.context(SHEET):
        yield


@pytest.fixture
def products(tmp_path):
    """Writes the three products of a case; its model may be another."""

    def write(system, title="", model="linear", segments=SEGMENTS, **kwargs):
        record, responses, coherences = (tmp_path / f"{n}.csv" for n in ("record", "responses", "coherences"))
        force, displacement = np.random.default_rng(2).standard_normal((2, 2048))
        channels = {"force": force, "displacement": 0.002 * displacement, "acceleration": force}
        write_csv(Record(0.02, channels), record)
        response_table(system, **kwargs).to_csv(responses, index=False)
        coherence_table(system).to_csv(coherences, index=False)
        return CaseFiles(record, ROOT / "models" / f"{model}.yaml", responses, coherences, title, segments=segments)

    return write


# ---- pages


def test_same_bytes_each_time_and_a_look_that_the_sheet_decides():
    def made():
        figure, panels = page.empty_page("Title", "what is shown")
        frequency_response.magnitude_panel(panels[0], one(), "N/m")
        page.shared_legend(figure, panels, bands=True)
        return figure

    for kind in ("png", "svg"):
        assert page.rendered(made(), kind) == page.rendered(made(), kind)
    assert b"<dc:date>" not in page.rendered(made(), "svg")
    assert made().axes[0].lines[0].get_color() == "C0"
    with style.context({"axes.prop_cycle": "cycler('color', ['ff0000'])"}):
        assert to_rgba("C0") == (1.0, 0.0, 0.0, 1.0)


def check_layout(figure):
    """Every word within the page, none over another or over a panel, a unit on every axis."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    extent, size = figure.get_tightbbox(renderer), figure.get_size_inches()
    assert min(extent.p0) > 0.0, "something leaves the page at the left or below"
    assert np.all(extent.p1 < size), "something leaves the page at the right or above"
    heads = [*figure.texts, *figure.legends, *(a for p in figure.axes for a in (p._left_title, *p.texts))]
    boxes = [(head, head.get_window_extent(renderer)) for head in heads]
    boxes = [(head, box) for head, box in boxes if box.width > 0]
    for (one_head, box), (other_head, other) in itertools.combinations(boxes, 2):
        assert not box.overlaps(other), f"{one_head} covers {other_head}"
    for panel in (p for p in figure.axes if p.axison):
        frame = panel.get_window_extent()
        assert not any(box.overlaps(frame) for _, box in boxes), "a heading or the legend covers a panel"
        assert all(label == "" or label.endswith(")") for label in (panel.get_xlabel(), panel.get_ylabel()))
    shown = [p for p in figure.axes if p.axison]
    assert not shown or (any(p.get_ylabel() for p in shown) and any(p.get_xlabel() for p in shown))


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("kind", KINDS)
def test_nothing_overlaps_on_any_page(products, system, kind, monkeypatch, tmp_path):
    seen = []
    monkeypatch.setattr(page, "rendered", lambda figure, _: seen.append(figure) or b"")
    title = "Extreme Duffing-Van der Pol system, input variance 0.2"
    draw_case(products(system, title), {kind: [tmp_path / "a.png"]}, SHEET)
    check_layout(seen[0])


def test_there_is_room_for_many_estimators(products, monkeypatch, tmp_path):
    seen = []
    monkeypatch.setattr(page, "rendered", lambda figure, _: seen.append(figure) or b"")
    names = (*styles.ESTIMATOR_LOOKS, "another_one")
    case = products("duffing_van_der_pol", "Noise", spread=0.5, estimators=names)
    draw_case(case, {k: [tmp_path / k] for k in ("linear", "nonlinear")}, SHEET)
    for figure in seen:
        check_layout(figure)
    assert {"local polynomial", "95 % band"} <= {t.get_text() for t in seen[0].legends[0].get_texts()}


def test_draw_writes_each_kind_twice(products, tmp_path):
    outputs = {kind: [tmp_path / f"{kind}.{ending}" for ending in ("png", "svg")] for kind in KINDS}
    draw_case(products("duffing", "Duffing system"), outputs, SHEET)
    for png, svg in outputs.values():
        assert png.read_bytes().startswith(b"\x89PNG")
        assert b"</svg>" in svg.read_bytes()


def test_draw_refuses_an_unknown_kind(products, tmp_path):
    with pytest.raises(StudyError, match="no kind of figure 'other'; known are linear"):
        draw_case(products("duffing"), {"other": [tmp_path / "a.png"]}, SHEET)


@pytest.mark.parametrize(
    ("system", "kind"),
    [("duffing", "pattern"), ("mathieu", "pattern"), ("mathieu", "autospectrum"), ("linear", "force_history"),
     ("linear", "force_histogram")],
)  # fmt: skip
def test_preliminary_figures(products, tmp_path, system, kind, monkeypatch):
    case = products("plain", f"{system} system", system)
    seen, real = [], page.rendered
    monkeypatch.setattr(page, "rendered", lambda figure, ending: seen.append(figure) or real(figure, ending))
    output = tmp_path / "a.svg"
    draw_case(case, {kind: [output]}, SHEET)
    assert b"</svg>" in output.read_bytes()
    check_layout(seen[0])


@pytest.mark.parametrize("length", [128, 256])
def test_the_stretch_of_force_is_as_long_as_a_segment(products, length):
    figure = force_history(products("plain", segments=Segments(length)))
    assert len(figure.axes[0].lines[0].get_xdata()) == length


def test_a_subtitle_that_is_too_long_for_its_page_is_written_smaller():
    figure, _ = page.empty_page("A title", "three records of one rig; " * 4)
    title, subtitle = figure.texts
    assert title.get_fontsize() == 11.0
    assert page.LEFT + page.text_width(subtitle.get_text(), subtitle.get_fontproperties()) < page.WIDTH


def test_a_step_of_the_workflow_loads_nothing_for_its_first_figure():
    """Each took 0.3 s for it, two dozen of them."""
    asked = """
import sys, study.figures.first_page
from study.figures import page
loaded = set(sys.modules)
figure, (panel,) = page.empty_page("Title", "$A_2(f)$")
panel.semilogy([1.0, 2.0], label="$u^3$")
page.shared_legend(figure, [panel])
drawn = [page.rendered(figure, kind) for kind in ("png", "svg")]
print(sorted(set(sys.modules) - loaded))
"""
    run = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["[]"]
