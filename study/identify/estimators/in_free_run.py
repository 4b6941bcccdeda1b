"""Estimators that rest on a fit in free run: the model runs under the measured force, held against the measured motion.

Coefficients of the model are ignored; shape parameters that it gives are held, those that it leaves open are found.
"""

from collections.abc import Collection
from dataclasses import replace
from functools import lru_cache

import numpy as np

from study.equations.free_run import prepare
from study.equations.model import Model
from study.identify.estimators.base import Identified, Settings, named_parameters
from study.identify.estimators.in_reverse import miso
from study.identify.frequency_domain import instruments
from study.identify.frequency_domain.coefficients import Estimate, fitted_functions, responses_with_errors
from study.identify.frequency_domain.conditioned import analyse
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.multiple_shooting import CLEAN
from study.identify.time_domain.part_fit import integration_shift, run_and_slopes
from study.records import spectra
from study.records.prepared import Prepared, whole
from study.records.record import ALONE, MOTIONS, Record, Sensor

FITS_KEPT = 4  # those of the records that the threads are working on


def output_error(model: Model, record: Record, settings: Settings) -> Identified:
    """Coefficients and open shape parameters of the fit itself; A_j(f) of the form that they give it."""
    fit = free_run_fit(model, record)
    inputs, result = reverse_inputs(fit.model), None
    if settings.curves:
        matrix = spectra.cross_spectra([*histories(inputs, record), record["force"]], record.dt, settings.segments)
        result = responses_with_errors(inputs, fit.estimate, matrix)
    return Identified(inputs, result, named_parameters(fit.estimate), fit.estimate, _note(fit))


def instrumental(model: Model, record: Record, settings: Settings) -> Identified:
    """A_j(f) with the fitted model's motion as instrument, without the bias from noise on the response.

    Coherences are those of the force with the inputs along that motion, which has no noise.
    """
    fit = free_run_fit(model, record)
    inputs, clean = reverse_inputs(fit.model), clean_motion(fit, record)
    values = instruments.channels(inputs, record, clean)
    matrix = spectra.cross_spectra(values, record.dt, settings.segments)
    estimate = instruments.fit_with_instruments(
        matrix, inputs, settings.band, fitted_functions(inputs, fit.estimate, matrix.frequency),
        instruments.stretches(values, record.dt, settings.segments),
    )  # fmt: skip
    shapes = _shapes_of(fit, [key for key in model.values if "." in key])
    named = (*named_parameters(estimate), *named_parameters(shapes))
    found = Identified(inputs, None, named, estimate, _note(fit), shapes)
    if not settings.curves:
        return found
    coherences = analyse(
        spectra.cross_spectra([*histories(inputs, clean), record["force"]], record.dt, settings.segments)
    )
    return replace(found, responses=instruments.instrumental_responses(matrix), analysis=coherences)


def miso_free_shape(model: Model, record: Record, settings: Settings) -> Identified:
    """The report's MI/SO where u_g or f_m is unknown: shape parameters, even those given, from the fit.

    Nothing for a model that has none.
    """
    shapes = tuple(key for key in model.values if "." in key)
    if not shapes:
        return Identified((), None, ())
    fit = free_run_fit(model.with_values(dict.fromkeys(shapes)), record)
    result = miso(model.with_values({key: fit.estimate[key] for key in shapes}), record, settings)
    own = _shapes_of(fit, shapes)
    named = (*result.parameters, *named_parameters(own))
    return Identified(result.inputs, result.responses, named, result.estimate, _note(fit), own)


def _note(fit: FreeRunFit) -> str:
    return "" if fit.converged else fit.message


def _shapes_of(fit: FreeRunFit, keys: Collection[str]) -> Estimate:
    """Of what a fit estimated, the shape parameters of these names."""
    places = [i for i, key in enumerate(fit.keys) if key in keys]
    return Estimate(tuple(fit.keys[i] for i in places), fit.values[places], fit.covariance[places][:, places])


def clean_motion(fit: FreeRunFit, record: Record) -> Record:
    """The record with displacement and velocity of the fitted model in free run."""
    sensors = [Sensor(ALONE, name) for name in MOTIONS[:2]]
    run = prepare(fit.model, record, sensors=sensors, steps_per_sample=fit.steps_per_sample, restarts=fit.restarts)
    motions = np.ascontiguousarray(run.respond_by_segment({}, fit.initial)[0].T)
    return record.with_channels(dict(zip(MOTIONS, motions, strict=False)))


@lru_cache(maxsize=FITS_KEPT)
def free_run_fit(model: Model, record: Record) -> FreeRunFit:
    """The fit in free run behind the estimate; cached, as several estimators use the same one."""
    opened = model.with_values({key: None for key in model.values if "." not in key})
    prepared = whole(record)
    return with_step_error(fit_model(opened, prepared), prepared)


def with_step_error(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit with the error of the integrator added to its covariance, where there is hardly any noise.

    Without noise the residual is the integrator's own error. That of a Runge-Kutta run falls to a sixteenth with
    halved steps, so halving them moves the estimates by fifteen sixteenths of their error. Continuity constraints
    are dropped for it, which can only add to the change.
    """
    if fit.rms >= CLEAN * prepared.spread:
        return fit
    moved = integration_shift(fit, prepared, *run_and_slopes(fit, prepared))[: len(fit.keys)]
    return replace(fit, covariance=fit.covariance + np.outer(moved, moved))
