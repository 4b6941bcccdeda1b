"""Steps in processes that are forked from one: each is alone, and says how it ended."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from study.support.errors import StudyError
from study.support.step_server import run_forked

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
def folder(tmp_path, monkeypatch):
    (tmp_path / "step.py").write_text(SCRIPT)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def asked(folder, name, do="write"):
    run_forked("step.py", {"output": str(folder / name), "params": {"do": do}}, 2)
    return (folder / name).read_text().split()


def test_steps_asked_for_at_once_are_children_of_one_process(folder):
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda number: asked(folder, str(number)), range(8)))
    parents, own = zip(*found, strict=True)
    assert len(set(parents)) == 1
    assert len(set(own)) == 8


@pytest.mark.parametrize(("do", "code"), [("refuse", "2"), ("fail", "1"), ("die", "-9")])
def test_a_step_that_fails_says_so_and_takes_no_other_with_it(folder, do, code):
    with pytest.raises(StudyError, match=f"step.py ended with exit code {code}"):
        asked(folder, "failed", do)
    assert not (folder / "failed").exists()
    assert asked(folder, "after")
