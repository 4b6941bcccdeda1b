"""The report's estimator: conditioned spectra of all inputs, parameters by weighted least squares."""

from study.equations.model import Model
from study.identify.estimators.base import Identified, Settings, named_parameters
from study.identify.frequency_domain import coefficients, conditioned
from study.identify.frequency_domain.inputs import Input, histories, reverse_inputs
from study.records import spectra
from study.records.record import Record


def identify(model: Model, record: Record, settings: Settings) -> Identified:
    """A_j(f) of every input by (4.23) to (4.28), then coefficients with Bendat-Piersol standard errors."""
    return identify_inputs(reverse_inputs(model), record, settings)


def identify_inputs(inputs: tuple[Input, ...], record: Record, settings: Settings) -> Identified:
    """The same for any inputs."""
    matrix = spectra.cross_spectra([*histories(inputs, record), record["force"]], record.dt, settings.segments)
    result = conditioned.analyse(matrix)
    estimate = coefficients.fit_coefficients(result, inputs, settings.band, settings.segments.line_inflation())
    return Identified(inputs, result, named_parameters(estimate), estimate)
