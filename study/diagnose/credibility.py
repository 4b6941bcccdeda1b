"""When an effect is believed: what it gains is no chance, its coefficient is not zero, and the gain can be seen."""

from study.compare.prediction import Prediction
from study.support.numbers import percent
from study.support.statistics import ALPHA as ALPHA
from study.support.statistics import SMALLEST_GAIN, gain


def credible(before: Prediction, after: Prediction, interval: tuple[float, float], asked: int = 1) -> bool:
    """Whether a model with an effect is better than one without, of which so many were asked for.

    Parameters
    ----------
    before, after : Prediction
        Held-out predictions of the model without the effect and with it.
    interval : pair of float
        95 % confidence interval of the effect's coefficient.
    asked : int
        Effects that were asked for: the p value is multiplied by it (Bonferroni).
    """
    fallen = gain(before.residual, after.residual)
    gained = max(before.error**2 - after.error**2, 0.0)
    return (
        fallen.p_value * asked < ALPHA
        and not interval[0] <= 0.0 <= interval[1]
        and gained > SMALLEST_GAIN**2
        and percent(before.error) != percent(after.error)
    )
