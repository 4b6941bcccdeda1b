import json

import pytest

from study import cli, trials
from study.compare import history
from study.records.record import write_csv


@pytest.fixture
def rig(tmp_path, monkeypatch):
    """A record with hidden drag and the model that its owner believes in, in a folder of their own."""
    monkeypatch.chdir(tmp_path)
    trial = trials.make_trial(911, hidden=["quadratic_damping"], noise=0.01, response="displacement")
    write_csv(trial.record.part(0, 4096), tmp_path / "rig.csv")
    lines = "".join(f"  - {t.name}  # mine\n" for t in trial.believed.terms)
    (tmp_path / "rig.yaml").write_text(f"name: rig\nterms:\n{lines}")
    return tmp_path


def test_diagnose_add_history(rig, capsys):
    assert cli.main(["diagnose", "rig.csv", "--model", "rig.yaml", "--out", "found"]) == 0
    found = json.loads((rig / "found" / "diagnosis.json").read_text())
    assert found["verdict"] == "missing_effect"
    assert found["candidates"][0]["term"] == "quadratic_damping"
    assert set(found["error"]) == {"force", "response"}
    assert set(found["where"]) >= {"frequency", "amplitude", "time"}
    assert "Quadratic damping is missing" in found["says"]
    assert (rig / "found" / "candidates.png").stat().st_size > 10_000

    assert cli.main(["add", "rig.yaml", "quadratic_damping", "--data", "rig.csv", "--out", "found"]) == 0
    text = (rig / "rig.yaml").read_text()
    assert text.endswith("  - quadratic_damping\n")
    assert text.count("# mine") == len(trials.make_trial(911, hidden=["quadratic_damping"]).believed.terms)
    before, after = history.read(rig / "rig.yaml")
    assert after["added"] == "quadratic_damping"
    assert after["error"]["response"] < before["error"]["response"]
    assert after["error"]["response"] == pytest.approx(after["noise_floor"]["response"], rel=0.15)

    capsys.readouterr()
    assert cli.main(["history", "rig.yaml", "--out", "found"]) == 0
    assert "+ quadratic_damping" in capsys.readouterr().out
    assert (rig / "found" / "history.png").stat().st_size > 5_000


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["add", "rig.yaml", "no_such_thing", "--data", "rig.csv"], "there is no term 'no_such_thing'"),
        (["add", "rig.yaml", "linear_damping", "--data", "rig.csv"], "in the model already"),
        (["add", "rig.yaml", "mine", "--force", "__import__('os')", "--data", "rig.csv"], "the expression"),
        (["add", "rig.yaml", "mine", "--force", "2*v", "--data", "rig.csv"], "no other than that of linear_damping"),
        (["diagnose", "rig.csv", "--model", "rig.yaml", "--candidate", "x"], "NAME=FORMULA"),
        (["diagnose", "rig.csv", "--model", "rig.yaml", "--without", "friction"], "there is no term 'friction'"),
        (["diagnose", "none.csv", "--model", "rig.yaml"], "none.csv"),
        (["history", "none.yaml"], "none.yaml"),
    ],
)
def test_bad_input_is_one_sentence_and_changes_nothing(rig, capsys, words, said):
    before = (rig / "rig.yaml").read_bytes()
    assert cli.main(words) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert (rig / "rig.yaml").read_bytes() == before
    assert not history.path_of(rig / "rig.yaml").exists()


def test_a_broken_history_is_refused_before_the_model_is_touched(rig, capsys):
    history.path_of(rig / "rig.yaml").write_text("{not json")
    before = (rig / "rig.yaml").read_bytes()
    assert cli.main(["add", "rig.yaml", "quadratic_damping", "--data", "rig.csv"]) == 2
    assert "is not JSON" in capsys.readouterr().err
    assert (rig / "rig.yaml").read_bytes() == before


@pytest.mark.usefixtures("rig")
def test_history_without_steps_says_so(capsys):
    assert cli.main(["history", "rig.yaml"]) == 0
    assert "nothing was added yet" in capsys.readouterr().out
