"""Errors in variables: noise on force and response does not bias what several periods tell."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.equations.simulate import Integrator, simulate
from study.identify import estimators
from study.identify.estimators.base import Settings
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.frequency_domain.periodic import Periods, fit_periodic, steady
from study.records.excitation import Excitation, force
from study.records.record import Record
from study.records.spectra import Segments
from study.reproduction.cases import identify_case
from study.reproduction.config import load_config
from study.support.errors import StudyError

BAND, SAMPLES, DT = (0.3, 10.0), 512, 0.02
TOLD = Settings(Segments(256), BAND)


def periodic(model, seed, periods=9, noise=0.0, samples=SAMPLES):
    """A record from rest, with white noise of this mean square on force and displacement."""
    one = force(Excitation("random_phase_multisine"), samples, DT, seed)
    record = simulate(model, np.tile(one, periods), DT, Integrator("rk4", 8))
    rng = np.random.default_rng(1000 + seed)
    noisy = {
        name: record[name] + np.sqrt(noise) * np.std(record[name]) * rng.standard_normal(len(record))
        for name in ("force", "displacement")
    }
    return replace(record.with_channels(noisy), period=samples)


def identified(model, record):
    return estimators.identify("errors_in_variables", model, record, TOLD).estimate


@pytest.mark.parametrize("system", ["linear", "duffing_van_der_pol"])
def test_without_noise_periods_tell_all(system, systems):
    estimate = identified(systems[system], periodic(systems[system], 1, samples=1024))
    truth = [1.0, 3.77, 355.3, 2e7, 2e6][: len(estimate.values)]
    np.testing.assert_allclose(estimate.values, truth, rtol=1e-4)


def test_noise_on_force_and_response_biases_nothing(systems):
    """5 % of the mean square on each, 8 periods: bias within its own error, which least squares misses by far."""
    model, values, plain, claimed = systems["duffing_van_der_pol"], [], [], []
    for seed in range(24):
        record = periodic(model, seed, noise=0.05)
        estimate = identified(model, record)
        values.append(estimate.values)
        claimed.append(np.sqrt(np.diag(estimate.covariance)))
        plain.append(least_squares(model, record))
    truth = np.array([1.0, 3.77, 355.3, 2e7, 2e6])
    scatter = np.std(values, axis=0, ddof=1)
    off = (np.mean(values, axis=0) - truth) / scatter * np.sqrt(len(values))
    assert np.all(np.abs(off) < 3.0), off
    ratio = np.sqrt(np.mean(np.square(claimed), axis=0)) / scatter
    assert np.all((ratio > 0.65) & (ratio < 1.5)), ratio
    naive = (np.mean(plain, axis=0) - truth) / np.std(plain, axis=0, ddof=1) * np.sqrt(len(plain))
    assert np.max(np.abs(naive)) > 8.0, naive


def least_squares(model, record):
    """What averaging alone gives: unweighted least squares on the mean period."""
    kept = steady(record, 1)
    mean = {name: kept[name].reshape(-1, SAMPLES).mean(axis=0) for name in ("force", "displacement")}
    inputs, frequency = reverse_inputs(model), np.fft.rfftfreq(SAMPLES, DT)
    keep = (frequency >= BAND[0]) & (frequency <= BAND[1])
    shapes = histories(inputs, replace(kept, channels=mean))
    columns = [np.fft.rfft(h)[:, None] * i.powers(frequency) for h, i in zip(shapes, inputs, strict=True)]
    design, output = np.concatenate(columns, axis=1)[keep], np.fft.rfft(mean["force"])[keep]
    size = np.linalg.norm(design, axis=0)
    stacked = np.concatenate([design.real, design.imag]) / size
    return np.linalg.lstsq(stacked, np.concatenate([output.real, output.imag]), rcond=None)[0] / size


def test_what_noise_adds_to_a_cube_is_taken_out(systems):
    """cos^3 has 3/4 at its own line; noise of variance 1 would add 3 / n to that of an average of n."""
    samples, line = 65536, 2000
    rng, wave = np.random.default_rng(1), np.cos(2.0 * np.pi * line * np.arange(samples) / samples)
    noisy = np.tile(wave, 4) + rng.standard_normal(4 * samples)
    record = Record(DT, {"displacement": noisy, "force": noisy}, period=samples)
    periods = Periods.of(record, reverse_inputs(systems["duffing"]), BAND)
    at = np.searchsorted(periods.keep, line)
    found = [shape(chosen)[at, 3].real / (0.5 * samples) for chosen in ((0, 1), (0, 1, 2, 3))
             for shape in (periods.columns, periods.unbiased)]  # fmt: skip
    np.testing.assert_allclose(found, [0.75 + 1.5, 0.75, 0.75 + 0.75, 0.75], atol=0.1)


def test_many_periods_are_grouped_and_help(systems):
    record = periodic(systems["duffing"], 3, periods=31, noise=0.05)
    few = identified(systems["duffing"], record.part(0, 9 * SAMPLES))
    many = identified(systems["duffing"], record)
    assert np.all(np.diag(many.covariance) < np.diag(few.covariance))


def test_an_odd_number_of_periods(systems):
    record = periodic(systems["duffing"], 3, periods=6, samples=1024)
    np.testing.assert_allclose(identified(systems["duffing"], record).values, [1.0, 3.77, 355.3, 2e7], rtol=1e-4)


def test_units_change_nothing(systems):
    record = periodic(systems["duffing"], 4, noise=0.05)
    other = record.with_channels({"displacement": 1e3 * record["displacement"]})
    one, two = identified(systems["duffing"], record), identified(systems["duffing"], other)
    np.testing.assert_allclose(two.values, one.values / np.array([1e3, 1e3, 1e3, 1e9]), rtol=1e-7)


def test_a_case_tells_the_period_that_its_table_has_lost(systems):
    record = replace(periodic(systems["linear"], 5), period=None)
    known = load_config(Path(__file__).parents[2] / "config").identification_settings(
        "linear", ("errors_in_variables",)
    )
    settings = known.model_copy(update={"also_assumed": "", "fit_band": BAND, "period": SAMPLES})
    found = identify_case(systems["linear"], record, settings)["errors_in_variables"]
    assert found.responses is None
    assert {p.name for p in found.parameters} == {"m", "c", "k", "f_n", "zeta"}


# ---- what cannot be done


def test_records_without_enough_periods(systems):
    record = periodic(systems["duffing"], 1, periods=4)
    for spoilt, says in (
        (replace(record, period=None), "has no period; errors_in_variables needs the samples of one"),
        (record.part(0, 2 * SAMPLES), "holds 2 periods of 512 samples; errors_in_variables needs 1 to settle and 2"),
        (record, "holds 3 steady periods; errors_in_variables needs 4 or more for nonlinear shapes"),
        (replace(record, period=500), "% of the force of duffing differs between periods of 500 samples"),
    ):
        with pytest.raises(StudyError, match=re.escape(says)):
            identified(systems["duffing"], spoilt)
    with pytest.raises(StudyError, match="a period of duffing has 12 lines from"):
        fit_periodic(replace(record, period=64), reverse_inputs(systems["duffing"]), BAND)


def test_shapes_that_differ_between_periods(systems):
    record = periodic(systems["mathieu"], 1)
    with pytest.raises(StudyError, match="of periodic_stiffness is not the same in every period"):
        identified(systems["mathieu"], record)
