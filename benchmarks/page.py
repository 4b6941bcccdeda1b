"""Seconds that the page of ``study explore`` lets its user wait: ``python -m benchmarks.page``.

On a record of 8,192 samples, in a real browser: from the address to the first answer with the plots in view, and to
the last plot; from a click on Add or Undo to figures and plots in view, from a click on Save to its notice. Beside
these, the processor's seconds of the browser's page and of the server meanwhile, which say more where the machine has
other work. Goals: Add 1 s, first paint 2 s, Save 3 s. Every wait has a limit, which ends in a sentence that names it.
"""

import os
import re
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
from playwright.sync_api import CDPSession, Page, sync_playwright
from playwright.sync_api import TimeoutError as PageTimeoutError

from scripts.page_picture import QUIET, browser
from study import trials
from study.equations import model_file
from study.explore import html_page, session
from study.explore.saved import files, of_stage
from study.explore.server import AGAIN
from study.explore.view import View
from study.records.prepared import prepare_record
from study.records.record import write_csv
from study.support.errors import StudyError
from study.support.workflow_step import one_sentence

ROUNDS = 5
SEED = 911
LIMIT = 120.0  # seconds within which anything that is waited for has to come
WHOLE = 1800.0  # within which all of it has to be done
REST = 1.0  # seconds in which a server at rest uses next to no processor
READY = "window.study && window.study.ready && document.querySelector('#figure-error b')"
IDLE = "!document.body.classList.contains('busy')"  # a click that comes while something is done is not taken on
# Words change first; plots are painted in the frames that follow.
FRAMES = """() => {
  let frames = 0
  window.painted = false
  const next = () => (++frames === 5 ? setTimeout(() => { window.painted = true }, 0) : requestAnimationFrame(next))
  requestAnimationFrame(next)
  return true
}"""


@dataclass(frozen=True)
class Took:
    """Seconds of the wall clock, and of the processor in the browser's page and in the server."""

    wall: float
    page: float
    server: float

    def row(self, what: str) -> str:
        return f"{what:22} {self.wall:6.2f} s; processor: page {self.page:5.2f} s, server {self.server:5.2f} s"


@dataclass(frozen=True)
class Watched:
    """A browser's page and the server behind it."""

    page: Page
    whole: CDPSession  # of the browser
    server: psutil.Process

    def processor(self) -> tuple[float, float]:
        """Seconds that the browser's pages and the server have used so far."""
        processes = self.whole.send("SystemInfo.getProcessInfo")["processInfo"]
        spent = self.server.cpu_times()
        return sum(p["cpuTime"] for p in processes if p["type"] == "renderer"), spent.user + spent.system

    def took(self, begin: Callable[[], object], *until: str) -> Took:
        """What it took from an action until the last of some conditions holds and frames were painted after it."""
        before, start = self.processor(), time.perf_counter()
        begin()
        for condition in until:
            self.wait(condition)
        self.wait(FRAMES)
        self.wait("window.painted")
        wall, after = time.perf_counter() - start, self.processor()
        return Took(wall, after[0] - before[0], after[1] - before[1])

    def wait(self, condition: str) -> None:
        """Until something holds of the page; a sentence if that takes too long."""
        try:
            self.page.wait_for_function(condition, timeout=1000.0 * LIMIT, polling=40)
        except PageTimeoutError:
            raise StudyError(f"the page did not come to this within {LIMIT:g} s: {condition!r}") from None

    def rest(self) -> None:
        """Until nothing is diagnosed, nor drawn for Save ahead of it."""
        self.wait("!document.body.classList.contains('working')")
        end = time.monotonic() + LIMIT
        while self.server.cpu_percent(REST) > 5.0:
            if time.monotonic() > end:
                raise StudyError(f"the server did not come to rest within {LIMIT:g} s")

    def clicked(self, selector: str) -> Took:
        """Until another model's figures are shown and its plots painted."""
        self.wait(IDLE)
        before = self.page.inner_text("#figures", timeout=1000.0 * LIMIT)
        changed = f"document.querySelector('#figures').innerText !== {before!r}"
        return self.took(lambda: self.page.click(selector, timeout=1000.0 * LIMIT), changed)

    def saved(self) -> Took:
        """Until the page says that all is saved."""
        self.wait(IDLE)
        said = "document.querySelector('#notice').innerText.startsWith('Saved')"
        return self.took(lambda: self.page.click("[data-act=save]", timeout=1000.0 * LIMIT), said)


def on_the_page(url: str, server: psutil.Process) -> Iterator[tuple[str, Took]]:
    """What is waited for, one after the other, as it is measured."""
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=browser(), args=list(QUIET))
        whole = opened.new_browser_cdp_session()
        for number in range(ROUNDS):
            page = opened.new_page(viewport={"width": 1280, "height": 900})
            seen = Watched(page, whole, server)
            visit = "first paint, at once" if number == 0 else "first paint, later"
            yield visit, seen.took(lambda page=page: page.goto(url, timeout=1000.0 * LIMIT, wait_until="commit"), READY)
            seen.wait("document.querySelector('[data-candidate]')")
            time.sleep(AGAIN + 1.0)  # a page is made for the next visit
            seen.rest()
            if number < ROUNDS - 1:
                page.close()
        for _ in range(ROUNDS):
            yield "add", seen.clicked("[data-candidate='0'] button")
            seen.rest()
            yield "save", seen.saved()
            yield "undo", seen.clicked("[data-act=undo]")
            seen.rest()
        opened.close()


@contextmanager
def served(folder: Path) -> Iterator[tuple[str, psutil.Process]]:
    """The address of a page on the record in a folder, and its server, which is ended whatever happens."""
    words = ["-m", "study", "explore", "rig.csv", "--model", "rig.yaml", "--port", "0", "--no-browser"]
    server = subprocess.Popen(
        [sys.executable, *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    late = threading.Timer(LIMIT, server.kill)
    late.start()
    try:
        assert server.stdout is not None
        said = re.match(r"(http://127\.0\.0\.1:\d+/)", line := server.stdout.readline())
        late.cancel()
        if said is None:
            raise StudyError(f"'study explore' said {line.strip()!r} within {LIMIT:g} s, expected its address")
        yield said[1], psutil.Process(server.pid)
    finally:
        late.cancel()
        server.kill()
        server.wait()


def alone(trial: Any) -> dict[str, float]:
    """The processor's seconds of what Python does, without a page."""
    now = session.begin(trial.believed, prepare_record(trial.record))
    stage, _ = session.examined(now)
    now = session.with_stage(now, stage)
    after = session.with_added(now, stage.shown[0].name)
    before, grown = View(now.now, 0), View(after.now, 1)
    text = model_file.format_model(trial.believed)
    drawn = of_stage(now.now)
    work: dict[str, Callable[[], object]] = {
        "add: fit": lambda: session.with_added(now, stage.shown[0].name),
        "add: columns": lambda: [grown.of_record(after), grown.of_sensor(grown.sensors[0]), grown.of_place("")],
        "first paint: document": lambda: html_page.build(before, now, before.sensors[0], ""),
        "save: page, history": lambda: files(now, "rig.yaml", text, drawn=drawn),
        "drawn ahead of save": lambda: of_stage(now.now),
    }
    return {what: min(_cpu(do) for _ in range(ROUNDS)) for what, do in work.items()}


def _cpu(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def ended() -> None:
    """The last resort: a browser may wait without end where nobody can set a limit."""
    print(f"benchmarks.page: not done within {WHOLE:g} s, ended", file=sys.stderr, flush=True)
    for child in psutil.Process().children(recursive=True):
        child.kill()
    os._exit(1)


def main() -> None:
    watchdog = threading.Timer(WHOLE, ended)
    watchdog.daemon = True
    watchdog.start()
    trial = trials.make_trial(SEED, hidden=["quadratic_damping"], noise=0.01, response="displacement")
    found: dict[str, list[Took]] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_csv(trial.record, folder / "rig.csv")
        terms = "".join(f"  - {term.name}\n" for term in trial.believed.terms)
        (folder / "rig.yaml").write_text(f"name: rig\nterms:\n{terms}", encoding="utf-8")
        with served(folder) as (url, server):
            for what, took in on_the_page(url, server):
                print(took.row(what), file=sys.stderr, flush=True)
                found.setdefault(what, []).append(took)
    print(f"medians; load of the machine {psutil.getloadavg()[0]:.1f} on {psutil.cpu_count()} cores")
    for what, each in found.items():
        print(Took(*(statistics.median(getattr(t, n) for t in each) for n in ("wall", "page", "server"))).row(what))
    for what, value in alone(trial).items():
        print(f"{what:22} {value:.2f} s of the processor")


if __name__ == "__main__":
    with one_sentence():
        main()
