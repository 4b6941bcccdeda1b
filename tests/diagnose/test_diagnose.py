import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from study import trials
from study.compare.comparison import compare
from study.compare.prediction import predict
from study.diagnose import constancy, diagnosis_report, verdict
from study.diagnose.adding import added
from study.diagnose.designs import AS_WAS
from study.diagnose.diagnosis_sentences import diagnosis_sentences
from study.diagnose.held_out import HeldOutResidual
from study.diagnose.ranking import distance
from study.diagnose.separation import rivals_of
from study.diagnose.verdict import MISSING, NOTHING, UNKNOWN, Diagnosis, diagnose
from study.equations.model import Model, ModelTerm
from study.equations.model_file import read_model
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LIBRARY, custom
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.part_fit import fit_part
from study.records import noise_floor
from study.records.excitation import Excitation, force
from study.records.prepared import prepare_record
from study.records.record import Record
from study.support import statistics
from study.support.thresholds import TOLERANCE, K

DT = 0.02


def all_but(*names: str) -> tuple[str, ...]:
    """What to leave out of the library, so that few candidates are tried and a test is soon done."""
    return tuple(name for name in LIBRARY if name not in names)


def diagnosed(believed: Model, record: Record, **options: Any) -> Diagnosis:
    return diagnose(compare(believed, prepare_record(record)), **options)


@pytest.fixture(scope="module")
def drag() -> trials.Trial:
    return trials.make_trial(901, hidden=["quadratic_damping"], noise=0.01, response="displacement")


@pytest.fixture(scope="module")
def of_drag(drag: trials.Trial) -> Diagnosis:
    return diagnosed(drag.believed, drag.record)


def test_the_hidden_effect_is_named_with_its_coefficient(drag, of_drag):
    first, before = of_drag.candidates[0], of_drag.comparison.prediction
    assert of_drag.verdict == MISSING
    assert first.name == "quadratic_damping"
    assert first.p_value < 1e-4
    true = drag.truth.values["c2"]
    assert true is not None
    assert abs(first.effect.coefficient - true) < 4.0 * first.effect.error
    assert first.effect.error < 0.2 * abs(true)
    assert first.response_error < before.error
    assert first.response_error == pytest.approx(before.floor, rel=0.1)


def test_adding_it_comes_as_near_as_the_true_model(drag, of_drag):
    prepared = of_drag.comparison.prepared
    true = predict(fit_part(drag.truth, prepared, (), drag.truth.numbers()), prepared)
    assert np.std(of_drag.candidates[0].residual) < 1.05 * np.std(true.residual)
    after = added(of_drag.comparison, of_drag.candidates[0].term)
    assert np.std(after.prediction.residual) < 1.05 * np.std(true.residual)


@pytest.mark.parametrize(("force", "motion"), [(1e-3, 1e3), (1e6, 1e-4)])
def test_units_do_not_matter(drag, of_drag, force, motion):
    scaled = drag.record.with_channels(
        {"force": force * drag.record["force"], "displacement": motion * drag.record["displacement"]}
    )
    again = diagnosed(drag.believed, scaled)
    assert again.verdict == of_drag.verdict
    assert [c.name for c in again.candidates[:3]] == [c.name for c in of_drag.candidates[:3]]
    assert again.candidates[0].response_error == pytest.approx(of_drag.candidates[0].response_error, rel=1e-3)


def test_nothing_missing_is_said_where_nothing_is():
    trial = trials.make_trial(902, hidden=[], noise=0.05)
    diagnosis = diagnosed(trial.believed, trial.record)
    prediction = diagnosis.comparison.prediction
    assert diagnosis.verdict == NOTHING
    assert prediction.error == pytest.approx(prediction.floor, rel=0.1)
    assert "Nothing is missing" in diagnosis_sentences(diagnosis)[0]


def test_a_model_that_misses_much_is_not_called_complete_where_nothing_is_found(of_drag):
    """What a mode at another frequency shows of a force that nobody measured depends on nothing that is there."""
    trial = trials.make_trial(901, hidden=[], noise=0.01, response="displacement")
    motion, rate = trial.record["displacement"], 1.0 / trial.record.dt
    another = sosfilt(butter(2, (0.3 * rate, 0.32 * rate), "bandpass", fs=rate, output="sos"),
                      np.random.default_rng(1).standard_normal(len(motion)))  # fmt: skip
    record = trial.record.with_channels({"displacement": motion + 0.5 * np.std(motion) / np.std(another) * another})
    found = diagnosed(trial.believed, record)
    assert (found.verdict, found.answer, found.misses_much) == (UNKNOWN, None, True)
    assert diagnosis_sentences(found)[0].startswith("The model does not describe this record, and no known effect")

    said = diagnosis_sentences(replace(of_drag, verdict=UNKNOWN, left=0.0))[0]
    assert of_drag.comparison.prediction.above_noise > 0.1
    assert "does not describe this record" in said
    assert "Nothing is missing" not in said


@pytest.mark.long
def test_an_effect_that_is_not_in_the_library_is_unknown_and_its_kind_is_said():
    trial = trials.make_trial(903, hidden=["periodic_stiffness"], noise=0.0)
    diagnosis = diagnosed(trial.believed, trial.record, without=["periodic_stiffness"])
    assert diagnosis.verdict == UNKNOWN
    assert diagnosis.families[0].family == "time"


@pytest.mark.parametrize("ripples", [5.0, 6.0])
def test_a_small_effect_is_not_given_the_name_of_what_takes_a_little_of_it(systems, report_force, ripples):
    """A hundredth of the stiffness in ripples; a dead band, alone or beside a cube, takes part of what is left."""
    size = float(np.std(simulate(systems["linear"], report_force, DT)["displacement"]))
    ripple = custom("ripple", f"sin({ripples / size!r}*u)")
    truth = systems["linear"].with_term(ModelTerm(ripple, (0.01 * 355.3 * size,), ()))
    history = simulate(truth, report_force, DT, Integrator("rk4", 8))["displacement"]
    record = Record(DT, {"force": report_force, "displacement": history})
    believed = systems["linear"].with_values(dict.fromkeys(systems["linear"].values))
    few = all_but("dead_band", "cubic_stiffness")
    diagnosis = diagnosed(believed, record, without=few)
    assert diagnosis.comparison.prediction.error < 0.01
    assert diagnosis.candidates[0].p_value < 0.01
    assert diagnosis.verdict == UNKNOWN
    assert "changes with the frequency" in " ".join(diagnosis_sentences(diagnosis))


def test_the_fields_are_those_of_the_file(of_drag):
    fields = diagnosis_report.diagnosis_fields(of_drag)
    assert set(fields) >= {"verdict", "candidates", "left", "depends_on"}
    wanted = {"term", "parameters", "coefficient", "interval", "response_error", "explained", "p_value", "tied_with"}
    assert all(set(row) >= wanted for row in fields["candidates"])
    assert "quadratic_damping" in diagnosis_report.candidate_table(of_drag)


def test_the_ends_of_a_narrow_interval_are_told_apart(of_drag):
    first = of_drag.candidates[0]
    first = replace(first, effects=(replace(first.effect, error=1e-7 * abs(first.effect.coefficient)),))
    said = " ".join(diagnosis_sentences(replace(of_drag, candidates=(first, *of_drag.candidates[1:]))))
    low, high = re.search(r"95 % interval (\S+) to (\S+?)\)", said).groups()
    assert float(low) < first.effect.coefficient < float(high)
    assert float(high) - float(low) == pytest.approx(3.92e-7 * abs(first.effect.coefficient), rel=0.2)


@pytest.mark.parametrize("error", [np.inf, np.nan, 0.0])
def test_an_interval_without_ends_is_said_all_the_same(of_drag, error):
    first = of_drag.candidates[0]
    first = replace(first, effects=(replace(first.effect, error=error),))
    said = diagnosis_sentences(replace(of_drag, candidates=(first, *of_drag.candidates[1:])))
    assert any("95 % interval" in sentence for sentence in said)


def test_twins_are_told_apart_by_exciting_harder(of_drag):
    rival = next(c for c in of_drag.candidates if c.name == "cubic_damping")
    rivals = rivals_of([of_drag.candidates[0], rival], of_drag.comparison.prepared)
    samples = len(rivals.present.source)
    same, louder = (rivals.distances(rivals.present.design(AS_WAS, AS_WAS, samples, level)) for level in (1.0, 4.0))
    assert np.sum(louder[0, 1]) > 4.0 * np.sum(same[0, 1])


def test_a_true_coefficient_is_flat_and_an_imitators_is_not():
    rng = np.random.default_rng(1)
    sensitivity = rng.standard_normal(8192) * (1.0 + 0.8 * np.sin(np.arange(8192) / 300.0))
    noise = 0.05 * rng.standard_normal(8192)
    flat = constancy.along_amplitude(sensitivity, noise, 1.0)
    bent = constancy.along_amplitude(sensitivity, noise + 0.3 * sensitivity**3, 1.0)
    assert flat.spread() < 0.02 < 0.1 < bent.spread()
    filtered = np.convolve(sensitivity, [0.5, 0.3, 0.2], "same")
    assert constancy.along_frequency(sensitivity, noise, 1.0, 0.02).spread() < 0.02
    assert constancy.along_frequency(sensitivity, filtered, 1.0, 0.02).spread() > 0.1


def test_gain_counts_the_blocks():
    rng = np.random.default_rng(2)
    before = rng.standard_normal(4096)
    assert statistics.gain(before, 0.5 * before).explained == pytest.approx(0.75)
    assert statistics.gain(before, 0.5 * before).p_value < 1e-6
    assert statistics.gain(before, before + 0.1 * rng.standard_normal(4096)).p_value > 1e-3
    assert statistics.gain(before, before).p_value == 1.0


def test_false_alarms_of_a_gain_are_as_rare_as_its_p_value():
    rng = np.random.default_rng(3)
    p = [
        statistics.gain(noise, noise - 0.2 * useless).p_value for noise, useless in rng.standard_normal((400, 2, 1536))
    ]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.025)


def test_a_small_change_of_the_prediction_that_is_right_is_seen():
    """A hundredth of the residual's power: five standard errors of the agreement, two of the fall of the power."""
    rng = np.random.default_rng(30)
    noise, change = rng.standard_normal((2, 200, 2500))
    p = [statistics.gain(n + 0.1 * c, n).p_value for n, c in zip(noise, change, strict=True)]
    assert np.mean(np.array(p) < 0.001) > 0.9


def test_clustered_errors_match_the_scatter_for_correlated_noise():
    rng = np.random.default_rng(4)
    n, design = 4096, rng.standard_normal((4096, 2))
    design = np.apply_along_axis(lambda c: np.convolve(c, np.ones(8), "same"), 0, design)
    solve = np.linalg.pinv(design)
    estimates, errors = [], []
    for _ in range(150):
        noise = np.convolve(rng.standard_normal(n), np.ones(8), "same")
        amount = solve @ noise
        estimates.append(amount)
        errors.append(np.sqrt(np.diag(statistics.clustered_covariance(design, noise - design @ amount))))
    ratio = np.mean(errors, axis=0) / np.std(estimates, axis=0)
    assert np.all((ratio > 0.8) & (ratio < 1.25))


def test_noise_floor_of_noise_and_of_noise_with_a_tone():
    rng = np.random.default_rng(5)
    noise = 0.3 * rng.standard_normal(8192)
    alone = noise_floor.floor(noise, 0.01)
    assert alone.noise == pytest.approx(0.3, rel=0.05)
    assert alone.significance < 4.0
    tone = 0.3 * np.sin(2 * np.pi * 7.0 * 0.01 * np.arange(8192))
    both = noise_floor.floor(noise + tone, 0.01)
    assert both.noise == pytest.approx(0.3, rel=0.05)
    assert both.excess == pytest.approx(0.045, rel=0.2)
    assert both.significance > 20.0


def test_the_judging_part_is_never_fitted(drag):
    first, last = prepare_record(drag.record).plan.judge
    changed = drag.record["displacement"].copy()
    changed[first:last] *= 3.0
    one, other = (
        fit_model(drag.believed, prepare_record(record))
        for record in (drag.record, drag.record.with_channels({"displacement": changed}))
    )
    np.testing.assert_allclose(one.values, other.values, rtol=1e-9)  # the last bits belong to the linear algebra


def test_a_model_that_runs_away_is_diagnosed_all_the_same() -> None:
    made = trials.make_trial(7_000_122, ("displacement_damping", "quadratic_damping"), 0.0, "acceleration")
    few = all_but("displacement_damping", "quadratic_damping", "van_der_pol_damping", "cubic_stiffness")
    diagnosis = diagnosed(made.believed, made.record, without=few)
    assert diagnosis.comparison.prediction.diverged
    assert diagnosis.comparison.prediction.error == pytest.approx(1.0)
    assert diagnosis.answer is not None
    assert set(diagnosis.answer.names) == {"displacement_damping", "quadratic_damping"}
    assert "grows without bound" in diagnosis_sentences(diagnosis)[0]


def test_an_imitator_that_leaves_only_noise_is_found_out_by_its_coefficient() -> None:
    made = trials.make_trial(7_000_142, ("quintic_stiffness",), 0.01, "acceleration")
    few = all_but("cubic_stiffness", "signed_quadratic_stiffness", "quadratic_damping")
    diagnosis = diagnosed(made.believed, made.record, without=few)
    assert diagnosis.verdict == UNKNOWN
    assert diagnosis.candidates[0].response_error < 0.5 * diagnosis.comparison.prediction.error
    assert "changes with the amplitude" in " ".join(diagnosis_sentences(diagnosis))


def test_a_constant_is_a_constant_and_a_moving_coefficient_is_not() -> None:
    rng = np.random.default_rng(3)
    error = np.full(8, 0.1)
    flat = [
        constancy.CoefficientCurve(np.arange(8.0), 5.0 + 0.1 * rng.standard_normal(8) + 0j, error) for _ in range(400)
    ]
    p_values = np.array([curve.p_value() for curve in flat])
    assert np.mean(p_values < 0.1) == pytest.approx(0.1, abs=0.05)
    assert constancy.CoefficientCurve(np.arange(8.0), 5.0 + 0.2 * np.arange(8.0) + 0j, error).p_value() < 1e-6


@pytest.mark.parametrize(("shown", "expected"), [(0.045, True), (0.065, False)])
def test_an_effect_of_a_decay_with_which_the_error_that_is_shown_grows_is_not_believed(monkeypatch, shown, expected):
    """Both parts of the wing's heave fell from 5.0 to 3.9 %, the judging part, and so every table, rose to 6.5."""
    evidence = {0.05: HeldOutResidual(np.ones(4), 0.05), shown: HeldOutResidual(np.ones(4), 0.04)}
    monkeypatch.setattr(verdict, "evidence", lambda prediction, _: evidence[prediction.error])
    row: Any = SimpleNamespace(
        prediction=SimpleNamespace(error=shown),
        response_error=shown,
        held_out=None,
        effect=SimpleNamespace(interval=(1.0, 2.0)),
        p_value=1e-6,
        idle="",
    )
    before: Any = SimpleNamespace(error=0.05)
    own: Any = None
    assert verdict.believed(row, before, own) == expected


def test_too_few_steps_make_an_effect_nobodys_equal(of_drag: Diagnosis):
    first, *_, other = of_drag.candidates
    white = {row.name: row.residual for row in (first, other)}
    apart = distance(other, first, white)
    assert apart > K
    size = np.std(other.prediction.measured)
    rough = replace(other, prediction=replace(other.prediction, numerical=np.array([size])))
    assert distance(rough, first, white) == apart


@pytest.mark.parametrize(
    ("explained", "left", "above_noise", "named"),
    [(0.1, 0.0, 0.32, False), (0.1, 0.0, 0.002, True), (0.1, 0.05, 0.002, False), (0.999, 0.05, 0.32, True)],
)
def test_an_effect_that_explains_little_is_not_named_where_much_is_left(explained, left, above_noise, named):
    """A periodic stiffness leaves what no shape of the motion sees: 32 % of the response beside a cogging of 6 %."""
    gain, prediction = SimpleNamespace(explained=explained), SimpleNamespace(above_noise=above_noise)
    assert verdict._explains(SimpleNamespace(gain=gain, prediction=prediction), left) is named


def test_an_effect_too_small_to_matter_is_not_said_to_explain_nothing():
    """The table had it first with 100.0 %, and the sentence below it said that no candidate explains any of it."""
    duffing = read_model(Path(__file__).parents[2] / "models" / "duffing.yaml")
    record = simulate(duffing, force(Excitation(level=4e-4), 4096, DT, 1), DT, Integrator("rk4", 8))
    found = diagnosed(
        duffing.without_term("cubic_stiffness"), record, without=all_but("cubic_stiffness", "coulomb_friction")
    )
    first = found.candidates[0]
    assert (found.verdict, first.name) == (NOTHING, "cubic_stiffness")
    assert found.comparison.prediction.error < TOLERANCE
    said = diagnosis_sentences(found)[0]
    assert said.startswith("Nothing is missing that matters at this level: ")
    assert f"Cubic stiffness explains {100.0 * first.gain.explained:.1f} % of its mean square" in said
    assert "looks like noise" not in said
