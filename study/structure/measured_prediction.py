"""The free run of a structure with a measured linear part along the part that was not fitted."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from study.records import noise_floor
from study.records.prepared import Prepared
from study.structure.measured_fit import MeasuredFit, modal_run
from study.support.arrays import Floats


@dataclass(frozen=True, eq=False)
class MeasuredPrediction:
    """The free run of such a structure along the judging part; n samples, s sensors."""

    fit: MeasuredFit
    prepared: Prepared
    predicted: Floats  # shape (n, s)

    @cached_property
    def residual(self) -> Floats:
        """Measured minus predicted, shape (n, s)."""
        return self.prepared.measured[slice(*self.prepared.plan.judge)] - self.predicted

    @cached_property
    def size(self) -> Floats:
        """Rms of each measured motion about its mean, shape (s,)."""
        return np.std(self.prepared.measured[slice(*self.prepared.plan.judge)], axis=0)

    @cached_property
    def errors(self) -> Floats:
        """Rms of the residual over that of the motion, shape (s,)."""
        return np.sqrt(np.mean(self.residual**2, axis=0)) / self.size

    @property
    def error(self) -> float:
        """Root mean square of the sensors' errors."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @cached_property
    def floors(self) -> Floats:
        """White noise in what is left of each sensor, over the rms of its motion, shape (s,)."""
        return np.array([noise_floor.floor(x, self.prepared.dt).noise for x in self.residual.T]) / self.size

    @property
    def floor(self) -> float:
        """Root mean square of the sensors' floors."""
        return float(np.sqrt(np.mean(self.floors**2)))


def predict_measured(fit: MeasuredFit, prepared: Prepared) -> MeasuredPrediction:
    """Run a fitted structure along the judging part, on from the fitting part or from rest where that is elsewhere."""
    follows = prepared.plan.judge[0] == prepared.plan.fit[1]
    begin = prepared.plan.fit[0] if follows else prepared.plan.judge[0]
    span = (begin, prepared.plan.judge[1])
    runs = modal_run(fit.model, fit.modal, prepared, prepared.sensors, fit.steps, span, fit.values)
    motion, _ = runs.respond(fit.values, fit.initial if follows else np.zeros_like(fit.initial))
    return MeasuredPrediction(fit, prepared, motion[prepared.plan.judge[0] - begin :])
