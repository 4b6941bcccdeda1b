"""A plain installation has neither Matplotlib, pandas nor Bokeh: commands do without and say what they leave out."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from study.cli import main

OF_EXTRAS = ("matplotlib", "pandas", "pydantic", "bokeh", "jinja2", "h5py", "pyarrow", "pyuff", "pooch")
# The command, in a Python that finds none of them.
WITHOUT = f"""
import sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {OF_EXTRAS!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Hidden())
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a record of a hardening spring, and a model without it."""
    folder = tmp_path_factory.mktemp("light")
    duffing = Path(__file__).parents[2] / "models" / "duffing.yaml"
    assert main(["simulate", str(duffing), "--samples", "1024", "--out", str(folder / "rig.csv")]) == 0
    (folder / "rig.yaml").write_text("name: rig\nterms: [inertia, linear_damping, linear_stiffness]\n")
    return folder


def ran(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", WITHOUT + code], cwd=folder, capture_output=True, text=True, check=False
    )


def command(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return ran(f"from study.cli import main; sys.exit(main({list(words)!r}))", folder)


def test_a_diagnosis_names_what_is_missing_and_says_what_it_left_out(rig: Path) -> None:
    done = command(rig, "diagnose", "rig.csv", "--model", "rig.yaml", "--no-measurement", "--out", "found")
    assert done.returncode == 0, done.stderr
    assert json.loads((rig / "found" / "diagnosis.json").read_text())["verdict"] == "missing_effect"
    assert [path.name for path in (rig / "found").iterdir()] == ["diagnosis.json"]
    (said,) = (line for line in done.stdout.splitlines() if line.startswith("Left out: "))
    assert "matplotlib" in said
    assert "[pictures]" in said
    assert "[explore]" in said


def test_a_comparison_has_its_tables(rig: Path) -> None:
    done = command(rig, "compare", "rig.csv", "--model", "rig.yaml", "--no-measurement", "--out", "compared")
    assert done.returncode == 0, done.stderr
    assert {path.suffix for path in (rig / "compared").iterdir()} == {".json", ".csv"}
    assert "no pictures (drawing pictures needs matplotlib" in done.stdout


@pytest.mark.parametrize("words", [("report", "rig.csv"), ("campaign", ".")])
def test_what_is_nothing_without_pictures_is_refused_before_the_work(rig: Path, words: tuple[str, str]) -> None:
    done = command(rig, *words, "--model", "rig.yaml", "--out", "refused")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "pip install reverse-miso-study[pictures]" in done.stderr
    assert not (rig / "refused").exists()


@pytest.mark.parametrize(
    ("call", "extra"),
    [("record.to_frame()", "notebook"), ("record.plot()", "pictures"), ("st.library()", "notebook")],
)
def test_a_notebook_says_what_its_tables_and_plots_need(rig: Path, call: str, extra: str) -> None:
    read = "import study as st\nrecord = st.read('rig.csv')\n"
    done = ran(f"{read}try:\n    {call}\nexcept st.StudyError as error:\n    print(error)", rig)
    assert f"[{extra}]" in done.stdout


def test_a_module_that_an_extra_brings_is_no_fault_of_the_program(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def absent(_: object) -> None:
        raise ModuleNotFoundError("No module named 'pandas.core'", name="pandas.core")

    monkeypatch.setattr("study.cli._run", absent)
    monkeypatch.setitem(sys.modules, "pandas", None)
    assert main([]) == 2
    assert "[workflow]" in capsys.readouterr().err
