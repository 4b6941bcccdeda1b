"""The notebooks of docs/ run, and end with what they say."""

import json
from pathlib import Path

import pytest

from scripts.notebooks import run
from tests.public_records import DATA, needs

ROOT = Path(__file__).parents[2]
NOTEBOOKS = ROOT / "docs" / "notebooks"


def test_duffing():
    _, ends = run(NOTEBOOKS / "duffing.ipynb")
    assert ends["siso"].parameters["k"] > 480.0  # too stiff, as the report says
    assert ends["miso"].parameters["k"] == pytest.approx(355.3, rel=1e-3)
    assert ends["miso"].parameters["k3"] == pytest.approx(2e7, rel=1e-2)


@pytest.mark.long
def test_your_own_rig():
    _, ends = run(NOTEBOOKS / "your_own_rig.ipynb")
    assert ends["found"].best.name == "quadratic_damping"
    low, high = ends["found"].best.interval
    assert low < 25.0 < high
    assert ends["wrong"].moving
    assert ends["right"].moving == ()


@pytest.mark.long
@needs("silverbox")
def test_silverbox(monkeypatch):
    monkeypatch.setenv("STUDY_DATA", str(DATA))
    _, ends = run(NOTEBOOKS / "silverbox.ipynb")
    assert [fit.given.terms[-1] for fit in ends["fits"]] == ["constant_force", "cubic_stiffness", "quadratic_stiffness"]
    assert ends["fits"][-1].error < 0.01


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_is_kept_with_what_it_shows(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    assert any("image/png" in output.get("data", {}) for cell in cells for output in cell.get("outputs", []))
    assert not any(output["output_type"] == "error" for cell in cells for output in cell.get("outputs", []))
