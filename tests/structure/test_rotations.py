"""Coordinates that were measured as angles: forces on them are moments, and every unit says so."""

from dataclasses import replace

import numpy as np
import pytest

from study.compare.comparison import compare
from study.compare.comparison_report import comparison_summary
from study.equations.coefficient_units import coefficient_unit, parameter_units, units_at
from study.equations.model import free
from study.equations.place import Place
from study.equations.terms import get
from study.records.prepared import prepare_record
from study.records.readers import read_record
from study.records.record import Record, Sensor, record_of, write_csv

TURNS = record_of(
    0.01, {"shaker": np.zeros(9)}, {Sensor(c, "displacement"): np.zeros(9) for c in ("heave", "pitch")}
)  # fmt: skip
TURNS = replace(TURNS, units={**TURNS.units, "pitch displacement": "rad"})
PITCH = Place("between", ("ground", "pitch"))


@pytest.mark.parametrize(
    ("term", "place", "unit"),
    [
        ("linear_stiffness", PITCH, "N m/rad"),
        ("linear_damping", Place("at", ("pitch",)), "N m s/rad"),
        ("cubic_stiffness", PITCH, "N m/rad^3"),
        ("coulomb_friction", PITCH, "N m"),
        ("linear_stiffness", Place("between", ("ground", "heave")), "N/m"),
        ("inertia", Place("at", ("pitch",)), "kg m^2"),
        ("inertia", Place("couples", ("heave", "pitch")), "kg m"),
        ("inertia", Place("at", ("heave",)), "kg"),
    ],
)
def test_a_coefficient_has_the_unit_of_its_place(term, place, unit):
    entry = free(get(term), place)
    assert coefficient_unit(entry, entry.term.symbols[0], TURNS) == unit


def test_a_gap_of_a_rotation_is_an_angle():
    assert parameter_units(free(get("dead_band"), PITCH), TURNS) == {"u_g": "rad"}
    assert parameter_units(free(get("periodic_stiffness"), PITCH), TURNS)["f_m"] == "Hz"
    assert units_at(Place("between", ("heave", "pitch")), TURNS) == ("N", "m")  # one end moves in metres


@pytest.mark.parametrize(("unit", "factor"), [("rad", 1.0), ("deg", 57.29577951308232)])
def test_a_record_tells_which_coordinates_turn(tmp_path, frame, quiet_frame, unit, factor):
    path = tmp_path / "rig.csv"
    kept = {s: x for s, x in quiet_frame.motions.items() if s.motion == "displacement"}
    turned = {s: x * (factor if s.coordinate == "floor3" else 1.0) for s, x in kept.items()}
    write_csv(quiet_frame.with_motions(turned), path)
    head, rest = path.read_text().split("\n", 1)
    path.write_text(
        head.replace("floor1 displacement", "floor1 (m)").replace("floor2 displacement", "floor2 (m)")
        .replace("floor3 displacement", f"floor3 ({unit})") + "\n" + rest
    )  # fmt: skip
    record = read_record(path, roles=frame.roles)
    assert record.rotations == {"floor3"}
    comparison = compare(frame, prepare_record(record))
    said = comparison_summary([comparison])
    assert comparison.prediction.error < 1e-5
    assert "kg m^2" in said
    assert " N m" in said


def test_a_turning_mass_that_decays_has_coefficients_per_inertia_and_no_metres():
    """No force says a moment: its unit is that of the angular acceleration."""
    time = 0.01 * np.arange(4000)
    roll = 0.3 * np.exp(-0.02 * time) * np.cos(2.5 * time)
    units = {"displacement": "rad", "force": "rad/s^2"}
    record = Record(0.01, {"force": np.zeros(4000), "displacement": roll}, units, "roll")
    entries = {name: free(get(name)) for name in ("inertia", "linear_stiffness", "cubic_stiffness", "coulomb_friction")}
    found = {name: coefficient_unit(entry, entry.symbols[0], record) for name, entry in entries.items()}
    assert list(found.values()) == ["", "1/s^2", "1/(rad^2 s^2)", "rad/s^2"]
