"""Coefficients that differ between records that are fitted together, and the groups of a file as records."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from study import cli
from study.equations.simulate import Integrator, simulate
from study.records.excitation import Excitation, force

DT, DAMPING = 0.02, {"low": 2.0, "mid": 3.0, "high": 5.0}
GROUPS = ("--group", "low", "--group", "mid", "--group", "high")


@pytest.fixture(autouse=True)
def _file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, systems) -> None:
    """Three groups of one structure whose damping alone differs, in millimetres."""
    monkeypatch.chdir(tmp_path)
    Path("linear.yaml").write_text("name: rig\nterms: [inertia, linear_damping, linear_stiffness]\n")
    Path("full.yaml").write_text("name: rig\nterms: [inertia, linear_damping, linear_stiffness, cubic_stiffness]\n")
    with h5py.File("rig.h5", "w") as file:
        for number, (name, damping) in enumerate(DAMPING.items()):
            drive = (0.5 + 0.5 * number) * force(Excitation(), 1000, DT, seed=number)
            model = systems["duffing"].with_values({"c": damping})
            u = 1e3 * simulate(model, drive, DT, Integrator("rk4", 8))["displacement"]
            noise = 0.01 * np.std(u) * np.random.default_rng(number).standard_normal(len(u))
            group = file.create_group(name)
            group["time"], group["force"], group["displacement"] = DT * np.arange(len(u)), drive, u + noise
            group["displacement"].attrs["units"] = "mm"


def by_key(command: str, *words: str) -> dict[str, dict]:
    assert cli.main([command, "rig.h5", *GROUPS, *words, "--out", "out"]) == 0
    name = "comparison" if command == "compare" else "diagnosis"
    return {row["key"]: row for row in json.loads(Path(f"out/{name}.json").read_text())["coefficients_by_record"]}


@pytest.mark.long
def test_a_separate_coefficient_is_that_of_each_record_and_a_shared_one_is_not_said_to_differ():
    rows = by_key("compare", "--each-record", "linear_damping", "--each-record", "k", "--model", "full.yaml")
    damping, stiffness = rows["c"], rows["k"]
    assert damping["records"] == ["rig_low", "rig_mid", "rig_high"]
    misses = (np.array(damping["value"]) - 1e-3 * np.array(list(DAMPING.values()))) / damping["standard_error"]
    assert np.max(np.abs(misses)) < 3.0
    assert (damping["differs"], stiffness["differs"]) == (True, False)


@pytest.mark.long
def test_errors_by_record_are_those_of_fits_to_each_alone():
    together = by_key("compare", "--each-record", "c", "--model", "full.yaml")["c"]["standard_error"]
    for name, error in zip(DAMPING, together, strict=True):
        words = ("rig.h5", "--group", name, "--judge", "every-other-block", "--model", "full.yaml", "--out", name)
        assert cli.main(["compare", *words]) == 0
        alone = json.loads(Path(name, "comparison.json").read_text())["coefficients"]
        assert error == pytest.approx(next(c["standard_error"] for c in alone if c["key"] == "c"), rel=0.6)


@pytest.mark.long
def test_an_effect_that_all_records_share_is_found_beside_a_coefficient_that_differs():
    rows = by_key("diagnose", "--each-record", "c", "--model", "linear.yaml")
    found = json.loads(Path("out/diagnosis.json").read_text())
    assert rows["c"]["differs"]
    assert found["candidates"][0]["term"] == "cubic_stiffness"
    assert found["candidates"][0]["explained"] > 0.95


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((*GROUPS, "--each-record", "m"), "a mass"),
        ((*GROUPS, "--each-record", "drag"), "expected one of inertia (m)"),
        ((*GROUPS, "--each-record", "c", "--each"), "exclude each other"),
        (("--group", "low", "--each-record", "c"), "there is one record"),
        (("--group", "low", "--group", "low"), "twice"),
        (("--group", "low", "--unit", "displacement=m"), "is in mm by the file"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused_in_one_sentence(words, said, capsys):
    assert cli.main(["diagnose", "rig.h5", *words, "--model", "linear.yaml", "--out", "out"]) == 2
    sentence = capsys.readouterr().err.strip().splitlines()
    assert len(sentence) == 1
    assert said in sentence[0]
    assert not Path("out").exists()


def test_a_unit_that_says_the_same_as_the_file_is_taken():
    words = ("rig.h5", "--group", "low", "--unit", "displacement=mm", "--model", "full.yaml", "--out", "out")
    assert cli.main(["compare", *words]) == 0
