"""Local polynomials: one transform of the whole record, no window, and no leakage of the record's ends."""

from study.equations.model import Model
from study.identify.estimators.base import Identified, Settings, named_parameters
from study.identify.frequency_domain.inputs import Input, histories, reverse_inputs
from study.identify.frequency_domain.local_polynomial_fit import fit_local_polynomial
from study.identify.frequency_domain.local_polynomial_method import Lines, local_polynomial_responses, transform
from study.records.record import Record


def identify(model: Model, record: Record, settings: Settings) -> Identified:
    """A_j(f) of every input in narrow bands, and coefficients from all lines of the band that is fitted."""
    inputs = reverse_inputs(model)
    return identify_lines(inputs, transform([*histories(inputs, record), record["force"]], record.dt), settings)


def identify_lines(inputs: tuple[Input, ...], lines: Lines, settings: Settings) -> Identified:
    """The same for the transforms of any inputs and, last, of what they make up."""
    estimate = fit_local_polynomial(lines, inputs, settings.band, settings.local_polynomial)
    return Identified(
        inputs, local_polynomial_responses(lines, settings.local_polynomial), named_parameters(estimate), estimate
    )
