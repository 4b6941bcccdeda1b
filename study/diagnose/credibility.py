"""When an effect is believed: what it gains is no chance, its coefficient is not zero, and the gain can be seen."""

from study.compare.prediction import Prediction
from study.support.numbers import percent
from study.support.statistics import gain

ALPHA = 0.01  # probability of believing in an effect that is not there, all that were asked for together
SMALLEST_GAIN = 1e-3  # of the rms response: what an effect must explain; less is the resolution of integration


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
    return certain(before, after, interval, asked) and percent(before.error) != percent(after.error)


def certain(before: Prediction, after: Prediction, interval: tuple[float, float], asked: int = 1) -> bool:
    """The same, whether or not the gain shows in the digits printed: much noise hides there what is no chance.

    An effect that is certain but not credible is neither called missing nor, where it is in the model, needless.
    """
    fallen = gain(before.residual, after.residual)
    gained = max(before.error**2 - after.error**2, 0.0)
    return fallen.p_value * asked < ALPHA and not interval[0] <= 0.0 <= interval[1] and gained > SMALLEST_GAIN**2
