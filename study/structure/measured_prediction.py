"""The free run of a structure with a measured linear part along the part that was not fitted."""

import numpy as np

from study.compare.prediction import Prediction
from study.records.prepared import Prepared
from study.structure.measured_fit import MeasuredFit, modal_run


def predict_measured(fit: MeasuredFit, prepared: Prepared) -> Prediction:
    """Run a fitted structure along the judging part, on from the fitting part or from rest where that is elsewhere.

    Its fit has steps so fine that halving them moves nothing that its errors notice.
    """
    follows = prepared.plan.judge[0] == prepared.plan.fit[1]
    begin = prepared.plan.fit[0] if follows else prepared.plan.judge[0]
    span = (begin, prepared.plan.judge[1])
    runs = modal_run(fit.model, fit.modal, prepared, prepared.sensors, fit.steps, span, fit.values)
    motion, _ = runs.respond(fit.values, fit.initial if follows else np.zeros_like(fit.initial))
    return Prediction(prepared, None, motion[prepared.plan.judge[0] - begin :], np.zeros(len(prepared.sensors)))
