"""What a page shows of a test of its kind: response functions, loops and dynamic stiffness, or a decay by amplitude."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page

from study import trials
from study.compare.decay import decays_of
from study.compare.force_map import CELLS, FEWEST_VISITS, cells_of, surface
from study.compare.residual_checks import residual_checks
from study.compare.response_functions import response_functions
from study.equations.model import Model, free
from study.equations.terms import get
from study.explore import page_units, place_words
from study.explore import session as sessions
from study.explore.axis_scales import Focus
from study.explore.cards import CHECKS
from study.explore.check_columns import DRIVEN, FREE, PRESCRIBED, kind_of
from study.explore.saved import saved
from study.explore.view import View
from study.records.record import Record
from study.support.errors import StudyError
from study.way_in.compare_records import compare_records

DT, STIFFNESS, DAMPING = 0.005, 2000.0, 30.0


@cache
def begun(kind: str) -> sessions.Session:
    """A component of spring and damper, a free decay, or a force on mass and spring."""
    if kind == PRESCRIBED:
        believed = Model("part", tuple(free(get(n)) for n in ("linear_damping", "linear_stiffness")))
        record = _component()
    else:
        free_run = kind == FREE
        trial = (
            trials.make_trial(9, ["hysteresis"], 0.0, test="free_decay")
            if free_run
            else trials.make_trial(4, ["dead_band"])
        )
        believed, record = trial.believed, trial.record.part(0, min(4000, len(trial.record)))
    return sessions.begin_with(compare_records([record], believed))


def _component() -> Record:
    rng, n = np.random.default_rng(3), 3000
    lines = np.arange(5, 200)
    phases = rng.uniform(0.0, 2.0 * np.pi, len(lines))
    turns = 2.0 * np.pi * np.outer(np.arange(n) * DT, lines / (n * DT)) + phases
    omega = 2.0 * np.pi * lines / (n * DT)
    u, v = 1e-3 * np.cos(turns).sum(axis=1), -1e-3 * (omega * np.sin(turns)).sum(axis=1)
    force = STIFFNESS * u + DAMPING * v
    force += 0.05 * np.std(force) * rng.standard_normal(n)
    return Record(DT, {"force": force, "displacement": u, "velocity": v}, name="part")


@pytest.mark.parametrize("kind", [DRIVEN, PRESCRIBED, FREE])
def test_a_page_shows_what_the_test_can_show(kind: str) -> None:
    session = begun(kind)
    assert kind_of(session.now.comparison) == kind
    text = saved(session).decode()
    shown = re.findall(r'data-panel="(\w+)"', text)
    checks = {check.name for cards in CHECKS.values() for card in cards for check in card}
    wanted = [check.name for card in CHECKS[kind] for check in card]
    assert [name for name in shown if name in checks] == wanted
    view = View(session.now, 0)
    columns = view.of_record(session) | view.of_sensor(view.sensors[0]) | view.of_place("")
    for name, source in columns.items():
        if name not in ("constancy", "lacking", "stiffness", "would_time", "would_spectrum", "would_u", "would_v",
                        "would_plane"):  # fmt: skip
            assert all(len(column) for column in source.values()), name


@pytest.mark.long
@pytest.mark.parametrize("kind", [DRIVEN, PRESCRIBED, FREE])
def test_a_browser_draws_every_panel_of_it(kind: str, page: Page, tmp_path: Path) -> None:
    (tmp_path / "page.html").write_bytes(saved(begun(kind)))
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda m: wrong.append(m.text) if m.type in ("error", "warning") else None)
    page.goto((tmp_path / "page.html").as_uri())
    page.wait_for_function("window.study && window.study.ready")
    page.click("[data-act=logarithm]")
    page.wait_for_timeout(300)
    wide = page.evaluate("[...document.querySelectorAll('[data-panel]')].map((p) => p.getBoundingClientRect().width)")
    assert min(wide) > 150.0
    drawn = page.evaluate("Object.keys(window.study.DRAWN)")  # what can be had as a file
    shown = page.evaluate("[...document.querySelectorAll('[data-panel]')].map((p) => p.dataset.panel)")
    assert set(shown) - {"difference"} <= set(drawn)  # that of the response's panel
    assert wrong == []
    printed = page.pdf(format="A4", prefer_css_page_size=True)
    assert len(re.findall(rb"/Type /Page\b", printed)) == 1, "it prints on one sheet"


@pytest.mark.parametrize("width", [1000, 1400, 1920])
def test_printing_keeps_the_layout_of_the_window_as_drawings_do_not_follow(
    width: int, page: Page, tmp_path: Path
) -> None:
    (tmp_path / "page.html").write_bytes(saved(begun(DRIVEN)))
    page.set_viewport_size({"width": width, "height": 900})
    page.goto((tmp_path / "page.html").as_uri())
    page.wait_for_function("window.study && window.study.ready")
    wide = "[...document.querySelectorAll('[data-panel]')].map((p) => p.offsetWidth)"
    shown = page.evaluate(wide)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert page.evaluate(wide) == pytest.approx(shown, rel=0.02)
    page.emulate_media(media="null")  # none is emulated any longer
    printed = page.pdf(format="A4", prefer_css_page_size=True)
    assert (len(re.findall(rb"/Type /Page\b", printed)) == 1) == (width > 1080), "in one column it takes more sheets"


def test_a_component_shows_its_dynamic_stiffness() -> None:
    comparison = begun(PRESCRIBED).now.comparison
    found = response_functions(comparison.prediction)
    expected = STIFFNESS + 2j * np.pi * found.frequency * DAMPING
    moved = found.frequency < 12.0  # the motion has power up to 13.3 Hz
    assert np.all(np.abs(found.measured - expected)[moved] < 0.05 * np.abs(expected[moved]))
    view = View(begun(PRESCRIBED).now, 0)
    seen, focus = view.of_sensor("force"), view.focus("force", "")
    scale = focus.response.factor / focus.displacement.factor
    size = np.interp(seen["frf"]["f"], found.frequency, np.abs(found.measured))
    assert np.allclose(seen["frf"]["measured"] * scale, size, rtol=1e-5)
    loops = seen["cycles"]
    assert np.allclose(loops["predicted"], loops["measured"], rtol=0.2)
    assert float(np.std(seen["loops"]["u"])) * focus.displacement.factor == pytest.approx(
        float(np.std(comparison.record["displacement"])), rel=0.2
    )


def test_what_is_left_of_a_component_is_held_against_its_motion() -> None:
    """Against its force it would always correlate: the noise is a part of that."""
    found = residual_checks(begun(PRESCRIBED).now.comparison.prediction)
    assert np.mean(np.abs(found.with_force) > found.band_force) < 0.1


def test_a_decay_shows_frequency_and_damping_by_amplitude() -> None:
    session = begun(FREE)
    found, view = decays_of(session.now.comparison), View(session.now, 0)
    assert found is not None
    shown = view.of_sensor(view.sensors[0])["decay"]
    assert np.all(np.diff(shown["at"]) >= 0.0)
    assert sorted(shown["frequency"]) == pytest.approx(sorted(found.measured.frequency), rel=1e-5)
    assert sorted(shown["damping"]) == pytest.approx(sorted(100.0 * found.measured.damping), rel=1e-5)
    with pytest.raises(StudyError, match="no force acts; expected a driven record"):
        response_functions(session.now.comparison.prediction)


@pytest.mark.parametrize(
    ("value", "half", "shown"),
    [
        (895.71, 97.3, ("896", "97")), (1821.2, 160.2, ("1820", "160")), (5.7387e6, 1.6e5, ("5.74·10⁶", "0.16·10⁶")),
        (-0.017237, 0.02, ("-0.017", "0.020")), (2.7e-4, 3e-6, ("2.700·10⁻⁴", "0.030·10⁻⁴")),
        (3.77, 5.7e-6, ("3.77", "5.7·10⁻⁶")), (0.0, 0.3, ("0.00", "0.30")), (12.0, float("nan"), ("12", "nan")),
    ],
)  # fmt: skip
def test_a_value_is_shown_to_the_digits_that_are_known(value: float, half: float, shown: tuple[str, str]) -> None:
    assert page_units.with_error(value, half) == shown


def test_a_screen_has_one_format_of_numbers() -> None:
    said = "from 3.2e-05 % it falls; 20000130 N/m^3 (20000064 to -20000196), of 131072 samples of trial_1234567."
    assert page_units.in_sentence(said) == (
        "from 3.2·10⁻⁵ % it falls; 2.000013·10⁷ N/m³ (2.0000064·10⁷ to -2.0000196·10⁷), of 131072 samples of "
        "trial_1234567."
    )
    assert page_units.in_percent(3.68e-7) == "3.68·10⁻⁵\u00a0%"
    assert page_units.in_percent(0.2286) == "22.9\u00a0%"


def test_a_map_has_cells_as_fine_as_the_record_allows() -> None:
    u, v = np.random.default_rng(7).standard_normal((2, 40000))
    lengths = (30, 300, 1000, 3000, 40000)
    cells = [cells_of(u[:n], v[:n]) for n in lengths]
    assert (cells[0], cells[-1]) == (CELLS[-1], CELLS[0])
    assert cells == sorted(cells)
    assert len(set(cells)) > 2
    for n, count in zip(lengths, cells, strict=True):
        plane = surface(u[:n], v[:n], u[:n])
        assert plane.mean.shape == (count, count)
        seen = np.isfinite(plane.mean)
        assert seen.any() == (n > 30)
        middle = 0.5 * (plane.displacement[1:] + plane.displacement[:-1])
        assert np.all(np.abs(plane.mean - middle[:, None])[seen] <= np.diff(plane.displacement)[0])


def test_a_map_that_stays_empty_says_why() -> None:
    comparison = begun(DRIVEN).now.comparison
    focus = Focus(comparison, 0, comparison.place)
    assert place_words.one_place(focus, seen=True, tied=False)["plane-hint"] == place_words.READ
    lacking = comparison.missing_force
    few = slice(lacking.inner.start, lacking.inner.start + 3 * FEWEST_VISITS)
    motion = {name: getattr(lacking, name)[few] for name in ("displacement", "velocity", "force")}
    short = replace(comparison, missing_force=replace(lacking, edge=0, **motion))
    hint = place_words.one_place(Focus(short, 0, short.place), seen=True, tied=False)["plane-hint"]
    assert "too short a record" in hint
