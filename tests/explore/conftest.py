"""A browser; and a short record of a frame with a hardening joint, of which its owner's model knows nothing."""

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, sync_playwright

from scripts.page_picture import MISSING, QUIET, browser
from study.equations.model_file import format_model, read_model
from study.equations.simulate import Integrator, simulate
from study.records.excitation import Excitation, force
from study.records.record import write_csv

FRAME = Path(__file__).parents[2] / "models" / "structures" / "frame.yaml"


@pytest.fixture(scope="session")
def hall(tmp_path_factory):
    """Folder with ``frame.csv`` and ``frame.yaml``."""
    folder, frame = tmp_path_factory.mktemp("hall"), read_model(FRAME)
    drive = force(Excitation(level=400.0, cutoff=12.5), 1600, 0.02, 1)
    record, rng = simulate(frame, {"shaker": drive}, 0.02, Integrator("rk4", 8)), np.random.default_rng(5)
    kept = {s: x for s, x in record.motions.items() if s.motion == "displacement"}
    noisy = {s: x + 0.05 * np.std(x) * rng.standard_normal(len(x)) for s, x in kept.items()}
    write_csv(record.with_motions(noisy), folder / "frame.csv")
    believed = frame.without_term("cubic_stiffness[floor2-floor3]")
    model = replace(believed, name="frame").with_values(dict.fromkeys(believed.values, None))
    (folder / "frame.yaml").write_text(f"# hall 3\n{format_model(model)}")
    return folder


@dataclass(frozen=True)
class Explored:
    """A ``study explore`` that runs."""

    process: int
    port: int
    errors: Path  # what it has said of faults

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/"


@contextmanager
def _exploring(folder: Path, record: str, model: str, *options: str) -> Iterator[Explored]:
    words = ["explore", record, "--model", model, "--port", "0", "--no-browser", *options]
    errors = folder / "errors.txt"
    with errors.open("w") as stream:
        server = subprocess.Popen(
            [sys.executable, "-m", "study", *words], cwd=folder, stdout=subprocess.PIPE, stderr=stream, text=True
        )
        assert server.stdout is not None
        line = server.stdout.readline()
        found = re.match(r"http://127\.0\.0\.1:(\d+)/ shows", line)
        assert found, line + errors.read_text()
        yield Explored(server.pid, int(found[1]), errors)
        server.terminate()
        server.wait(10)
        server.stdout.close()
    assert "Traceback" not in errors.read_text()


@pytest.fixture(scope="session")
def exploring() -> Callable[..., AbstractContextManager[Explored]]:
    """What starts ``study explore`` in a folder, and ends it: of a record, a model file and further options."""
    return _exploring


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    """An empty page of a browser."""
    where = browser()
    if where is None:
        pytest.fail(MISSING) if os.environ.get("CI") else pytest.skip(MISSING)
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=where, args=list(QUIET))
        opened = started.new_page(viewport={"width": 1280, "height": 900})
        yield opened
        started.close()
