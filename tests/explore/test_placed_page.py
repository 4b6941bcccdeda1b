"""``study explore`` of a structure in a real browser: a place is selected, what is missing there added, all saved."""

import re
import subprocess
import sys

import pytest
from playwright.sync_api import Page

from study.compare import history

CUBIC = "cubic_stiffness[floor2-floor3]"


@pytest.fixture(scope="module")
def shown(hall):
    """The address of a page that is served."""
    words = ["explore", "frame.csv", "--model", "frame.yaml", "--port", "0", "--no-browser", "--out", "saved"]
    with (hall / "errors.txt").open("w") as errors:
        server = subprocess.Popen(
            [sys.executable, "-m", "study", *words], cwd=hall, stdout=subprocess.PIPE, stderr=errors, text=True
        )
        line = server.stdout.readline()
        found = re.match(r"(http://127\.0\.0\.1:\d+/) shows", line)
        assert found, line + (hall / "errors.txt").read_text()
        yield found[1]
        server.terminate()
        server.wait(10)
        server.stdout.close()
    assert "Traceback" not in (hall / "errors.txt").read_text()


def until(page: Page, condition: str) -> None:
    page.wait_for_function(condition, timeout=180_000)


def marks(page: Page, name: str) -> list[float]:
    return page.evaluate(f"Array.from(Bokeh.documents[0].get_model_by_name('{name}').get_column('at'))")


def the_sketch_selects(page: Page) -> None:
    # A line has no area that a click could aim at.
    box = page.locator("[data-place='floor1-floor2'] .hit").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    assert page.inner_text("#places .selected h3") == "Between floor1 and floor2"
    first = marks(page, "map")
    page.locator(f"[data-row='{CUBIC}'] .name").click()
    assert page.inner_text("#places .selected h3") == "Between floor2 and floor3"
    assert len(marks(page, "map")) > 5
    assert marks(page, "map") != first
    assert "cubic stiffness" in page.inner_text("#constancy-of")
    page.locator("[data-place='ground-floor3']").first.focus()
    page.keyboard.press("Enter")
    assert page.inner_text("#places .selected h3") == "Between the ground and floor3"
    page.keyboard.press("Escape")


def test_a_session_of_a_structure_from_the_verdict_to_the_saved_page(page: Page, shown: str, hall) -> None:
    wrong: list[str] = []
    page.on("console", lambda m: wrong.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(shown)
    until(page, "document.querySelector('#verdict h3') && window.study.ready")
    assert page.inner_text("#verdict h3") == "An effect is missing"
    assert "between floor2 and floor3" in page.inner_text("#verdict")
    the_sketch_selects(page)
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
    the_sketch_selects(page)
    assert not wrong
