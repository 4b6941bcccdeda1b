"""Coefficients that vary, found: along time, with a channel, in a step; and not where something else is missing."""

from pathlib import Path

import numpy as np
import pytest

from study.diagnose.confirmed_faults import diagnose_accounted
from study.diagnose.diagnosis_pictures import picture_files
from study.diagnose.diagnosis_sentences import diagnosis_sentences
from study.diagnose.varying_candidates import promise
from study.diagnose.verdict import MISSING
from study.equations.model_file import parse_model
from study.records.record import Record
from study.records.record_layout import Layout
from study.trials.varying import make_varying_trial
from study.way_in.compare_records import compare_records
from tests.public_records import DATA, needs


def diagnosed(kind, seed, **drawn):
    trial = make_varying_trial(kind, seed, **drawn)
    return trial, diagnose_accounted(compare_records([trial.record], trial.believed)).diagnosis


@pytest.mark.long
def test_a_stiffness_that_drifts_by_a_third_says_so_and_nothing_else():
    trial, found = diagnosed("drift", 4, of="linear_stiffness", change=-0.3, noise=0.01)
    assert found.verdict == MISSING
    assert found.answer.names == trial.hidden == ("linear_stiffness_over_time",)
    (one,) = found.varying
    assert one.symbol == "k"
    assert one.along == "time"
    assert "The model lacks linear stiffness that changes" in " ".join(diagnosis_sentences(found))
    assert "varying.png" in picture_files(found, trial.record.name)


@pytest.mark.long
def test_a_channel_is_named_where_it_explains_more_than_time_does():
    trial, found = diagnosed("schedule", 2, of="linear_stiffness", change=0.2, noise=0.01)
    assert found.answer.names == trial.hidden == ("linear_stiffness_over_load",)


def test_a_linear_system_and_a_cubic_one_promise_no_change_to_search_for():
    for kind in ("nothing", "nonlinear"):
        trial = make_varying_trial(kind, 3, noise=0.02)
        seen = promise(compare_records([trial.record], trial.believed).comparison)
        assert seen is None or not seen.alone


def beam():
    entries = ("inertia", "linear_damping", "linear_stiffness", "{term: linear_stiffness, varies_with: pin_location}")
    return parse_model("name: beam\nterms:\n" + "".join(f"  - {entry}\n" for entry in entries), Path("beam.yaml"))


def ten_steps():
    values = np.genfromtxt(DATA / "movable_support" / "ten_steps.csv", delimiter=",", skip_header=1)
    still = np.zeros(len(values))
    channels = {"force": still, "acceleration": values[:, 1], "pin_location": values[:, 3]}
    return Record(0.001, channels, {"acceleration": "V", "pin_location": "V"}, "ten_steps")


@pytest.mark.long
@needs("movable_support")
def test_the_stiffness_of_a_beam_follows_the_pin_of_its_support():
    """Free decays between moves: its frequencies at each place of the pin, out and back, are those of the README."""
    use = ((0.85, 1.83), (2.07, 3.0), (3.25, 4.19), (4.42, 5.4), (5.6, 6.57), (6.77, 7.74), (7.98, 8.92),
           (10.42, 11.29), (11.52, 13.9))  # fmt: skip
    found = compare_records([ten_steps()], beam(), Layout(use=use, cutoff=15.0)).comparison
    (one,) = found.varying
    pins, frequencies = (1.64, 2.08, 2.5, 2.93, 3.36), (28.1, 30.8, 34.0, 37.5, 42.0)
    shown = np.sqrt(np.interp(pins, one.at, one.value)) / (2.0 * np.pi)
    assert np.allclose(shown, frequencies, rtol=0.02)
    assert np.sqrt(one.value[0]) / (2.0 * np.pi) == pytest.approx(26.0, rel=0.03)  # the vaguest
