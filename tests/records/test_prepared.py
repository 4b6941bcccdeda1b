"""A record made ready: units, motions, parts, and what is judged of it."""

from dataclasses import replace

import numpy as np
import pytest

from study.records.plan import Plan, make_plan
from study.records.prepared import limited, prepare_record, whole
from study.records.record import MOTIONS, Record
from study.support.errors import StudyError


@pytest.fixture(scope="module")
def measured(records):
    clean = records["linear"]
    return type(clean)(clean.dt, {name: clean[name] for name in ("force", "acceleration")}, name="rig")


def test_what_was_measured_is_completed_and_stays_what_is_fitted_and_judged(measured, records):
    prepared = prepare_record(measured)
    assert prepared.response == "acceleration"
    assert all(name in prepared.record for name in MOTIONS)
    assert prepared.notes
    np.testing.assert_array_equal(prepared.fitted, measured["acceleration"][:4096])
    np.testing.assert_array_equal(prepared.judged, measured["acceleration"][4096:])
    inner = slice(*prepared.inner((0, len(measured))))
    assert np.std(prepared.record["displacement"][inner] - records["linear"]["displacement"][inner]) < 0.1 * np.std(
        records["linear"]["displacement"]
    )


def test_what_lies_below_the_cutoff_is_out_of_the_band(measured):
    assert prepare_record(measured, cutoff=0.5).band[0] == 0.5
    with pytest.raises(StudyError, match="cut-off"):
        prepare_record(measured, cutoff=30.0)


def test_the_uncertain_ends_belong_to_no_inner_span(measured):
    prepared = prepare_record(measured)
    assert prepared.edge > 0
    assert prepared.inner((0, 8192)) == (prepared.edge, 8192 - prepared.edge)
    assert prepared.inner((4000, 5000)) == (4000, 5000)


@pytest.mark.parametrize(("judge", "fit"), [((5000, 8000), (4488, 5000)), ((6000, 8000), (1000, 1512))])
def test_a_shorter_look_fits_the_samples_that_the_judging_part_follows(judge, fit, measured):
    prepared = prepare_record(measured, make_plan(measured, (1000, 5000), judge))
    look = prepared.shortened(512)
    assert look.plan == Plan("acceleration", fit, judge)
    assert look.record is prepared.record
    assert prepared.shortened(4000) is prepared


def test_a_whole_record_is_fitted_and_none_of_it_judged(records):
    prepared = whole(records["duffing"])
    np.testing.assert_array_equal(prepared.fitted, records["duffing"]["displacement"])
    assert len(prepared.judged) == 0


def test_a_quiet_stretch_is_no_look_at_a_record():
    """A sweep that is repeated passes its resonance in the middle of each part, away from where the parts meet."""
    place = np.arange(4000) % 2000
    sweep = np.cos(0.3 * place) * np.exp(-(((place - 1000.0) / 150.0) ** 2))
    steady = np.random.default_rng(2).standard_normal(4000)
    for motion, fit, judge in ((sweep, (750, 1250), (2750, 3250)), (steady, (1500, 2000), (2000, 2500))):
        prepared = prepare_record(Record(0.01, {"force": steady, "displacement": motion}))
        plan = limited(prepared, 500).plan
        assert (plan.fit, plan.judge) == (fit, judge)


def test_what_a_sensor_counts_is_the_same_whatever_part_is_fitted():
    """Else what is left by two fits, one to all and one to a part, would be told in two measures."""
    time = 0.01 * np.arange(4096)
    sensors = {"a displacement": np.sin(3.0 * time) * (1.0 + time), "b displacement": np.sin(5.0 * time)}
    forces = {"shaker": np.cos(time)}
    record = Record(0.01, forces | sensors, name="growing", coordinates=("a", "b"), forces=tuple(forces))
    prepared = replace(whole(record), sensors=record.sensors)
    assert len(prepared.outputs) == 2
    assert prepared.with_fit(0, 512).outputs.weights == prepared.outputs.weights
