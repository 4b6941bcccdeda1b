"""Fits in segments: chaotic systems, starts that are far off, and when one run will do."""

import numpy as np
import pytest
from numpy.typing import NDArray

from study.equations.model import Model
from study.identify.frequency_domain import coefficients
from study.identify.frequency_domain.conditioned import analyse
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.time_domain.free_run_fit import FreeRunFit, fit_free_run
from study.identify.time_domain.multiple_shooting import fit_in_segments
from study.identify.time_domain.shooting import REACHES, ShootingSegments
from study.records.excitation import displacement_noise
from study.records.outputs import DISPLACEMENT
from study.records.record import Record
from study.records.spectra import Segments, cross_spectra
from study.records.states import starting_states

Floats = NDArray[np.float64]


def numbers(model: Model) -> dict[str, float]:
    return {key: float(value) for key, value in model.values.items() if value is not None}


def known(model: Model, fit: FreeRunFit) -> Floats:
    return np.array([numbers(model)[key] for key in fit.keys])


def error_in_standard_errors(model: Model, fit: FreeRunFit) -> Floats:
    return (fit.values - known(model, fit)) / np.sqrt(np.diag(fit.covariance))


def started(model: Model, record: Record) -> dict[str, float]:
    """What MI/SO makes of the record."""
    inputs, cut = reverse_inputs(model), Segments()
    responses = analyse(cross_spectra([*histories(inputs, record), record["force"]], record.dt, cut))
    estimate = coefficients.fit_coefficients(responses, inputs, (0.3, 10.0), cut.line_inflation())
    return dict(zip(estimate.symbols, (float(v) for v in estimate.values), strict=True))


def noisy(record: Record, fraction: float, seed: int) -> Record:
    clean = record["displacement"]
    return record.with_channels({"displacement": clean + displacement_noise(clean, fraction, seed)})


def test_a_regular_system_needs_no_pieces(systems: dict[str, Model], records: dict[str, Record]) -> None:
    """... but they find the way from a start which a single free run does not survive."""
    model, record = systems["duffing_van_der_pol"], noisy(records["duffing_van_der_pol"], 0.05, 4).part(0, 2048)
    far = {"m": 3.0, "c": 1.0, "k": 100.0, "k3": 0.0, "c3": 0.0}
    assert not fit_free_run(model, record, start=far).converged
    fit = fit_in_segments(model, record, start=far)
    assert fit.converged
    near = fit_free_run(model, record)
    np.testing.assert_allclose(fit.values, near.values, rtol=1e-4)
    assert fit.initial.shape == (2,)


def test_first_states_are_the_best_of_several_widths(systems: dict[str, Model], records: dict[str, Record]) -> None:
    model, record, cuts = systems["duffing"], noisy(records["duffing"], 0.05, 2), (100, 200, 300)
    pieces = ShootingSegments(record, DISPLACEMENT, (0, 400), cuts, 4)
    begun = pieces.misfits(model, pieces.first_states(model))
    for reach in REACHES:
        one = starting_states(record, DISPLACEMENT, (0, *cuts), reach)
        assert np.all(begun <= pieces.misfits(model, one))


def test_tied_pieces_are_one_motion(systems: dict[str, Model], records: dict[str, Record]) -> None:
    """... with the estimates and the covariance of a free run; loose ones know less."""
    model, record = systems["duffing"], noisy(records["duffing"], 0.05, 2).part(0, 2048)
    whole, cuts = fit_free_run(model, record), tuple(range(128, 2048, 128))
    states = starting_states(record, DISPLACEMENT, (0, *cuts))
    loose = fit_free_run(model, record, restarts=cuts, initial=states)
    tied = fit_free_run(model, record, restarts=cuts, initial=loose.initial, continuity=1000.0)
    assert tied.converged
    deviations = np.sqrt(np.diag(whole.covariance))
    assert np.max(np.abs(tied.values - whole.values) / deviations) < 0.01
    np.testing.assert_allclose(np.sqrt(np.diag(tied.covariance)), deviations, rtol=0.01)
    assert np.all(np.sqrt(np.diag(loose.covariance)) > deviations)
    assert tied.residual.shape == whole.residual.shape


def test_chaotic_system_is_fitted_in_pieces(systems: dict[str, Model], records: dict[str, Record]) -> None:
    """The Dead-Band system: a whole free run is hopeless, pieces recover it, the width of the gap included."""
    model, record = systems["dead_band"], noisy(records["dead_band"], 0.05, 3).part(0, 4096)
    start = {**started(model, record), "dead_band.u_g": 0.0028}
    whole = fit_free_run(model, record, start=start, steps_per_sample=4)
    noise = np.sqrt(0.05) * np.std(records["dead_band"]["displacement"])
    assert whole.rms > 1.5 * noise
    fit = fit_in_segments(model, record, start=start, steps_per_sample=4)
    assert fit.rms < 1.05 * noise
    assert fit.initial.ndim == 2
    assert np.max(np.abs(error_in_standard_errors(model, fit))) < 4.0
    assert fit.estimate["dead_band.u_g"] == pytest.approx(0.0025, rel=0.02)
