"""What the command line and the file beside a record say of faults, what is printed, and what is refused."""

import json

import numpy as np
import pytest

from study import cli
from study.faults.fault import NOTHING_ASKED, settings_beside
from study.faults.imposed import impose
from study.records.record import write_csv
from study.trials.draw import make_trial

TERMS = ("inertia", "linear_damping", "linear_stiffness")


@pytest.fixture(scope="module")
def late():
    """A record with hidden drag whose response is read late, and by how much."""
    trial = make_trial(911, hidden=["quadratic_damping"], noise=0.01, response="displacement")
    return *impose(trial.record.part(0, 4096), "displacement", "delay", np.random.default_rng(1)), trial.believed


@pytest.fixture
def rig(tmp_path, monkeypatch, late):
    monkeypatch.chdir(tmp_path)
    record, known, model = late
    write_csv(record, tmp_path / "rig.csv")
    (tmp_path / "rig.yaml").write_text("name: rig\nterms:\n" + "".join(f"  - {t.name}\n" for t in model.terms))
    return tmp_path, known


def written(folder, name):
    return json.loads((folder / "out" / f"{name}.json").read_text())


def test_the_diagnosis_says_the_fault_and_judges_the_physics_without_it(rig, capsys):
    folder, known = rig
    assert cli.main(["diagnose", "rig.csv", "--model", "rig.yaml", "--out", "out"]) == 0
    found = written(folder, "diagnosis")
    (fault,) = found["measurement"]
    assert (fault["fault"], fault["channel"], fault["unit"], fault["corrected"]) == (
        "delay", "displacement", "samples", True,
    )  # fmt: skip
    assert fault["value"] == pytest.approx(known["value"], abs=0.1)
    assert fault["interval"][0] < fault["value"] < fault["interval"][1]
    assert fault["explained"] > 0.5
    assert fault["says"] in capsys.readouterr().out
    assert (found["verdict"], found["candidates"][0]["term"]) == ("missing_effect", "quadratic_damping")


@pytest.mark.parametrize("options", [["--no-measurement"], []])
def test_it_can_be_switched_off(rig, options):
    folder, _ = rig
    if not options:
        (folder / "rig.record.yaml").write_text("measurement: off\n")
    assert cli.main(["compare", "rig.csv", "--model", "rig.yaml", "--out", "out", *options]) == 0
    document = written(folder, "comparison")
    assert document["measurement"] == []
    assert document["error"]["response"] > 0.3  # what the delay leaves


@pytest.mark.long
def test_a_value_can_be_held(rig, capsys):
    folder, known = rig
    (folder / "rig.record.yaml").write_text(f"measurement: {{delay: {known['value']!r}, drift: off}}\n")
    assert cli.main(["compare", "rig.csv", "--model", "rig.yaml", "--out", "out"]) == 0
    assert [f["value"] for f in written(folder, "comparison")["measurement"]] == [known["value"]]
    assert "as given; corrected" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("measurement: 3", "measurement is 3; expected 'off', or a mapping"),
        ("measurement: {rust: off}", "measurement names 'rust'; expected one of offset, drift"),
        ("measurement: {delay: late}", "delay in measurement is 'late'; expected a number, or 'off'"),
        ("measurement: {delay: .nan}", "delay in measurement is"),
        ("measurement: {hum: 0.5}", "hum is held at 0.5; expected 'off', or a number for one of offset, delay"),
        ("measurement: {high_pass: -1.0}", "high_pass is -1"),
        ("measurement: {gain_change: -1.0}", "gain_change is -1"),
        ("measurement: {}", "measurement is"),
    ],
)
def test_what_no_instrument_has_is_refused_in_a_sentence(rig, capsys, text, said):
    folder, _ = rig
    (folder / "rig.record.yaml").write_text(text + "\n")
    assert cli.main(["diagnose", "rig.csv", "--model", "rig.yaml", "--out", "out"]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert "rig.record.yaml" in error
    assert error.count("\n") == 1
    assert not (folder / "out" / "diagnosis.json").exists()


def test_settings_without_a_word_on_them_are_those_of_everyone(rig):
    folder, _ = rig
    assert settings_beside(folder / "rig.csv").switched_off == ()
    (folder / "rig.record.yaml").write_text("fs: 50\n")
    assert settings_beside(folder / "rig.csv").switched_off == ()
    (folder / "rig.record.yaml").write_text("measurement: false\n")
    assert settings_beside(folder / "rig.csv") == NOTHING_ASKED
