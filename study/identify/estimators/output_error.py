"""Output error: the model runs free under the measured force and is fitted to the measured displacement."""

from collections.abc import Collection
from dataclasses import replace
from functools import lru_cache

import numpy as np

from study.equations.model import Model
from study.identify.estimators import miso
from study.identify.estimators.base import Identified, Settings, named_parameters
from study.identify.frequency_domain import from_coefficients
from study.identify.frequency_domain.coefficients import Estimate
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.time_domain import held_out
from study.identify.time_domain.free_run_fit import FreeRunFit, fit_free_run
from study.identify.time_domain.multiple_shooting import CLEAN, astray, fit_record
from study.identify.time_domain.open_shapes import shape_keys, with_starting_shapes
from study.records import spectra
from study.records.plan import Plan
from study.records.record import Record
from study.support.errors import DivergenceError

KEPT = 4  # fits: those of the records that the threads are at
REFINED = 12  # free runs in which a fit follows a change of steps


def identify(model: Model, record: Record, settings: Settings) -> Identified:
    """Coefficients, and shape parameters that the model leaves open; A_j(f) of the form that they give it."""
    found = fit(model, record, settings)
    inputs, estimate = reverse_inputs(found.model), found.estimate
    matrix = spectra.cross_spectra([*histories(inputs, record), record["force"]], record.dt, settings.segments)
    result = from_coefficients.responses(inputs, estimate, matrix)
    note = "" if found.converged else found.message
    return Identified(inputs, result, named_parameters(estimate), estimate, note)


def shapes_of(found: FreeRunFit, keys: Collection[str]) -> Estimate:
    """Of what a fit estimated, the shape parameters of these names."""
    places = [i for i, key in enumerate(found.keys) if key in keys]
    symbols = tuple(found.keys[i] for i in places)
    return Estimate(symbols, found.values[places], found.covariance[places][:, places])


@lru_cache(maxsize=KEPT)
def fit(model: Model, record: Record, settings: Settings) -> FreeRunFit:
    """The fit in free run that the estimate is made of; kept a while, for instruments rest on the same one.

    The search begins with the MI/SO estimate, or where shape parameters are open with what their search found.
    Where that leads nowhere, as under much noise, or with inputs that it cannot tell apart, the search
    begins anew with the best linear approximation.

    Raises
    ------
    DivergenceError
        If the model diverges from both starts.
    StudyError
        If force and displacement have nothing in common.
    """
    held = shape_keys(model)
    return with_step_error(_searched(model, record, settings, held), record, held)


def with_step_error(found: FreeRunFit, record: Record, held: Collection[str]) -> FreeRunFit:
    """The fit with what the steps of its free run add to its covariance, where there is hardly any noise.

    Without noise the residual is the integrator's own error. That of a Runge-Kutta run falls to a sixteenth with
    halved steps, so the estimates move from these steps to those by fifteen sixteenths of what is wrong with them.
    Pieces that were tied are let go for it, which can only add.
    """
    if found.rms >= CLEAN * float(np.std(record["displacement"])):
        return found
    try:
        finer = fit_free_run(
            found.model, record, held=held, steps_per_sample=2 * found.steps_per_sample, restarts=found.restarts,
            initial=found.initial, max_iterations=REFINED,
        )  # fmt: skip
    except DivergenceError:
        return found
    moved = finer.values - found.values
    return replace(found, covariance=found.covariance + np.outer(moved, moved))


def _searched(model: Model, record: Record, settings: Settings, held: tuple[str, ...]) -> FreeRunFit:
    """The fit by whichever start leads to it."""
    begun = with_starting_shapes(model, record)
    start = _reverse(model, record, settings) if begun is model else {}
    try:
        found = fit_record(begun, record, start=start, held=held)
    except DivergenceError:
        return fit_record(begun, record, start=_linear(begun, record), held=held)
    if found.converged or not astray(found, record["displacement"]):
        return found
    try:
        again = fit_record(begun, record, start=_linear(begun, record), held=held)
    except DivergenceError:
        return found
    return again if again.rms < found.rms else found


def _reverse(model: Model, record: Record, settings: Settings) -> dict[str, float]:
    """Coefficients by MI/SO."""
    found = miso.identify(model, record, settings).estimate
    assert found is not None  # MI/SO finds all coefficients together
    return dict(zip(found.symbols, (float(v) for v in found.values), strict=True))


def _linear(model: Model, record: Record) -> dict[str, float]:
    """Coefficients of the best linear approximation, and none of the others."""
    everything = Plan("displacement", (0, len(record)), (0, len(record)))
    start = held_out.linear_start(model, record, everything)
    return {key: value for key, value in start.items() if "." not in key}
