"""Every option of reading and judging does to a structure what it says, or is refused in one sentence."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from study.cli import main
from study.equations.model_file import parse_model
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LIBRARY
from study.records.excitation import Excitation, force
from study.records.record import Sensor, record_of, write_csv

MODEL = """
name: pair
coordinates: [a, b]
forces: {shaker: a}
terms:
  - {term: inertia, at: a}
  - {term: inertia, at: b}
  - {term: linear_stiffness, between: [ground, a]}
  - {term: linear_stiffness, between: [a, b]}
  - {term: linear_damping, between: [ground, a]}
  - {term: linear_damping, between: [a, b]}
"""
SAMPLES, DT = 2400, 0.02


def motions(drive: np.ndarray, dt: float, stiffness: float = 900.0) -> np.ndarray:
    """Displacements of two masses on springs, shape (2, n)."""
    values = iter((1.0, 0.6, stiffness, 700.0, 1.2, 0.8))
    text = "\n".join(
        line.replace("}", f", value: {next(values)}}}") if "{term" in line else line for line in MODEL.splitlines()
    )
    wanted = [Sensor(c, "displacement") for c in "ab"]
    model = parse_model(text, Path("pair.yaml"))
    made = simulate(model, {"shaker": drive}, dt, Integrator("rk4"), sensors=wanted)
    return np.stack([made[s] for s in wanted])


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("pair")
    (place / "pair.yaml").write_text(MODEL)
    drive, rng = force(Excitation(level=100.0, cutoff=12.5), SAMPLES, DT, 1), np.random.default_rng(1)
    clean = motions(drive, DT)
    noisy = clean + 0.01 * np.std(clean, axis=1, keepdims=True) * rng.standard_normal(clean.shape)
    record = record_of(DT, {"shaker": drive}, {Sensor(c, "displacement"): x for c, x in zip("ab", noisy, strict=True)})
    write_csv(record, place / "b.csv")
    (place / "again").mkdir()
    write_csv(record.with_motions({s: 0.5 * x for s, x in record.motions.items()}), place / "again" / "b.csv")
    millimetres = record.with_motions({s: 1e3 * x for s, x in record.motions.items()})
    text = (place / "b.csv").read_text().split("\n", 1)[0]
    write_csv(millimetres, place / "mm.csv")
    rest = (place / "mm.csv").read_text().split("\n", 1)[1]
    (place / "mm.csv").write_text(text.replace("displacement", "displacement [mm]") + "\n" + rest)
    return place


def compared(folder: Path, *words: str, records=("b.csv",), out="out") -> Path:
    named = [str(folder / record) for record in records]
    assert main(["compare", *named, "--model", str(folder / "pair.yaml"), "--out", str(folder / out), *words]) == 0
    return folder / out


def document(path: Path) -> dict:
    return json.loads(path.read_text())


def test_two_records_of_one_name_are_told_apart(folder):
    out = compared(folder, records=("b.csv", "again/b.csv"), out="two")
    assert {path.name for path in out.glob("*explore.html")} == {"b_1_explore.html", "b_2_explore.html"}
    both = document(out / "comparison.json")
    assert [found["record"] for found in both["records"]] == ["b_1", "b_2"]
    stiffness = [found["coefficients"][2]["value"] for found in both["records"]]
    assert stiffness[1] == pytest.approx(2.0 * stiffness[0], rel=0.05)
    moving = {level["key"] for level in both["where"]["level"] if level["moves"]}
    assert "k[a-b]" in moving, "half the motion under the same force: all is twice as stiff"


def test_a_stiffness_may_differ_between_records_that_are_fitted_together(folder):
    (folder / "softer").mkdir(exist_ok=True)
    drive, rng = force(Excitation(level=100.0, cutoff=12.5), SAMPLES, DT, 2), np.random.default_rng(4)
    clean = motions(drive, DT, stiffness=850.0)
    noisy = clean + 0.01 * np.std(clean, axis=1, keepdims=True) * rng.standard_normal(clean.shape)
    softer = record_of(DT, {"shaker": drive}, {Sensor(c, "displacement"): x for c, x in zip("ab", noisy, strict=True)})
    write_csv(softer, folder / "softer" / "c.csv")
    out = compared(folder, "--each-record", "k[ground-a]", records=("b.csv", "softer/c.csv"), out="each")
    (row,) = document(out / "comparison.json")["coefficients_by_record"]
    assert row["key"] == "k[ground-a]"
    assert row["differs"]
    assert row["value"] == pytest.approx([900.0, 850.0], rel=5e-3)


@pytest.mark.long
def test_a_diagnosis_may_leave_a_stiffness_to_each_record(folder):
    """One record has a softer spring, and where that may be, no effect is missing."""
    test_a_stiffness_may_differ_between_records_that_are_fitted_together(folder)
    out = folder / "each"
    named = [str(folder / record) for record in ("b.csv", "softer/c.csv")]
    words = ["--model", str(folder / "pair.yaml"), "--out", str(folder / "each"), "--each-record", "k[ground-a]"]
    without = [word for name in LIBRARY if name != "cubic_stiffness" for word in ("--without", name)]
    assert main(["diagnose", *named, *words, *without]) == 0
    found = document(folder / "each" / "diagnosis.json")
    assert found["verdict"] == "nothing_missing"
    assert found["coefficients_by_record"] == document(out / "comparison.json")["coefficients_by_record"]


def test_a_record_in_millimetres_stays_in_millimetres(folder):
    metres, millimetres = (
        document(compared(folder, records=(name,), out=name[:-4]) / "comparison.json") for name in ("b.csv", "mm.csv")
    )
    for one, other in zip(metres["coefficients"], millimetres["coefficients"], strict=True):
        assert other["value"] == pytest.approx(1e-3 * one["value"], rel=1e-4)
    units = [[c["unit"] for c in found["coefficients"]] for found in (metres, millimetres)]
    assert units[0][:3] == ["kg", "kg", "N/m"]
    assert units[1][:3] == ["N s^2/mm", "N s^2/mm", "N/mm"]


@pytest.mark.parametrize(("words", "said"), [
    (("--absolute",), "--absolute is for a moving base"),
    (("--estimator", "local_polynomial"), "--estimator local_polynomial is for a single mass"),
    (("--each-record", "linear_stiffness"), "--each-record linear_stiffness: there is one record; expected two"),
    (("--response", "acceleration"), "no acceleration was measured at a; expected --response displacement"),
    (("--free",), "nothing drives 'pair': its motion says nothing of m[a], m[b]; expected a value for each"),
    (("--group", "low"), "a group 'low' is asked for and this file has none"),
    (("--column", "c.acceleration=2"), "names 'c.acceleration', which the model does not have"),
    (("--unit", "a.velocity=m/s"), "a unit is given for 'a.velocity'"),
    (("--fs", "10"), "its times step by 0.02 s"),
    (("--period", "7"), "the force 'shaker' 7 samples later differs"),
    (("--use", "0:9", "--fit", "0:100"), "--use and --fit or --judge A:B exclude each other"),
    (("--near", "2"), "--near chooses the mode of a single mass"),
    (("--cutoff", "40"), "the cut-off is 40 Hz; expected it above 0 and below 25 Hz"),
])  # fmt: skip
def test_what_a_structure_cannot_have_is_refused_in_one_sentence(folder, capsys, words, said):
    code = main(
        ["compare", str(folder / "b.csv"), "--model", str(folder / "pair.yaml"), "--out", str(folder / "x"), *words]
    )
    told = capsys.readouterr().err
    assert code == 2
    assert said in told
    assert told.strip().count("\n") == 0


def test_a_fault_that_is_held_beside_a_structure_is_that_of_its_channel(folder, capsys, tmp_path):
    shifted = pd.read_csv(folder / "b.csv")
    shifted["b displacement"] += 0.25
    shifted.to_csv(tmp_path / "b.csv", index=False)
    words = ["compare", str(tmp_path / "b.csv"), "--model", str(folder / "pair.yaml"), "--out", str(tmp_path / "out")]
    (tmp_path / "b.record.yaml").write_text("measurement: {offset: {b displacement: 0.25}, delay: off}\n")
    assert main(words) == 0
    held, *_ = document(tmp_path / "out" / "comparison.json")["measurement"]
    assert (held["fault"], held["channel"], held["value"], held["corrected"]) == (
        "offset",
        "b displacement",
        0.25,
        True,
    )
    (tmp_path / "b.record.yaml").write_text("measurement: {offset: 0.25}\n")
    assert main(words) == 2
    assert "there are several sensors; expected a value by channel" in capsys.readouterr().err
    (tmp_path / "b.csv").write_bytes((folder / "b.csv").read_bytes())
    assert main([*words, "--no-measurement"]) == 0
    assert document(tmp_path / "out" / "comparison.json")["measurement"] == []


def test_blocks_in_turn_and_parts_are_what_is_asked_for(folder, capsys):
    compared(folder, "--judge", "every-other-block", out="turns")
    assert "every other block is judged" in capsys.readouterr().out
    compared(folder, "--fit", "100:900", out="parts")
    assert "fitted to samples 100:900, judged on 900:2400" in capsys.readouterr().out


def test_an_oversampled_structure_is_thinned_unless_it_is_as_sampled(folder, tmp_path, capsys):
    drive = force(Excitation(level=100.0, cutoff=8.0), 8 * SAMPLES, DT / 8, 1)
    clean, rng = motions(drive, DT / 8), np.random.default_rng(2)
    noisy = clean + 0.01 * np.std(clean, axis=1, keepdims=True) * rng.standard_normal(clean.shape)
    record = record_of(
        DT / 8, {"shaker": drive}, {Sensor(c, "displacement"): x for c, x in zip("ab", noisy, strict=True)}
    )
    write_csv(record, tmp_path / "fine.csv")
    words = [
        "compare",
        str(tmp_path / "fine.csv"),
        "--model",
        str(folder / "pair.yaml"),
        "--out",
        str(tmp_path / "out"),
    ]
    assert main(words) == 0
    thinned = document(tmp_path / "out" / "comparison.json")
    assert "sample is used after a low-pass filter" in capsys.readouterr().out
    assert main([*words, "--as-sampled"]) == 0
    assert "sample is used after" not in capsys.readouterr().out
    whole = document(tmp_path / "out" / "comparison.json")
    for one, other in zip(thinned["coefficients"], whole["coefficients"], strict=True):
        half = 0.5 * (one["interval"][1] - one["interval"][0]) + 0.5 * (other["interval"][1] - other["interval"][0])
        assert abs(one["value"] - other["value"]) < half
