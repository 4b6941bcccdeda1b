"""The report's estimator where u_g or f_m is unknown: shape parameters from the record, then MI/SO."""

from study.equations.model import Model
from study.identify.estimators import miso, output_error
from study.identify.estimators.base import Identified, Settings, named_parameters
from study.records.record import Record


def identify(model: Model, record: Record, settings: Settings) -> Identified:
    """MI/SO with shape parameters from a fit in free run; nothing for a model that has none.

    Shape parameters of the model are ignored, as coefficients are.
    """
    shapes = tuple(key for key in model.values if "." in key)
    if not shapes:
        return Identified((), None, ())
    fit = output_error.free_run_fit(model.with_values(dict.fromkeys(shapes)), record)
    known = model.with_values({key: fit.estimate[key] for key in shapes})
    result = miso.identify(known, record, settings)
    own = output_error.shapes_of(fit, shapes)
    note = "" if fit.converged else fit.message
    named = (*result.parameters, *named_parameters(own))
    return Identified(result.inputs, result.responses, named, result.estimate, note, own)
