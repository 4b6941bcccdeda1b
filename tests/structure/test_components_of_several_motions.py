"""Components between named coordinates: their motions are prescribed, the forces at their ends are predicted."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import study
from study import cli
from study.compare.loops import loops
from study.diagnose.designs import AS_WAS, MULTISINE, present_test
from study.diagnose.late_force import late_force
from study.diagnose.separation import limit_share, own_limits
from study.diagnose.verdict import diagnose
from study.equations.model_file import parse_model
from study.explore import session as sessions
from study.explore.view import View
from study.faults.accounting import Accounted
from study.faults.imposed import shifted
from study.identify.frequency_domain.reverse_system import equations_of
from study.records.record import Record, Sensor, record_of, write_csv
from study.records.record_layout import Layout
from study.support.errors import StudyError
from study.way_in.compare_records import compare_records

SPRING, DAMPING, CUBIC, GROUND, DT = 2.0e4, 40.0, 6.0e9, 1.5e4, 0.002
LEFT, RIGHT = Sensor("left", "displacement"), Sensor("right", "displacement")
JOINT = """name: joint
coordinates: [left, right]
forces: {load_left: left, load_right: right}
terms:
  - {term: linear_stiffness, between: [left, right]}
  - {term: linear_damping, between: [left, right]}
  - {term: linear_stiffness, at: right}
"""


@cache
def joint(cubic: float = CUBIC, damping: float = DAMPING) -> Record:
    """A hardening spring with a damper between two motions, and a spring from one of them to the ground; 1 % noise."""
    rng, time = np.random.default_rng(3), DT * np.arange(3000)
    motions = []
    for lines in (np.arange(0.5, 6.0, 0.37), np.arange(0.6, 6.0, 0.41)):
        omega, phase = 2.0 * np.pi * lines[:, None], rng.uniform(0.0, 2.0 * np.pi, (len(lines), 1))
        waves = np.exp(1j * (omega * time + phase)) * rng.normal(0.0, 1e-3, (len(lines), 1))
        motions.append((np.sum(waves.imag, axis=0), np.sum((1j * omega * waves).imag, axis=0)))
    (left, left_rate), (right, right_rate) = motions
    stretch, rate = left - right, left_rate - right_rate
    force = SPRING * stretch + damping * rate + cubic * stretch**3
    loads = {"load_left": force, "load_right": GROUND * right - force}
    loads = {name: f + 0.01 * np.std(f) * rng.standard_normal(len(f)) for name, f in loads.items()}
    return record_of(DT, loads, {LEFT: left, RIGHT: right}, name="joint")


@cache
def compared(cubic: float = CUBIC) -> Accounted:
    return compare_records([joint(cubic)], parse_model(JOINT, Path("joint.yaml")))


def test_the_forces_at_both_ends_give_every_coefficient():
    linear = compared(0.0).comparison
    assert linear.prediction.error == pytest.approx(linear.prediction.floor, rel=0.1)
    for found, true in zip(linear.coefficients, (SPRING, DAMPING, GROUND), strict=True):
        assert found.interval[0] < true < found.interval[1], found.key
    assert [str(sensor) for sensor in linear.prepared.outputs.sensors] == ["left force", "right force"]
    assert linear.model.forces == (("load_left", "left"), ("load_right", "right"))


def test_what_is_missing_stands_at_its_place_and_nothing_is_said_to_be_lost_on_its_way():
    comparison = compared().comparison
    assert comparison.place.path == frozenset(("left", "right"))
    assert comparison.force_error > 0.2
    assert comparison.growths is not None
    assert comparison.growths.ways[0].power == pytest.approx(3.0, abs=0.1)
    shares = {place.label: share for place, share in comparison.missing.aligned}
    assert shares["left-right"] > 0.99
    assert not any("loses the motion" in note or "drift" in note for note in comparison.notes)
    equations, lacking = equations_of(comparison.fit.model, comparison.prepared)
    assert ([equation.coordinate for equation in equations], lacking) == (["left", "right"], {})


def test_a_force_does_its_work_along_the_motion_of_what_holds_it():
    """Left is tied to right alone, right to the ground as well: there are loops of the joint, and of right's motion."""
    comparison = compared(0.0).comparison
    of_left, of_right = (loops(comparison, number) for number in range(2))
    assert (of_left.across, of_right.across) == ("left − right", "right")
    part = comparison.record.part(*comparison.plan.judge)
    assert np.array_equal(of_left.displacement, part[LEFT] - part[RIGHT])
    assert np.median(of_left.measured) > 0.0  # a damper takes energy
    np.testing.assert_allclose(of_left.measured, of_left.predicted, atol=0.1 * np.max(of_left.measured))


@pytest.mark.long
def test_all_forces_that_are_read_late_are_told():
    """A delay turns a spring into a damper of the wrong sign, at both places alike."""
    record, late = joint(0.0, 0.0), 3.0
    moved = record.with_channels({name: shifted(record[name], late) for name in record.forces})
    springs = parse_model(JOINT, Path("joint.yaml")).without_term("linear_damping[left-right]")
    found = late_force(diagnose(compare_records([moved], springs).comparison))
    assert found is not None
    assert abs(found.value - late) < 4.0 * found.error < 0.3


def test_one_force_is_enough_and_each_motion_is_needed():
    record, model = joint(), parse_model(JOINT.replace(", load_right: right", ""), Path("joint.yaml"))
    channels = {name: values for name, values in record.channels.items() if name != "load_right"}
    alone = replace(record, channels=channels, forces=("load_left",))
    comparison = compare_records([alone], model.without_term("linear_stiffness[right]")).comparison
    assert "no force was measured at right" in " ".join(comparison.notes)
    assert comparison.place.path == frozenset(("left", "right"))
    blind = replace(alone, channels={name: values for name, values in channels.items() if name != str(RIGHT)})
    with pytest.raises(StudyError, match="nothing measures the motion of 'right'"):
        compare_records([blind], model)
    with pytest.raises(StudyError, match="the force is predicted, not the acceleration"):
        compare_records([record], parse_model(JOINT, Path("joint.yaml")), Layout(response="acceleration"))


def test_the_next_test_moves_both_ends_and_stays_within_the_stroke():
    comparison = compared(0.0).comparison
    present = present_test(comparison.prepared, comparison.fit)
    assert (present.prescribed, present.drivers) == (True, (str(LEFT), str(RIGHT)))
    design = present.design(MULTISINE, AS_WAS, 1024, 0.5)
    strokes = design.record.columns(present.drivers)
    assert np.all(np.max(np.abs(strokes), axis=0) <= 0.5 * present.peaks)
    assert abs(np.corrcoef(strokes.T)[0, 1]) < 0.3  # each end has a motion of its own
    limits = own_limits([comparison.fit], present)
    assert limit_share([comparison.fit], present, present.design(AS_WAS, AS_WAS, 3000, 1.0), limits) <= 1.0 + 1e-9


@pytest.mark.long
def test_command_line_notebook_and_page_say_the_same(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_csv(joint(), Path("joint.csv"))
    Path("joint.yaml").write_text(JOINT)
    assert cli.main(["diagnose", "joint.csv", "--model", "joint.yaml", "--out", "out"]) == 0
    told = json.loads(Path("out/diagnosis.json").read_text())
    printed = capsys.readouterr().out
    assert "missing between left and right" in printed
    assert "error of the forces" in printed
    assert "modes" not in printed
    model = study.Model.load("joint.yaml")
    fit = model.fit(study.read("joint.csv", model=model))
    found = fit.diagnose()
    assert found.best is not None
    assert found.best.name == "cubic_stiffness[left-right]"
    first = told["candidates"][0]
    assert (first["term"], first["between"]) == ("cubic_stiffness", ["left", "right"])
    better = fit.add(found.best)
    assert better.error == pytest.approx(better.floor, rel=0.1)
    assert fit.add("cubic_stiffness", between=("left", "right")).error == pytest.approx(better.error, rel=1e-3)
    assert better.plot(sensor="right force").get_lines()

    session = sessions.with_stage(
        sessions.begin_with(compared()), sessions.examined(sessions.begin_with(compared()))[0]
    )
    view = View(session.now, 0)
    assert view.sensors == ("left force", "right force")
    assert next(iter(view.places)) == "left-right"
    of_left = view.of_sensor("left force")
    labels = {row: value for row, _, value in zip(*of_left["frame_sensor"].values(), strict=True)}
    assert labels["loop_u_x"].startswith("left − right displacement / ")
    assert len(of_left["loops"]["u"]) > 100
    grown = sessions.with_added(session, "cubic_stiffness[left-right]")
    assert grown.now.comparison.prediction.error == pytest.approx(better.error, rel=1e-3)
