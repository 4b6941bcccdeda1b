"""Single input, single output: the best linear fit, what the report's dashed curves show."""

from study.equations.model import Model
from study.identify.estimators.base import Identified, Settings, named_parameters
from study.identify.frequency_domain import coefficients, conditioned
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.records import spectra
from study.records.record import Record


def identify(model: Model, record: Record, settings: Settings) -> Identified:
    """Fit L_1(f) = G_1y / G_11, (4.23), as if the system were linear."""
    inputs = tuple(i for i in reverse_inputs(model) if i.shape == "u")
    matrix = spectra.cross_spectra([*histories(inputs, record), record["force"]], record.dt, settings.segments)
    result = conditioned.analyse(matrix)
    estimate = coefficients.fit(result, inputs, settings.band, settings.segments.line_inflation())
    return Identified(inputs, result, named_parameters(estimate), estimate)
