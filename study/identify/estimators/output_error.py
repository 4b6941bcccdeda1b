"""Output error: the model runs free under the measured force and is fitted to the measured displacement."""

from collections.abc import Collection
from dataclasses import replace
from functools import lru_cache

import numpy as np

from study.equations.model import Model
from study.identify.estimators.base import Identified, Settings, named_parameters
from study.identify.frequency_domain import from_coefficients
from study.identify.frequency_domain.coefficients import Estimate
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.free_run_fit import FreeRunFit, fit_free_run
from study.identify.time_domain.multiple_shooting import CLEAN
from study.records import spectra
from study.records.prepared import whole
from study.records.record import Record
from study.support.errors import DivergenceError

KEPT = 4  # cached fits: those of the records that the threads are working on
REFINED = 12  # free runs in which a fit follows a change of steps


def identify(model: Model, record: Record, settings: Settings) -> Identified:
    """Coefficients, and shape parameters that the model leaves open; A_j(f) of the form that they give it."""
    free_run = free_run_fit(model, record)
    inputs, estimate = reverse_inputs(free_run.model), free_run.estimate
    matrix = spectra.cross_spectra([*histories(inputs, record), record["force"]], record.dt, settings.segments)
    result = from_coefficients.responses_with_errors(inputs, estimate, matrix)
    note = "" if free_run.converged else free_run.message
    return Identified(inputs, result, named_parameters(estimate), estimate, note)


def shapes_of(fit: FreeRunFit, keys: Collection[str]) -> Estimate:
    """Of what a fit estimated, the shape parameters of these names."""
    places = [i for i, key in enumerate(fit.keys) if key in keys]
    symbols = tuple(fit.keys[i] for i in places)
    return Estimate(symbols, fit.values[places], fit.covariance[places][:, places])


@lru_cache(maxsize=KEPT)
def free_run_fit(model: Model, record: Record) -> FreeRunFit:
    """The fit in free run behind the estimate; cached, as the instruments use the same one.

    Coefficients of the model are left open, shape parameters that it gives are held.
    """
    opened = model.with_values({key: None for key in model.values if "." not in key})
    return with_step_error(fit_model(opened, whole(record)), record, opened.held_keys)


def with_step_error(fit: FreeRunFit, record: Record, held: Collection[str]) -> FreeRunFit:
    """The fit with the error of the integrator added to its covariance, where there is hardly any noise.

    Without noise the residual is the integrator's own error. That of a Runge-Kutta run falls to a sixteenth with
    halved steps, so halving them moves the estimates by fifteen sixteenths of their error. Continuity constraints
    are dropped for it, which can only add to the change.
    """
    if fit.rms >= CLEAN * float(np.std(record["displacement"])):
        return fit
    try:
        finer = fit_free_run(
            fit.model, record, held=held, steps_per_sample=2 * fit.steps_per_sample, restarts=fit.restarts,
            initial=fit.initial, max_iterations=REFINED,
        )  # fmt: skip
    except DivergenceError:
        return fit
    moved = finer.values - fit.values
    return replace(fit, covariance=fit.covariance + np.outer(moved, moved))
