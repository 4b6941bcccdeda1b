"""What is missing between sensors where the linear part is a sum of modes: effect and place, on the beam."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import study as st
from study.cli import main
from study.compare.comparison import compare
from study.compare.each_record import levels_by_record, separated
from study.diagnose.diagnosis_files import diagnosis_in_words
from study.diagnose.verdict import diagnose
from study.equations.linear_part import connections
from study.equations.model_file import parse_model, read_model
from study.equations.possible_effects import candidate_entries
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LIBRARY
from study.identify.time_domain.fit_model import fit_model
from study.records.excitation import Excitation, force
from study.records.prepared import prepare_record
from study.records.record import Sensor, write_csv
from study.way_in.compare_records import compare_records

ROOT = Path(__file__).parents[2]
DT, SAMPLES = 0.005, 4000
BARE = "name: bare\ncoordinates: [p4, p10]\nforces: {shaker: p4}\nlinear: modal\nterms: []\n"
OTHERS = tuple(name for name in LIBRARY if name != "cubic_stiffness")  # left out: all effects would take a minute


@pytest.fixture(scope="module")
def record():
    """Two displacements of the beam at 1 % noise."""
    model = read_model(ROOT / "models" / "structures" / "beam.yaml")
    drive = force(Excitation(level=1.0, reading="filtered", cutoff=30.0), SAMPLES, DT, 3)
    exact, rng = simulate(model, {"shaker": drive}, DT, Integrator("rk4", 4)), np.random.default_rng(4)
    shown = {s: x for s, x in exact.motions.items() if s in {Sensor(p, "displacement") for p in ("p4", "p10")}}
    noisy = {s: x + 0.1 * np.std(x) * rng.standard_normal(len(x)) for s, x in shown.items()}
    return replace(exact.with_motions(noisy), name="beam")


@pytest.fixture(scope="module")
def folder(tmp_path_factory, record):
    place = tmp_path_factory.mktemp("beam")
    write_csv(record, place / "beam.csv")
    (place / "bare.yaml").write_text(BARE)
    return place


@pytest.mark.long
def test_effect_and_place_are_named_and_add_finds_the_coefficient(folder, capsys):
    data, model, out = str(folder / "beam.csv"), str(folder / "bare.yaml"), str(folder / "out")
    without = [word for name in OTHERS for word in ("--without", name)]
    assert main(["diagnose", data, "--model", model, "--out", out, *without]) == 0
    found = json.loads((folder / "out" / "diagnosis.json").read_text())
    first = found["candidates"][0]
    assert found["verdict"] == "missing_effect"
    assert (first["term"], first["between"]) == ("cubic_stiffness", ["ground", "p10"])
    assert not first["tied_with"]
    assert first["coefficient"] == pytest.approx(1e5, rel=0.03)
    assert first["response_error"] == pytest.approx(first["noise_floor"], rel=0.05)
    assert first["response_error"] < 0.3 * found["error"]["response"]
    assert "Cubic stiffness is missing between the ground and p10" in capsys.readouterr().out
    command = ["add", model, "cubic_stiffness", "--between", "ground", "p10", "--data", data, "--out", out]
    assert main(command) == 0
    assert "k3[ground-p10]" in capsys.readouterr().out
    assert read_model(folder / "bare.yaml").terms[-1].name == "cubic_stiffness[ground-p10]"
    steps = json.loads((folder / "bare.history.json").read_text())["steps"]
    assert steps[1]["error"]["response"] == pytest.approx(first["response_error"], rel=0.01)


def test_nothing_is_missing_from_the_right_model(record):
    model = parse_model(BARE.replace("[]", "\n  - {term: cubic_stiffness, between: [ground, p10]}"), Path("right.yaml"))
    asked = tuple(name for name in LIBRARY if name != "quadratic_stiffness")
    diagnosis = diagnose(compare(model, prepare_record(record)), without=asked)
    assert diagnosis.verdict == "nothing_missing"
    assert "Nothing is missing" in diagnosis_in_words(diagnosis)


@pytest.mark.long
def test_one_set_of_modes_is_fitted_to_records_of_several_levels(record):
    """Both records tell of the same modes and the same spring: together better than the louder one alone."""
    text = BARE.replace("[]", "\n  - {term: cubic_stiffness, between: [ground, p10]}")
    model, beam = parse_model(text, Path("right.yaml")), read_model(ROOT / "models" / "structures" / "beam.yaml")
    drive = force(Excitation(level=0.5, reading="filtered", cutoff=30.0), SAMPLES, DT, 7)
    exact, rng = simulate(beam, {"shaker": drive}, DT, Integrator("rk4", 4)), np.random.default_rng(8)
    noisy = {s: exact[s] + 0.1 * np.std(exact[s]) * rng.standard_normal(SAMPLES) for s in record.sensors}
    quiet = replace(exact.with_motions(noisy), name="quiet")
    alone, both = (compare_records(records, model).comparison for records in ([record], [record, quiet]))
    found = {c.key: c for c in both.coefficients}["k3[ground-p10]"]
    assert found.interval[0] < 1e5 < found.interval[1]
    assert both.fit.model.modal.count == alone.fit.model.modal.count
    assert both.prediction.error == pytest.approx(both.prediction.floor, rel=0.05)
    errors = [{c.key: c.error for c in one.coefficients}["k3[ground-p10]"] for one in (both, alone)]
    assert errors[0] < errors[1]
    model, marked, separate = separated(model, [record, quiet], ["cubic_stiffness"])
    apart = compare_records(marked, model).comparison
    (level,) = levels_by_record(apart, separate, [record, quiet])
    assert not level.moves
    assert level.value == pytest.approx([1e5, 1e5], rel=0.05)


def test_candidates_are_nonlinear_effects_between_sensors():
    model = parse_model(BARE, Path("bare.yaml"))
    assert [p.label for p in connections(model)] == ["ground-p4", "ground-p10", "p4-p10"]
    names = {e.term.name for e in candidate_entries(model)}
    assert {"cubic_stiffness", "hysteresis", "dead_band", "coulomb_friction"} <= names
    assert not names & {
        "linear_stiffness",
        "linear_damping",
        "inertia",
        "relaxation",
        "constant_force",
        "harmonic_force",
    }


@pytest.mark.long
def test_an_open_shape_parameter_is_searched_for():
    """The report's Dead-Band system as a structure of one mode."""
    text = (ROOT / "models" / "dead_band.yaml").read_text().replace("value", "at: x, value")
    place = "coordinates: [x]\nforces: {shaker: x}\n"
    whole = parse_model(text.replace("terms:", f"{place}terms:"), Path("whole.yaml"))
    drive = force(Excitation(level=1.0, cutoff=12.5), 2048, 0.02, 1990)
    record = simulate(whole, {"shaker": drive}, 0.02, Integrator("rk4", 16))
    shown = record.with_motions({s: x for s, x in record.motions.items() if s.motion == "displacement"})
    model = parse_model(f"{place}linear: modal\nterms: [{{term: dead_band, at: x}}]", Path("dead.yaml"))
    comparison = compare(model, prepare_record(shown))
    true, found = whole.numbers(), comparison.fit.model.numbers()
    assert "dead_band[x].u_g" in comparison.fit.keys
    assert found["dead_band[x].u_g"] == pytest.approx(true["dead_band[x].u_g"], rel=0.02)
    assert comparison.prediction.error < 0.02


def test_a_shape_parameter_that_the_model_gives_is_held():
    place = "coordinates: [x]\nforces: {shaker: x}\n"
    text = (ROOT / "models" / "duffing.yaml").read_text().replace("value", "at: x, value")
    drive = force(Excitation(level=1.0, cutoff=12.5), 1024, 0.02, 1990)
    whole = parse_model(text.replace("terms:", f"{place}terms:"), Path("whole.yaml"))
    record = simulate(whole, {"shaker": drive}, 0.02, Integrator("rk4", 8))
    model = parse_model(f"{place}linear: modal\nterms: [{{term: hysteresis, at: x, beta: 200.0}}]", Path("one.yaml"))
    fitted = fit_model(model, prepare_record(record))
    assert fitted.model.numbers()["hysteresis[x].beta"] == 200.0
    assert "hysteresis[x].beta" in fitted.held
    assert "hysteresis[x].gamma" in fitted.keys


@pytest.mark.long
def test_a_notebook_takes_it_as_any_model(record):
    bare = st.Model(name="bare", coordinates=["p4", "p10"], forces={"shaker": "p4"}, modal=True)
    fit = bare.fit(st.Record.of(record))
    grown = fit.add("cubic_stiffness", between=("ground", "p10"))
    assert grown.error < 0.3 * fit.error
    assert grown.model.values["k3[ground-p10]"] == pytest.approx(1e5, rel=0.03)
    assert grown.drop("cubic_stiffness").error == pytest.approx(fit.error, rel=1e-3)
