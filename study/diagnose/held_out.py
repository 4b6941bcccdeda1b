"""What a model leaves of samples that it was not fitted to, on both parts of the record.

The judging part is predicted by the fit to the fitting part. The other way round takes no second search: one step of
Gauss and Newton from that fit, by the sensitivities on the judging part, gives the coefficients that this part wants.
"""

from dataclasses import dataclass

import numpy as np

from study.compare.prediction import Prediction
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.autoregression import whitened
from study.support.errors import DivergenceError
from study.support.least_squares import least_squares


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Held-out residuals; both are made white with the same filter when models are compared."""

    judged: Floats  # of the judging part, coefficients from the fitting part
    fitted: Floats  # of the fitting part, coefficients from the judging part; empty where that cannot be

    def white(self, noise: Floats) -> Floats:
        """Both strung together, filtered with the coefficients of an autoregressive noise, shape (n,)."""
        return np.concatenate([whitened(part, noise) for part in (self.judged, self.fitted) if len(part)])


def held_out(fit: FreeRunFit, prediction: Prediction, jacobian: Floats, prepared: Prepared) -> HeldOut:
    """Held-out residuals of a fitted model on the parts of a record; ``jacobian`` is :func:`linearise` of the fit."""
    nothing = np.empty(0)
    if prediction.run is None or fit.restarts or fit.span != prepared.plan.fit or not fit.keys:
        return HeldOut(prediction.residual, nothing)
    try:
        there = prediction.run.derivatives(fit)
    except DivergenceError:
        return HeldOut(prediction.residual, nothing)
    own = len(fit.keys)
    step = least_squares(there, prediction.difference)[:own]
    other = fit.residual - jacobian[:, :own] @ step
    begin = jacobian[:, own:]  # the initial state is no part of what is predicted
    return HeldOut(prediction.residual, prediction.above(other - begin @ least_squares(begin, other)))
