"""Pieces of a free run: what passes their ends, and how neighbours are joined to one motion."""

from dataclasses import replace

import numpy as np
import pytest

from study.equations.free_run import predict_response
from study.equations.simulate import simulate
from study.identify.time_domain.continuation import fit_segments, lengthen
from study.identify.time_domain.multiple_shooting import fit_in_segments
from study.identify.time_domain.shooting import ShootingSegments, even_restarts
from study.records.excitation import displacement_noise
from study.records.outputs import DISPLACEMENT
from study.records.record import Record

NOISE = 0.05


@pytest.fixture(scope="module")
def chaotic(systems, records):
    """Half a record of the Dead-Band system with noise, what the record truly does, and the model."""
    clean = records["dead_band"]
    noise = displacement_noise(clean["displacement"], NOISE, 21)
    noisy = clean.with_channels({"displacement": clean["displacement"] + noise})
    return noisy.part(0, 4096), clean.part(0, 4096), systems["dead_band"]


def in_pieces(record, restarts=None):
    span = (0, len(record))
    if restarts is None:
        restarts = even_restarts(record, DISPLACEMENT, span)
    return ShootingSegments(record, DISPLACEMENT, span, tuple(restarts), 4)


def test_a_motion_passes_the_ends_of_pieces_as_it_is(make_model, report_force):
    """... with the state of a term that has one, and anew where it is told to begin."""
    linear = {"inertia": {"m": 1.0}, "linear_damping": {"c": 3.77}, "linear_stiffness": {"k": 355.3}}
    memory = {"hysteresis": {"kz": 200.0, "hysteresis.beta": 300.0, "hysteresis.gamma": 100.0}}
    model = make_model("rig", {**linear, **memory})
    record = Record(0.02, {"force": report_force, "displacement": np.zeros(len(report_force))})
    pieces = replace(in_pieces(record, range(50, 1000, 50)), span=(0, 1000))
    states = pieces.passing(model, (), np.zeros(3))
    motions = [
        predict_response(model, record, response=name, steps_per_sample=4) for name in ("displacement", "velocity")
    ]
    np.testing.assert_allclose(states[:, :2], np.stack(motions, axis=1)[:1000:50], rtol=1e-12, atol=1e-15)
    assert np.all(states[1:, 2] != 0.0)
    again = pieces.passing(model, (500,), np.stack([np.zeros(3), states[10]]))
    np.testing.assert_array_equal(again, states)
    other = pieces.passing(model, (500,), np.zeros((2, 3)))
    np.testing.assert_array_equal(other[:10], states[:10])
    assert np.all(other[10] == 0.0)


def test_neighbours_are_joined_to_long_pieces_beside_the_true_motion(chaotic):
    record, clean, model = chaotic
    pieces = in_pieces(record)
    loose = fit_segments(model, pieces, pieces.first_states(model), (), 12)
    longer = lengthen(loose, pieces, ())[-1]
    assert len(longer.restarts) < len(pieces.restarts) / 10
    assert set(longer.restarts) < set(pieces.restarts)
    noise = np.sqrt(NOISE) * np.std(clean["displacement"])
    misfit = record["displacement"] - longer.residual - clean["displacement"]
    assert np.sqrt(np.mean(misfit**2)) < 0.25 * noise
    assert longer.estimate.error("dead_band.u_g") < 0.4 * loose.estimate.error("dead_band.u_g")


def test_what_is_no_one_motion_is_left_apart(chaotic):
    """The mass is struck at one sample, which the force does not tell: there and nowhere else no motion goes on."""
    record, clean, model = chaotic
    struck = 2048
    later = clean.part(struck, 4096)
    kicked = predict_response(
        model, Record(later.dt, {"force": later["force"], "displacement": later["displacement"]}),
        steps_per_sample=8, initial=(clean["displacement"][struck] + 0.01, clean["velocity"][struck]),
    )  # fmt: skip
    noise = record["displacement"] - clean["displacement"]
    displacement = np.concatenate([clean["displacement"][:struck], kicked]) + noise
    record = record.with_channels({"displacement": displacement})
    restarts = range(128, 4096, 128)
    pieces = in_pieces(record, restarts)
    loose = fit_segments(model, pieces, pieces.first_states(model), tuple(model.values), 12)
    assert struck in lengthen(loose, pieces, tuple(model.values))[-1].restarts


def test_pieces_stay_as_they_are_where_longer_ones_run_away(systems, records):
    """A softening spring which loses its hold within a second; pieces of a fifth of one are over before."""
    model = systems["duffing"].with_values({"k3": -1e7})
    pieces = in_pieces(records["duffing"].part(0, 2048), range(10, 2048, 10))
    loose = fit_segments(model, pieces, pieces.first_states(model), tuple(model.values), 3)
    left = lengthen(loose, pieces, tuple(model.values))[-1]
    assert np.all(np.isfinite(left.residual))
    assert left.restarts


def test_a_clean_record_needs_no_ties(systems, records):
    model, record = systems["dead_band"], records["dead_band"].part(0, 4096)
    start = {"dead_band.u_g": 0.00275}
    found = fit_in_segments(model, record, start=start, steps_per_sample=4)
    assert found.rms < 1e-3 * np.std(record["displacement"])
    assert found.estimate["dead_band.u_g"] == pytest.approx(0.0025, rel=1e-3)


@pytest.mark.parametrize("seed", [31, 32])
def test_the_width_is_found_within_its_errors_which_are_below_a_hundredth(systems, records, seed):
    clean = records["dead_band"]
    noise = displacement_noise(clean["displacement"], NOISE, seed)
    record = clean.with_channels({"displacement": clean["displacement"] + noise})
    start = {key: 1.05 * value for key, value in systems["dead_band"].numbers().items()}
    found = fit_in_segments(systems["dead_band"], record, start=start)
    width, error = found.estimate["dead_band.u_g"], found.estimate.error("dead_band.u_g")
    assert abs(width - 0.0025) < 3.5 * error
    assert error < 0.01 * 0.0025
    assert found.residual @ found.residual < 1.05 * float(noise @ noise)


@pytest.mark.parametrize(("c", "k"), [(200.0, 355.3), (3.77, 5e3)])
def test_a_stiff_system_is_found_from_afar(c, k, make_model, report_force):
    """Of which the displacement is slow: steps that suit it alone would make the free run grow without end."""
    terms = {"inertia": {"m": 1.0}, "linear_damping": {"c": c}, "linear_stiffness": {"k": k}}
    model = make_model("stiff", terms)
    record = simulate(model, report_force, 0.02).part(0, 2048)
    start = {"c": 0.7 * c, "k": 1.3 * k}
    found = fit_in_segments(model, record, start=start, steps_per_sample=8)
    assert found.converged
    assert found.estimate["c"] == pytest.approx(c, rel=0.02)
    assert found.estimate["k"] == pytest.approx(k, rel=0.02)


def test_where_no_motion_is_found_the_pieces_say_so(systems, records):
    """With a dead band held at thrice its width; what is returned took the steps asked for and every open key."""
    clean = records["dead_band"]
    noise = displacement_noise(clean["displacement"], NOISE, 33)
    record = clean.with_channels({"displacement": clean["displacement"] + noise}).part(0, 4096)
    model = systems["dead_band"].with_values({"dead_band.u_g": 0.0075})
    found = fit_in_segments(model, record, held=("dead_band.u_g",), steps_per_sample=2)
    assert found.keys == ("m", "c", "k", "kg")
    assert found.steps_per_sample == 2
    assert not found.converged
    assert found.message == f"no single motion follows the record; {len(found.restarts) + 1} segments of it were fitted"
