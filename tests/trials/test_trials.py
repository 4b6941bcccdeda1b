"""Trials: every effect can be hidden, at its share, from one seed, with the answer apart."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.cli import main
from study.compare.prediction import predict
from study.equations.model_file import parse_model, read_model
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LIBRARY
from study.identify.time_domain.fit_model import fit_model
from study.records.prepared import prepare_record
from study.records.readers import read_record
from study.support.errors import StudyError
from study.trials import DRIVEN_MASS, HIDDEN, SHARE, make_trial, sealed, share_of
from study.trials.driven import EXCITATIONS, LABORATORIES, PLAIN_RATE, wide
from study.trials.effects import LATER


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
    assert {*HIDDEN, *LATER} == set(LIBRARY) - {"inertia", "linear_damping", "linear_stiffness"}


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


def test_a_completed_model_has_the_true_terms_and_knows_nothing() -> None:
    trial = make_trial(21, ("hysteresis", "quadratic_damping"), 0.0, "displacement")
    assert [t.name for t in trial.completed.terms] == [t.name for t in trial.truth.terms]
    assert set(trial.completed.values.values()) == {None}


def test_a_trial_with_a_fault_is_the_same_trial_before_it() -> None:
    clean = make_trial(22, (), 0.01, "velocity")
    faulty = make_trial(22, (), 0.01, "velocity", "delay")
    assert clean.fault == {}
    assert (faulty.fault["fault"], faulty.fault["channel"], faulty.fault["unit"]) == ("delay", "velocity", "samples")
    assert clean.truth == faulty.truth
    assert clean.record["force"].tobytes() == faulty.record["force"].tobytes()
    apart = np.std(clean.record["velocity"] - faulty.record["velocity"])
    rate = np.std(np.diff(clean.record["velocity"]))
    assert apart == pytest.approx(abs(faulty.fault["value"]) * rate, rel=0.2)


@pytest.mark.long
def test_any_fault_means_one_in_half_of_the_trials() -> None:
    named = [make_trial(seed, (), 0.0, "displacement", "any", DRIVEN_MASS).fault.get("fault") for seed in range(40)]
    without = named.count(None)
    assert 10 <= without <= 30
    assert len(set(named)) > 5


def test_the_wide_range_reaches_its_ends_and_every_record_is_long_enough() -> None:
    rng = np.random.default_rng(1)
    drawn = [wide(rng, LABORATORIES) for _ in range(2000)]
    rates, dampings = (np.array([getattr(e, name) for e in drawn]) for name in ("samples_a_period", "damping"))
    samples = np.array([e.samples for e in drawn])
    for values, bounds in (
        (rates, LABORATORIES.rates),
        (dampings, LABORATORIES.dampings),
        (samples, LABORATORIES.samples),
    ):
        assert bounds[0] * (1.0 - 1e-9) <= np.min(values) < 1.05 * bounds[0]
        assert 0.95 * bounds[1] < np.max(values) <= bounds[1] * (1.0 + 1e-9)
    assert np.all(samples >= LABORATORIES.periods * rates * (1.0 - 1e-9))
    assert np.all(samples >= LABORATORIES.memories * rates / (2.0 * np.pi * dampings) * (1.0 - 1e-9))
    assert {e.kind for e in drawn} == set(EXCITATIONS)
    # evenly on a logarithmic scale, as far as long records are not refused
    assert np.mean(rates < np.sqrt(np.prod(LABORATORIES.rates))) == pytest.approx(0.5, abs=0.04)
    assert np.mean(dampings < np.sqrt(np.prod(LABORATORIES.dampings))) == pytest.approx(0.5, abs=0.04)
    assert all(e.excitation.highest * e.dt <= 0.4 + 1e-9 for e in drawn)
    assert all(e.excitation.periods > 1 for e in drawn if "sweep" in e.kind)


@pytest.mark.parametrize("seed", range(4))
def test_a_wide_trial_is_the_motion_of_its_truth_and_forgets_its_start(seed: int) -> None:
    """Against an integration with other steps, from another state."""
    trial = make_trial(4000 + seed, (), 0.0, "displacement", test=DRIVEN_MASS)
    initial = (float(np.std(trial.record["displacement"])), 0.0)
    steps = Integrator("rk4", 16 * int(np.ceil(max(1.0, PLAIN_RATE / trial.about["samples_a_period"]))))
    again = simulate(trial.truth, trial.record["force"], trial.record.dt, steps, initial=initial)["displacement"]
    half = len(again) // 2
    measured = trial.record["displacement"]
    assert np.std(again[half:] - measured[half:]) < 0.02 * np.std(measured[half:])
    assert np.std(again[-len(again) // 8 :] - measured[-len(again) // 8 :]) < 2e-3 * np.std(measured)


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


@pytest.mark.long
def test_command_writes_record_model_and_sealed_answer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["trial", "--seed", "7", "--hidden", "quadratic_damping", "--noise", "0.05", "--response", "acceleration"]
    assert main([*words, "--out", str(tmp_path / "new")]) == 0
    said = capsys.readouterr().out
    answer = tmp_path / "new" / "trial_7.answer.json"
    assert f"study trial --open {answer}" in said
    record, model = read_record(tmp_path / "new" / "trial_7.csv"), read_model(tmp_path / "new" / "trial_7.yaml")
    trial = make_trial(7, ("quadratic_damping",), 0.05, "acceleration", test=DRIVEN_MASS)
    np.testing.assert_array_equal(record["acceleration"], trial.record["acceleration"])
    assert model == trial.believed
    for path in (tmp_path / "new").iterdir():
        assert b"quadratic_damping" not in path.read_bytes()
    assert b"quadratic_damping" not in said.encode()
    assert main(["trial", "--open", str(answer)]) == 0
    assert "quadratic_damping" in capsys.readouterr().out
    assert parse_model(sealed.unseal(answer).truth, answer) == trial.truth


@pytest.mark.parametrize(("fault", "said"), [("delay", "delay of the velocity"), ("force_noise", "force noise of the")])
def test_answer_names_the_fault(tmp_path: Path, capsys: pytest.CaptureFixture[str], fault: str, said: str) -> None:
    words = ["--seed", "3", "--hidden", "none", "--response", "velocity", "--fault", fault, "--out", str(tmp_path)]
    assert main(["trial", *words]) == 0
    assert fault not in capsys.readouterr().out
    imposed = sealed.unseal(tmp_path / "trial_3.answer.json").fault
    assert isinstance(imposed, sealed.Imposed)
    assert imposed.fault == fault
    assert main(["trial", "--open", str(tmp_path / "trial_3.answer.json")]) == 0
    assert f"fault of the measurement: {said}" in capsys.readouterr().out


def test_a_fault_that_there_is_not_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["trial", "--seed", "3", "--hidden", "none", "--fault", "rust", "--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert "'rust'" in said
    assert "delay" in said
    assert list(tmp_path.iterdir()) == []


def test_command_hides_nothing_when_told_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["trial", "--seed", "3", "--hidden", "none", "--noise", "0", "--out", str(tmp_path)]) == 0
    assert sealed.unseal(tmp_path / "trial_3.answer.json").hidden == []
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
    _, _, answer = sealed.write_trial(make_trial(2, ()), tmp_path)
    assert json.loads(answer.read_text())["open_with"] == "study trial --open trial_2.answer.json"


def test_a_model_that_runs_away_predicts_nothing() -> None:
    trial = make_trial(911, ["quadratic_damping"], 0.01, "displacement")
    prepared = prepare_record(trial.record)
    fit = fit_model(trial.believed, prepared)
    wild = replace(fit, model=fit.model.with_values({"k": -fit.model.numbers()["k"]}))
    assert predict(fit, prepared).error < 1.0
    assert predict(wild, prepared).diverged
    assert predict(wild, prepared).error == pytest.approx(1.0, abs=1e-12)
