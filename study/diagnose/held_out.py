"""What a model leaves of samples that it was not fitted to, on both parts of the record.

The judging part is predicted by the fit to the fitting part. The other way round takes no second search: one step of
Gauss and Newton from that fit, by the sensitivities on the judging part, gives the coefficients that this part wants.
"""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from study.compare.comparison import Comparison
from study.compare.prediction import Prediction
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import linearise
from study.records.outputs import Noise, Outputs
from study.records.prepared import Prepared
from study.support import statistics
from study.support.arrays import Floats
from study.support.errors import DivergenceError
from study.support.least_squares import DISTINCT, least_squares, length_or_one


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Held-out residuals, stacked; both are made white with the same filter when models are compared."""

    judged: Floats  # of the judging part, coefficients from the fitting part
    fitted: Floats  # of the fitting part, coefficients from the judging part; empty where that cannot be

    def white(self, outputs: Outputs, noise: Noise) -> tuple[Floats, Floats]:
        """Judging and fitting part filtered with the coefficients of each sensor's autoregressive noise."""
        judged, fitted = (outputs.whitened(part, noise) if len(part) else part for part in (self.judged, self.fitted))
        return judged, fitted


@dataclass(frozen=True, eq=False)
class HeldOutResidual:
    """What a model leaves of samples that it was not fitted to, as far as it counts for or against it."""

    residual: Floats
    error: float  # rms of it over that of the response


def evidence(prediction: Prediction, held: HeldOut, both: bool = True) -> HeldOutResidual:
    """The judging part's residual; with stretches to fit and to judge in turn, those of both parts, if these count.

    The first stretch of a decay is the loudest, and is fitted: what shows there alone is seen the other way round.
    """
    prepared = prediction.prepared
    if not (both and prepared.record.stretches and len(held.fitted)):
        return HeldOutResidual(prediction.residual, prediction.error)
    residual = np.concatenate([held.judged, held.fitted])
    size = float(np.std(np.concatenate([prediction.above(prepared.judged), prediction.above(prepared.fitted)])))
    return HeldOutResidual(residual, float(np.sqrt(np.mean(residual**2))) / size)


def alike(one: HeldOutResidual, other: HeldOutResidual) -> bool:
    """Whether two models have been judged on the same samples."""
    return len(one.residual) == len(other.residual)


def held_out(fit: FreeRunFit, prediction: Prediction, jacobian: Floats, prepared: Prepared) -> HeldOut:
    """Held-out residuals of a fitted model on the parts of a record; ``jacobian`` is :func:`linearise` of the fit."""
    nothing = np.empty(0)
    if prediction.run is None or fit.restarts or fit.span != prepared.plan.fit or not fit.keys:
        return HeldOut(prediction.residual, nothing)
    try:
        there = prediction.run.derivatives(fit)
    except DivergenceError:
        return HeldOut(prediction.residual, nothing)
    own = len(fit.keys)
    step = least_squares(there, prepared.outputs.stacked(prediction.misfit))[:own]
    other = fit.residual - jacobian[:, :own] @ step
    begin = jacobian[:, own:]  # the initial state is no part of what is predicted
    back = prediction.above(other - begin @ least_squares(begin, other))
    if not prepared.record.stretches:
        return HeldOut(prediction.residual, back)
    judged, fitted = _own(there, own), _own(jacobian, own)
    return HeldOut(
        independent(prediction.residual, judged, _spread(fitted)), independent(back, fitted, _spread(judged))
    )


def held_out_of(comparison: Comparison) -> HeldOut:
    """Held-out residuals of the model of a comparison."""
    fit, prepared = comparison.fit, comparison.prepared
    return held_out(fit, comparison.prediction, linearise(fit, prepared), prepared)


@dataclass(frozen=True, eq=False)
class HeldOutTest:
    """Whether a candidate explains what a model leaves beyond what its own coefficients could, on held-out parts.

    These have errors that show in all of the judging part alike: a candidate that happens to move them nearer to what
    that part wants gains there with every block. So what they could do is taken out of residual and gain on each part
    (Frisch and Waugh, 1933).
    """

    outputs: Outputs
    noise: Noise
    before: HeldOut  # what the model leaves
    own: tuple[Floats, Floats]  # the same of judging and fitting part, white
    bases: tuple[Floats, Floats]  # orthonormal bases of what its own coefficients and states could change there
    evenly: bool  # of a decay: what a change explains lies in the loud blocks

    def p_value(self, after: HeldOut, tuned: bool) -> float:
        """Of one candidate alone, by what it leaves.

        A frequency is where the fitting part has its largest line, by chance if it is noise: its blocks all agree there
        with whatever amplitude the judging part gives that line, so that they bear witness of nothing. A part that the
        candidate does not predict, as a search fits less than all, is left out.
        """
        before, left = list[Floats](), list[Floats]()
        parts = zip(self.own, self.bases, after.white(self.outputs, self.noise), strict=True)
        for own, basis, part in list(parts)[: 1 if tuned else 2]:
            if len(own) == len(part):
                alone, change = (x - basis @ (basis.T @ x) for x in (own, own - part))
                before.append(alone)
                left.append(alone - change)
        return statistics.gain(np.concatenate(before), np.concatenate(left), evenly=self.evenly).p_value


def held_out_test(fit: FreeRunFit, before: Prediction, noise: Noise) -> HeldOutTest:
    """The test of whatever a fitted model lacks, in noise as the best candidate leaves it."""
    prepared, outputs = before.prepared, before.prepared.outputs
    jacobian = linearise(fit, prepared)
    own = held_out(fit, before, jacobian, prepared)
    judged, fitted = (np.zeros((len(part), 0)) for part in (own.judged, own.fitted))
    if before.run is not None and fit.keys and not fit.restarts:
        with suppress(DivergenceError):  # of a long record the derivatives along one part take as much as its channels
            judged = _orthonormal(outputs.whitened(before.run.derivatives(fit), noise))
            fitted = _orthonormal(outputs.whitened(jacobian, noise))
    return HeldOutTest(outputs, noise, own, own.white(outputs, noise), (judged, fitted), prepared.free)


def _orthonormal(columns: Floats) -> Floats:
    """A basis of what the columns span; they are scaled in place."""
    columns /= length_or_one(columns)
    return np.linalg.qr(columns)[0]


def independent(residual: Floats, derivatives: Floats, spread: Floats) -> Floats:
    """A predicted part's residual with samples that are independent where noise is white, shape (n,).

    The coefficients that predict it have errors, which it bears all along: where a quiet part predicts a loud one, as
    in a decay, these are many times the noise, and all samples tell of one chance. With ``L L^T`` the covariance of the
    coefficients over the noise's variance and J their derivatives, the residual times ``(I + J L L^T J^T)^(-1/2)``, and
    times the 2n-th root of that matrix's determinant: so that, as in the likelihood of a prediction, a model gains
    nothing by coefficients that are so uncertain that anything is expected of them.

    Parameters
    ----------
    residual : array, shape (n,)
        Of what is predicted.
    derivatives : array, shape (n, coefficients)
        J, on the same samples.
    spread : array, shape (coefficients, any)
        L, of the part that the coefficients come from.
    """
    directions, sizes, _ = np.linalg.svd(derivatives @ spread, full_matrices=False)
    share = 1.0 - 1.0 / np.sqrt(1.0 + sizes**2)
    price = np.exp(0.5 * np.sum(np.log1p(sizes**2)) / len(residual))
    return np.asarray(price * (residual - directions @ (share * (directions.T @ residual))), dtype=np.float64)


def _own(jacobian: Floats, own: int) -> Floats:
    """Derivatives by the coefficients, without what the states that the parts begin with can do."""
    begin, keys = jacobian[:, own:], jacobian[:, :own]
    return keys - np.column_stack([begin @ least_squares(begin, column) for column in keys.T])


def _spread(jacobian: Floats) -> Floats:
    """A root of the covariance of least-squares estimates over the noise's variance, shape (keys, keys)."""
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    _, sizes, directions = np.linalg.svd(jacobian / scale, full_matrices=False)
    seen = sizes > DISTINCT * sizes[0]
    return np.asarray(directions[seen].T / sizes[seen] / scale[:, None], dtype=np.float64)
