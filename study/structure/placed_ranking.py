"""Candidates of a structure in order, by the same score as those of a single coordinate (``diagnose.ranking``)."""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from study.compare.prediction import Prediction
from study.diagnose import ranked
from study.diagnose.constancy import CoefficientCurve, along_amplitude, along_frequency, changes
from study.diagnose.ranking import in_order
from study.equations.coefficient_units import coefficient_unit
from study.equations.model import ModelTerm
from study.equations.term import Term
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import linearise, uncertainty
from study.identify.time_domain.weighted_fit import noise_left
from study.records.outputs import Noise, Outputs
from study.records.record import Record
from study.structure.placed_candidates import PlacedCandidate, physical
from study.support import statistics
from study.support.arrays import Floats
from study.support.cores import cores
from study.support.errors import DivergenceError
from study.support.least_squares import least_squares
from study.support.statistics import Gain

INDISTINCT = 1e-6  # of a coefficient's effect: what the others leave of it below says nothing


@dataclass(frozen=True, eq=False)
class PlacedRanked:
    """One candidate with what an engineer needs to believe or doubt it."""

    entry: ModelTerm  # the effect and its place
    fit: FreeRunFit
    prediction: Prediction
    gain: Gain  # what it explains of the held-out residual
    coefficient: float  # its size: the amplitude, for an effect of any phase
    error: float  # standard error of that
    parameters: dict[str, float]  # shape parameters, and the phase of an effect of any phase
    parameter_errors: dict[str, float]
    flatness: CoefficientCurve | None  # the coefficient along frequency, at the sensor that sees most of it
    steadiness: CoefficientCurve | None  # along amplitude, at all sensors
    parts: tuple[Floats, Floats]  # held-out residuals of judging and fitting part, stacked
    p_value: float = 1.0  # of what it explains, with the number of candidates accounted for (Bonferroni)
    tied_with: tuple[str, ...] = ()
    distance: float = math.inf

    @property
    def name(self) -> str:
        """Effect and place."""
        return self.entry.name

    @property
    def term(self) -> Term:
        """The effect."""
        return self.entry.term

    @property
    def record(self) -> Record:
        """Coordinates that were measured as angles."""
        return self.prediction.prepared.record

    @property
    def unit(self) -> str:
        """Unit of the coefficient."""
        return coefficient_unit(self.entry, self.term.symbols[0], self.record)

    @property
    def response_error(self) -> float:
        """Error of the motions with it, held out."""
        return self.prediction.error

    @property
    def residual(self) -> Floats:
        """Held-out residual in shares of the sensors' sizes, those of one time side by side."""
        return self.prediction.relative_residual

    @property
    def numerical(self) -> float:
        """Rms error of the integration itself, in the same shares."""
        return float(np.sqrt(np.mean((self.prediction.numerical / self.prediction.size) ** 2)))

    @property
    def unphysical(self) -> str:
        """Why it is no physical effect as fitted; empty if it is one."""
        return physical(self.entry, self.fit.model)

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval of the coefficient."""
        return self.coefficient - 1.96 * self.error, self.coefficient + 1.96 * self.error

    @property
    def unsteadiness(self) -> float:
        """By how much, relative to itself, the coefficient changes with frequency or amplitude."""
        return changes(self.flatness, self.steadiness)

    def wanders(self, asked: int) -> bool:
        """Whether its coefficient, of so many that are asked for, moves as that of a true term would not."""
        return ranked.wanders(self.prediction.error, self.gain, self.unsteadiness, self.steadiness, asked)

    def white(self, noise: Noise) -> Floats:
        """Both held-out parts strung together, made white, sensors of one time side by side."""
        outputs = self.prediction.prepared.outputs
        return np.concatenate([outputs.whitened(part, noise) for part in self.parts if len(part)])


def rank_placed(
    candidates: Sequence[PlacedCandidate], fit: FreeRunFit, before: Prediction, asked: int
) -> list[PlacedRanked]:
    """Candidates by what they leave of samples that they were not fitted to; ``fit`` is that without any of them."""
    if not candidates:
        return []

    def row(candidate: PlacedCandidate) -> PlacedRanked:
        return _examined(candidate, before)

    with ThreadPoolExecutor(cores()) as pool:
        rows = list(pool.map(row, candidates))
    best = min(rows, key=lambda r: float(r.residual @ r.residual))
    noise = noise_left(best.fit.residual, len(best.fit.outputs))
    white = {r.name: r.white(noise) for r in rows}
    test = held_out_test(fit, before, noise)
    rows = [replace(r, p_value=min(1.0, asked * test.p_value(r.parts, bool(r.term.parameters)))) for r in rows]
    return [replace(r, distance=away, tied_with=tied) for r, away, tied in in_order(rows, white, asked)]


@dataclass(frozen=True, eq=False)
class HeldOutTest:
    """Whether a candidate explains what the model leaves beyond what its own coefficients could, on held-out parts.

    A structure has many coefficients, each with an error that shows in all of the judging part alike: a candidate that
    happens to move them nearer to what that part wants gains there with every block. So what they could do is taken out
    of residual and gain on each part (Frisch and Waugh, 1933).
    """

    outputs: Outputs
    noise: Noise
    own: tuple[Floats, Floats]  # what the model leaves of judging and fitting part, white
    bases: tuple[Floats, Floats]  # orthonormal bases of what its own coefficients and initial state could change there
    anew: bool = False  # stretches of a decay: what a change explains lies in the loud ones

    def p_value(self, parts: tuple[Floats, Floats], searched: bool) -> float:
        """Of one candidate alone, by what it leaves of both parts (:func:`held_out_parts`).

        Where its shape was searched for along the fitting part, on the other part only.
        """
        used = 1 if searched else 2
        before, after = list[Floats](), list[Floats]()
        for own, basis, part in zip(self.own[:used], self.bases, parts, strict=False):
            if len(own) and len(part):
                change = own - self.outputs.whitened(part, self.noise)
                left, moved = (x - basis @ (basis.T @ x) for x in (own, change))
                before.append(left)
                after.append(left - moved)
        return statistics.gain(np.concatenate(before), np.concatenate(after), evenly=self.anew).p_value


def held_out_test(fit: FreeRunFit, before: Prediction, noise: Noise) -> HeldOutTest:
    """The test of whatever a fitted structure lacks, in noise as the best candidate leaves it."""
    jacobian, outputs = linearise(fit, before.prepared), before.prepared.outputs
    parts = held_out_parts(fit, before, jacobian, before.prepared.plan.fit)
    try:
        columns = [] if before.run is None else [before.run.derivatives(fit), jacobian]
    except DivergenceError:
        columns = []
    bases = [orthonormal(outputs.whitened(x, noise)) for x in columns] or [np.zeros((len(p), 0)) for p in parts]
    white = [outputs.whitened(part, noise) if len(part) else part for part in parts]
    stretched = bool(before.prepared.record.stretches)
    return HeldOutTest(outputs, noise, (white[0], white[1]), (bases[0], bases[1]), stretched)


def orthonormal(columns: Floats) -> Floats:
    """An orthonormal basis of stacked derivatives, the same shape."""
    length = np.linalg.norm(columns, axis=0)
    return np.linalg.qr(columns / np.where(length > 0.0, length, 1.0))[0]


def held_out_parts(
    fit: FreeRunFit, prediction: Prediction, jacobian: Floats, fitted: tuple[int, int]
) -> tuple[Floats, Floats]:
    """Stacked residual of the judging part by the fitting part's coefficients, and the other way round.

    The other way (``diagnose.held_out``) takes one step of Gauss and Newton by the judging part's derivatives; it is
    empty where that cannot be, or the fit is of another part than ``fitted``, as that of a search is.
    """
    judged, nothing = prediction.residual, np.zeros(0)
    if prediction.run is None or not fit.keys or fit.span != fitted:
        return judged, nothing
    try:
        there = prediction.run.derivatives(fit)
    except DivergenceError:
        return judged, nothing
    own = len(fit.keys)
    misfit = prediction.prepared.outputs.stacked(prediction.misfit)
    other = fit.residual - jacobian[:, :own] @ least_squares(there, misfit)[:own]
    return judged, prediction.above(other - jacobian[:, own:] @ least_squares(jacobian[:, own:], other))


def _examined(candidate: PlacedCandidate, before: Prediction) -> PlacedRanked:
    fit, prepared = candidate.fit, candidate.prediction.prepared
    jacobian = linearise(fit, prepared)
    covariance = uncertainty(fit, prepared, jacobian)
    coefficient, error, parameters, errors = ranked.amount(candidate.entry, fit.keys, fit.values, covariance)
    flatness, steadiness = _curves(fit, candidate.entry, prepared.dt, jacobian)
    return PlacedRanked(
        candidate.entry, fit, candidate.prediction,
        statistics.gain(before.relative_residual, candidate.prediction.relative_residual),
        coefficient, error, parameters, errors, flatness, steadiness,
        held_out_parts(fit, candidate.prediction, jacobian, before.prepared.plan.fit),
    )  # fmt: skip


def _curves(
    fit: FreeRunFit, entry: ModelTerm, dt: float, jacobian: Floats
) -> tuple[CoefficientCurve | None, CoefficientCurve | None]:
    """The coefficient along frequency and along amplitude (``diagnose.constancy``); sensors one after the other."""
    columns = [fit.keys.index(s) for s in entry.symbols]
    direction = fit.values[columns]
    size = float(np.linalg.norm(direction))
    if size == 0.0:
        return None, None
    sensors = len(fit.outputs)
    samples = len(jacobian) // sensors
    rows = jacobian.reshape(samples, sensors, -1).transpose(1, 0, 2).reshape(samples * sensors, -1)
    residual = fit.residual.reshape(samples, sensors).T.ravel()
    own = rows[:, columns] @ (direction / size)
    length = np.linalg.norm(rows, axis=0)
    others = np.delete(rows / np.where(length > 0.0, length, 1.0), columns, axis=1)
    basis = np.linalg.qr(others)[0]
    alone = own - basis @ (basis.T @ own)
    if np.linalg.norm(alone) <= INDISTINCT * np.linalg.norm(own):
        return None, None
    each = alone.reshape(sensors, samples)
    most = int(np.argmax(np.sum(each**2, axis=1)))
    bands = along_frequency(each[most], residual.reshape(sensors, samples)[most], size, dt)
    classes = along_amplitude(alone, residual, size)
    return bands if len(bands.at) else None, classes if len(classes.at) else None
