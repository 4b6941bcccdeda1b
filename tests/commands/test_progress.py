"""The line of progress of a command."""

import re

import pytest

from study.commands import command


@pytest.mark.parametrize("steps", [2, 7])
def test_progress_never_counts_past_its_total(
    steps: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "QUIET", 0.0)
    monkeypatch.setenv("TQDM_MININTERVAL", "0")
    with command.progress("step", 3) as step:
        for number in range(steps):
            step(f"fit {number}")
    shown = [(int(done), int(total)) for done, total in re.findall(r"(\d+)/(\d+) \[", capsys.readouterr().err)]
    assert shown[-1][0] >= 1
    assert all(done < total for done, total in shown)


def test_progress_without_a_total_counts(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(command, "QUIET", 0.0)
    with command.progress(" candidates") as step:
        step("")
    assert "candidates" in capsys.readouterr().err
