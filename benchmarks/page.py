"""Seconds that the page of ``study explore`` lets its user wait: ``python -m benchmarks.page``.

On a record of 8,192 samples, in a real browser: from the address to the first plots, from a click on Add or Undo to
figures and plots, from a click on Save to its notice. Beside these, the processor's seconds of what Python does of it,
which say more where the machine has other work. Goals: Add 1 s, first paint 2 s, Save 3 s.
"""

import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, sync_playwright

from scripts.page_picture import QUIET, browser
from study import trials
from study.equations import model_file
from study.explore import any_page, html_page, session
from study.explore.saved_files import files, of_stage
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


def first_paint(page: Page, url: str) -> float:
    """Seconds from the address to the first model's figures and plots."""
    start = time.perf_counter()
    page.goto(url)
    page.wait_for_function("window.study && window.study.ready && document.querySelector('#figure-error b')")
    page.evaluate(PAINTED)
    return time.perf_counter() - start


def saved_in(page: Page) -> float:
    """Seconds until the page says that all is saved."""
    start = time.perf_counter()
    page.click("[data-act=save]")
    page.wait_for_function("document.querySelector('#notice').innerText.startsWith('Saved')", timeout=60_000)
    return time.perf_counter() - start


def on_the_page(url: str) -> dict[str, float]:
    found: dict[str, list[float]] = {"first paint": [], "add": [], "save": [], "undo": []}
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=browser(), args=list(QUIET))
        page = opened.new_page(viewport={"width": 1280, "height": 900})
        found["first paint"].append(first_paint(page, url))
        for _ in range(ROUNDS):
            page.wait_for_selector("[data-candidate]", timeout=120_000)
            time.sleep(1.0)
            found["add"].append(clicked(page, "[data-candidate='0'] button"))
            time.sleep(20.0)  # the diagnosis of the new model is done, and what Save writes is drawn
            found["save"].append(saved_in(page))
            found["undo"].append(clicked(page, "[data-act=undo]"))
        opened.close()
    return {what: statistics.median(seconds) for what, seconds in found.items()}


def alone(trial: Any) -> dict[str, float]:
    """The processor's seconds of what Python does, without a page."""
    now = session.begin(trial.believed, prepare_record(trial.record))
    stage, _ = session.examined(now)
    now = session.with_stage(now, stage)
    after = session.with_added(now, stage.shown[0].name)
    history = any_page.history_columns(after)
    text = model_file.format_model(trial.believed)
    drawn = of_stage(now.now)
    work: dict[str, Callable[[], object]] = {
        "add: fit": lambda: session.with_added(now, stage.shown[0].name),
        "add: columns": lambda: view(after.now, 1),
        "first paint: document": lambda: html_page.build(view(now.now, 0), history),
        "save: page, history": lambda: files(now, "rig.yaml", text, drawn=drawn),
        "drawn ahead of save": lambda: of_stage(now.now),
    }
    return {what: min(_cpu(do) for _ in range(ROUNDS)) for what, do in work.items()}


def _cpu(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


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
    for what, value in seconds.items():
        print(f"{what:22} {value:.2f} s")
    for what, value in alone(trial).items():
        print(f"{what:22} {value:.2f} s of the processor")


if __name__ == "__main__":
    main()
