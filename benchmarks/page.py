"""Seconds from a click on the page of ``study explore`` to figures and plots: ``python -m benchmarks.page``.

On a record of 8,192 samples, in a real browser, beside the fit and the columns that the server alone needs.
"""

import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, sync_playwright

from scripts.page_picture import QUIET, browser
from study import trials
from study.explore import session
from study.explore.view import view
from study.records.prepared import prepare_record
from study.records.record import write_csv

ROUNDS = 5
SEED = 911
# Words change first; plots are painted in the frames that follow.
PAINTED = """new Promise((done) => {
  let frames = 0
  const next = () => (++frames === 5 ? setTimeout(done, 0) : requestAnimationFrame(next))
  requestAnimationFrame(next)
})"""


def clicked(page: Page, selector: str) -> float:
    """Seconds until another model's figures are shown and its plots painted."""
    before = page.inner_text("#figures")
    start = time.perf_counter()
    page.click(selector)
    page.wait_for_function(f"document.querySelector('#figures').innerText !== {before!r}", timeout=60_000)
    page.evaluate(PAINTED)
    return time.perf_counter() - start


def on_the_page(url: str) -> dict[str, float]:
    found: dict[str, list[float]] = {"add": [], "undo": []}
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=browser(), args=list(QUIET))
        page = opened.new_page(viewport={"width": 1280, "height": 900})
        page.goto(url)
        for _ in range(ROUNDS):
            page.wait_for_selector("[data-candidate]", timeout=120_000)
            time.sleep(1.0)
            found["add"].append(clicked(page, "[data-candidate='0'] button"))
            time.sleep(15.0)  # the diagnosis of the new model is done
            found["undo"].append(clicked(page, "[data-act=undo]"))
        opened.close()
    return {what: statistics.median(seconds) for what, seconds in found.items()}


def alone(trial: Any) -> float:
    """Seconds of the fit and of the page's columns, without a page."""
    now = session.begin(trial.believed, prepare_record(trial.record))
    stage, _ = session.examined(now)
    now = session.with_stage(now, stage)
    start = time.perf_counter()
    after = session.with_added(now, stage.shown[0].name)
    view(after.now, 1)
    return time.perf_counter() - start


def main() -> None:
    trial = trials.make_trial(SEED, hidden=["quadratic_damping"], noise=0.01, response="displacement")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_csv(trial.record, folder / "rig.csv")
        terms = "".join(f"  - {term.name}\n" for term in trial.believed.terms)
        (folder / "rig.yaml").write_text(f"name: rig\nterms:\n{terms}", encoding="utf-8")
        words = ["-m", "study", "explore", "rig.csv", "--model", "rig.yaml", "--port", "0", "--no-browser"]
        with subprocess.Popen([sys.executable, *words], cwd=folder, stdout=subprocess.PIPE, text=True) as server:
            assert server.stdout is not None
            said = re.match(r"(http://127\.0\.0\.1:\d+/)", server.stdout.readline())
            assert said is not None
            seconds = on_the_page(said[1])
            server.terminate()
    seconds["add, without a page"] = alone(trial)
    for what, value in seconds.items():
        print(f"{what:22} {value:.2f} s")


if __name__ == "__main__":
    main()
