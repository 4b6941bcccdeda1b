import json

import pytest

from study import cli, trials
from study.commands import climb
from study.compare import history
from study.diagnose import confirmed_faults, verdict
from study.equations.model_file import read_model
from study.equations.terms import LIBRARY
from study.explore import PAGE
from study.records.record import write_csv

# A climb diagnoses at each step; the few that could take part in what is tested are enough to choose from.
TRIED = ("quadratic_damping", "cubic_damping", "quadratic_stiffness", "cubic_stiffness", "coulomb_friction")


@pytest.fixture
def few(monkeypatch):
    original, others = confirmed_faults.diagnose_as_read, [name for name in LIBRARY if name not in TRIED]
    monkeypatch.setattr(
        confirmed_faults, "diagnose_as_read", lambda c, **options: original(c, **{"without": others, **options})
    )


@pytest.fixture
def rig(tmp_path, monkeypatch):
    """A record with hidden drag and the model that its owner believes in, in a folder of their own."""
    monkeypatch.chdir(tmp_path)
    trial = trials.make_trial(911, hidden=["quadratic_damping"], noise=0.01, response="displacement")
    write_csv(trial.record.part(0, 4096), tmp_path / "rig.csv")
    lines = "".join(f"  - {t.name}  # mine\n" for t in trial.believed.terms)
    (tmp_path / "rig.yaml").write_text(f"name: rig\nterms:\n{lines}")
    return tmp_path


def test_a_term_that_raises_the_error_is_added_only_where_that_is_asked_for(rig, capsys):
    """Little is fitted, so that what is superfluous takes up noise there."""
    model, words = rig / "rig.yaml", ["--data", "rig.csv", "--fit", "0:300", "--judge", "600:4000", "--out", "found"]
    before = model.read_bytes()
    assert cli.main(["add", "rig.yaml", "quintic_stiffness", *words]) == 0
    said = capsys.readouterr().out
    assert "Quintic stiffness raises the held-out error, from" in said
    assert "rig.yaml is left as it was" in said
    assert model.read_bytes() == before
    assert not (rig / "found").exists()
    assert not history.read_history(model)
    assert cli.main(["add", "rig.yaml", "quintic_stiffness", "--anyway", *words]) == 0
    assert model.read_text().endswith("  - quintic_stiffness\n")


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
    before, after = history.read_history(rig / "rig.yaml")
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
        (["drop", "rig.yaml", "hysteresis", "--data", "rig.csv"], "rig.yaml: 'hysteresis' is not in the model"),
        (["drop", "rig.yaml", "no_such\nthing", "--data", "rig.csv"], "is not in the model; expected linear_damping"),
        (["drop", "rig.yaml", "inertia", "--data", "rig.csv"], "rig.yaml: inertia cannot be dropped"),
        (["drop", "rig.yaml", "linear_damping", "--data", "none.csv"], "none.csv"),
        (["drop", "none.yaml", "linear_damping", "--data", "rig.csv"], "none.yaml"),
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


def test_the_only_term_left_is_not_dropped(rig, capsys):
    (rig / "rig.yaml").write_text("terms: [inertia, linear_stiffness]\n")
    assert cli.main(["drop", "rig.yaml", "linear_stiffness", "--data", "rig.csv"]) == 2
    assert "linear_stiffness is the only term beside inertia; expected" in capsys.readouterr().err
    assert (rig / "rig.yaml").read_text() == "terms: [inertia, linear_stiffness]\n"


@pytest.mark.long
def test_what_is_not_needed_is_said_and_dropped(rig, capsys):
    """What an earlier guess added, and what the record shows once the hidden drag is in the model."""
    text = (rig / "rig.yaml").read_text() + "  # tried in March\n"
    (rig / "rig.yaml").write_text(text)
    add = ["add", "rig.yaml", "quadratic_damping", "--data", "rig.csv", "--out", "found"]
    drop = ["drop", "rig.yaml", "quadratic_stiffness", "--data", "rig.csv", "--out", "found"]
    assert cli.main(["add", "rig.yaml", "quadratic_stiffness", "--data", "rig.csv", "--out", "found"]) == 0
    capsys.readouterr()
    assert cli.main(add) == 0
    said = "Quadratic stiffness is not needed any more: without it the error is "
    assert said in capsys.readouterr().out

    assert cli.main(["diagnose", "rig.csv", "--model", "rig.yaml", "--out", "found"]) == 0
    assert "Quadratic stiffness is not needed: without it" in capsys.readouterr().out
    (unneeded,) = json.loads((rig / "found" / "diagnosis.json").read_text())["not_needed"]
    assert unneeded["term"] == "quadratic_stiffness"

    assert cli.main(drop) == 0
    out = capsys.readouterr().out
    assert "- quadratic_stiffness" in out
    assert "not needed" not in out
    assert (rig / "rig.yaml").read_text() == text.replace("  # tried", "  - quadratic_damping\n  # tried")
    steps = history.read_history(rig / "rig.yaml")
    assert [history.label(s) for s in steps[1:]] == [
        "+ quadratic_stiffness",
        "+ quadratic_damping",
        "- quadratic_stiffness",
    ]
    assert steps[-1]["error"]["response"] == pytest.approx(unneeded["error_without"], rel=1e-3)
    assert "quadratic_stiffness" not in steps[-1]["terms"]
    assert cli.main(drop) == 2
    assert len(history.read_history(rig / "rig.yaml")) == len(steps)


def test_a_layout_that_cannot_be_changed_is_refused_before_anything_is_written(rig, capsys, monkeypatch):
    monkeypatch.setattr("study.support.yaml_text.without_entry", lambda text, *_: f"{text}!")
    before = (rig / "rig.yaml").read_bytes()
    assert cli.main(["drop", "rig.yaml", "linear_damping", "--data", "rig.csv"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert (rig / "rig.yaml").read_bytes() == before
    assert not history.path_of(rig / "rig.yaml").exists()


@pytest.mark.long
@pytest.mark.usefixtures("few")
def test_a_climb_goes_forwards_and_backwards(rig, capsys):
    """It begins with an effect that does some of the work of the missing one, and ends without it."""
    (rig / "rig.yaml").write_text((rig / "rig.yaml").read_text() + "  - cubic_damping  # a guess\n")
    steps = climb.climb([rig / "rig.csv"], rig / "rig.yaml", [], 3, rig / "out")
    assert [history.label(s) for s in steps] == ["as given", "+ quadratic_damping", "- cubic_damping"]
    assert steps[-1]["error"]["response"] == pytest.approx(steps[-2]["error"]["response"], rel=0.01)
    assert "Cubic damping is not needed any more" in capsys.readouterr().out
    reached = read_model(rig / "out" / "climb" / "rig.yaml")
    assert "cubic_damping" not in reached
    assert "quadratic_damping" in reached
    assert "# a guess" in (rig / "rig.yaml").read_text()
    assert "- cubic damping" in (rig / "out" / climb.SAVED).read_text()
    assert not (rig / "out" / "climb" / PAGE).exists()


@pytest.mark.long
@pytest.mark.usefixtures("few")
def test_a_climb_does_not_go_in_a_circle(rig, capsys, monkeypatch):
    """A diagnosis that asks for what was just taken out, again and again, ends the climb."""
    (rig / "rig.yaml").write_text((rig / "rig.yaml").read_text() + "  - quadratic_stiffness\n")
    original = confirmed_faults.diagnose_as_read

    def stubborn(comparison, **options):
        found = original(comparison, **options)
        rows = sorted(found.candidates, key=lambda row: row.name != "quadratic_stiffness")
        first = rows[0].name == "quadratic_stiffness" or "quadratic_damping" not in comparison.model
        shown = tuple(rows) if rows[0].name == "quadratic_stiffness" else found.candidates
        return verdict.Diagnosis(**{**vars(found), "verdict": verdict.MISSING if first else found.verdict,
                                    "candidates": shown, "sets": shown[:1]})  # fmt: skip

    monkeypatch.setattr(confirmed_faults, "diagnose_as_read", stubborn)
    steps = climb.climb([rig / "rig.csv"], rig / "rig.yaml", [], 6, rig / "out")
    assert [history.label(s) for s in steps] == ["as given", "+ quadratic_damping", "- quadratic_stiffness"]
    assert "the climb ends" in capsys.readouterr().out


def test_a_term_comes_back_where_it_brings_the_best_model_so_far():
    """What was not needed once may be needed when the model around it is another."""

    class Row:
        name = "relaxation"
        names = ("relaxation",)
        response_error = 0.1

    class Error:
        def __init__(self, error, dropped=None):
            self.comparison, self.dropped = self, dropped
            self.prediction, self.error = self, error

    class Past:
        stages = (Error(0.3), Error(0.2, "relaxation"))

    assert not climb._in_a_circle(Past(), Row())  # type: ignore[arg-type]
    Row.response_error = 0.2
    assert climb._in_a_circle(Past(), Row())  # type: ignore[arg-type]
    Row.names = ("hysteresis",)
    assert not climb._in_a_circle(Past(), Row())  # type: ignore[arg-type]


@pytest.mark.usefixtures("rig")
def test_history_without_steps_says_so(capsys):
    assert cli.main(["history", "rig.yaml"]) == 0
    assert "no history yet" in capsys.readouterr().out
