"""One error and one noise floor of a model: compare, diagnose, add, history and the page tell the same numbers."""

import json

import pytest

from study import cli
from study.compare import history
from study.compare.comparison_report import comparison_document
from study.equations.model_file import read_model
from study.explore import session as sessions
from study.records.prepared import prepare_record
from study.records.readers import read_record
from study.support.numbers import percent
from study.trials import DRIVEN_MASS, LIKE_THE_REPORT, make_trial
from study.trials.sealed import write_trial

ALIKE = 1e-9  # relative: the same computation, whoever asks for it
pytestmark = pytest.mark.usefixtures("numbers_only")
TRIALS = [(31, "cubic_stiffness", 0.0, "displacement"), (32, "quadratic_damping", 0.01, "acceleration")]
TRIALS += [(33, "dead_band", 0.05, "velocity")]
OVERSAMPLED = 520001, "quadratic_damping", 0.05, "velocity"


@pytest.mark.long
@pytest.mark.parametrize(("seed", "hidden", "noise", "response"), [*TRIALS, OVERSAMPLED])
def test_one_error_and_one_floor(seed, hidden, noise, response, tmp_path, capsys):
    fine = seed == OVERSAMPLED[0]
    test = DRIVEN_MASS if fine else LIKE_THE_REPORT
    data, model, _ = write_trial(make_trial(seed, (hidden,), noise, response, test=test), tmp_path)

    def told(*words):
        assert cli.main([str(w) for w in words]) == 0
        return capsys.readouterr().out

    def read(folder, name):
        return json.loads((tmp_path / folder / name).read_text())

    told("compare", data, "--model", model, "--out", tmp_path / "compared")
    told("diagnose", data, "--model", model, "--out", tmp_path / "diagnosed")
    compared, diagnosed = read("compared", "comparison.json"), read("diagnosed", "diagnosis.json")
    assert_same(compared, diagnosed)
    assert (diagnosed["every_sample"] > 1) == (compared["fit"]["every_sample"] > 1) == fine
    first = diagnosed["candidates"][0]
    assert first["term"] == hidden

    page = sessions.begin(read_model(model), prepare_record(read_record(data)))
    assert_same(compared, comparison_document([page.now.comparison]))
    page = sessions.with_stage(page, sessions.examined(page)[0])
    grown = comparison_document([sessions.with_added(page, hidden).now.comparison])

    told("add", model, hidden, "--data", data, "--out", tmp_path / "added")
    added, steps = read("added", "comparison.json"), history.read_history(model)
    for after in (grown, steps[1]):
        assert_same(added, after)
    assert_same(compared, steps[0])
    assert first["response_error"] == pytest.approx(added["error"]["response"], rel=ALIKE)
    assert first["noise_floor"] == pytest.approx(added["noise_floor"]["response"], rel=ALIKE)
    assert added["noise_floor"]["response"] <= added["error"]["response"]
    shown = told("history", model)
    for step in (compared, added):
        assert percent(step["error"]["response"]) in shown
        assert percent(step["noise_floor"]["response"]) in shown


def assert_same(one, other):
    for key in ("error", "noise_floor"):
        assert other[key]["response"] == pytest.approx(one[key]["response"], rel=ALIKE)


@pytest.mark.long
def test_a_cut_off_is_heeded_by_all(tmp_path, capsys):
    data, model, _ = write_trial(make_trial(32, ("quadratic_damping",), 0.01, "acceleration"), tmp_path)
    errors = {}
    for cutoff in ((), ("--cutoff", "6")):
        for command, name in (("compare", "comparison.json"), ("diagnose", "diagnosis.json")):
            words = [command, str(data), "--model", str(model), "--out", str(tmp_path / "out"), *cutoff]
            assert cli.main(words) == 0
            errors[command, bool(cutoff)] = json.loads((tmp_path / "out" / name).read_text())["error"]["response"]
    capsys.readouterr()
    for given in (False, True):
        assert errors["diagnose", given] == pytest.approx(errors["compare", given], rel=ALIKE)
    assert errors["diagnose", True] != pytest.approx(errors["diagnose", False], rel=1e-3)
