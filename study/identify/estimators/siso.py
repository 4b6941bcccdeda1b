"""Single input, single output: the best linear fit, what the report's dashed curves show."""

from study.equations.model import Model
from study.identify.estimators.base import Identified, Settings
from study.identify.estimators.miso import identify_inputs
from study.identify.frequency_domain.inputs import Input, reverse_inputs
from study.records.record import Record


def identify(model: Model, record: Record, settings: Settings) -> Identified:
    """Fit L_1(f) = G_1y / G_11, (4.23), as if the system were linear."""
    return identify_inputs(tuple(i for i in reverse_inputs(model) if is_linear(i)), record, settings)


def is_linear(item: Input) -> bool:
    """Whether an input is the motion itself."""
    return item.shape == "u"
