"""Instruments from a free run: A_j(f) line by line, without the bias from noise on the response."""

from study.equations.free_run import prepare
from study.equations.model import Model
from study.identify.estimators import output_error
from study.identify.estimators.base import Identified, Settings, named_parameters
from study.identify.frequency_domain import conditioned, from_coefficients, instruments
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.records import spectra
from study.records.outputs import alone
from study.records.record import MOTIONS, Record


def identify(model: Model, record: Record, settings: Settings) -> Identified:
    """A_j(f) with the fitted model's motion as instrument, then coefficients as from MI/SO.

    Coherences are those of the force with the inputs along that motion, which has no noise.
    """
    fit = output_error.free_run_fit(model, record)
    inputs = reverse_inputs(fit.model)
    clean = clean_motion(fit, record)
    values = instruments.channels(inputs, record, clean)
    matrix = spectra.cross_spectra(values, record.dt, settings.segments)
    estimate = instruments.fit_with_instruments(
        matrix, inputs, settings.band, from_coefficients.fitted_functions(inputs, fit.estimate, matrix.frequency),
        instruments.stretches(values, record.dt, settings.segments),
    )  # fmt: skip
    note = "" if fit.converged else fit.message
    own = spectra.cross_spectra([*histories(inputs, clean), record["force"]], record.dt, settings.segments)
    shapes = output_error.shapes_of(fit, [key for key in model.values if "." in key])
    named = (*named_parameters(estimate), *named_parameters(shapes))
    return Identified(
        inputs, instruments.instrumental_responses(matrix), named, estimate, note, shapes, conditioned.analyse(own)
    )


def clean_motion(fit: FreeRunFit, record: Record) -> Record:
    """The record with displacement and velocity of the fitted model in free run."""
    motions = {
        name: prepare(
            fit.model, record, sensors=alone(name).sensors, steps_per_sample=fit.steps_per_sample, restarts=fit.restarts
        ).respond_by_segment({}, fit.initial)[0][:, 0]
        for name in MOTIONS[:2]
    }
    return record.with_channels(motions)
