"""The line of progress of a command."""

import re
from typing import Any

import pytest
import tqdm

from study.commands import command

BAR = tqdm.tqdm


def at_once(**options: Any) -> "tqdm.tqdm[Any]":
    """The line from the first step on, which a user sees after two seconds."""
    return BAR(**(options | {"delay": 0.0, "mininterval": 0.0}))


@pytest.mark.parametrize("steps", [2, 7])
def test_progress_never_counts_past_its_total(
    steps: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tqdm, "tqdm", at_once)
    with command.progress("step", 3) as step:
        for number in range(steps):
            step(f"fit {number}")
    shown = [(int(done), int(total)) for done, total in re.findall(r"(\d+)/(\d+) \[", capsys.readouterr().err)]
    assert shown[-1][0] == steps
    assert all(done < total for done, total in shown)


def test_progress_without_a_total_counts(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(tqdm, "tqdm", at_once)
    with command.progress(" candidates") as step:
        step("")
    assert "candidates" in capsys.readouterr().err


def test_a_second_round_of_a_diagnosis_has_a_total_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Sets are counted after candidates, and a corrected record is diagnosed anew: what is still to come is known."""
    monkeypatch.setattr(tqdm, "tqdm", at_once)
    with command.progress(" fits") as step:
        for of in (5, 3):
            for done in range(1, of + 1):
                step("", of - done)
    shown = [(int(done), int(total)) for done, total in re.findall(r"(\d+)/(\d+) \[", capsys.readouterr().err)]
    assert [total for done, total in shown if done in (1, 6)] == [5, 8]
    assert shown[-1] == (8, 8)
