"""Ways to get coefficients from a record. Each is one file with one function, entered in ``ESTIMATORS``."""

from importlib import import_module
from typing import TYPE_CHECKING, cast

from study.support.errors import StudyError

if TYPE_CHECKING:  # a list of the estimators needs none of their modules
    from study.equations.model import Model
    from study.identify.estimators.base import Estimator, Identified, Settings
    from study.records.record import Record

ESTIMATORS = {
    "siso": "study.identify.estimators.siso",
    "miso": "study.identify.estimators.miso",
    "miso_hand_read": "study.identify.estimators.hand_read",
    "local_polynomial": "study.identify.estimators.local_polynomial",
    "output_error": "study.identify.estimators.output_error",
    "instrumental": "study.identify.estimators.instrumental",
    "miso_free_shape": "study.identify.estimators.free_shape",
    "errors_in_variables": "study.identify.estimators.errors_in_variables",
}


def get_estimator(name: str) -> "Estimator":
    """The estimator of this name, its module imported only now."""
    if name not in ESTIMATORS:
        raise StudyError(f"there is no estimator {name!r}; known are {', '.join(ESTIMATORS)}")
    return cast("Estimator", import_module(ESTIMATORS[name]).identify)


def identify(name: str, model: "Model", record: "Record", settings: "Settings") -> "Identified":
    """Identify a record with the estimator of this name."""
    return get_estimator(name)(model, record, settings)
