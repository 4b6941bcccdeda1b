"""A fit weighted with the noise that it leaves, where the two agree as those of a true model do.

Noise of any colour biases no fit in free run, but the plain sum of squares makes poor use of a record whose noise lies
at some frequencies alone. The residual of a wrong model is no noise: weighted with it, the coefficients move by more
than their errors (Hausman, 1978), and the plain fit stands.
"""

from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, influence_of, linearise
from study.identify.time_domain.settling import continued, settled
from study.records.prepared import Prepared
from study.support.autoregression import autoregression
from study.support.errors import DivergenceError

DISAGREE = 0.01  # p value of the difference between the two
RUNS = 20  # free runs of the weighted fit, which begins at the plain one


def finished(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit of a search as all that is shown rests on it: to the whole fitting part, settled, and weighted."""
    return weighted(settled(continued(fit, prepared), prepared), prepared)


def weighted(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit weighted with the autoregressive noise that it leaves, or as it is where that is white or no noise."""
    noise = autoregression(fit.residual)
    if len(noise) == 1 or not fit.keys or fit.restarts or len(fit.noise) > 1:
        return fit
    try:
        again = fit_part(
            fit.model, prepared, fit.held, steps=fit.steps_per_sample, initial=np.atleast_2d(fit.initial), noise=noise,
            max_iterations=RUNS,
        )  # fmt: skip
    except DivergenceError:
        return fit
    again = replace(again, elsewhere=fit.elsewhere)
    return again if again.converged and _agree(fit, again, prepared) else fit


def _agree(plain: FreeRunFit, other: FreeRunFit, prepared: Prepared) -> bool:
    """Whether two estimates of the same coefficients differ by no more than the noise explains."""
    keys = len(plain.keys)
    each = [influence_of(fit, linearise(fit, prepared))[:, :keys] for fit in (plain, other)]
    spread = each[0] - each[1]
    scale = np.maximum(np.sqrt(np.sum(spread**2, axis=0)), np.finfo(float).tiny)
    apart = (other.values - plain.values) / scale
    correlation = (spread / scale).T @ (spread / scale)
    statistic = float(apart @ np.linalg.pinv(correlation, rcond=1e-6, hermitian=True) @ apart)
    return float(chdtrc(keys, statistic)) > DISAGREE
