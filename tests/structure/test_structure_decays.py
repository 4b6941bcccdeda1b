"""Free decays of a structure: stretches that begin anew, what is missing in them, and what is never said of them."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from study.compare.comparison import compare
from study.compare.comparison_pictures import comparison_pictures
from study.compare.comparison_report import comparison_document
from study.compare.decay import decays_of
from study.diagnose.verdict import MISSING, NOTHING, diagnose
from study.equations.free_run import prepare
from study.equations.linear_part import modes_of
from study.equations.model_file import parse_model
from study.identify.time_domain.part_fit import linearise, run_of
from study.records.plan import make_plan
from study.records.prepared import prepare_record
from study.records.record import Sensor, record_of
from study.records.record_layout import Layout
from study.support.errors import StudyError
from study.way_in.compare_records import compare_records, made_ready

DT, SAMPLES = 0.01, 2000
SENSORS = (Sensor("a", "displacement"), Sensor("b", "displacement"))
BEGIN = np.array([0.01, 0.02, 0.0, 0.0])
FEW = ("quintic_stiffness", "periodic_stiffness", "harmonic_force", "hysteresis", "relaxation", "dead_band",
       "cubic_damping", "displacement_damping", "van_der_pol_damping", "two_sided_contact")  # fmt: skip
TERMS = """
name: pair
coordinates: [a, b]
terms:
  - {{term: inertia, at: a, value: 1.0}}
  - {{term: inertia, at: b, value: 0.5}}
  - {{term: linear_stiffness, between: [ground, a]{}}}
  - {{term: linear_stiffness, between: [a, b]{}}}
  - {{term: linear_damping, between: [ground, a]{}}}
  - {{term: linear_damping, between: [a, b]{}}}
"""
HARD = "  - {term: cubic_stiffness, between: [ground, a], value: 60000.0}\n"


def model(*, known=False, more=""):
    values = (40.0, 25.0, 0.1, 0.06)
    texts = [f", value: {value}" if known else "" for value in values]
    return parse_model(TERMS.format(*texts) + more, Path("pair.yaml"))


def decay(more="", noise=0.003, seed=1, begin=BEGIN, samples=SAMPLES):
    """The pair let go; noise as a share of each motion's size."""
    still = record_of(DT, {}, {s: np.zeros(samples) for s in SENSORS})
    run = prepare(model(known=True, more=more), still, sensors=SENSORS, steps_per_sample=4)
    motion, rng = run.respond({}, begin)[0].T, np.random.default_rng(seed)
    noisy = motion + noise * np.std(motion, axis=1, keepdims=True) * rng.standard_normal(motion.shape)
    return record_of(DT, {}, dict(zip(SENSORS, noisy, strict=True)), name="decay", start=3.0)


def test_a_decay_is_fitted_and_judged_in_turn_and_its_motion_begins_anew():
    prepared = made_ready([decay()], model(), Layout())[1]
    record = prepared.record
    runs = record.runs((0, len(record)))
    assert len(record.stretches) == len(runs) >= 6
    assert prepared.plan.fit == (0, prepared.plan.judge[0])
    firsts = sorted((s.first, s.last) for s in record.stretches)
    assert all(end == begin for (_, end), (begin, _) in itertools.pairwise(firsts)), "each sample once"
    fitted = [s.first for s, (_, end) in zip(record.stretches, runs, strict=True) if end <= prepared.plan.fit[1]]
    assert fitted == [first for first, _ in firsts[::2]], "every other block is judged"
    begin = record.joints[0]
    assert record.time[begin] == pytest.approx(3.0 + DT * record.stretches[1].first)
    assert record.time[begin] - record.time[begin - 1] > 10 * DT
    whole = prepare_record(decay())
    a = record.stretches[1]
    assert np.allclose(
        prepared.record.motion("a")[:, begin : begin + len(a)], whole.record.motion("a")[:, a.first : a.last]
    )


def test_derivatives_by_the_states_of_each_stretch_are_those_of_the_motion():
    prepared = made_ready([decay(HARD)], model(more=HARD), Layout())[1]
    fit = compare(model(more=HARD), prepared).fit
    jacobian = fit.outputs.apart(linearise(fit, prepared))
    assert fit.initial.shape == (len(prepared.record.runs(prepared.plan.fit)), 4)
    run = run_of(fit, prepared)
    for state in (0, 5, fit.initial.size - 1):
        moved = np.zeros(fit.initial.size)
        moved[state] = 1e-6
        moved = moved.reshape(fit.initial.shape)
        change = (run.respond({}, fit.initial + moved)[0] - run.respond({}, fit.initial - moved)[0]) / 2e-6
        column = jacobian[:, :, len(fit.keys) + state]
        assert np.allclose(change, column, atol=1e-5 * np.max(np.abs(column)))
        begin, end = prepared.record.runs(prepared.plan.fit)[state // 4]
        assert not np.any(column[:begin])
        assert not np.any(column[end:])


@pytest.mark.parametrize("seed", [2, 7, 9])
@pytest.mark.parametrize("noise", [0.05, 0.1])
def test_a_fit_begins_where_noise_does_not_lead_it_astray(noise, seed):
    """Of displacements every 0.01 s: two derivatives of their noise are larger than the acceleration itself."""
    record = decay(noise=noise, seed=seed)
    comparison = compare(model(), made_ready([record], model(), Layout((), (0, 1000), (1000, 1600)))[1])
    found = comparison.fit.model.values
    assert found["k[ground-a]"] == pytest.approx(40.0, rel=0.02)
    assert found["k[a-b]"] == pytest.approx(25.0, rel=0.02)


def test_a_hardening_spring_is_found_where_it_is():
    comparison = compare(model(), made_ready([decay(HARD)], model(), Layout())[1])
    diagnosis = diagnose(comparison, without=FEW)
    assert diagnosis.verdict == MISSING
    first = diagnosis.candidates[0]
    assert first.name == "cubic_stiffness[ground-a]"
    assert first.effect.coefficient == pytest.approx(60000.0, abs=4.0 * first.effect.error)
    assert first.effect.error < 0.05 * 60000.0
    assert first.response_error < 1.2 * first.prediction.floor


@pytest.mark.parametrize("noise", [0.003, 0.05])
def test_where_nothing_is_missing_nothing_is_said_to_be(noise):
    comparison = compare(model(), made_ready([decay(noise=noise)], model(), Layout())[1])
    assert diagnose(comparison, without=FEW).verdict == NOTHING


def test_a_free_run_that_lost_the_motion_is_no_noise():
    """One run of a linear model along the decay of a hard spring: whatever explains nothing there, something lacks."""
    prepared = prepare_record(decay(HARD), make_plan(decay(HARD), (0, 1000), (1000, 1600)))
    prediction = compare(model(), prepared).prediction
    assert prediction.error > 20.0 * prediction.floor
    assert prediction.above_noise > 0.5 * prediction.error
    right = model(more=HARD)
    again = compare(right, prepare_record(decay(HARD), make_plan(decay(HARD), (0, 1000), (1000, 1600)))).prediction
    assert again.above_noise < 2e-3


def test_stretches_that_are_named_are_used_alone():
    prepared = made_ready([decay()], model(), Layout(use=((3.5, 9.0), (12.0, None))))[1]
    times = prepared.record.time
    assert np.all((times >= 3.5) & (times < 9.0) | (times >= 12.0))
    assert min(times) == pytest.approx(3.5)
    explicit = made_ready([decay()], model(), Layout((), (0, 900), (900, 1800)))[1]
    assert len(explicit.record.stretches) == 2


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        (Layout(use=((0.0, 5.0),)), "--use 0:5 leaves the record; its times run from 3 to 22.99 s"),
        (Layout(use=((4.0, 9.0), (8.0, 12.0))), "two of the stretches to use overlap"),
        (Layout(fit=(0, 500), alternate=True), "exclude each other; expected '--judge every-other-block'"),
        (Layout(use=((4.0, 4.3),)), "leave 30 that are sure; expected 64"),
    ],
)
def test_parts_that_cannot_be_are_refused(parts, said):
    with pytest.raises(StudyError, match=said):
        made_ready([decay()], model(), parts)


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
    assert {"decay.png", "force_error.png"} <= comparison_pictures(comparison).keys()
