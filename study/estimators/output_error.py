"""Output error: the model runs free under the measured force and is fitted to the measured displacement."""

from functools import lru_cache

from study import parametric, spectra
from study.chaotic import fit_record
from study.estimators import miso
from study.estimators.base import Identified, Settings, named_parameters
from study.inputs import histories, reverse_inputs
from study.model import Model
from study.output_error import FreeRunFit
from study.record import Record
from study.shapes import shape_keys, with_starting_shapes

KEPT = 4  # fits: those of the records that the threads are at


def identify(model: Model, record: Record, settings: Settings) -> Identified:
    """Coefficients, and shape parameters that the model leaves open; A_j(f) of the form that they give it.

    The search begins with the MI/SO estimate of the same record.
    """
    found = fit(model, record, settings)
    inputs, estimate = reverse_inputs(found.model), found.estimate
    matrix = spectra.cross_spectra([*histories(inputs, record), record["force"]], record.dt, settings.segments)
    result = parametric.responses(inputs, estimate, matrix)
    note = "" if found.converged else found.message
    return Identified(inputs, result, named_parameters(estimate), estimate, note)


@lru_cache(maxsize=KEPT)
def fit(model: Model, record: Record, settings: Settings) -> FreeRunFit:
    """The fit in free run that the estimate is made of; kept a while, for instruments rest on the same one."""
    begun = with_starting_shapes(model, record)
    first = miso.identify(begun, record, settings).estimate
    assert first is not None  # MI/SO finds all coefficients together
    start = dict(zip(first.symbols, (float(v) for v in first.values), strict=True))
    return fit_record(begun, record, start=start, held=shape_keys(model))
