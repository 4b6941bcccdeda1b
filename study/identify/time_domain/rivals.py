"""Other minima of the sum of squares that a record does not exclude.

A search keeps the best of fits from several starts. Another of them may have ended in a minimum of its own whose
residual is no larger than chance explains: the record then bears both, and the error of either says nothing of the
other. Sums of squares are compared by blocks of time, as what a model leaves is seldom white: taken for independent,
samples would exclude what the record does not.
"""

from dataclasses import replace

import numpy as np
from scipy.special import chdtri, stdtr

from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import covariance_of, fit_part, linearise, run_of
from study.identify.time_domain.settling import KEPT
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares
from study.support.statistics import block_powers

SIGNIFICANCE_LEVEL = 0.05  # of both tests: of the sums of squares, and of the distance between the values


def rivals(fit: FreeRunFit, prepared: Prepared) -> tuple[FreeRunFit, ...]:
    """Fits of the same model in other minima, none significantly worse on the fitting part; the best first.

    Each start of the search is first followed by one Gauss-Newton step. Only what may compete after it, elsewhere than
    the fit, is fitted anew, so that a record with a single minimum costs one free run a start. A fit in segments, or
    one at no minimum, has none: its values are uncertain in other ways, which it says.
    """
    return _others(fit, prepared) if fit.converged else ()


def best_first(fit: FreeRunFit, prepared: Prepared) -> tuple[FreeRunFit, ...]:
    """A fit and its rivals; a minimum that leaves less on the whole fitting part than the fit takes its place."""
    best, *others = sorted((fit, *_others(fit, prepared)), key=lambda one: one.rms)
    if not best.converged:
        return (best,)
    return (best, *(one for one in others if one.converged and not larger(one.residual, best.residual)))


def _others(fit: FreeRunFit, prepared: Prepared) -> tuple[FreeRunFit, ...]:
    found: list[FreeRunFit] = []
    if not fit.keys or fit.restarts:
        return ()
    covariance = _covariance(fit, prepared)
    for other in fit.elsewhere:
        rival = _followed(other, fit, covariance, prepared)
        if rival is not None and all(_apart(rival, known, prepared) for known in (fit, *found)):
            found.append(rival)
    return tuple(sorted(found, key=lambda rival: rival.rms))


def _followed(other: FreeRunFit, fit: FreeRunFit, covariance: Floats, prepared: Prepared) -> FreeRunFit | None:
    """The minimum that a start leads to on the whole fitting part; None if it is no rival of the fit."""
    if other.restarts or other.first < fit.first or other.span[1] > fit.span[1]:
        return None
    begun = _begun(other, fit)
    try:
        run = run_of(begun, prepared, begun.keys)
        response, jacobian = run.respond(
            dict(zip(begun.keys, begun.values.tolist(), strict=True)), begun.initial, run.moving
        )
        outputs = prepared.outputs
        jacobian = outputs.stacked(jacobian)
        residual = outputs.stacked(outputs.measured(prepared.record, begun.span) - response)
        step = least_squares(jacobian, residual, 1e-12)
        here = fit.residual[len(outputs) * (begun.first - fit.first) :][: len(residual)]
        moved = begun.values + step[: len(begun.values)] - fit.values
        if larger(residual - jacobian @ step, here) or not _far(moved, covariance):
            return None
        rival = fit_part(begun.model, prepared, fit.held, steps=fit.steps_per_sample, max_iterations=KEPT)
    except StudyError:
        return None
    return rival if rival.converged and not larger(rival.residual, fit.residual) else None


def _begun(other: FreeRunFit, fit: FreeRunFit) -> FreeRunFit:
    """A start with what the fit found for the terms that joined the model after it."""
    model = fit.model.with_values(fit.model.numbers() | other.model.numbers())
    values = np.array([model.numbers()[key] for key in fit.keys])
    initial = np.zeros((*other.initial.shape[:-1], fit.initial.shape[-1]))
    initial[..., : other.initial.shape[-1]] = other.initial
    return replace(other, model=model, keys=fit.keys, values=values, initial=initial)


def larger(residual: Floats, than: Floats) -> bool:
    """Whether a residual is significantly larger than another of the same samples, by blocks of time.

    One-sided, by Student's t; of residuals that are alike to the last bit neither is.
    """
    rise = block_powers(residual) - block_powers(than)
    rise = np.ldexp(rise, -int(np.frexp(np.max(np.abs(rise)))[1]))  # by a power of two: squares of 1e160 are no numbers
    count, mean = len(rise), float(np.mean(rise))
    error = float(np.std(rise, ddof=1)) / np.sqrt(count)
    chance = np.asarray(stdtr(count - 1, -mean / max(error, np.finfo(float).tiny)), dtype=np.float64)
    return mean > 0.0 and float(chance) < SIGNIFICANCE_LEVEL


def _apart(one: FreeRunFit, other: FreeRunFit, prepared: Prepared) -> bool:
    """Whether each of two fits lies outside the other's confidence ellipsoid."""
    apart = one.values - other.values
    return all(_far(apart, _covariance(fit, prepared)) for fit in (one, other))


def _far(apart: Floats, covariance: Floats) -> bool:
    """Whether a difference of estimates lies outside their confidence ellipsoid, as far as it has a size."""
    deviations = np.sqrt(np.diag(covariance))
    scale = np.where(deviations > 0.0, deviations, np.inf)
    distance = apart / scale @ np.linalg.pinv(covariance / np.outer(scale, scale), hermitian=True) @ (apart / scale)
    return bool(distance > chdtri(len(apart), SIGNIFICANCE_LEVEL))


def _covariance(fit: FreeRunFit, prepared: Prepared) -> Floats:
    """Of the estimates, as the intervals that a user sees have it (``fitted_coefficients.standard_errors``)."""
    count = len(fit.keys)
    return covariance_of(fit, linearise(fit, prepared))[:count, :count]
