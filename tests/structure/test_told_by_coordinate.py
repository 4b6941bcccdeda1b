"""What is told of a single mass is told of each coordinate: the error of the force in its equation."""

import json

import numpy as np
import pytest

from study.compare.comparison import compare
from study.compare.comparison_report import as_json, comparison_document, comparison_summary, tables
from study.records.prepared import prepare_record


@pytest.fixture(scope="module")
def compared(believed, record_of):
    return compare(believed, prepare_record(record_of(noise=1e-4)))


def test_the_force_is_unexplained_in_the_equations_that_lack_one(frame, believed, record_of):
    true = frame.with_values(dict.fromkeys(frame.values, None))
    quiet = prepare_record(record_of(noise=0.0))
    whole, lacking = ({f.coordinate: f for f in compare(m, quiet).forces} for m in (true, believed))
    assert whole.keys() == lacking.keys() == {"floor1", "floor2", "floor3"}
    for floor in ("floor2", "floor3"):
        assert lacking[floor].total > 100.0 * whole[floor].total, "the joint lies between these two"
        assert lacking[floor].parametric_total > lacking[floor].total, "no linear system leaves more than the best one"
    assert lacking["floor1"].total == pytest.approx(whole["floor1"].total, rel=1e-3), "its leakage is the same"


def test_an_equation_with_a_motion_that_no_sensor_shows_is_left_out(believed, record_of):
    found = compare(believed, prepare_record(record_of(noise=1e-4, without=("floor3",))))
    assert [force.coordinate for force in found.forces] == ["floor1"]
    assert "-" in comparison_summary([found]).split()


def test_files_tell_it_by_coordinate(compared):
    content = json.loads(as_json(comparison_document([compared])))
    floors = ["floor1", "floor2", "floor3"]
    for of in ("error", "noise_floor", "error_of_fitted_coefficients"):
        assert list(content[of]["coordinates"]) == floors
        assert content[of]["force"] == pytest.approx(np.mean(list(content[of]["coordinates"].values())))
    assert {f"force at {floor}" for floor in floors} <= {band["of"] for band in content["where"]["frequency"]}
    assert tables([compared])["force_error"].decode().startswith("record,coordinate,frequency,force_density")


def test_noise_alone_leaves_as_much_as_is_said(frame, record_of):
    """Of the true model, whose equations at floor2 and floor3 have no force but that of inertia."""
    true = frame.with_values(dict.fromkeys(frame.values, None))
    found = {force.coordinate: force for force in compare(true, prepare_record(record_of(noise=1e-4))).forces}
    for floor in ("floor2", "floor3"):
        assert found[floor].parametric_total == pytest.approx(found[floor].noise_total, rel=0.25)
