"""What is told of a single mass is told of each coordinate: the error of its force, and how its motion decays."""

import json

import numpy as np
import pytest
from test_structure_decays import BEGIN, DT, HARD, decay, model

from study.compare.comparison import compare
from study.compare.comparison_report import as_json, comparison_document, comparison_summary, tables
from study.compare.decay import decays_of
from study.equations.linear_part import modes_of
from study.records.prepared import prepare_record
from study.records.record_layout import Layout
from study.way_in.compare_records import compare_records, made_ready


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


def test_each_sensor_of_a_decay_shows_the_frequency_that_it_swings_in_most():
    comparison = compare_records([decay(samples=4000)], model(), Layout()).comparison
    modes = modes_of(model(known=True))
    measured = [decays_of(comparison, i).measured for i in range(2)]
    content = comparison_document([comparison])["decay"]
    assert list(content) == ["a displacement", "b displacement"]
    for number, seen in enumerate(measured):
        late = seen.frequency[-3:]
        assert min(abs(np.median(late) / modes.frequency - 1.0)) < 0.02, number
        again = decays_of(comparison, number).predicted
        assert again is not None
        assert np.median(again.frequency) == pytest.approx(np.median(seen.frequency), rel=0.01)
