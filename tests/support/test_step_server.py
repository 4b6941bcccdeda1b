"""Steps in processes that are forked from one: each is alone, and says how it ended."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from study.support.errors import StudyError
from study.support.step_server import StepServer

SCRIPT = """
import os, sys
import json as preloaded
ALREADY = os.getpid()
if "snakemake" in globals():
    step = globals()["snakemake"]
    step.params["do"] == "die" and os.kill(os.getpid(), 9)
    step.params["do"] == "refuse" and sys.exit(2)
    step.params["do"] == "fail" and 1 / 0
    with open(step.output, "w") as file:
        file.write(f"{os.getppid()} {os.getpid()}")
"""


@pytest.fixture
def server(tmp_path, monkeypatch):
    (tmp_path / "step.py").write_text(SCRIPT)
    monkeypatch.chdir(tmp_path)
    return StepServer(["step.py"])


def asked(server, folder, name, do="write"):
    server.run("step.py", {"output": str(folder / name), "params": {"do": do}})
    return (folder / name).read_text().split()


def test_steps_asked_for_at_once_are_children_of_one_process(server, tmp_path):
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda number: asked(server, tmp_path, str(number)), range(8)))
    parents, own = zip(*found, strict=True)
    assert len(set(parents)) == 1
    assert len(set(own)) == 8


@pytest.mark.parametrize(("do", "code"), [("refuse", "2"), ("fail", "1"), ("die", "none")])
def test_a_step_that_fails_says_so_and_takes_no_other_with_it(server, tmp_path, do, code):
    with pytest.raises(StudyError, match=f"step.py ended with exit code {code}"):
        asked(server, tmp_path, "failed", do)
    assert not (tmp_path / "failed").exists()
    assert asked(server, tmp_path, "after")


def test_the_server_ends_with_the_process_that_started_it(tmp_path):
    (tmp_path / "step.py").write_text(SCRIPT)
    script = (
        "import os; from study.support.step_server import StepServer\n"
        "StepServer(['step.py']).run('step.py', {'output': 'ran', 'params': {'do': 'write'}})\n"
        "os.kill(os.getpid(), 9)"
    )
    # The server holds the standard output too: this returns when both have ended.
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, timeout=60, check=False)
    assert done.returncode == -9
    assert (tmp_path / "ran").exists()
