"""What a fitted model leaves of the response, beside all that its own coefficients and initial state could take."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import fdtrc

from study.compare.prediction import Prediction, predict
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import linearise, run_of
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.least_squares import least_squares
from study.support.statistics import Gain, clustered_covariance, gain, gain_beside
from study.support.thresholds import ALPHA, BLOCKS, TOLERANCE

INDISTINCT = 1e-5  # share of a column's length that the model's own coefficients leave of it


@dataclass(frozen=True, eq=False)
class FittedResidual:
    """Residual of a fitted model on the fitting and on the judging part; n and m samples, p keys."""

    fit: FreeRunFit
    prediction: Prediction
    prepared: Prepared

    @cached_property
    def own(self) -> tuple[Floats, Floats]:
        """Derivatives of the response by the keys and initial states, shapes (n, p + 2) and (m, p + 2).

        Where the judging part has an initial state of its own it is known there: its columns are zero.
        """
        run = self.prediction.run
        fitted = linearise(self.fit, self.prepared)
        judged = np.zeros((len(self.prediction.residual), fitted.shape[1]))
        if run is not None:
            judged[:] = run.derivatives(self.fit)
            if run.first != self.fit.first:
                judged[:, len(self.fit.keys) :] = 0.0
        return fitted, judged

    @cached_property
    def predicted(self) -> tuple[Floats, Floats]:
        """Response of the free run on both parts: free of noise."""
        fitted = run_of(self.fit, self.prepared).respond({}, self.fit.initial)[0][:, 0]
        return fitted, self.prediction.of(0).predicted

    @property
    def residual(self) -> tuple[Floats, Floats]:
        """Measured less predicted response on both parts."""
        return self.fit.residual, self.prediction.of(0).difference

    @cached_property
    def beside_own(self) -> Floats:
        """Residual of the judging part beside what the model's own coefficients, fitted to both parts, take, (m,).

        A change of the prediction is held against this (``study.support.statistics.gain_beside``).
        """
        design = np.vstack(self.own)
        return self.residual[1] - self.own[1] @ least_squares(design, np.concatenate(self.residual), 1e-9)

    @property
    def samples(self) -> tuple[Floats, Floats]:
        """Places of both parts in the record."""
        spans = (self.fit.span, self.prepared.plan.judge)
        return np.arange(*spans[0], dtype=np.float64), np.arange(*spans[1], dtype=np.float64)

    @property
    def size(self) -> float:
        """Rms of the measured response on the judging part."""
        return self.prediction.of(0).size

    def known(self, columns: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
        """Columns on both parts, zero where samples are lost."""
        return self.prepared.known(columns[0], self.fit.span), self.prepared.known(columns[1], self.prepared.plan.judge)


@dataclass(frozen=True)
class Share:
    """What columns explain of a leftover; k columns."""

    amounts: Floats  # shape (k,); from both parts
    covariance: Floats  # shape (k, k), clustered
    p_value: float  # of such amounts, or the first of them, if they were zero
    gain: Gain  # on the judging part, of the amounts of the fitting part
    power: (
        float  # mean square on both parts of what the amounts from both add beside the model's own, over the response's
    )

    def significant(self, asked: int) -> bool:
        """Whether that is no chance, of so many that were asked for, and more than integration resolves."""
        p_value = 2.0 * min(self.p_value, self.gain.p_value)  # two tests: each sees what the other is blind to
        return p_value * asked < ALPHA and self.power > TOLERANCE**2


def leftover(fit: FreeRunFit, prepared: Prepared) -> FittedResidual | None:
    """What a fit leaves; None where its free run is no smooth function of its coefficients, or none at all."""
    if fit.restarts:
        return None
    prediction = predict(fit, prepared)
    return None if prediction.diverged else FittedResidual(fit, prediction, prepared)


def share(left: FittedResidual, columns: tuple[Floats, Floats], leading: bool = False) -> Share | None:
    """Joint regression of the residual on the model's own sensitivities and more columns.

    ``columns`` are those of a fault or an effect on both parts, shapes (n, k) and (m, k). They get only what the
    model's own coefficients and initial state cannot take; None where these can take all of it. A test of all amounts
    or, where ``leading``, of the first alone: the others stand for what is unknown beside it.
    """
    fitted, judged = left.known(columns)
    taken = _taken(left.own[0], fitted)
    alone = fitted - left.own[0] @ taken
    if np.any(np.linalg.norm(alone, axis=0) <= INDISTINCT * np.linalg.norm(fitted, axis=0)):
        return None
    change = (judged - left.own[1] @ taken) @ least_squares(alone, left.residual[0], 1e-9)
    whole, covariance = amounts_on_both(left, columns)
    both = np.vstack(left.own)
    apart = np.vstack([fitted, judged]) - both @ _taken(both, np.vstack([fitted, judged]))
    power = float(np.mean((apart @ whole) ** 2)) / left.size**2
    tested = slice(1) if leading else slice(None)
    return Share(whole, covariance, _p_value(whole[tested], covariance[tested, tested]),
                 gain_beside(left.residual[1], change, left.beside_own), power)  # fmt: skip


def _taken(own: Floats, columns: Floats) -> Floats:
    """Amounts of the model's own sensitivities that come nearest to each column, shape (p, k)."""
    return np.column_stack([least_squares(own, column, 1e-9) for column in columns.T])


def _p_value(amounts: Floats, covariance: Floats) -> float:
    """Wald's test of amounts whose covariance rests on blocks: Hotelling's, as these are few."""
    count, freedom = len(amounts), 2 * BLOCKS - 1
    wald = float(amounts @ np.linalg.pinv(covariance, hermitian=True) @ amounts)
    return float(fdtrc(count, freedom - count + 1, wald * (freedom - count + 1) / (count * freedom)))


def leaves_less(before: FittedResidual, after: FittedResidual, asked: int) -> bool:
    """Whether a fit leaves less of the judging part than another by no chance, so many having been tried."""
    power = float(np.mean(before.residual[1] ** 2) - np.mean(after.residual[1] ** 2)) / before.size**2
    held_out = gain(before.residual[1], after.residual[1])
    return held_out.p_value * asked < ALPHA and power > TOLERANCE**2


def amounts_on_both(left: FittedResidual, columns: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Amounts of the columns, shape (k,), and their clustered covariance, from both parts of the record together."""
    fitted, judged = left.known(columns)
    count = fitted.shape[1]
    design = np.vstack([np.hstack([left.own[0], fitted]), np.hstack([left.own[1], judged])])
    residual = np.concatenate(left.residual)
    amounts = least_squares(design, residual, 1e-9)
    return amounts[-count:], clustered_covariance(design, residual - design @ amounts)[-count:, -count:]
