"""Noise on force and response: records with several periods of the same excitation."""

from study.equations.model import Model
from study.identify.estimators.base import Identified, Settings, named_parameters
from study.identify.frequency_domain.inputs import reverse_inputs
from study.identify.frequency_domain.periodic import fit_periodic, steady
from study.records.record import Record


def identify(model: Model, record: Record, settings: Settings) -> Identified:
    """Coefficients by averages of periods, instruments from other periods, weights from the scatter between them."""
    inputs = reverse_inputs(model)
    estimate = fit_periodic(steady(record, settings.settle_periods), inputs, settings.band)
    return Identified(inputs, None, named_parameters(estimate), estimate)
