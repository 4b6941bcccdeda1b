"""When an effect is believed: what it gains is no chance, its coefficient is not zero, and the gain can be seen."""

import math
from typing import Protocol

from study.support.numbers import percent
from study.support.thresholds import ALPHA, TOLERANCE


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
    return not by_luck(interval, p_value) and explained_rms(before, after) > TOLERANCE


def by_luck(interval: tuple[float, float], p_value: float) -> bool:
    """Whether chance gains as much as an effect, or its coefficient may be zero."""
    return not p_value < ALPHA or interval[0] <= 0.0 <= interval[1]


def explained_rms(before: HeldOutPrediction, after: HeldOutPrediction) -> float:
    """Rms of what a model with an effect explains of the residual of that without, over that of the response."""
    return math.sqrt(max(before.error**2 - after.error**2, 0.0))
