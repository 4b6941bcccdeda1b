"""``study explore`` of a structure in a real browser: a place is selected, what is missing there added, all saved."""

import pytest
from playwright.sync_api import Page

from study.compare import history

CUBIC = "cubic_stiffness[floor2-floor3]"


@pytest.fixture(scope="module")
def address(hall, exploring):
    """The address of a page that is served."""
    with exploring(hall, "frame.csv", "frame.yaml", "--out", "saved") as running:
        yield running.address


def until(page: Page, condition: str) -> None:
    page.wait_for_function(condition, timeout=180_000)


def source(page: Page, name: str, column: str) -> list[float]:
    return page.evaluate(f"Array.from(Bokeh.documents[0].get_model_by_name('{name}').get_column('{column}'))")


def turned(page: Page, what: str, name: str) -> None:
    """Until the panels show what belongs to a sensor or a place: a live page asks for it."""
    until(page, f"Bokeh.documents[0].get_model_by_name('turned').get_column('{what}')[0] === '{name}'")


def the_sketch_selects(page: Page) -> None:
    # A line has no area that a click could aim at.
    box = page.locator("[data-place='floor1-floor2'] .hit").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    assert page.inner_text("#places .selected h3") == "Between floor1 and floor2"
    turned(page, "place", "floor1-floor2")
    first = source(page, "against_u", "at")
    page.locator(f"[data-row='{CUBIC}'] .name").click()
    assert page.inner_text("#places .selected h3") == "Between floor2 and floor3"
    turned(page, "place", "floor2-floor3")
    assert len(source(page, "against_u", "at")) > 5
    assert source(page, "against_u", "at") != first
    assert "cubic stiffness" in page.inner_text("#constancy-of")
    a_candidate_is_previewed(page)
    page.locator("[data-place='ground-floor3']").first.focus()
    page.keyboard.press("Enter")
    assert page.inner_text("#places .selected h3") == "Between the ground and floor3"
    turned(page, "place", "ground-floor3")
    page.keyboard.press("Escape")


def a_candidate_is_previewed(page: Page) -> None:
    """What the pinned one would leave stands beside what there is, in the motion of another sensor too."""
    for sensor in ("floor1 displacement", "floor3 displacement"):
        page.click(f"[data-act=sensor][data-name='{sensor}']")
        turned(page, "sensor", sensor)
        until(page, "Bokeh.documents[0].get_model_by_name('ghost_time').get_length() > 100")
        left = "Bokeh.documents[0].get_model_by_name('{}').get_column('{}')"
        until(page, f"{left.format('ghost_time', 'y')} === {left.format('would_time', '0')}")
        assert max(map(abs, source(page, "ghost_time", "y"))) < 0.8 * max(
            map(abs, source(page, "time", "difference"))
        )  # fmt: skip
    assert source(page, "plane", "mean") == source(page, "would_plane", "0")
    assert page.locator("li.pinned").count() == 1
    page.keyboard.press("Escape")
    page.mouse.move(5, 5)
    until(page, "Bokeh.documents[0].get_model_by_name('ghost_time').get_length() === 0")
    assert source(page, "plane", "mean") == source(page, "plane", "found")


def the_residual_is_checked(page: Page) -> None:
    """Of the sensor that is looked at: the autocorrelation begins at one, the histogram holds nearly all samples."""
    seen: list[list[float]] = []
    for button in page.locator("#sensors button").all_text_contents():
        page.click(f"[data-act=sensor][data-name='{button}']")
        turned(page, "sensor", button)
        own, left, right, top = (
            source(page, name, column)
            for name, column in (("autocorrelation", "value"), *(("histogram", c) for c in ("left", "right", "top")))
        )
        assert own[0] == pytest.approx(1.0)
        assert max(map(abs, own[1:])) < 1.0
        held = sum(t * (r - q) for q, r, t in zip(left, right, top, strict=True))
        assert 0.95 < held < 1.0 + 1e-5
        seen.append(own)
    assert len(seen) > 1
    assert all(own != seen[0] for own in seen[1:])


def the_panels_are_drawn(page: Page) -> None:
    """Also those that nobody has scrolled to, and each is as high as the room that was kept for it."""
    until(page, "window.study.drawn")
    rooms = page.evaluate(
        "[...document.querySelectorAll('[data-panel]')].map((p) => [p.dataset.panel, p.clientHeight, "
        "p.firstElementChild.shadowRoot.querySelectorAll('canvas').length, "
        "Bokeh.documents[0].get_model_by_name('panel_' + p.dataset.panel).height])"
    )
    assert len(rooms) > 10
    for name, room, _, height in rooms:
        assert abs(room - height) < 2.0, name


def the_axes_have_ticks(page: Page) -> None:
    """That of the history, and those of frequency, which may be logarithmic."""
    ticks = "Array.from(Bokeh.documents[0].get_model_by_name('history_ticks').ticks)"
    assert len(page.evaluate(ticks)) > 1
    scale = "Bokeh.documents[0].get_model_by_name('panel_{}').x_scale.type"

    def kinds() -> list[str]:
        return [page.evaluate(scale.format(name)) for name in ("lacking", "stiffness", "spectrum", "response")]

    page.click("[data-act=logarithm]")
    assert kinds() == ["LogScale", "LogScale", "LogScale", "LinearScale"]
    assert page.evaluate("Bokeh.documents[0].get_model_by_name('range_frequency').start") > 0.0
    page.click("[data-act=logarithm]")
    assert kinds() == ["LinearScale"] * 4


@pytest.mark.long
def test_a_session_of_a_structure_from_the_verdict_to_the_saved_page(page: Page, address: str, hall) -> None:
    wrong: list[str] = []
    page.on("console", lambda m: wrong.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(address)
    until(page, "document.querySelector('#verdict h3') && window.study.ready")
    assert page.inner_text("#verdict h3") == "An effect is missing"
    assert "between floor2 and floor3" in page.inner_text("#verdict")
    the_panels_are_drawn(page)
    the_sketch_selects(page)
    the_residual_is_checked(page)
    the_axes_have_ticks(page)
    given = float(page.inner_text("#figure-error b").removesuffix("%"))
    page.click(f"[data-act=add][data-name='{CUBIC}']")
    until(page, f"parseFloat(document.querySelector('#figure-error b').textContent) < {0.7 * given}")
    until(page, "document.querySelector('#verdict h3.nothing_missing')")
    page.click("[data-act=save]")
    until(page, "document.getElementById('notice').textContent.includes('Saved in')")
    assert [s["added"] for s in history.read_history(hall / "saved" / "frame.yaml")] == [None, CUBIC]
    page.goto((hall / "saved" / "explore.html").as_uri())
    until(page, "window.study && window.study.ready")
    page.locator("#steps button").first.click()
    assert float(page.inner_text("#figure-error b").removesuffix("%")) == given
    the_panels_are_drawn(page)
    the_sketch_selects(page)
    the_residual_is_checked(page)
    assert not wrong
