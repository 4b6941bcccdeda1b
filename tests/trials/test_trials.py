"""Trials: every effect can be hidden, at its share, from one seed, with the answer apart."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from study.cli import main
from study.compare.prediction import predict
from study.equations.model_file import parse_model, read_model
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LIBRARY
from study.identify.time_domain.fit_model import fit_model
from study.records.prepared import prepare_record
from study.records.readers import read_record
from study.reproduction.settings import TrialSettings
from study.support.errors import StudyError
from study.trials import HIDDEN, SHARE, make_trial, reach, runs, sealed, share_of
from study.trials.runs import COLUMNS, Order, Row

SETTINGS = TrialSettings(first_seed=100, noises=(0.0, 0.05), rounds=1, none=2, pairs=4, removed=1, jobs=3)


@pytest.mark.parametrize("name", HIDDEN)
def test_every_effect_can_be_hidden_at_its_share(name: str) -> None:
    trial = make_trial(811, (name,), noise=0.0, response="displacement")
    assert trial.hidden == (name,)
    assert name in trial.truth
    assert name not in trial.believed
    again = simulate(trial.truth, trial.record["force"], trial.record.dt, Integrator("rk4", 8))
    assert share_of(trial.truth, name, again) == pytest.approx(trial.shares[0], rel=1e-12)
    assert SHARE[0] <= trial.shares[0] <= SHARE[1]
    assert [t.term.physical(t.values) for t in trial.truth.terms if t.term.physical(t.values)] == []


@pytest.mark.parametrize("seed", range(820, 824))
def test_shares_of_two_effects_are_those_of_the_final_motion(seed: int) -> None:
    trial = make_trial(seed, ("cubic_stiffness", "quadratic_damping"), noise=0.0, response="displacement")
    assert all(SHARE[0] <= share <= SHARE[1] for share in trial.shares)


def test_share_is_what_no_linear_model_can_take_over() -> None:
    trial = make_trial(4, ("cubic_stiffness",), noise=0.0, response="displacement")
    record = simulate(trial.truth, trial.record["force"], trial.record.dt, Integrator("rk4", 8))
    u, v, a = (record[c] for c in ("displacement", "velocity", "acceleration"))
    force = (trial.truth.values["k3"] or 0.0) * u**3
    motion = np.column_stack([u, v, a]) / [np.std(u), np.std(v), np.std(a)]
    left = force - motion @ np.linalg.lstsq(motion, force, rcond=None)[0]
    restoring = record["force"] - (trial.truth.values["m"] or 0.0) * a
    assert np.sqrt(np.mean(left**2)) / np.std(restoring) == pytest.approx(trial.shares[0], rel=1e-6)


def test_library_beside_the_linear_terms_is_covered() -> None:
    assert set(HIDDEN) == set(LIBRARY) - {"inertia", "linear_damping", "linear_stiffness"}


def test_same_seed_same_bytes_and_other_seed_other_record() -> None:
    hidden = ("quadratic_damping",)
    one, other = make_trial(12, hidden), make_trial(12, hidden)
    for channel in one.record.channels:
        assert one.record[channel].tobytes() == other.record[channel].tobytes()
    assert one.truth == other.truth
    assert make_trial(13, hidden).record["force"].tobytes() != one.record["force"].tobytes()


@pytest.mark.parametrize("noise", [0.01, 0.10])
def test_noise_is_a_share_of_the_mean_square(noise: float) -> None:
    clean = make_trial(5, ("quadratic_damping",), 0.0, "acceleration").record["acceleration"]
    noisy = make_trial(5, ("quadratic_damping",), noise, "acceleration").record["acceleration"]
    assert np.mean((noisy - clean) ** 2) / np.mean(clean**2) == pytest.approx(noise, rel=0.06)


def test_believed_model_knows_no_value_and_nothing_of_the_effect() -> None:
    trial = make_trial(21, ("hysteresis", "constant_force"), 0.0, "displacement")
    assert set(trial.believed.values.values()) == {None}
    assert not {"hysteresis", "constant_force"} & {t.name for t in trial.believed.terms}


def test_nothing_hidden_means_the_believed_model_is_the_true_one() -> None:
    trial = make_trial(22, ())
    assert [t.name for t in trial.believed.terms] == [t.name for t in trial.truth.terms]


@pytest.mark.parametrize(
    ("hidden", "response", "said"),
    [
        (("inertia",), None, "inertia"),
        (("cubic_stifness",), None, "did you mean"),
        (("relaxation", "relaxation"), None, "named once"),
        ((), "force", "response is 'force'"),
    ],
)
def test_what_cannot_be_hidden_is_refused(hidden: tuple[str, ...], response: str | None, said: str) -> None:
    with pytest.raises(StudyError, match=said):
        make_trial(1, hidden, response=response)


@pytest.mark.parametrize("seed", [31, 32, 33, 34, 35])
def test_steady_force_is_hidden_behind_acceleration_only_where_it_shows(seed: int) -> None:
    trial = make_trial(seed, ("constant_force",), 0.0, "acceleration")
    without = replace(trial.truth, terms=tuple(t for t in trial.truth.terms if t.name != "constant_force"))
    still = simulate(without, trial.record["force"], trial.record.dt, Integrator("rk4", 8))["acceleration"]
    measured = trial.record["acceleration"]
    assert np.std(measured - still) > 0.01 * np.std(measured)


def test_steady_force_beside_effects_that_know_no_place_is_hidden_only_behind_another_that_does() -> None:
    trial = make_trial(36, ("constant_force", "harmonic_force"), 0.0, "acceleration")
    assert {t.name for t in trial.believed.terms} & {"cubic_stiffness", "van_der_pol_damping"}


def test_command_writes_record_model_and_sealed_answer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["trial", "--seed", "7", "--hidden", "quadratic_damping", "--noise", "0.05", "--response", "acceleration"]
    assert main([*words, "--out", str(tmp_path / "new")]) == 0
    said = capsys.readouterr().out
    answer = tmp_path / "new" / "trial_7.answer.json"
    assert f"study trial --open {answer}" in said
    record, model = read_record(tmp_path / "new" / "trial_7.csv"), read_model(tmp_path / "new" / "trial_7.yaml")
    trial = make_trial(7, ("quadratic_damping",), 0.05, "acceleration")
    np.testing.assert_array_equal(record["acceleration"], trial.record["acceleration"])
    assert model == trial.believed
    for path in (tmp_path / "new").iterdir():
        assert b"quadratic_damping" not in path.read_bytes()
    assert b"quadratic_damping" not in said.encode()
    assert main(["trial", "--open", str(answer)]) == 0
    assert "quadratic_damping" in capsys.readouterr().out
    assert parse_model(sealed.unseal(answer)["truth"], answer) == trial.truth


def test_command_hides_nothing_when_told_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["trial", "--seed", "3", "--hidden", "none", "--noise", "0", "--out", str(tmp_path)]) == 0
    assert sealed.unseal(tmp_path / "trial_3.answer.json")["hidden"] == []
    capsys.readouterr()
    assert main(["trial", "--open", str(tmp_path / "trial_3.answer.json")]) == 0
    assert capsys.readouterr().out.startswith("nothing is hidden")


@pytest.mark.parametrize("text", ["", "[1]", "{}", '{"answer": 5}', '{"answer": "?"}', '{"answer": "WzFd"}'])
def test_what_is_no_answer_is_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str
) -> None:
    path = tmp_path / "x.json"
    path.write_text(text)
    assert main(["trial", "--open", str(path)]) == 2
    said = capsys.readouterr().err
    assert "answer" in said
    assert said.count("\n") == 1


def test_answer_file_is_plain_json_with_how_to_open_it(tmp_path: Path) -> None:
    _, _, answer = sealed.write(make_trial(2, ()), tmp_path)
    assert json.loads(answer.read_text())["open_with"] == "study trial --open trial_2.answer.json"


def test_orders_cover_every_effect_noise_and_response_with_seeds_of_their_own() -> None:
    orders = runs.orders(SETTINGS)
    assert len({o.seed for o in orders}) == len(orders) == 17 * 4 + 2 * 4 + 4 + 17
    singles = {(o.hidden[0], o.noise, o.response) for o in orders if o.kind == "single"}
    assert len(singles) == 17 * 4
    parts = [runs.chunk(orders, i, 3) for i in range(3)]
    assert sorted((o for part in parts for o in part), key=lambda o: o.seed) == orders


def row(**given: object) -> Row:
    blank: Row = dict.fromkeys(COLUMNS, "")
    zero = {"noise": 0.0, "error_before": 0.4, "error_after": 0.1, "error_after_two": 0.1, "error_true": 0.1}
    return blank | zero | given


FOUND = {"kind": "single", "hidden": "relaxation", "verdict": "missing_effect", "first": "relaxation"}


@pytest.mark.parametrize(
    ("given", "score"),
    [
        ({"named": "relaxation"}, 1.0),
        ({"named": "hysteresis", "tied_with": "cubic_damping+relaxation"}, 0.5),
        ({"named": "hysteresis", "tied_with": "cubic_damping"}, 0.0),
        ({"verdict": "unknown_effect"}, 0.0),
    ],
)
def test_first_counts_one_a_tie_half(given: Row, score: float) -> None:
    assert reach.first_score(row(**(FOUND | given))) == score


def test_pair_needs_both_and_removed_a_tie_or_unknown() -> None:
    pair = {"kind": "pair", "hidden": "relaxation+hysteresis", "named": "hysteresis"}
    assert reach.pair_score(row(**pair, second_named="relaxation")) == 1.0
    assert reach.pair_score(row(**pair, second_named="cubic_damping")) == 0.0
    removed = {"kind": "removed", "hidden": "relaxation", "named": "hysteresis"}
    assert reach.removed_score(row(**removed, verdict="missing_effect")) == 0.0
    assert reach.removed_score(row(**removed, verdict="missing_effect", tied_with="dead_band")) == 1.0
    assert reach.removed_score(row(**removed, verdict="missing_effect", tie_with_hidden="True")) == 1.0
    assert reach.removed_score(row(**removed, verdict="nothing_missing")) == 0.0
    assert reach.removed_score(row(**removed, verdict="unknown_effect")) == 1.0


def test_summary_confusion_and_ladder_of_a_table(tmp_path: Path) -> None:
    table = [
        row(**FOUND, named="relaxation"),
        row(**FOUND | {"verdict": "unknown_effect"}, error_after=0.4),
        row(**FOUND, named="relaxation", noise=0.1),
        row(kind="single", hidden="relaxation", trouble="it would not run"),
        row(kind="none", verdict="nothing_missing"),
        row(kind="pair", hidden="relaxation+hysteresis", named="hysteresis", second_named="relaxation"),
    ]
    pd.DataFrame(table, columns=list(COLUMNS)).to_csv(tmp_path / "trials.csv", index=False)
    read = pd.read_csv(tmp_path / "trials.csv")
    rates = reach.summary(read, {"first": 0.95, "nothing": 0.95, "both": 0.85, "removed": 0.8})
    assert rates["trials"].tolist() == [3, 1, 3, 1, 1, 0, 4, 1]
    assert rates["rate"].tolist()[:2] == pytest.approx([1.0 / 3.0, 1.0])
    assert rates["standard_error"][0] == pytest.approx(np.sqrt(2.0 / 27.0))
    assert rates["met"].tolist()[3] == "yes"
    counts = reach.confusion(read).set_index("hidden")
    assert counts.loc["relaxation", "relaxation"] == 2
    assert counts.loc["relaxation", "unknown_effect"] == 1
    assert counts.loc["none", "nothing_missing"] == 1
    assert counts.to_numpy().sum() == 4
    rungs = reach.ladder(read).set_index(["kind", "noise", "step"])
    assert rungs.loc[("single", 0.0, "after"), "mean_error"] == pytest.approx(0.25)


def test_a_trial_that_cannot_be_made_is_a_row_with_its_trouble(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("study.trials.draw.ATTEMPTS", 0)
    made = runs.run(Order("single", 1, ("relaxation",), 0.0, "displacement"))
    assert "no system" in made["trouble"]


def test_a_model_that_runs_away_predicts_nothing() -> None:
    trial = make_trial(911, ["quadratic_damping"], 0.01, "displacement")
    prepared = prepare_record(trial.record)
    fit = fit_model(trial.believed, prepared)
    wild = replace(fit, model=fit.model.with_values({"k": -fit.model.numbers()["k"]}))
    assert predict(fit, prepared).error < 1.0
    assert predict(wild, prepared).diverged
    assert predict(wild, prepared).error == pytest.approx(1.0, abs=1e-12)
