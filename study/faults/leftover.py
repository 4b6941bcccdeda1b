"""What a fitted model leaves of the response, and what a fault or an effect of the library would explain of it.

A fault or an effect gets no more than the model's own coefficients and initial state could not take.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import fdtrc

from study.compare.prediction import Prediction, predict
from study.equations.model import ModelTerm
from study.equations.possible_effects import candidate_entries
from study.identify.time_domain import shape_search
from study.identify.time_domain.fit_model import with_term
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.motion_range import idle_effects
from study.identify.time_domain.part_fit import JudgingRun, fit_part, linearise, run_of
from study.identify.time_domain.shape_search import Start
from study.records.completion import derivative
from study.records.prepared import Prepared
from study.records.record import Sensor
from study.support.arrays import Floats, Ints
from study.support.cores import side_by_side
from study.support.errors import DivergenceError, StudyError
from study.support.least_squares import least_squares, pseudo_inverse
from study.support.statistics import Gain, clustered_covariance, gain, gain_beside, worse
from study.support.thresholds import ALPHA, BLOCKS, TOLERANCE

Columns = tuple[Floats, Floats]  # on the fitting and on the judging part, shapes (n, k) and (m, k)
IMITATED = 1e-5  # share of a column's length that the model's own coefficients leave of it
LONGEST_LOOK = 8192  # samples in which effects are searched for
STRONGEST = 5  # effects, by their linear share, that are fitted
AS_GOOD = 2.0  # standard errors by which one effect may leave more than another and be as good
FIT_RUNS = 20  # free runs of the fit of such an effect


@dataclass(frozen=True, eq=False)
class FittedResidual:
    """Residual of a fitted model on the fitting and on the judging part; n and m samples, s sensors, p keys.

    Those of several sensors are stacked (``records.outputs``).
    """

    fit: FreeRunFit
    prediction: Prediction

    @property
    def prepared(self) -> Prepared:
        """The record and its parts."""
        return self.prediction.prepared

    @property
    def run(self) -> JudgingRun:
        """The free run along the judging part."""
        assert self.prediction.run is not None, "what does not run leaves nothing to look at"
        return self.prediction.run

    @cached_property
    def own(self) -> Columns:
        """Derivatives of the response by the keys and initial states, shapes (n s, p + states), (m s, p + states).

        Where the judging part has an initial state of its own it is known there: its columns are zero.
        """
        judged = np.array(self.run.derivatives(self.fit), order="C")
        if self.run.first != self.fit.first:
            judged[:, len(self.fit.keys) :] = 0.0
        return linearise(self.fit, self.prepared), judged

    @cached_property
    def predicted(self) -> tuple[Floats, Floats]:
        """Response of the free run on both parts, free of noise: shapes (n, s) and (m, s)."""
        return run_of(self.fit, self.prepared).respond({}, self.fit.initial)[0], self.prediction.predicted

    @cached_property
    def residual(self) -> tuple[Floats, Floats]:
        """Measured less predicted response on both parts, shapes (n s,) and (m s,)."""
        outputs = self.prepared.outputs
        return outputs.stacked(self.fit.misfit), outputs.stacked(self.prediction.misfit)

    @property
    def both(self) -> Floats:
        """The same strung together, shape (n s + m s,)."""
        return np.concatenate(self.residual)

    @cached_property
    def sensors(self) -> "tuple[SensorResidual, ...]":
        """What is left of each sensor."""
        return tuple(SensorResidual(self, i) for i in range(len(self.prepared.outputs)))

    def of(self, channel: str) -> "SensorResidual":
        """What is left of the sensor with this channel."""
        return next(sensor for sensor in self.sensors if sensor.channel == channel)

    @cached_property
    def taking(self) -> tuple[Floats, Floats]:
        """What makes of a column the amounts of ``own`` nearest to it: of the fitting part's, and of both parts'.

        Shapes (p + states, n s) and (p + states, n s + m s).
        """
        return pseudo_inverse(self.own[0], 1e-9), pseudo_inverse(np.vstack(self.own), 1e-9)

    @cached_property
    def beside_own(self) -> Floats:
        """Residual of both parts beside what the model's own coefficients, fitted to both, take, (n s + m s,)."""
        return self.both - np.vstack(self.own) @ (self.taking[1] @ self.both)

    @property
    def spans(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """First sample of each part in the record, and the one after its last."""
        return self.fit.span, self.prepared.plan.judge

    @property
    def samples(self) -> tuple[Ints, Ints]:
        """Places of both parts in the record."""
        return np.arange(*self.spans[0], dtype=np.int64), np.arange(*self.spans[1], dtype=np.int64)

    @property
    def size(self) -> float:
        """Rms of the measured responses on the judging part, as they are stacked."""
        return float(np.sqrt(np.mean((self.prediction.size * np.array(self.prepared.outputs.weights)) ** 2)))

    @property
    def relative_power(self) -> float:
        """Power of what is left over that of the response: a correction of the gain scales both."""
        measured = self.prepared.fitted, self.prepared.judged
        return sum(float(np.sum(r**2)) / float(np.sum(m**2)) for r, m in zip(self.residual, measured, strict=True))

    def known(self, columns: Columns) -> Columns:
        """Columns on both parts, zero where samples are lost."""
        return self.prepared.known(columns[0], self.spans[0]), self.prepared.known(columns[1], self.spans[1])

    @cached_property
    def missing(self) -> "FittedResidual | None":
        """What is left beside the effect that explains most; None if none explains any of it.

        One outside of what makes it physical, which is another effect or a fault in disguise, only where no other does.
        """
        return _beside_the_best(self)


@dataclass(frozen=True, eq=False)
class SensorResidual:
    """What is left of one sensor, in its own unit; n and m samples."""

    whole: FittedResidual
    number: int  # of the sensor among those that are compared

    @property
    def prepared(self) -> Prepared:
        """The record and its parts."""
        return self.whole.prepared

    @property
    def sensor(self) -> Sensor:
        """What it measures."""
        return self.prepared.outputs.sensors[self.number]

    @property
    def channel(self) -> str:
        """What is read of it."""
        return str(self.sensor)

    @property
    def unit(self) -> str:
        """Unit of the channel."""
        return self.prepared.record.units.get(self.channel, "")

    @property
    def predicted(self) -> tuple[Floats, Floats]:
        """Its response in free run on both parts, shapes (n,) and (m,)."""
        fitted, judged = self.whole.predicted
        return fitted[:, self.number], judged[:, self.number]

    @property
    def residual(self) -> tuple[Floats, Floats]:
        """Measured less predicted response on both parts, shapes (n,) and (m,)."""
        return self.whole.fit.misfit[:, self.number], self.whole.prediction.misfit[:, self.number]

    @property
    def both(self) -> Floats:
        """The same strung together, shape (n + m,)."""
        return np.concatenate(self.residual)

    @property
    def size(self) -> float:
        """Rms of the measured response on the judging part."""
        return self.whole.prediction.of(self.number).size

    @property
    def samples(self) -> tuple[Ints, Ints]:
        """Places of both parts in the record."""
        return self.whole.samples

    def kept(self, span: tuple[int, int]) -> Floats:
        """1 for its samples along a span and 0 for those that are lost, shape (n,)."""
        count = len(self.prepared.outputs)
        return self.prepared.known(np.ones((span[1] - span[0]) * count), span)[self.number :: count]

    def changed(self, change: Callable[[Floats], Floats]) -> Columns:
        """A linear change of its response, shapes (n, 1) and (m, 1): of both parts at once where they follow."""
        fitted, judged = self.predicted
        if self.whole.spans[0][1] != self.whole.spans[1][0]:
            return change(fitted)[:, None], change(judged)[:, None]
        both = change(np.concatenate([fitted, judged]))[:, None]
        return both[: len(fitted)], both[len(fitted) :]

    @cached_property
    def by_late_reading(self) -> Columns:
        """Change of its response with each sample that it is read late, shapes (n, 1) and (m, 1)."""
        dt = self.prepared.dt
        return self.changed(lambda motion: -dt * derivative(motion, dt, 1))

    def stacked(self, columns: Columns) -> Columns:
        """Columns of this sensor, shapes (n, k) and (m, k), among those of all, which are zero: (n s, k), (m s, k)."""
        outputs = self.prepared.outputs
        if len(outputs) == 1:
            return columns

        def among(own: Floats) -> Floats:
            found = np.zeros((len(own), len(outputs), own.shape[1]))
            found[:, self.number] = own
            return outputs.stacked(found)

        return among(columns[0]), among(columns[1])


def leftover(fit: FreeRunFit, prepared: Prepared) -> FittedResidual | None:
    """What a fit leaves; None where its free run is no smooth function of its coefficients, or none at all."""
    if fit.restarts:
        return None
    prediction = predict(fit, prepared)
    return None if prediction.diverged else FittedResidual(fit, prediction)


def refitted(fit: FreeRunFit, prepared: Prepared, without: str = "") -> FreeRunFit | None:
    """A fit again, to a record that was corrected or without an effect, from where it stands; None where that fails."""
    if fit.restarts:
        return None
    model, anew = fit.model, fit.first != prepared.plan.fit[0]
    if without:
        gone = next(entry.term for entry in model.terms if entry.name == without)
        model, anew = model.without_term(without), anew or gone.state is not None
    held = [key for key in fit.held if key in model.values]
    initial = None if anew else np.atleast_2d(fit.initial)
    try:
        return fit_part(model, prepared, held, steps=fit.steps_per_sample, initial=initial)
    except StudyError:
        return None


def left_again(left: FittedResidual, prepared: Prepared, without: str = "") -> FittedResidual | None:
    """What the model leaves that is fitted so again."""
    fit = refitted(left.fit, prepared, without)
    return None if fit is None else leftover(fit, prepared)


@dataclass(frozen=True)
class Share:
    """What columns explain of a leftover; k columns."""

    amounts: Floats  # shape (k,); from both parts
    covariance: Floats  # shape (k, k), clustered
    p_value: float  # of such amounts, or the first of them, if they were zero
    gain: Gain  # on the judging part, of the amounts of the fitting part
    # Mean square on both parts of what the amounts from both add beside the model's own, over that of the response.
    power: float

    def significant(self, asked: int) -> bool:
        """Whether that is no chance, of so many that were asked for, and more than integration resolves."""
        p_value = 2.0 * min(self.p_value, self.gain.p_value)  # two tests: each sees what the other is blind to
        return p_value * asked < ALPHA and self.power > TOLERANCE**2


def share(left: FittedResidual, columns: Columns, leading: bool = False) -> Share | None:
    """Joint regression of the residual on the model's own sensitivities and more columns.

    ``columns`` are those of a fault or an effect on both parts, shapes (n, k) and (m, k). They get only what the
    model's own coefficients and initial state cannot take; None where these can take all of it, or where what they can
    take is beyond the range of numbers, as along a chaotic motion. A test of all amounts or, where ``leading``, of the
    first alone: the others stand for what is unknown beside it.
    """
    fitted, judged = left.known(columns)
    try:
        taken = left.taking[0] @ fitted
    except DivergenceError:
        return None
    alone = fitted - left.own[0] @ taken
    if np.any(np.linalg.norm(alone, axis=0) <= IMITATED * np.linalg.norm(fitted, axis=0)):
        return None
    change = (judged - left.own[1] @ taken) @ least_squares(alone, left.residual[0], 1e-9)
    whole, covariance = amounts_on_both(left, columns)
    power = float(np.mean((_apart(left, columns) @ whole) ** 2)) / left.size**2
    count = 1 if leading else len(whole)
    wald = float(whole[:count] @ np.linalg.pinv(covariance[:count, :count], hermitian=True) @ whole[:count])
    freedom = 2 * BLOCKS - count  # the covariance rests on blocks: the test is Hotelling's, as these are few
    p_value = float(fdtrc(count, freedom, wald * freedom / (count * (2 * BLOCKS - 1))))
    found = gain_beside(left.residual[1], change, left.beside_own[len(fitted) :])
    return Share(whole, covariance, p_value, found, power)


def gained(before: FittedResidual, after: FittedResidual) -> Gain:
    """What a fit explains of what another leaves of the judging part."""
    return gain(before.residual[1], _judged_as(before, after))


def _judged_as(before: FittedResidual, after: FittedResidual) -> Floats:
    """What a fit leaves of the judging part, (m s,), weighted as in another: a correction changes sizes."""
    return before.prepared.outputs.stacked(after.prediction.misfit)


def leaves_less(before: FittedResidual, after: FittedResidual, asked: int) -> bool:
    """Whether a fit leaves less of the judging part than another by no chance, so many having been tried."""
    less = _judged_as(before, after)
    power = float(np.mean(before.residual[1] ** 2) - np.mean(less**2)) / before.size**2
    held_out = gained(before, after)
    return held_out.p_value * asked < ALPHA and power > TOLERANCE**2


def amounts_on_both(left: FittedResidual, columns: Columns) -> tuple[Floats, Floats]:
    """Amounts of the columns, shape (k,), and their clustered covariance, from both parts of the record together."""
    apart, own = _apart(left, columns), left.taking[1]
    amounts = least_squares(apart, left.both, 1e-9)
    return amounts, clustered_covariance(apart, left.beside_own - apart @ amounts, len(own))


def _apart(left: FittedResidual, columns: Columns) -> Floats:
    """Columns on both parts less what the model's own coefficients, fitted to both, take of them, (n s + m s, k).

    A regression on these has the amounts of one on all of them (Frisch and Waugh, 1933).
    """
    together = np.vstack(left.known(columns))
    return together - np.vstack(left.own) @ (left.taking[1] @ together)


def asks_for_more(left: FittedResidual) -> bool:
    """Whether any effect of the library explains a part of what is left, as far as small amounts of it show.

    One free run with the sensitivities of all effects without shape parameters; where that fails nothing is ruled out.
    """
    fit, model, keys = left.fit, left.fit.model, list[str]()
    for entry in candidate_entries(model, turning=left.prepared.record.rotations):
        if not entry.parameters:
            model = model.with_term(replace(entry, coefficients=(0.0,) * len(entry.symbols)))
            keys += entry.symbols
    if not keys:
        return True
    extended = replace(fit, model=model, keys=tuple(keys), values=np.zeros(len(keys)))
    try:
        added = run_of(extended, left.prepared, keys).respond(dict.fromkeys(keys, 0.0), fit.initial, 0)[1]
        fitted = left.prepared.outputs.stacked(added)
        judged = left.run.derivatives(extended)[:, : len(keys)]
    except StudyError:
        return True
    if not (np.all(np.isfinite(fitted)) and np.all(np.isfinite(judged))):
        return True
    found = [share(left, (fitted[:, [i]], judged[:, [i]])) for i in range(len(keys))]
    return any(f is not None and f.significant(len(found)) for f in found)


def _beside_the_best(left: FittedResidual) -> FittedResidual | None:
    prepared, fit = left.prepared, left.fit
    look = prepared.shortened(
        int(np.clip(prepared.samples_in(shape_search.SEARCH_PERIODS), shape_search.SEARCH_SAMPLES, LONGEST_LOOK))
    )
    entries = candidate_entries(fit.model, turning=prepared.record.rotations)
    try:
        near = fit if look is prepared else fit_part(fit.model, look, fit.held, steps=fit.steps_per_sample)
        base = shape_search.baseline(near, look)
    except StudyError:
        return None

    def fitted(begun: tuple[ModelTerm, list[Start]]) -> FittedResidual | None:
        try:
            near = with_term(base, *begun)
            initial = np.atleast_2d(near.initial)[:1] if near.first == prepared.plan.fit[0] else None
            fit = fit_part(
                near.model,
                prepared,
                base.fit.held,
                steps=near.steps_per_sample,
                max_iterations=FIT_RUNS,
                initial=initial,
            )
        except StudyError:
            return None
        return leftover(fit, prepared)

    begins = zip(entries, shape_search.starts_of(entries, base), strict=True)
    starts = [(entry, found) for entry, found in begins if found]
    promising = sorted(starts, key=lambda s: -s[1][0].share)[:STRONGEST]
    tried = [t for t in side_by_side(fitted, promising, lambda begun: begun[0].term.effort) if t is not None]
    for group in ([t for t in tried if not unphysical(t, left)], tried):
        if group:  # of those that chance may make worse than the best, the one with the fewest unknowns
            best = min(group, key=lambda t: float(np.sum(t.residual[1] ** 2)))
            level = [t for t in group if t is best or worse(t.residual[1], best.residual[1]) < AS_GOOD]
            simplest = min(level, key=lambda t: (len(t.fit.keys), t is not best))
            if leaves_less(left, simplest, len(entries)):
                return simplest
    return None


def effects_beside(more: FittedResidual, left: FittedResidual) -> list[str]:
    """Names of the effects that a fuller model has beside those of a plainer one."""
    return [e.name for e in more.fit.model.terms if e.name not in left.fit.model]


def unphysical(more: FittedResidual, left: FittedResidual) -> bool:
    """Whether any of these is fitted outside of what makes it physical, or of what the motion reaches."""
    model, names = more.fit.model, effects_beside(more, left)
    added, values = [e for e in model.terms if e.name in names], model.values
    broken = any(e.term.physical(dict(zip(e.term.keys, map(values.get, e.keys), strict=True))) for e in added)
    return broken or bool(idle_effects(more.fit, added, more.prepared))
