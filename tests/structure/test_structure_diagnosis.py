"""Which effect is missing from a structure, and where; at the command line."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from study.cli import main
from study.compare.comparison import compare
from study.diagnose.candidates import screened, try_all
from study.diagnose.verdict import diagnose, search_base
from study.equations.model_file import format_model, read_model
from study.equations.possible_effects import candidate_entries
from study.equations.simulate import Integrator, simulate
from study.equations.terms import external, get, one_sided
from study.records.prepared import prepare_record
from study.records.record import Sensor, write_csv


@pytest.fixture(scope="module")
def folder(tmp_path_factory, record_of, believed):
    place = tmp_path_factory.mktemp("frame")
    write_csv(record_of(), place / "frame.csv")
    (place / "frame.yaml").write_text(format_model(believed))
    return place


@pytest.fixture(scope="module")
def diagnosed(folder):
    code = main(
        ["diagnose", str(folder / "frame.csv"), "--model", str(folder / "frame.yaml"), "--out", str(folder / "out")]
    )
    assert code == 0
    return json.loads((folder / "out" / "diagnosis.json").read_text())


@pytest.mark.long
def test_effect_and_place_come_first(diagnosed):
    first = diagnosed["candidates"][0]
    assert diagnosed["verdict"] == "missing_effect"
    assert (first["term"], first["between"]) == ("cubic_stiffness", ["floor2", "floor3"])
    low, high = first["interval"]
    assert abs(first["coefficient"] - 1e6) < 0.84 * (high - low)  # 3.3 standard errors: the 99.9 % quantile
    assert high - low < 0.1 * first["coefficient"]
    assert first["response_error"] == pytest.approx(first["noise_floor"], rel=0.05)
    assert first["response_error"] < 0.8 * diagnosed["error"]["response"]
    assert "between floor2 and floor3" in diagnosed["says"]
    assert all({"term", "between"} == set(tie) for c in diagnosed["candidates"] for tie in c["tied_with"])
    after = [m["frequency"] for m in diagnosed["modes"]["after"]]
    np.testing.assert_allclose(after, [2.16976, 5.07901, 7.31513], rtol=5e-3)


def test_the_reverse_system_puts_the_effect_where_it_is(believed, record_of):
    comparison = compare(believed, prepare_record(record_of()))
    ordered = screened(candidate_entries(believed), search_base(comparison))
    assert ordered[0].entry.place.path == {"floor2", "floor3"}
    cubic = next(item for item in ordered if item.entry.name == "cubic_stiffness[floor2-floor3]")
    assert cubic.share > 0.95 * ordered[0].share
    assert cubic.points[0].coefficients[0] == pytest.approx(1e6, rel=0.2)
    elsewhere = max(item.share for item in ordered if item.entry.place.path != {"floor2", "floor3"})
    assert elsewhere < 0.8 * cubic.share


@pytest.mark.long
def test_a_term_is_added_between_two_coordinates(folder, capsys):
    model = folder / "frame.yaml"
    command = [
        "add",
        str(model),
        "cubic_stiffness",
        "--between",
        "floor2",
        "floor3",
        "--data",
        str(folder / "frame.csv"),
    ]
    assert main([*command, "--out", str(folder / "added")]) == 0
    assert read_model(model).terms[-1].name == "cubic_stiffness[floor2-floor3]"
    shown = capsys.readouterr().out
    assert "k3[floor2-floor3]" in shown
    assert re.search(r"\+ cubic_stiffness\[floor2-floor3\]", shown)
    assert json.loads((folder / "frame.history.json").read_text())["steps"][1]["error"]["response"] < 0.105
    assert main(command) == 2
    assert "in the model already" in capsys.readouterr().err
    assert main(["diagnose", str(folder / "frame.csv"), "--model", str(model), "--out", str(folder / "again")]) == 0
    assert json.loads((folder / "again" / "diagnosis.json").read_text())["verdict"] == "nothing_missing"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--between", "floor2", "floor9"], "no coordinate of the model"),
        (["--between", "floor2", "floor2"], "two different ends"),
        ([], "says not where it acts"),
    ],
)
def test_a_place_that_is_not_there_gets_its_sentence(folder, capsys, words, said):
    before = (folder / "frame.yaml").read_bytes()
    command = ["add", str(folder / "frame.yaml"), "quadratic_damping", *words, "--data", str(folder / "frame.csv")]
    assert main(command) == 2
    assert said in capsys.readouterr().err
    assert (folder / "frame.yaml").read_bytes() == before


def test_candidates_are_effects_times_places(believed):
    entries = candidate_entries(believed)
    names = [e.name for e in entries]
    assert len(names) == len(set(names))
    assert "cubic_stiffness[floor1-floor2]" in names
    assert "cubic_stiffness[ground-floor3]" in names
    assert "constant_force[floor2]" in names
    assert "linear_stiffness[ground-floor2]" in names
    assert "linear_stiffness[floor1-floor2]" not in names
    assert {"one_sided_contact[floor2-floor3]", "one_sided_contact[floor3-floor2]"} <= set(names)
    assert [external(get(n)) for n in ("constant_force", "harmonic_force", "hysteresis")] == [True, True, False]
    assert [one_sided(get(n)) for n in ("cubic_stiffness", "quadratic_stiffness", "bilinear_stiffness")] == [
        False, False, True,
    ]  # fmt: skip


TWO_MASSES = """
name: two masses
coordinates: [mass1, mass2]
forces: {shaker: mass2}
terms:
  - {term: inertia, at: mass1, value: 1.0}
  - {term: inertia, at: mass2, value: 1.0}
  - {term: linear_stiffness, between: [ground, mass1], value: 400.0}
  - {term: linear_damping, between: [ground, mass1], value: 1.0}
  - {term: linear_stiffness, between: [mass1, mass2], value: 400.0}
  - {term: linear_damping, between: [mass1, mass2], value: 1.0}
  - {term: cubic_stiffness, between: [ground, mass1], value: 1200.0}
"""


@pytest.mark.long
def test_an_effect_that_promises_little_is_tried_where_all_others_leave_much(tmp_path: Path) -> None:
    # The linear model loses the motion of a hard spring far from the only sensor, and what is left points elsewhere.
    (tmp_path / "true.yaml").write_text(TWO_MASSES)
    true = read_model(tmp_path / "true.yaml")
    rng = np.random.default_rng(3)
    frequencies = np.fft.rfftfreq(4096, 0.02)
    driven = (frequencies > 0.5) & (frequencies < 8.0)
    lines = np.zeros(len(frequencies), dtype=complex)
    lines[driven] = np.exp(2j * np.pi * rng.random(np.sum(driven)))
    drive = np.fft.irfft(lines)
    drive *= 20.0 / np.std(drive)
    record = simulate(true, {"shaker": drive}, 0.02, Integrator("rk4", 8), sensors=[Sensor("mass2", "displacement")])
    moved = record["mass2 displacement"]
    noisy = moved + 0.03 * np.std(moved) * rng.standard_normal(len(moved))
    record = record.with_channels({"mass2 displacement": noisy})
    lacking = true.without_term("cubic_stiffness[ground-mass1]")
    comparison = compare(lacking.with_values(dict.fromkeys(lacking.values, None)), prepare_record(record))
    tried = try_all(candidate_entries(comparison.fit.model), search_base(comparison))
    assert "cubic_stiffness[ground-mass1]" not in [c.name for c in tried]
    found = diagnose(comparison)
    assert found.verdict == "missing_effect"
    assert found.candidates[0].name == "cubic_stiffness[ground-mass1]"
    assert found.candidates[0].prediction.error < 0.035 < 0.5 < comparison.prediction.error
