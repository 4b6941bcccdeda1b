"""Continuation in segment length: neighbours are merged while the record lets them be one motion."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from study.equations.model import Model
from study.identify.time_domain.free_run_fit import FreeRunFit, fit_free_run
from study.identify.time_domain.shooting import ShootingSegments
from study.support.arrays import Floats, Ints
from study.support.errors import DivergenceError
from study.support.levenberg_marquardt import RELATIVE_OFFSET

SET_RUNS = 6  # free runs for each set of segments
NEAR = 0.01  # standard errors: how near a minimum an intermediate fit, or that of a search, has to come
FALSELY_APART = 1e-3  # probability that two segments of one motion are kept apart
NEGLIGIBLE = 1e-3  # of the response's standard deviation: a residual that the integrator may have made


def fit_segments(
    model: Model, segments: ShootingSegments, states: Floats, held: Collection[str], max_iterations: int,
    continuity: float = 0.0, offset: float = RELATIVE_OFFSET,
) -> FreeRunFit:  # fmt: skip
    """:func:`free_run_fit.fit_free_run` from these initial states of the segments."""
    return fit_free_run(
        model, segments.record, held=held, outputs=segments.outputs, steps_per_sample=segments.steps_per_sample,
        span=segments.span, restarts=segments.restarts, max_iterations=max_iterations, initial=states,
        continuity=continuity, offset=offset,
    )  # fmt: skip


def lengthen(fit: FreeRunFit, segments: ShootingSegments, held: Collection[str]) -> list[FreeRunFit]:
    """Merge neighbouring segments again and again, with a fit after each time; the fits, beginning with ``fit``.

    Each merger changes the states by little, so the search stays at the measured motion, which a single free run of
    the whole length would not find among the local minima. ``segments`` are the shortest ones; the ``restarts`` of the
    last fit are where the motion could not be made continuous.
    """
    fits = [fit]
    # from segments of one period to segments of 32: a longer chaotic motion has too many local minima
    for _ in range(5):
        try:
            fits.append(_merged(fits[-1], segments, held))
        except DivergenceError:  # a wrong model may stay finite over short segments alone
            break
        if len(fits[-1].restarts) == len(fits[-2].restarts):
            break
    return fits


def _merged(fit: FreeRunFit, segments: ShootingSegments, held: Collection[str]) -> FreeRunFit:
    """Every second segment merged with the one before, except where the misfit rises by more than chance explains."""
    states, begins = np.atleast_2d(fit.initial), np.array([segments.span[0], *fit.restarts])
    pair = np.arange(len(begins)) // 2
    wide = fit_segments(fit.model, _restarted(segments, begins[::2]), states[::2], held, SET_RUNS, offset=NEAR)
    firsts = len(segments.outputs) * (begins[::2] - begins[0])
    rise = np.add.reduceat(wide.residual**2 - fit.residual**2, firsts)
    split = rise > _quantile(states.shape[1], FALSELY_APART) * _variance(fit, segments)
    if not split.any():
        return wide
    apart = split[pair]
    stays = apart | (np.arange(len(begins)) % 2 == 0)
    initial = np.where(apart[:, None], states, np.atleast_2d(wide.initial)[pair])
    return fit_segments(wide.model, _restarted(segments, begins[stays]), initial[stays], held, SET_RUNS, offset=NEAR)


def _restarted(segments: ShootingSegments, begins: Ints) -> ShootingSegments:
    return replace(segments, restarts=tuple(int(b) for b in begins[1:]))


def _variance(fit: FreeRunFit, segments: ShootingSegments) -> float:
    """Variance of the noise, from the median square: segments at a local minimum count little."""
    middle = float(np.median(fit.residual**2)) / _quantile(1, 0.5)
    return max(middle, (NEGLIGIBLE * segments.spread) ** 2)


def _quantile(freedom: int, chance: float) -> float:
    """The value that a chi-square variable exceeds with this probability."""
    return float(np.asarray(chdtri(freedom, chance), dtype=np.float64))
