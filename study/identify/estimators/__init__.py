"""Ways to get coefficients from a record, each a function of its name: in reverse, or on a fit in free run."""

from importlib import import_module
from typing import TYPE_CHECKING, cast

from study.support.errors import StudyError

if TYPE_CHECKING:  # a list of the estimators needs none of their modules
    from study.equations.model import Model
    from study.identify.estimators.base import Estimator, Identified, Settings
    from study.records.record import Record

IN_REVERSE, IN_FREE_RUN = "study.identify.estimators.in_reverse", "study.identify.estimators.in_free_run"
ESTIMATORS = {
    "siso": IN_REVERSE,
    "miso": IN_REVERSE,
    "miso_hand_read": IN_REVERSE,
    "local_polynomial": IN_REVERSE,
    "output_error": IN_FREE_RUN,
    "instrumental": IN_FREE_RUN,
    "miso_free_shape": IN_FREE_RUN,
    "errors_in_variables": IN_REVERSE,
}


def get_estimator(name: str) -> "Estimator":
    """The estimator of this name, its module imported only now."""
    if name not in ESTIMATORS:
        raise StudyError(f"there is no estimator {name!r}; known are {', '.join(ESTIMATORS)}")
    return cast("Estimator", getattr(import_module(ESTIMATORS[name]), name))


def identify(name: str, model: "Model", record: "Record", settings: "Settings") -> "Identified":
    """Identify a record with the estimator of this name."""
    return get_estimator(name)(model, record, settings)
