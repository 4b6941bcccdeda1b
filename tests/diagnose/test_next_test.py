"""Which test next: limits that hold, distances that mean what they say, promises that are kept, files for a shaker."""

import io
import json
import wave
from dataclasses import replace

import numpy as np
import pytest

from study import cli
from study.diagnose import next_test as following
from study.diagnose.designs import AS_WAS, LET_GO, MULTISINE, SWEEP, Limits
from study.diagnose.next_test import DECIDES, Choice, driving, next_test, rehearsed, simulated, tied_rows
from study.diagnose.next_test_report import as_wav, deciding_plan, next_test_in_words, precise_plan
from study.diagnose.precision import precise_test
from study.diagnose.separation import allowed, limit_share, own_limits, respond, rivals_of, root_of_inverse
from study.diagnose.verdict import diagnose
from study.equations.terms import LIBRARY
from study.explore.session import begin_with, with_next_test
from study.explore.words import words
from study.faults.accounting import Accounted
from study.identify.time_domain.part_fit import fit_part
from study.interface.planned import planned
from study.records.interpolation import between_samples
from study.records.record import Sensor
from study.support.errors import StudyError
from study.support.thresholds import K
from study.trials import make_trial
from study.trials.findings import compared
from study.trials.next_tests import measured_in
from study.trials.sealed import write_trial
from study.way_in.compare_records import compare_records

TWINS = ("cubic_damping", "quadratic_damping")


@pytest.fixture(scope="module")
def trial():
    """A shake table under which two dampers are a tie."""
    return make_trial(630_001, test="base")


@pytest.fixture(scope="module")
def diagnosis(trial):
    comparison = compared(trial, trial.believed).comparison
    return diagnose(comparison, without=[name for name in LIBRARY if name not in TWINS and name not in trial.believed])


@pytest.fixture(scope="module")
def rivals(diagnosis):
    rows = tied_rows(diagnosis)
    assert {row.name for row in rows} == set(TWINS)
    return rivals_of(rows, diagnosis.comparison.prepared)


@pytest.fixture(scope="module")
def plan(rivals):
    return next_test(rivals, own_limits(rivals.fits, rivals.present, 2.0))


def test_no_test_breaks_the_limits_under_any_rival(rivals):
    own = own_limits(rivals.fits, rivals.present)
    limits = Limits(1.7 * own.force, 1.3 * own.displacement, 0.6 * own.length)
    found = allowed(rivals.fits, rivals.present, limits)
    assert len({(d.kind, d.place) for d in found}) > 8
    for design in found:
        assert design.length <= limits.length
        (written,) = driving(rivals.present, design, rivals.prepared.every).values()
        assert float(np.max(np.abs(written))) <= limits.force * (1.0 + 1e-9)
        for fit in rivals.fits:
            shown = respond(fit, design, [Sensor("", "displacement")])[0]
            assert float(np.max(np.abs(between_samples(shown[:, 0], 4)))) <= limits.displacement


def test_a_multisine_keeps_the_limit_between_its_samples(rivals):
    design = rivals.present.design(MULTISINE, AS_WAS, 2000, 1.0)
    peak = float(np.max(np.abs(between_samples(design.record["force"], 8))))
    assert peak == pytest.approx(float(rivals.present.peaks[0]), rel=1e-9)


def test_a_distance_grows_with_the_length_and_vanishes_between_twins(rivals):
    whole, half = (rivals.present.design(MULTISINE, "about resonance", n, 1.5) for n in (4000, 2000))
    one, other = rivals.distances(whole), rivals.distances(half)
    assert float(np.sum(one[0, 1])) > float(np.sum(other[0, 1])) > 0.0
    same = rivals_of([rivals.rows[0], rivals.rows[0]], rivals.prepared)
    assert float(np.max(same.distances(whole))) < 1e-6
    assert float(np.min(same.decided(same.distances(whole)))) < 0.01


def test_a_distance_is_the_difference_of_two_fits(rivals):
    """Of the squares that both leave of the answer of one, each with what this record tells of its coefficients."""
    design = rivals.present.design(SWEEP, "about resonance", 3000, 1.5)
    left = rivals.left(design, 0, 1)
    assert 0.0 < float(np.sum((left / rivals.size) ** 2)) <= float(np.sum(rivals.distances(design)[0, 1])) * 1.05


def test_what_is_known_weighs_as_its_covariance():
    covariance = np.array([[4.0, 1.0], [1.0, 1.0]])
    root = root_of_inverse(covariance)
    np.testing.assert_allclose(root.T @ root, np.linalg.inv(covariance), rtol=1e-9)


def test_the_test_that_is_proposed_decides_and_the_same_again_does_not(plan):
    assert plan.choice.promise >= DECIDES
    assert plan.choice.rehearsed >= 6
    assert plan.again is not None
    assert plan.again.promise < 0.8
    said = next_test_in_words(plan)
    assert "decides between" in said
    assert "a repetition of this record's test" in said


def test_a_rehearsal_is_a_record_of_the_test_with_the_noise_of_this_one(rivals, plan):
    record = simulated(rivals, plan.choice, 0, np.random.default_rng(3))
    clean = respond(rivals.fits[0], plan.choice.design, [Sensor("", "displacement")])[0][:, 0]
    assert set(record.channels) == {"force", "displacement"}
    noise = float(np.std(np.diff(record["displacement"] - clean))) / np.sqrt(2.0)
    assert noise == pytest.approx(rivals.noise_of(None)[Sensor("", "displacement")], rel=0.15)


def test_a_test_that_separates_nothing_is_not_promised_after_rehearsals(rivals):
    """Sensitivities may say what they like: what the fits say counts."""
    quiet = rivals.present.design(AS_WAS, AS_WAS, len(rivals.present.source) // 4, 0.3)
    lofty = Choice(quiet, None, np.full((2, 2), 0.999), np.full(2, 0.999))
    assert rehearsed(rivals, lofty, 2).promise < 0.5


@pytest.mark.long
def test_the_true_rival_stands_alone_after_the_test(trial, rivals, plan):
    record = measured_in(trial, rivals, plan.choice, np.random.default_rng(5))
    comparison = compare_records([trial.record, record], trial.believed).comparison
    found = diagnose(comparison, without=[n for n in LIBRARY if n not in TWINS and n not in trial.believed])
    assert [row.name for row in found.sets] == list(trial.hidden)


def test_the_files_hold_the_force_in_its_unit(plan):
    printed, files = deciding_plan(plan)
    assert set(files) == {"plan.json", "next_test.csv", "next_test.wav", "next_test.png", "next_test.svg"}
    fields = json.loads(files["plan.json"])
    heading, *lines = files["next_test.csv"].decode().splitlines()
    assert heading == "time [s],base_acceleration [m/s^2]", "the table's own acceleration, not the force it stands for"
    values = np.array([line.split(",") for line in lines], dtype=float)
    design = plan.choice.design
    np.testing.assert_allclose(values[:: plan.rivals.prepared.every, 1], -design.record["force"], rtol=1e-6, atol=1e-9)
    with wave.open(io.BytesIO(files["next_test.wav"])) as sound:
        assert sound.getframerate() == fields["wav"]["rate_hz"]
    assert f"{fields['wav']['full_scale']:.6g}" in printed
    assert fields["promise"] == plan.choice.promise


@pytest.mark.parametrize("dt", [0.01, 0.0123])
def test_a_wav_file_is_the_signal_over_its_full_scale(dt):
    time = dt * np.arange(600)
    signal = 3.7 * np.sin(2.0 * np.pi * 2.0 * time)
    data, rate, scale = as_wav([signal, 0.5 * signal], dt)
    with wave.open(io.BytesIO(data)) as sound:
        assert (sound.getnchannels(), sound.getsampwidth(), sound.getframerate()) == (2, 4, rate)
        numbers = np.frombuffer(sound.readframes(sound.getnframes()), "<i4").reshape(-1, 2)
    assert 0.0 <= rate - 1.0 / dt < 1.0
    shown = numbers / (2.0**31 - 1.0) * scale
    wanted = 3.7 * np.sin(2.0 * np.pi * 2.0 * np.arange(len(shown)) / rate)
    np.testing.assert_allclose(shown[40:-40, 0], wanted[40:-40], atol=0.02)
    np.testing.assert_allclose(shown[:, 1], 0.5 * shown[:, 0], atol=1e-6)


def test_an_interval_becomes_as_narrow_as_was_said(trial, rivals):
    """The fit to this record and the test: its standard errors beside those that were expected."""
    fit, prepared = rivals.fits[0], rivals.prepared
    own = own_limits((fit,), rivals.present)
    key = next(key for key in fit.keys if key not in trial.believed.values)
    now = precise_test(fit, prepared, key, 0.9, (None, None, None)).now
    found = precise_test(fit, prepared, key, 0.5 * now, (3.0 * own.force, 3.0 * own.displacement, None))
    assert found.width <= 0.5 * now
    record = simulated(rivals, Choice(found.design, None, np.ones((2, 2)), np.ones(2)), 0, np.random.default_rng(8))
    joint = following.judged_together(rivals, record, alone=False)
    both = fit_part(fit.model, joint, fit.held, steps=fit.steps_per_sample)
    at = both.keys.index(key)
    assert found.width == pytest.approx(1.96 * float(np.sqrt(both.covariance[at, at])) / found.value, rel=0.25)
    assert "95 % interval" in precise_plan(found)[0]
    assert "already" not in precise_plan(found)[0]
    assert f"tells {key} to +- " in precise_plan(replace(found, wanted=2.0 * now))[0]  # and no test is needed


def test_nothing_pulls_at_what_stands_on_a_table_whose_acceleration_is_written(rivals):
    assert LET_GO not in {kind for kind, _ in rivals.present.kinds}
    assert driving(rivals.present, rivals.present.design(AS_WAS, AS_WAS, 500, 1.0), 1).keys() == {"base_acceleration"}


def test_a_table_is_limited_in_its_acceleration_whatever_stands_on_it(rivals):
    heavy = replace(rivals.present, peaks=5.0 * rivals.present.peaks, scale=-5.0)
    assert heavy.reached == pytest.approx(rivals.present.reached)
    design = heavy.design(MULTISINE, AS_WAS, 500, 1.0)
    (written,) = driving(heavy, design, heavy.every).values()
    assert float(np.max(np.abs(written))) == pytest.approx(heavy.largest(design.record))
    np.testing.assert_allclose(written[:: heavy.every], -design.record["force"] / 5.0)
    assert heavy.unit == "m/s^2"


@pytest.mark.parametrize(
    ("force", "displacement", "length", "says"),
    [
        (1e-12, 1e-18, None, "allow no test"),
        (None, None, 0.001, "the largest length of a test .--max-length. is 0.001 s"),
    ],
)
def test_limits_that_allow_nothing_are_one_sentence(rivals, force, displacement, length, says):
    own = own_limits(rivals.fits, rivals.present)
    limits = Limits(force or own.force, displacement or own.displacement, length or own.length)
    with pytest.raises(StudyError, match=says):
        next_test(rivals, limits, rehearsals=0)


def test_an_unknown_sensor_is_one_sentence(rivals, plan):
    with pytest.raises(
        StudyError, match="'roof displacement' is no sensor beside those of the record; expected one of"
    ):
        next_test(rivals, plan.limits, sensors=["roof displacement"])


def test_no_tie_is_one_sentence(diagnosis):
    with pytest.raises(StudyError, match="nothing is tied with another; expected a record"):
        tied_rows(replace(diagnosis, sets=diagnosis.sets[:1]))


def test_a_value_that_is_not_fitted_is_one_sentence(rivals):
    with pytest.raises(StudyError, match="'k9' is no fitted value"):
        precise_test(rivals.fits[0], rivals.prepared, "k9", 0.05, (None, None, None))


def test_the_diagnosis_names_the_test(diagnosis):
    found = following.suggested(diagnosis)
    assert found is not None
    assert found is following.suggested(diagnosis), "it is found once"
    assert limit_share(found.rivals.fits, found.rivals.present, found.choice.design, found.limits) <= 1.0


def test_the_command_writes_the_plan(trial, tmp_path, capsys):
    record, model, _ = write_trial(trial, tmp_path)
    others = [name for name in LIBRARY if name not in TWINS and name not in trial.believed]
    words = ["plan", str(record), "--model", str(model), "--out", str(tmp_path / "plan"), "--max-force", "3"]
    words += [word for name in others for word in ("--without", name)]
    assert cli.main(words) == 0
    assert "decides between" in capsys.readouterr().out
    assert json.loads((tmp_path / "plan" / "plan.json").read_text())["limits"]["force"] == 3.0
    assert cli.main([*words, "--precision", "c=banana"]) == 2
    assert "is no value and width such as k3=5%" in capsys.readouterr().err
    assert cli.main([*words, "--sensor", "roof displacement"]) == 2
    told = capsys.readouterr().err
    assert "'roof displacement' is no motion of the model; expected one of displacement, velocity, acceleration" in told
    assert "diagnosing" not in told, "at once"


def test_the_distance_that_is_needed_is_the_one_of_the_constants():
    """T = 86 decides with 95 % at three standard errors."""
    from scipy.special import ndtri

    assert (2.0 * (K + float(ndtri(0.95)))) ** 2 == pytest.approx(86.3, abs=0.1)


def test_a_notebook_has_the_same_plan(diagnosis, plan, tmp_path):
    own = plan.limits
    found = planned(diagnosis, (own.force, own.displacement, own.length), None)
    assert found.promise == pytest.approx(plan.choice.promise, abs=0.05)
    assert list(found.to_frame().columns) == ["base_acceleration"]
    assert "decides between" in found.says
    assert "told from" in found.table()
    found.save(tmp_path / "plan")
    assert (tmp_path / "plan" / "next_test.wav").is_file()
    with pytest.raises(StudyError, match="expected one value and a share of it"):
        planned(diagnosis, (None, None, None), {"c": 0.1, "k": 0.1})


def test_the_page_shows_what_each_rival_would_answer_and_nothing_where_there_is_no_tie(diagnosis):
    stage = replace(begin_with(Accounted.as_compared(diagnosis.comparison)).now, diagnosis=diagnosis)
    shown = with_next_test(stage)
    assert shown.next_test.startswith(b"\x89PNG")
    assert "src='data:image/png;base64," in words(shown, 0, live=False)["next-test"]
    alone = replace(diagnosis, sets=diagnosis.sets[:1])
    assert words(with_next_test(replace(stage, diagnosis=alone)), 0, live=False)["next-test"] == ""
