"""When an effect is believed: what it gains is no chance, its coefficient is not zero, and the gain can be seen."""

import math

from study.compare.prediction import Prediction
from study.support.numbers import percent
from study.support.thresholds import ALPHA, TOLERANCE


def credible(before: Prediction, after: Prediction, interval: tuple[float, float], p_value: float) -> bool:
    """Whether a model with an effect is better than one without.

    Parameters
    ----------
    before, after : Prediction
        Held-out predictions of the model without the effect and with it.
    interval : pair of float
        95 % confidence interval of the effect's coefficient.
    p_value : float
        Of what it explains, all effects that were asked for accounted for.
    """
    gained = math.sqrt(max(before.error**2 - after.error**2, 0.0))
    zero = interval[0] <= 0.0 <= interval[1]
    seen = percent(before.error) != percent(after.error)
    return p_value < ALPHA and not zero and gained > TOLERANCE and seen
