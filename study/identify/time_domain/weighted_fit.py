"""A fit weighted with the noise that it leaves, where that costs nothing of the response, as with a true model.

Noise of any colour biases no fit in free run, but the plain sum of squares makes poor use of a record whose noise lies
at some frequencies alone. The residual of a wrong model is no noise: weighted with it, the model leaves more of the
response or its coefficients move by more than their errors, and the plain fit stands.
"""

from dataclasses import replace

import numpy as np

from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import covariance_of, fit_part, linearise
from study.identify.time_domain.settling import continued, settled
from study.identify.time_domain.smoothness import smoothed
from study.identify.time_domain.step_moments import dated
from study.records.outputs import Noise
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.autoregression import autoregression, whitened
from study.support.errors import DivergenceError
from study.support.thresholds import TOLERANCE, K

WEIGHTED_RUNS = 20  # free runs of the weighted fit, which begins at the plain one


def finished(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit of a search as all that is shown rests on it: the whole fitting part, settled, weighted and smooth."""
    if (fit.noise or len(fit.penalty)) and fit.span == prepared.plan.fit:
        return fit
    return smoothed(weighted(dated(settled(continued(fit, prepared), prepared), prepared), prepared), prepared)


def weighted(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit weighted with the autoregressive noise that it leaves, or as it is where that is white or no noise."""
    noise = noise_left(fit.residual, len(fit.outputs))
    if not noise or not fit.keys or fit.restarts:
        return fit
    try:
        again = fit_part(
            fit.model, prepared, fit.held, steps=fit.steps_per_sample, initial=np.atleast_2d(fit.initial), noise=noise,
            max_iterations=WEIGHTED_RUNS,
        )  # fmt: skip
    except DivergenceError:
        return fit
    again = replace(again, elsewhere=fit.elsewhere)
    return again if again.converged and _agree(fit, again, prepared) else fit


def noise_left(residual: Floats, sensors: int) -> Noise:
    """The noise that a stacked residual would be; empty if it is white, of a single sensor."""
    left = residual.reshape(-1, sensors)
    noise = [autoregression(own) for own in left.T]
    if len(noise) == 1:
        return tuple(noise) if len(noise[0]) > 1 else ()
    size = np.array([float(np.std(whitened(own, a))) for own, a in zip(left.T, noise, strict=True)])
    size = np.maximum(size, np.finfo(float).eps * max(float(np.max(np.abs(left))), np.finfo(float).tiny))
    return tuple(a * size[0] / own for a, own in zip(noise, size, strict=True))


def _agree(plain: FreeRunFit, other: FreeRunFit, prepared: Prepared) -> bool:
    """Whether two fits follow the response alike, and no coefficient moves by more than its error explains.

    Of a true model weighting lowers the variance, so what moves an estimate is less than that (Hausman, 1978).
    """
    if other.rms > (1.0 + TOLERANCE) * plain.rms:
        return False
    deviations = np.sqrt(np.diag(covariance_of(plain, linearise(plain, prepared))))[: len(plain.keys)]
    return bool(np.all(np.abs(other.values - plain.values) <= K * deviations))
