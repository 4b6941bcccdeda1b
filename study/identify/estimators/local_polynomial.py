"""Local polynomials: one transform of the whole record, no window, and no leakage of the record's ends."""

from study.equations.model import Model
from study.identify.estimators.base import Identified, Settings, named_parameters
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.frequency_domain.local_polynomial_fit import fit
from study.identify.frequency_domain.local_polynomial_method import responses, transform
from study.records.record import Record


def identify(model: Model, record: Record, settings: Settings) -> Identified:
    """A_j(f) of every input in narrow bands, and coefficients from all lines of the band that is fitted."""
    inputs, bands = reverse_inputs(model), settings.local_polynomial
    lines = transform([*histories(inputs, record), record["force"]], record.dt)
    estimate = fit(lines, inputs, settings.band, bands)
    return Identified(inputs, responses(lines, bands), named_parameters(estimate), estimate)
