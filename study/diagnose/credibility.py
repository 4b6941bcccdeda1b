"""When an effect is believed: what it gains is no chance, its coefficient is not zero, and the gain can be seen."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from study.equations.term import Term
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import run_of
from study.records.prepared import Prepared
from study.records.record import MOTIONS, Sensor
from study.support.arrays import Floats
from study.support.numbers import percent
from study.support.thresholds import ALPHA, TOLERANCE

SLIGHT = 0.05  # of a loop's yield displacement: a motion that goes no farther bends nothing


class HeldOutPrediction(Protocol):
    """A held-out prediction."""

    @property
    def error(self) -> float:
        """Rms of the residual over that of the response."""
        ...


def credible(
    before: HeldOutPrediction, after: HeldOutPrediction, interval: tuple[float, float], p_value: float
) -> bool:
    """Whether a model with an effect is better than one without.

    Parameters
    ----------
    before, after : Judged
        Held-out predictions of the model without the effect and with it.
    interval : pair of float
        95 % confidence interval of the effect's coefficient.
    p_value : float
        Of what it explains, all effects that were asked for accounted for.
    """
    return certain(before, after, interval, p_value) and percent(before.error) != percent(after.error)


def certain(before: HeldOutPrediction, after: HeldOutPrediction, interval: tuple[float, float], p_value: float) -> bool:
    """The same, whether or not the gain shows in the digits printed: much noise hides there what is no chance.

    An effect that is certain but not credible is neither called missing nor, where it is in the model, needless.
    """
    gained = math.sqrt(max(before.error**2 - after.error**2, 0.0))
    return p_value < ALPHA and not interval[0] <= 0.0 <= interval[1] and gained > TOLERANCE


@dataclass(frozen=True, eq=False)
class MotionRange:
    """How far a motion reaches that a model was fitted to; what an effect needs to act lies within."""

    motion: Floats  # displacement and velocity of each coordinate along the free run, shape (2, n, c)
    dt: float  # sampling interval in seconds

    def idle(self, term: Term, direction: Floats, values: Mapping[str, float], errors: Mapping[str, float]) -> str:
        """Why an effect does not act as itself along this motion, as a clause; empty where it does.

        A gap that is never reached is no stop, and a band that is never left a spring; a loop that closes at once is
        dry friction, a relaxation that outlasts the record a spring, a pitch beyond the stroke a curved one. What the
        record does not tell from zero may be any of these. ``direction`` is that of its place, shape (c,); ``values``
        and ``errors`` are those of its shape parameters.
        """
        u, v = self.motion @ direction
        for parameter in term.parameters:
            value, error = values.get(parameter.name, math.nan), errors.get(parameter.name, 0.0)
            if math.isnan(value) or parameter.relative or parameter.quantity == "frequency":
                continue
            low, high = self._limits(parameter.quantity, u, v)
            if parameter.signed and parameter.quantity == "length":
                low, high, size = float(np.min(u)), float(np.max(u)), value
            else:
                size = abs(value)
            if not low < size < high:
                reached = f"{low:.3g} to {high:.3g}"
                return f"its {parameter.meaning}, {value:.4g}, is outside of what this motion reaches ({reached})"
            if not parameter.signed and value < 1.96 * error:
                return f"the record does not tell its {parameter.meaning} ({value:.3g} +- {1.96 * error:.2g})"
        return ""

    def _limits(self, quantity: str, u: Floats, v: Floats) -> tuple[float, float]:
        """Between which sizes of such a quantity an effect acts."""
        match quantity:
            case "time":
                return self.dt, len(u) * self.dt
            case "velocity":
                return 0.0, float(np.max(np.abs(v)))
            case "1/length":
                return SLIGHT / float(np.max(np.abs(u))), math.inf
            case _:
                return 0.0, float(np.max(np.abs(u)))


def motion_range(fit: FreeRunFit, prepared: Prepared) -> MotionRange:
    """How far the free run of a fit reaches along the samples that it was fitted to."""
    motions = tuple(Sensor(c, m) for m in MOTIONS[:2] for c in fit.model.coordinates)
    free = run_of(fit, prepared, sensors=motions).respond({}, fit.initial)[0]
    return MotionRange(free.reshape(len(free), 2, -1).transpose(1, 0, 2), prepared.dt)
