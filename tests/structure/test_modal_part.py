"""Structures whose linear part is a sum of modes, with nonlinear terms between sensors."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

from study.cli import main
from study.compare import history
from study.compare.comparison import compare
from study.compare.comparison_report import comparison_document
from study.compare.each_record import separated
from study.compare.missing_force import MissingForce, unbalanced
from study.compare.prediction import predict
from study.equations.free_run import prepare
from study.equations.linear_part import matrices, modes_of, transfer
from study.equations.modal_part import ModalPart, rates_of
from study.equations.model import Model
from study.equations.model_file import format_model, parse_model, read_model
from study.equations.simulate import Integrator, simulate
from study.explore import session as sessions
from study.explore.view import View
from study.faults.accounting import Accounted
from study.identify.frequency_domain.modal_lines import observability
from study.identify.time_domain.part_fit import fit_part
from study.records.excitation import Excitation, force
from study.records.prepared import prepare_record
from study.records.record import MOTIONS, Record, Sensor, record_of, write_csv
from study.records.record_layout import Layout
from study.support.errors import StudyError
from study.way_in.compare_records import made_ready

ROOT = Path(__file__).parents[2]
DT, SAMPLES = 0.005, 8192
MODAL = """name: by modes
coordinates: [p4, p7, p10]
forces: {shaker: p4}
linear: modal
terms:
  - {term: cubic_stiffness, between: [ground, p10]}
"""


def modal(text=MODAL):
    return parse_model(text, Path("modal.yaml"))


@pytest.fixture(scope="module")
def lumped_and_by_modes():
    """Three masses with a stop between two of them, and the same by all of its modes, which damping couples."""
    lumped = read_model(ROOT / "models" / "structures" / "three_masses.yaml")
    lumped = lumped.without_term("coulomb_friction[first-second]")
    stiffness, damping, mass = matrices(lumped, lumped.numbers())
    squares, shapes = eigh(stiffness, mass)  # of unit modal mass
    part, modal_damping = ModalPart(lumped.coordinates).of(3), shapes.T @ damping @ shapes
    values = dict(zip(part.stiffness, squares.tolist(), strict=True))
    values |= {key: float(modal_damping[pair]) for pair, key in zip(part.pairs, part.damping, strict=True)}
    for point, row in zip(part.points, shapes.tolist(), strict=True):
        values |= dict(zip(part.shape(point), row, strict=True))
    stops = tuple(t for t in lumped.terms if t.term.name == "one_sided_contact")
    return lumped, Model("by modes", stops, lumped.coordinates, lumped.forces, part.with_values(values))


def test_a_structure_by_all_of_its_modes_is_the_structure(lumped_and_by_modes):
    lumped, own = lumped_and_by_modes
    drive = {"shaker": force(Excitation(level=100.0, cutoff=8.0), 400, 0.02, 5)}
    wanted, found = (simulate(model, drive, 0.02, Integrator("rk4", 8)) for model in (lumped, own))
    for sensor, motion in wanted.motions.items():
        assert np.max(np.abs(found[sensor] - motion)) < 1e-9 * np.std(motion), sensor
    assert np.any(wanted["third displacement"] - wanted["second displacement"] > 0.002), "the stop is met"
    sensors = (Sensor("third", "acceleration"), Sensor("first", "displacement"))
    np.testing.assert_allclose(*(transfer(model, sensors, 0.02, 256) for model in (lumped, own)), rtol=1e-9)
    modes, same = (modes_of(model) for model in (lumped, own))
    for name in ("frequency", "damping", "shape"):
        np.testing.assert_allclose(getattr(same, name), getattr(modes, name), rtol=1e-9, err_msg=name)


def test_numbers_of_modes_are_values_of_the_model(lumped_and_by_modes):
    own = lumped_and_by_modes[1]
    keys = (*own.terms[0].keys, "w2[1]", "w2[2]", "w2[3]", "g[1,1]", "g[1,2]", "g[1,3]", "g[2,2]", "g[2,3]", "g[3,3]")
    assert tuple(own.values) == (*keys, *(f"phi[{c},{r}]" for c in own.coordinates for r in (1, 2, 3)))
    assert own.held_keys == tuple(own.numbers())
    opened = own.with_values({"w2[2]": None, "phi[third,1]": None})
    assert set(own.held_keys) - set(opened.held_keys) == {"w2[2]", "phi[third,1]"}
    assert opened.with_values(own.numbers()) == own


def test_rates_of_modes_are_their_largest_eigenvalues():
    w2, g = np.array([100.0, 100.0, -4.0]), np.array([2.0, 50.0, 0.1])
    exact = [np.max(np.abs(np.linalg.eigvals([[0.0, 1.0], [-a, -b]]))) for a, b in zip(w2, g, strict=True)]
    np.testing.assert_allclose(rates_of(w2, g), exact)


def test_errors_of_modes_are_those_of_the_scatter(lumped_and_by_modes):
    own, keys = lumped_and_by_modes[1], ("w2[1]", "g[1,1]", "g[1,2]", "phi[first,1]", "phi[third,1]")
    middle = np.array([own.numbers()[key] for key in keys])
    deviations = 0.01 * np.abs(middle)
    found, rng = modes_of(own, keys, np.diag(deviations**2)), np.random.default_rng(3)
    samples = middle + deviations * rng.standard_normal((1500, len(keys)))
    drawn = [modes_of(own.with_values(dict(zip(keys, x.tolist(), strict=True)))) for x in samples]
    for name in ("frequency", "damping", "shape"):
        scatter = np.std([getattr(d, name) for d in drawn], axis=0)
        np.testing.assert_allclose(getattr(found, f"{name}_error"), scatter, rtol=0.12, atol=2e-6, err_msg=name)


def test_before_a_record_has_shown_its_modes_it_does_not_run(lumped_and_by_modes):
    bare = replace(lumped_and_by_modes[1], modal=ModalPart(("first", "second", "third")))
    with pytest.raises(StudyError, match="'linear: modal' and no modes yet; expected it fitted to a record"):
        simulate(bare, {"shaker": np.zeros(100)}, 0.02)


@pytest.fixture(scope="module")
def beam():
    model = read_model(ROOT / "models" / "structures" / "beam.yaml")
    drive = force(Excitation(level=1.0, reading="filtered", cutoff=30.0), SAMPLES, DT, 3)
    return model, simulate(model, {"shaker": drive}, DT, Integrator("rk4", 4))


def at_sensors(beam, motion="displacement", noise=0.01, places=("p4", "p7", "p10"), seed=4, samples=SAMPLES) -> Record:
    rng, motions = np.random.default_rng(seed), {}
    for place in places:
        x = beam[1].motions[Sensor(place, motion)]
        motions[Sensor(place, motion)] = x + np.sqrt(noise) * np.std(x) * rng.standard_normal(len(x))
    forces = {name: beam[1][name][:samples] for name in beam[1].forces}
    return record_of(DT, forces, {s: x[:samples] for s, x in motions.items()})


@pytest.fixture(scope="module")
def comparison(beam):
    return compare(modal(), prepare_record(at_sensors(beam)))


def test_the_cubic_spring_and_the_free_run_of_the_beam(comparison):
    """The proof that the issue asks for: 2 % at 1 % noise, and the error within 1.2 times the noise."""
    (found,) = comparison.coefficients
    value, error = found.value, found.error
    assert found.key == "k3[ground-p10]"
    assert value == pytest.approx(1e5, rel=0.02)
    assert abs(value - 1e5) < 4.0 * error
    noise = np.sqrt(0.01 / 1.01)
    assert comparison.prediction.error < 1.2 * noise
    assert comparison.prediction.floor == pytest.approx(noise, rel=0.1)


def test_modes_in_the_band_are_those_of_the_structure(beam, comparison):
    exact, found = modes_of(beam[0]), comparison.modes
    for k in range(3):
        nearest = int(np.argmin(np.abs(found.frequency - exact.frequency[k])))
        assert found.frequency[nearest] == pytest.approx(exact.frequency[k], rel=0.01)
        assert found.damping[nearest] == pytest.approx(exact.damping[k], rel=0.1)


def test_coefficients_line_by_line_are_real_and_flat(comparison):
    (spectrum,) = comparison.by_line
    mean, error = spectrum.mean
    assert abs(mean - 1e5) < 4.0 * error < 0.5e5
    for value, error in (spectrum.imaginary, spectrum.trend):
        assert abs(value) < 4.0 * error
    assert spectrum.frequency[0] < 1.0
    assert spectrum.frequency[-1] == pytest.approx(30.0, abs=0.5)


def test_a_term_at_the_wrong_place_leaves_the_error(beam):
    wrong = modal(MODAL.replace("[ground, p10]", "[p4, p7]"))
    found = compare(wrong, prepare_record(at_sensors(beam, samples=4000)))
    assert found.prediction.error > 1.1 * np.sqrt(0.01)


def test_derivatives_of_the_free_run_are_exact(comparison):
    fit, prepared, values = comparison.fit, comparison.prepared, comparison.fit.model.numbers()
    modal = fit.model.modal
    told = {"sensors": prepared.sensors, "steps_per_sample": fit.steps_per_sample, "span": (0, 300)}
    run = prepare(fit.model, prepared.record, tuple(values), **told)
    motion, slopes = run.respond(values, fit.initial)
    for key in ("k3[ground-p10]", modal.stiffness[0], modal.damping[1], modal.shape("p7")[0]):
        step = 1e-5 * max(abs(values[key]), 1e-3)
        near = [run.respond(values | {key: values[key] + s * step}, fit.initial)[0] for s in (-1, 1)]
        difference = (near[1] - near[0]) / (2.0 * step)
        own = slopes[:, :, run.keys.index(key)]
        assert np.max(np.abs(own - difference)) < 1e-4 * np.max(np.abs(own)), key
    alone = prepare(fit.model, prepared.record, **told)
    np.testing.assert_allclose(alone.respond({}, fit.initial)[0], motion, rtol=1e-12)


@pytest.mark.parametrize(
    ("motion", "noise", "relative"),
    [("displacement", 0.0, 1e-5), ("displacement", 0.0025, 0.01), ("acceleration", 0.0025, 0.02)],
)
def test_the_reports_duffing_system_is_a_structure_of_one_mode(motion, noise, relative):
    """Its mass, damping and stiffness follow from the mode; 5 % of the rms as noise is what the peer was given."""
    true = read_model(ROOT / "models" / "duffing.yaml").numbers()
    drive = force(Excitation(level=1.0, cutoff=12.5), 4096, 0.02, 1990)
    placed = (ROOT / "models" / "duffing.yaml").read_text().replace("value", "at: x, value")
    whole = parse_model(placed.replace("terms:", "coordinates: [x]\nforces: {shaker: x}\nterms:"), Path("whole.yaml"))
    record = simulate(whole, {"shaker": drive}, 0.02, Integrator("rk4", 16))
    u = record.motions[Sensor("x", motion)]
    noisy = u + np.sqrt(noise) * np.std(u) * np.random.default_rng(3).standard_normal(len(u))
    model = modal("coordinates: [x]\nforces: {shaker: x}\nlinear: modal\nterms: [{term: cubic_stiffness, at: x}]")
    own = record.with_motions({Sensor("x", motion): noisy})
    fitted = compare(model, prepare_record(own)).fit.model
    assert fitted.modal.count == 1
    values = fitted.numbers()
    mass = values["phi[x,1]"] ** -2
    found = {"m": mass, "c": values["g[1,1]"] * mass, "k": values["w2[1]"] * mass, "k3": values["k3[x]"]}
    for key, value in found.items():
        assert value == pytest.approx(true[key], rel=relative), key


def test_poles_from_a_subspace_are_exact_without_noise():
    """Any rational function through the bilinear transformation."""
    poles = np.array([-0.4 + 9.0j, -1.0 + 31.0j])
    omega = np.linspace(1.0, 60.0, 400)
    s = 1j * omega[:, None]
    gains = np.array([[1.0, 2.0], [3.0, -1.0]])
    response = np.stack([np.sum(g / ((s - poles) * (s - poles.conj())), axis=1) for g in gains], axis=1)
    rng = np.random.default_rng(1)
    drive = rng.standard_normal((400, 1)) + 1j * rng.standard_normal((400, 1))
    found = observability(omega, drive, response * drive, 10, np.zeros(400, dtype=np.int64))
    assert found.singular[4] < 1e-10 * found.singular[0]
    left = sorted(found.poles(4), key=lambda p: p.imag)[2:]
    np.testing.assert_allclose(left, poles, rtol=1e-8)


def test_the_model_file_holds_the_key():
    model = modal()
    assert model.modal
    assert modal(MODAL.replace("modal", "measured")) == model
    assert parse_model(format_model(model), Path("again.yaml")) == model
    assert modal(MODAL.split("  - ")[0].replace("terms:", "terms: []")).terms == ()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("linear: modal", "linear: guessed", "'linear' is 'guessed'; expected modal"),
        ("forces: {shaker: p4}\n", "", "needs 'forces'"),
        ("coordinates: [p4, p7, p10]\n", "", "no 'coordinates'"),
        ("cubic_stiffness", "linear_stiffness", "is linear, and 'linear: modal' holds it already"),
    ],
)
def test_a_bad_model_gets_its_sentence(old, new, said):
    with pytest.raises(StudyError, match=said):
        modal(MODAL.replace(old, new, 1))


def test_what_the_sensors_do_not_show_is_said(beam):
    for places, said in (
        (("p7", "p10"), "nothing measures the coordinate 'p4'"),
        (("p4", "p7"), "nothing measures the coordinate 'p10'"),
    ):
        record = at_sensors(beam, places=places)
        with pytest.raises(StudyError, match=said):
            made_ready([record], modal(), Layout())


def test_compare_on_the_command_line(tmp_path, beam, comparison, capsys):
    write_csv(at_sensors(beam), tmp_path / "beam.csv")
    (tmp_path / "beam.yaml").write_text(MODAL)
    words = [str(tmp_path / "beam.csv"), "--model", str(tmp_path / "beam.yaml"), "--out", str(tmp_path / "out")]
    assert main(["compare", *words]) == 0
    assert "k3[ground-p10]" in capsys.readouterr().out
    assert (tmp_path / "out" / "comparison.json").stat().st_size > 1000
    document = comparison_document([comparison])
    assert document["model"]["linear"] == "modal"
    assert document["error"]["force"] != document["error"]["force"], "no equation of motion, no error of a force"
    assert "Line by line" in document["says"]


@pytest.mark.long
def test_a_term_is_dropped_beside_a_measured_linear_part(tmp_path, beam, capsys):
    write_csv(at_sensors(beam, samples=4000), tmp_path / "beam.csv")
    model = tmp_path / "beam.yaml"
    model.write_text(MODAL)
    words = ["--data", str(tmp_path / "beam.csv"), "--out", str(tmp_path / "out")]
    assert main(["drop", str(model), "quintic_stiffness", *words]) == 2
    assert "expected one of cubic_stiffness[ground-p10]" in capsys.readouterr().err
    assert main(["drop", str(model), "cubic_stiffness", "--between", "ground", "p10", *words]) == 0
    assert read_model(model).terms == ()
    before, after = history.read_history(model)
    assert after["dropped"] == "cubic_stiffness[ground-p10]"
    assert after["error"]["response"] > 2.0 * before["error"]["response"]


def test_the_force_that_is_missing_between_two_coordinates_is_told_through_the_modes(lumped_and_by_modes):
    """A stop that the model lacks, beside the exact modes: the same as the equations of motion tell."""
    lumped, own = lumped_and_by_modes
    drive = {"shaker": force(Excitation(level=100.0, cutoff=8.0), 4000, 0.02, 5)}
    whole = simulate(lumped, drive, 0.02, Integrator("rk4", 8))
    prepared = prepare_record(whole.with_motions({s: x for s, x in whole.motions.items() if s.motion == MOTIONS[0]}))
    (stop,) = own.terms
    found: list[MissingForce] = []
    for model in (lumped, own):
        fit = fit_part(model.without_term(stop.name), prepared, tuple(model.without_term(stop.name).values), steps=8)
        missing = unbalanced(fit.model, fit.keys, predict(fit, prepared))
        found.append(missing.at(next(p for p in missing.shown if p.path == stop.place.path)))
    assert missing.equations == ()
    k, gap = (stop.values[key] for key in stop.keys)
    judged = slice(*prepared.plan.judge)
    ends = {end: whole[Sensor(end, MOTIONS[0])][judged] for end in stop.place.ends}
    true = k * np.maximum(ends[stop.place.ends[1]] - ends[stop.place.ends[0]] - gap, 0.0)
    for lacking in found:
        seen, wanted = (lacking.weighted(x)[lacking.inner] for x in (lacking.force, true))
        assert np.std(seen - wanted) < 0.05 * np.std(wanted)


def test_the_page_of_a_modal_model_has_its_places_and_modes_and_no_error_of_the_forces(comparison):
    session = sessions.begin_with(Accounted.as_compared(comparison))
    shown = View(session.now, 0)
    table = shown.of_record(session)["words"]
    words = dict(zip(table["place"], table["html"], strict=True))
    assert "noise" in words["figures"].lower()
    assert "Error of the force" not in words["figures"]
    assert words["modes"].count("<tr>") == 2 + len(comparison.modes.frequency)
    assert shown.sketch is not None
    assert len(shown.places) == len(shown.sketch.links) == 6, "each sensor to the ground, and each two"
    for place in shown.places:
        assert shown.focus(shown.nearest(place), place).place.label == place
        assert len(shown.of_place(place)["against_u"]) > 0
    assert all(len(shown.of_sensor(sensor)["time"]["t"]) > 1000 for sensor in shown.sensors)
    assert not shown.stiffnesses


def test_of_modes_no_number_may_differ_between_records():
    text = "name: sheet\ncoordinates: [a]\nforces: {shaker: a}\nlinear: modal\nterms: []\n"
    records = [
        record_of(0.01, {"shaker": np.ones(64)}, {Sensor("a", "displacement"): np.ones(64)}, name=n) for n in "xy"
    ]
    with pytest.raises(StudyError, match="no such term or coefficient"):
        separated(parse_model(text, Path("sheet.yaml")), records, ["linear_stiffness"])
