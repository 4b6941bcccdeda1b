"""Fits of structures in free run: coefficients, their errors, missing sensors; where the equations are violated."""

import numpy as np
import pytest

from study.compare.comparison import compare
from study.compare.comparison_report import comparison_document
from study.equations.model import Model
from study.identify.frequency_domain import linear_start
from study.identify.frequency_domain.linear_start import lumped_start
from study.records.plan import make_plan
from study.records.prepared import prepare_record
from study.records.record_layout import Layout
from study.support.errors import StudyError
from study.way_in.compare_records import made_ready


def noise_over_motion(comparison):
    """What noise alone leaves: it is a tenth of the rms of the whole record, which the judged half exceeds."""
    prediction = comparison.prediction
    whole = np.std(prediction.prepared.measured, axis=0)
    return float(np.sqrt(np.mean((0.1 * whole / prediction.size) ** 2)))


@pytest.mark.parametrize(
    ("motion", "without"), [("displacement", ()), ("acceleration", ()), ("displacement", ("floor2",))]
)
def test_the_true_model_is_found_within_its_errors(frame, record_of, motion, without):
    free = frame.with_values(dict.fromkeys(frame.values, None))
    comparison = compare(free, prepare_record(record_of(motion, without=without)))
    off = comparison.fit.values - [frame.values[key] for key in comparison.fit.keys]
    distance = off @ np.linalg.solve(comparison.found.covariance, off)  # chi square with ten degrees of freedom
    assert distance < 29.6  # its 99.9 % quantile
    assert comparison.prediction.error == pytest.approx(noise_over_motion(comparison), rel=0.05)
    assert comparison.prediction.floor == pytest.approx(comparison.prediction.error, rel=0.05)
    true = 2.16976, 5.07901, 7.31513
    apart = np.abs(comparison.modes.frequency - true) / comparison.modes.frequency_error
    assert np.max(apart) < 4.0
    assert bool(comparison.missing.lacking) == bool(without)


def test_held_values_are_held(frame, record_of):
    """With nothing open nothing is fitted: the error is that of the model as it is."""
    comparison = compare(frame, prepare_record(record_of()))
    assert comparison.fit.keys == ()
    assert all(c.error is None for c in comparison.coefficients)
    assert comparison.prediction.error == pytest.approx(noise_over_motion(comparison), rel=0.05)
    wrong = frame.with_values({"m[floor2]": 5.0})
    assert compare(wrong, prepare_record(record_of())).prediction.error > 0.2


def test_what_is_held_is_integrated_as_finely_as_what_is_fitted(frame, quiet_frame):
    """Seven samples a period of the third mode: the integration alone left 0.15 %."""
    held = compare(frame, prepare_record(quiet_frame))
    assert held.prediction.error < 1e-5


def test_the_residual_force_acts_between_the_two_floors(believed, record_of):
    quiet = compare(believed, prepare_record(record_of(noise=0.0)))
    rows = comparison_document([quiet])["where"]
    assert rows["places"][0]["between"] == ["floor2", "floor3"]
    shared = np.array(rows["shared_force"])
    assert np.argmax(shared) in (5, 7)  # row floor2, column floor3, or the other way round
    assert shared[1, 2] > 0.5
    noisy = compare(believed, prepare_record(record_of()))
    assert comparison_document([noisy])["where"]["places"][0]["between"] == ["floor2", "floor3"]
    errors = list(comparison_document([noisy])["error"]["sensors"].values())
    floors = list(comparison_document([noisy])["noise_floor"]["sensors"].values())
    assert all(e > 1.1 * f for e, f in zip(errors, floors, strict=True))


def test_what_is_missing_between_two_floors_grows_with_the_cube_of_their_distance(believed, record_of):
    """With noise on every sensor, in their common equation; the band and the time are those of the worst sensor."""
    comparison = compare(believed, prepare_record(record_of(noise=1e-4)))
    assert comparison.place.path == frozenset(("floor2", "floor3"))
    best = comparison.growths.ways[0]
    assert (best.of, best.parity) == ("displacement", "odd")
    assert best.power == pytest.approx(3.0, abs=0.35)
    where = comparison_document([comparison])["where"]
    assert where["amplitude"][0]["between"] == ["floor2", "floor3"]
    places = {f"floor{i} displacement" for i in (1, 2, 3)} | {f"force at floor{i}" for i in (1, 2, 3)}
    assert {row["of"] for row in where["frequency"]} == places


def test_linear_terms_come_from_frequency_responses(frame, record_of):
    linear = frame.without_term("cubic_stiffness[floor2-floor3]")
    free = linear.with_values(dict.fromkeys(linear.values, None))
    for without in ((), ("floor2",)):
        start = lumped_start(free, prepare_record(record_of(without=without)), {})
        masses = [start[f"m[floor{i}]"] / frame.values[f"m[floor{i}]"] for i in (1, 2, 3)]
        assert np.max(np.abs(np.array(masses) - 1.0)) < 0.1


def test_what_another_term_holds_says_nothing_of_the_linear_ones(frame, record_of):
    """Each candidate with a shape of its own would have them searched for anew, and their size left as it is drawn."""
    linear = frame.without_term("cubic_stiffness[floor2-floor3]")
    free, prepared = linear.with_values(dict.fromkeys(linear.values, None)), prepare_record(record_of())
    before = linear_start._of_linear_terms.cache_info().misses
    starts = [lumped_start(free, prepared, held) for held in ({}, {"dead_band[floor1].gap": 1e-3})]
    assert starts[0] == starts[1]
    assert linear_start._of_linear_terms.cache_info().misses == before + 1


def test_what_cannot_be_judged_gets_its_sentence(believed, record_of):
    record = record_of()
    with pytest.raises(StudyError, match=r"overlap.*expected"):
        prepare_record(record, make_plan(record, (0, 2000), (1000, 5000)))
    loose = tuple(t for t in believed.terms if t.place and not {"floor2", "floor3"} <= set(t.place.ends))
    apart = Model("loose", loose, believed.coordinates, (("shaker", "floor1"),))
    with pytest.raises(StudyError, match="nothing measures the coordinate 'floor3' and nothing ties it"):
        made_ready([record_of(without=("floor3",))], apart, Layout())
