"""Each kind of test from the command line to its verdict, and what a user may do wrong with it."""

import json
from pathlib import Path

import numpy as np
import pytest

from study import cli
from study.equations.simulate import Integrator, simulate
from study.records.excitation import Excitation, force
from study.records.record import Record, write_csv
from study.trials import make_trial

LINEAR = "name: rig\nterms: [inertia, linear_damping, linear_stiffness]\n"
DT = 0.02
NUMBERS = pytest.mark.usefixtures("numbers_only")  # where another test has pages and pictures of the same kind drawn


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rig.yaml").write_text(LINEAR)


def verdict(*words: str) -> dict:
    assert cli.main(["diagnose", *words, "--out", "out"]) == 0
    return json.loads(Path("out/diagnosis.json").read_text())


def compared(*words: str) -> dict:
    assert cli.main(["compare", *words, "--out", "out"]) == 0
    return json.loads(Path("out/comparison.json").read_text())


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert cli.main([*words, "--out", "out"]) == 2
    said = capsys.readouterr().err.strip()
    assert len(said.splitlines()) == 1
    return said


def decay(model, heights=(0.01,), samples=3000, noise=0.0, name="decay.csv") -> None:
    """Decays from several heights, one behind the other in one file, with or without a column of no force."""
    parts = [simulate(model, np.zeros(samples), DT, Integrator("rk4", 8), initial=(h, 0.0)) for h in heights]
    u = np.concatenate([p["displacement"] for p in parts])
    u = u + noise * np.std(u) * np.random.default_rng(5).standard_normal(len(u))
    write_csv(Record(DT, {"force": 0.0 * u, "displacement": u}), Path(name))


def lightly(model):
    return model.with_values({"c": 0.6})


@pytest.mark.long
def test_a_free_decay_fixes_all_but_one_common_factor(systems):
    decay(lightly(systems["linear"]), noise=0.01)
    found = compared("decay.csv", "--model", "rig.yaml")
    values = {c["key"]: c for c in found["coefficients"]}
    assert values["m"]["held"]
    assert values["m"]["value"] == 1.0
    assert values["k"]["value"] == pytest.approx(355.3, rel=1e-3)
    assert values["k"]["unit"] == "1/s^2"
    assert any("per unit mass" in note for note in found["notes"])


@NUMBERS
def test_a_coefficient_that_is_given_fixes_the_common_factor(systems):
    decay(lightly(systems["linear"]))
    Path("given.yaml").write_text(
        "name: rig\nterms: [inertia, linear_damping, {term: linear_stiffness, value: 710.6}]\n"
    )
    values = {c["key"]: c for c in compared("decay.csv", "--model", "given.yaml")["coefficients"]}
    assert values["m"]["value"] == pytest.approx(2.0, rel=1e-4)
    assert values["m"]["unit"] == "kg"


@pytest.mark.long
def test_an_effect_hidden_in_decays_from_several_heights_is_found(systems):
    decay(lightly(systems["duffing"]), (0.008, 0.004), 1200, 0.01)
    found = verdict("decay.csv", "--model", "rig.yaml", "--use", "0:23.9", "--use", "24:47.9")
    assert found["verdict"] == "missing_effect"
    assert found["candidates"][0]["term"] == "cubic_stiffness"
    assert Path("out/candidates.png").is_file()


@NUMBERS
def test_a_record_without_a_force_column_is_a_free_decay_where_nothing_else_could_be_one(systems, capsys):
    decay(lightly(systems["linear"]))
    table = np.loadtxt("decay.csv", delimiter=",", skiprows=1)
    np.savetxt("bare.csv", table[:, [0, 2]], delimiter=",", header="time,displacement", comments="")
    np.savetxt("other.csv", table[:, [0, 2, 2]], delimiter=",", header="time,displacement,V1", comments="")
    assert compared("bare.csv", "--model", "rig.yaml")["error"]["response"] < 1e-3
    assert "--free" in refused(capsys, "compare", "other.csv", "--model", "rig.yaml")
    assert compared("other.csv", "--free", "--model", "rig.yaml")["error"]["response"] < 1e-3


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--use", "0:10", "--use", "5:20"), "overlap"),
        (("--use", "0:1e9"), "leaves the record"),
        (("--use", "ten"), "no range of times"),
        (("--use", "0:20", "--fit", "0:500"), "exclude each other"),
        (("--use", "3:2"), "ends before it begins"),
    ],
)  # fmt: skip
def test_stretches_that_cannot_be_used_are_refused_in_one_sentence(options, words, systems, capsys):
    decay(lightly(systems["linear"]))
    assert words in refused(capsys, "compare", "decay.csv", "--model", "rig.yaml", *options)


def drawn(test: str, seed: int, hidden: tuple[str, ...], noise: float = 0.01) -> None:
    write_csv(make_trial(seed, hidden, noise, test=test).record, Path("record.csv"))


@pytest.mark.long
@pytest.mark.parametrize("hidden", ["hysteresis", "quadratic_damping"])
def test_a_component_test_predicts_the_force(hidden, request):
    if hidden != "hysteresis":
        request.getfixturevalue("numbers_only")
    Path("part.yaml").write_text("name: part\nterms: [linear_damping, linear_stiffness]\n")
    drawn("component", 4, (hidden,))
    found = verdict("record.csv", "--model", "part.yaml")
    first = found["candidates"][0]
    assert found["verdict"] == "missing_effect"
    assert hidden in (first["term"], *first["tied_with"])


@NUMBERS
@pytest.mark.parametrize("seed", [4, 600100])
def test_a_line_in_the_noise_of_a_component_is_not_called_a_force(seed):
    """Both called a harmonic force, that noise alone had put where it was found, missing before."""
    Path("part.yaml").write_text("name: part\nterms: [linear_damping, linear_stiffness]\n")
    drawn("component", seed, ())
    found = verdict("record.csv", "--model", "part.yaml")
    assert found["candidates"][0]["term"] == "harmonic_force"
    assert found["verdict"] == "nothing_missing"


@pytest.mark.long
def test_a_component_has_loops_and_takes_terms_with_a_memory():
    drawn("component", 4, ("hysteresis",))
    Path("part.yaml").write_text("name: part\nterms: [linear_damping, linear_stiffness, hysteresis]\n")
    found = compared("record.csv", "--model", "part.yaml")
    assert found["error"]["response"] < 0.12  # the square root of 1 % of noise
    assert Path("out/loops.png").is_file()
    assert found["fit"]["response"] == "force"


@pytest.mark.parametrize("given", ["relative", "absolute", "position"])
def test_a_moving_base_takes_the_place_of_the_force(given, systems, request):
    if given != "relative":
        request.getfixturevalue("numbers_only")
    drive = force(Excitation(), 3000, DT, seed=2)
    motion = simulate(systems["linear"], drive, DT, Integrator("rk4", 8))
    base = Record(DT, {"force": 0.0 * drive, "displacement": motion["displacement"], "base_acceleration": -drive})
    if given == "absolute":
        base = Record(
            DT, {"force": 0.0 * drive, "acceleration": motion["acceleration"] - drive, "base_acceleration": -drive}
        )
    write_csv(base, Path("shaken.csv"))
    options = ("--absolute",) if given == "absolute" else ()
    values = {c["key"]: c for c in compared("shaken.csv", "--model", "rig.yaml", *options)["coefficients"]}
    assert values["m"]["value"] == 1.0
    assert values["k"]["value"] == pytest.approx(355.3, rel=2e-3)
    assert values["c"]["value"] == pytest.approx(3.77, rel=2e-2)


def test_a_base_acts_through_the_mass_alone(systems, capsys):
    drive = force(Excitation(), 1500, DT, seed=2)
    motion = simulate(systems["linear"], drive, DT, Integrator("rk4", 8))
    write_csv(
        Record(DT, {"force": 0.0 * drive, "displacement": motion["displacement"], "base_acceleration": -drive}),
        Path("shaken.csv"),
    )
    Path("stiff.yaml").write_text(LINEAR.replace("linear_stiffness]", "{term: linear_stiffness, value: 300.0}]"))
    assert "no mass" in refused(capsys, "compare", "shaken.csv", "--model", "stiff.yaml")
    assert "base_displacement" in refused(capsys, "compare", "shaken.csv", "--absolute", "--model", "rig.yaml")


@pytest.mark.long
def test_several_records_have_one_verdict(systems):
    for seed, level in ((1, 0.5), (2, 1.0)):
        drive = level * force(Excitation(), 1500, DT, seed=seed)
        motion = simulate(systems["duffing"], drive, DT, Integrator("rk4", 8))
        write_csv(Record(DT, {"force": drive, "displacement": motion["displacement"]}), Path(f"level_{seed}.csv"))
    found = verdict("level_1.csv", "level_2.csv", "--model", "rig.yaml")
    assert found["candidates"][0]["term"] == "cubic_stiffness"


@NUMBERS
def test_every_other_block_of_a_sweep_is_judged(systems):
    time = DT * np.arange(4000)
    drive = np.sin(2.0 * np.pi * (1.0 * time + 0.5 * 5.0 / time[-1] * time**2))
    motion = simulate(systems["linear"], drive, DT, Integrator("rk4", 8))
    write_csv(Record(DT, {"force": drive, "displacement": motion["displacement"]}), Path("sweep.csv"))
    found = compared("sweep.csv", "--judge", "every-other-block", "--model", "rig.yaml")
    assert found["error"]["response"] < 1e-4
    assert any("every other block is judged" in note for note in found["notes"])


def test_a_horizon_is_for_a_mass_without_a_spring(systems, capsys):
    decay(lightly(systems["linear"]))
    said = refused(capsys, "compare", "decay.csv", "--model", "rig.yaml", "--horizon", "1")
    assert "--horizon is for a mass that nothing in the model brings back" in said


@pytest.mark.long
def test_an_axis_is_judged_over_a_horizon_and_never_called_chaotic():
    drawn("axis", 3, ("coulomb_friction",))
    Path("axis.yaml").write_text("name: axis\nterms: [inertia, linear_damping]\n")
    found = verdict("record.csv", "--model", "axis.yaml")
    assert found["candidates"][0]["term"] == "coulomb_friction"
    notes = compared("record.csv", "--model", "axis.yaml")["notes"]
    assert any("each from its own state" in note for note in notes)
    shorter = compared("record.csv", "--model", "axis.yaml", "--horizon", "0.5")["notes"]
    said = next(note for note in shorter if "each from its own state" in note)
    assert float(said.split("pieces of ")[1].split()[0]) == pytest.approx(0.5, rel=0.02)
    assert not any("chaotic" in note for note in notes)
