"""Pieces of a free run joined to longer ones, as far as the record lets them be one motion."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from study.equations.model import Model
from study.identify.time_domain.free_run_fit import FreeRunFit, fit_free_run
from study.identify.time_domain.shooting import Pieces
from study.support.errors import DivergenceError
from study.support.levenberg_marquardt import OFFSET

Floats = NDArray[np.float64]
DOUBLINGS = 5  # from pieces of a period to pieces of 32, beyond which a chaotic motion has too many side valleys
TRIALS = 6  # free runs for each set of pieces
NEAR = 0.01  # standard errors: as near a minimum as a fit has to come from which another begins
RARE = 1e-3  # chance that two pieces of one motion are taken for two
NEGLIGIBLE = 1e-3  # of the response's standard deviation: a residual that the integrator may have made


def fit_pieces(
    model: Model, pieces: Pieces, states: Floats, held: Collection[str], max_iterations: int, tie: float = 0.0,
    offset: float = OFFSET,
) -> FreeRunFit:  # fmt: skip
    """:func:`free_run_fit.fit_free_run` from these states of the pieces."""
    return fit_free_run(
        model, pieces.record, held=held, response=pieces.response, steps_per_sample=pieces.steps_per_sample,
        span=pieces.span, restarts=pieces.restarts, max_iterations=max_iterations, initial=states, tie=tie,
        offset=offset,
    )  # fmt: skip


def joined(found: FreeRunFit, pieces: Pieces, held: Collection[str]) -> list[FreeRunFit]:
    """Join neighbours again and again, and fit after each time; ``restarts`` of the last fit tell what is left apart.

    Each step changes the states by little, so that the search stays in the valley of the measured motion, which
    one free run of the whole length would never find.

    Parameters
    ----------
    found : FreeRunFit
        A fit of ``pieces``, none of which has to fit its neighbours.
    pieces : Pieces
        The shortest pieces.
    held : collection of str
        Keys that keep their value.

    Returns
    -------
    list of FreeRunFit
        ``found``, then the fit after each time.
    """
    fits = [found]
    for _ in range(DOUBLINGS):
        try:
            fits.append(_pairs_joined(fits[-1], pieces, held))
        except DivergenceError:  # a wrong model may bear short pieces alone
            break
        if len(fits[-1].restarts) == len(fits[-2].restarts):
            break
    return fits


def _pairs_joined(found: FreeRunFit, pieces: Pieces, held: Collection[str]) -> FreeRunFit:
    """Each second piece joined to the one before, but where the misfit rises by more than chance makes it."""
    states, begins = np.atleast_2d(found.initial), np.array([pieces.span[0], *found.restarts])
    pair = np.arange(len(begins)) // 2
    wide = fit_pieces(found.model, _restarted(pieces, begins[::2]), states[::2], held, TRIALS, offset=NEAR)
    rise = np.add.reduceat(wide.residual**2 - found.residual**2, begins[::2] - begins[0])
    torn = rise > _quantile(states.shape[1], RARE) * _variance(found, pieces)
    if not torn.any():
        return wide
    apart = torn[pair]
    stays = apart | (np.arange(len(begins)) % 2 == 0)
    mended = np.where(apart[:, None], states, np.atleast_2d(wide.initial)[pair])
    return fit_pieces(wide.model, _restarted(pieces, begins[stays]), mended[stays], held, TRIALS, offset=NEAR)


def _restarted(pieces: Pieces, begins: NDArray[np.int64]) -> Pieces:
    return replace(pieces, restarts=tuple(int(b) for b in begins[1:]))


def _variance(found: FreeRunFit, pieces: Pieces) -> float:
    """Of the noise, from the middle of the squares: pieces in a side valley count little."""
    middle = float(np.median(found.residual**2)) / _quantile(1, 0.5)
    return max(middle, (NEGLIGIBLE * pieces.spread) ** 2)


def _quantile(freedom: int, chance: float) -> float:
    """What a chi-square variable exceeds with this chance."""
    return float(np.asarray(chdtri(freedom, chance), dtype=np.float64))
