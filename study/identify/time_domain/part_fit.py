"""A free run fitted to one part of a record, and run along the part that is judged."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from study.equations.free_run import FreeRun, needed_steps, prepare
from study.equations.model import Model
from study.identify.time_domain.free_run_fit import FreeRunFit, fit_free_run
from study.identify.time_domain.stretch_states import states_along, states_of_segments
from study.records.prepared import Prepared
from study.records.record import ALONE, Sensor
from study.support.arrays import Floats
from study.support.errors import DivergenceError
from study.support.least_squares import least_squares
from study.support.levenberg_marquardt import RELATIVE_OFFSET
from study.support.numbers import BEYOND_MEASURE
from study.support.statistics import clustered_covariance

SEARCH_STEPS = 2  # Runge-Kutta steps in a sampling interval while a search compares models


def rough_steps(model: Model, prepared: Prepared, start: Mapping[str, float]) -> int:
    """Steps of a search's runs: those of every search, or more where the model's own rates ask for them."""
    return max(SEARCH_STEPS, needed_steps(model.with_values(start), prepared.record, prepared.outputs))


def fit_part(
    model: Model,
    prepared: Prepared,
    held: Collection[str],
    start: Mapping[str, float] | None = None,
    *,
    steps: int = SEARCH_STEPS,
    max_iterations: int = 60,
    initial: Floats | None = None,
    offset: float = RELATIVE_OFFSET,
    noise: tuple[Floats, ...] = (),
    penalty: Floats | None = None,
) -> FreeRunFit:
    """Fit what is not held on the fitting part, from ``start`` where it has a value and from the model elsewhere.

    Raises
    ------
    StudyError
        If the model cannot run with these values, or a value is missing.
    """
    begin = {key: value for key, value in (start or {}).items() if key not in held}
    return fit_free_run(
        model, prepared.record, start=begin, held=held, outputs=prepared.outputs, steps_per_sample=steps,
        span=prepared.plan.fit, max_iterations=max_iterations, offset=offset,
        initial="estimate" if initial is None else initial, noise=noise, lost=prepared.lost,
        penalty=penalty,
    )  # fmt: skip


def run_of(
    fit: FreeRunFit, prepared: Prepared, keys: Sequence[str] = (), *,
    sensors: Sequence[Sensor] | None = None, finer: int = 1,
) -> FreeRun:  # fmt: skip
    """The free run of a fit along the samples that it was fitted to, ``finer`` times as many steps taken."""
    return prepare(
        fit.model, prepared.record, keys, sensors=prepared.outputs.sensors if sensors is None else sensors,
        steps_per_sample=finer * fit.steps_per_sample, span=fit.span, restarts=fit.restarts,
    )  # fmt: skip


def linearise(fit: FreeRunFit, prepared: Prepared) -> Floats:
    """Stacked derivatives of the motion on the samples that were fitted, by keys, then by initial states.

    Shape (n s, keys + 2 degrees of freedom). States are as many for each stretch of the record, and none where the
    motion is prescribed. Where the fit begins anew at restarts there may be thousands: the derivatives by the keys are
    then those beside all of them, shape (n s, keys), whose regression has the same coefficients and errors (Frisch and
    Waugh, 1933).
    """
    return run_and_slopes(fit, prepared)[1]


def run_and_slopes(fit: FreeRunFit, prepared: Prepared) -> tuple[Floats, Floats]:
    """The free run on the samples that were fitted, shape (n, s), and what :func:`linearise` gives."""
    values, run = dict(zip(fit.keys, fit.values.tolist(), strict=True)), run_of(fit, prepared, fit.keys)
    if not fit.restarts:
        motion, derivatives = run.respond(values, fit.initial, run.moving)
        return motion.copy(), _known(derivatives, prepared, fit.span)
    motion, derivatives, _ = run.respond_by_segment(values, fit.initial, run.moving)
    derivatives = _known(derivatives, prepared, fit.span)
    keys, width = len(fit.keys), len(prepared.outputs)
    for first, last in pairwise((0, *run.cuts, run.samples)):
        own = derivatives[width * first : width * last]
        states = own[:, keys:] / np.maximum(np.linalg.norm(own[:, keys:], axis=0), np.finfo(float).tiny)
        own[:, :keys] -= states @ np.linalg.lstsq(states, own[:, :keys], rcond=1e-10)[0]
    return motion.copy(), derivatives[:, :keys]


def with_states(fit: FreeRunFit, prepared: Prepared) -> Floats:
    """The same with the derivatives by the initial states of all segments, shape (n s, keys + states)."""
    values, run = dict(zip(fit.keys, fit.values.tolist(), strict=True)), run_of(fit, prepared, fit.keys)
    return _known(run.respond(values, fit.initial, run.moving)[1], prepared, fit.span)


def _known(values: Floats, prepared: Prepared, span: tuple[int, int]) -> Floats:
    """Values of all sensors along a span stacked, zero where a sample is lost."""
    return prepared.known(prepared.outputs.stacked(values), span)


def covariance_of(fit: FreeRunFit, jacobian: Floats) -> Floats:
    """Covariance of a fit's estimates that holds whatever the residual is, shape (keys + 2, keys + 2).

    ``jacobian`` is what :func:`linearise` gives of the fit.
    """
    others = fit.initial.size if fit.restarts and jacobian.shape[1] == len(fit.keys) else 0
    columns, residual = fit.whitened(jacobian), fit.whitened(fit.residual)
    if len(fit.penalty):
        beside = np.zeros((len(fit.penalty), columns.shape[1]))
        beside[:, : len(fit.keys)] = fit.penalty
        return clustered_covariance(columns, residual, others, len(fit.keys), beside)
    return clustered_covariance(columns, residual, others, len(fit.keys))


def integration_shift(fit: FreeRunFit, prepared: Prepared, coarse: Floats, jacobian: Floats) -> Floats:
    """By how much halving the steps would move the estimates, shape (keys + 2,), by one step of Gauss and Newton.

    ``coarse`` and ``jacobian`` are what :func:`run_and_slopes` gives of the fit.
    """
    try:
        fine = run_of(fit, prepared, finer=2).respond({}, fit.initial)[0]
    except DivergenceError:  # a motion that stays finite by the error of its integration alone
        return BEYOND_MEASURE * np.ones(jacobian.shape[1])
    return least_squares(fit.whitened(jacobian), fit.whitened(prepared.outputs.stacked(coarse - fine)))


def uncertainty(fit: FreeRunFit, prepared: Prepared, coarse: Floats, jacobian: Floats) -> Floats:
    """Covariance of a fit's estimates, shape (keys + 2, keys + 2): of the noise, and of the integration's own error.

    ``coarse`` and ``jacobian`` are what :func:`run_and_slopes` gives of the fit.
    """
    moved = integration_shift(fit, prepared, coarse, jacobian)
    with np.errstate(over="ignore"):  # where a run drifts away the shift is beyond all measure
        return covariance_of(fit, jacobian) + np.outer(moved, moved)


@dataclass(frozen=True)
class JudgingRun:
    """The free run of a fitted model that covers the judging part.

    Where that follows the fitting part the run goes on through both. Elsewhere its initial state, and nothing else, is
    estimated from the judging part; of a chaotic system, which forgets any, the states of as few segments as it needs.

    Attributes
    ----------
    fit : FreeRunFit
        The fitted model.
    prepared : Prepared
        The record and its parts.
    first : int
        Sample of the record at which the run begins.
    initial : array, shape (states,) or (1 + restarts, states)
        State there, and at each restart.
    restarts : tuple of int
        Samples of the record at which it begins anew.
    """

    fit: FreeRunFit
    prepared: Prepared
    first: int
    initial: Floats
    restarts: tuple[int, ...] = ()

    def motions(self, sensors: Sequence[Sensor] | None = None, finer: int = 1) -> Floats:
        """Motions on the judging part, shape (samples to judge, sensors); with more steps if asked.

        Those that are compared if ``sensors`` are left out.

        Raises
        ------
        DivergenceError
            If the free run leaves the range of finite numbers.
        """
        run, before = self._run((), finer, sensors=sensors), self.prepared.plan.judge[0] - self.first
        return run.respond({}, self.initial)[0][before:].copy()  # the run along what was fitted is not kept

    def motion(self, name: str) -> Floats:
        """A motion of a single mass on the judging part, shape (samples to judge,)."""
        return self.motions([Sensor(ALONE, name)])[:, 0]

    def derivatives(self, fit: FreeRunFit) -> Floats:
        """As :func:`linearise`, on the judging part, of a fit with the same motion.

        Raises
        ------
        DivergenceError
            If they leave the range of finite numbers, as they do long before the motion of a chaotic system.
        """
        values = dict(zip(fit.keys, fit.values.tolist(), strict=True))
        run = self._run(fit.keys, 1, fit.model)
        before = self.prepared.plan.judge[0] - self.first
        derivatives = run.respond(values, self.initial, run.moving)[1][before:].copy()  # as in `motions`
        if not np.all(np.abs(derivatives) < BEYOND_MEASURE):
            raise DivergenceError("the derivatives of the free run leave the range of numbers", run.start)
        return _known(derivatives, self.prepared, self.prepared.plan.judge)

    def _run(
        self, keys: Sequence[str], finer: int, model: Model | None = None, sensors: Sequence[Sensor] | None = None
    ) -> FreeRun:  # fmt: skip
        return prepare(
            model or self.fit.model, self.prepared.record, keys,
            sensors=self.prepared.outputs.sensors if sensors is None else sensors,
            steps_per_sample=finer * self.fit.steps_per_sample, span=(self.first, self.prepared.plan.judge[1]),
            restarts=self.restarts,
        )  # fmt: skip


def judging_run(fit: FreeRunFit, prepared: Prepared) -> JudgingRun:
    """The free run that the fitted model is judged by.

    Raises
    ------
    DivergenceError
        If it leaves the range of finite numbers.
    """
    plan = prepared.plan
    begun = plan.judge[0] in prepared.record.joints
    if plan.judge[0] == fit.span[1] and not (fit.restarts or begun):
        return JudgingRun(fit, prepared, fit.first, fit.initial)
    if fit.restarts:
        states, restarts = states_of_segments(fit, prepared, plan.judge)
        return JudgingRun(fit, prepared, plan.judge[0], states, restarts)
    return JudgingRun(fit, prepared, plan.judge[0], states_along(fit, prepared, plan.judge))
