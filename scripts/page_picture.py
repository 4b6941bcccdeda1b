"""A picture of a saved page, as a browser shows it: ``make picture`` draws the one that opens the README."""

import io
import os
import shutil
import sys
from pathlib import Path

from study.support.errors import StudyError
from study.support.files import replace_file
from study.support.workflow_step import one_sentence

BROWSERS = ("chromium", "chromium-browser", "google-chrome-stable", "google-chrome")
MISSING = "no Chromium here: 'apt-get install chromium', or name a browser in STUDY_BROWSER"
# Nothing of the browser's own may ask for anything; a browser that root starts needs the first.
QUIET = (
    "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--no-first-run",
)  # fmt: skip
WIDTH, HEIGHT = 1400, 1340
COLOURS = 128  # of the picture: a page has few


def browser() -> str | None:
    """The browser of this machine, or the one that ``STUDY_BROWSER`` names."""
    return os.environ.get("STUDY_BROWSER") or next((path for path in map(shutil.which, BROWSERS) if path), None)


def main(page: Path, picture: Path, step: int) -> None:
    from PIL import Image
    from playwright.sync_api import sync_playwright

    where = browser()
    if where is None:
        raise StudyError(MISSING)
    if not page.is_file():
        raise StudyError(f"{page}: there is no such page; 'snakemake -j2 silverbox_climb' makes it")
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=where, args=list(QUIET))
        seen = opened.new_context(viewport={"width": WIDTH, "height": HEIGHT}, offline=True).new_page()
        seen.goto(page.absolute().as_uri())
        seen.wait_for_function("window.study && window.study.ready")
        seen.evaluate(f"window.study.step({step})")
        seen.wait_for_timeout(1000)
        data = seen.screenshot()
        opened.close()
    small = io.BytesIO()
    Image.open(io.BytesIO(data)).convert("RGB").quantize(COLOURS).save(small, "PNG", optimize=True)
    replace_file(picture, small.getvalue())


if __name__ == "__main__":
    with one_sentence():
        main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]))
