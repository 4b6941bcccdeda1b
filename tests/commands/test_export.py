"""``study export`` as a user types it, and the same in a notebook."""

import runpy
from pathlib import Path

import numpy as np
import pytest

import study as st
from study.cli import main
from study.support.errors import StudyError

RIG = """name: rig
terms:
  - {term: inertia, value: 1.0}
  - {term: linear_damping, value: 3.77}
  - {term: linear_stiffness, value: 355.3}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("rig.yaml").write_text(RIG)
    return tmp_path


@pytest.mark.parametrize(("way", "suffix"), [("python", "py"), ("fmu", "fmu"), ("modelica", "mo")])
def test_a_model_file_becomes_a_file_of_its_name(folder, capsys, way, suffix):
    assert main(["export", "rig.yaml", "--to", way]) == 0
    assert capsys.readouterr().out == f"rig.{suffix}: rig with m = 1, c = 3.77, k = 355.3\n"
    assert (folder / f"rig.{suffix}").stat().st_size > 500
    assert main(["export", "rig.yaml", "--to", way, "--out", f"other.{suffix}"]) == 0
    assert (folder / f"other.{suffix}").read_bytes() == (folder / f"rig.{suffix}").read_bytes()


@pytest.mark.usefixtures("folder")
def test_what_a_model_leaves_open_is_fitted_and_has_the_units_of_the_record() -> None:
    model = st.Model.load("rig.yaml")
    st.simulate(model, st.gaussian(samples=1024, seed=3)).save("rig.csv")
    Path("open.yaml").write_text("name: open\nterms: [inertia, linear_damping, linear_stiffness]\n")
    words = ["export", "open.yaml", "--to", "python", "--data", "rig.csv", "--no-measurement"]
    assert main(words) == 0
    found = runpy.run_path("open.py")
    assert found["VALUES"]["k"] == pytest.approx(355.3, rel=1e-3)
    assert found["slopes"](0.0, [0.01, 0.0], np.cos)[1] == pytest.approx(1.0 - 3.553, rel=1e-2)
    fit = model.free().fit(st.read("rig.csv"), measurement=False)
    fit.export("again.py")
    assert runpy.run_path("again.py")["VALUES"] == pytest.approx(found["VALUES"])
    fit.model.export("again.fmu", step=0.001)
    with pytest.raises(StudyError, match=r"again\.m: its suffix says no way to export; expected \.py, \.fmu, \.mo"):
        fit.export("again.m")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["open.yaml", "--to", "fmu"], "open.yaml: model 'open' gives no value for k; expected all, or the record"),
        (["stuck.yaml", "--to", "modelica"], "stuck.yaml: coulomb_friction of 'stuck' sticks and lets go, which"),
        (["rig.yaml", "--to", "python", "--step", "0.1"], "a step of 0.1 s is given to python; expected one of an FMU"),
        (["rig.yaml", "--to", "fmu", "--out", "rig.yaml"], "this would be written over the input rig.yaml"),
        (["rig.yaml", "--to", "fmu", "--out", "no/rig.fmu"], "no/rig.fmu: cannot be written"),
        (["rig.yaml", "--to", "matlab"], "invalid choice: 'matlab'"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_a_sentence(folder, capsys, words, said):
    Path("open.yaml").write_text(
        RIG.replace("rig", "open").replace("{term: linear_stiffness, value: 355.3}", "linear_stiffness")
    )
    Path("stuck.yaml").write_text(RIG.replace("rig", "stuck") + "  - {term: coulomb_friction, value: 0.2}\n")
    before = sorted(folder.iterdir())
    assert main(["export", *words]) == 2
    assert said in capsys.readouterr().err
    assert sorted(folder.iterdir()) == before
