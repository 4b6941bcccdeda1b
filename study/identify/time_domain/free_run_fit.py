"""Output error: the model runs free under the measured force and is fitted to the measured response.

The force is taken as known and the noise as additive on the response, so no noisy regressor enters and
the estimate is not biased by noise (the reverse MI/SO estimate is, Section 5.4). The sum of squares is
minimised by the method of Levenberg and Marquardt (``levenberg_marquardt``) with exact derivatives
(``free_run``). A chaotic system is run segment by segment (``shooting``, ``multiple_shooting``).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from study.equations.free_run import FreeRun, prepare
from study.equations.linear_part import is_positive
from study.equations.modal_part import ModalPart
from study.equations.model import Model
from study.identify.frequency_domain.coefficients import Estimate
from study.records.outputs import DISPLACEMENT, Outputs
from study.records.record import Record
from study.records.states import starting_states
from study.support.arrays import Bools, Floats
from study.support.errors import DivergenceError, StudyError
from study.support.levenberg_marquardt import RELATIVE_OFFSET, ContinuityGaps, End, Point, minimise, point_at, with_gaps

FARTHEST = 1e9  # times its start: a mass that the motion does not show at all runs off without end


@dataclass(frozen=True)
class FreeRunFit:
    """Result of a fit in free run; n samples, s sensors, p keys.

    Attributes
    ----------
    model : Model
        The model with the estimates filled in.
    keys : tuple of str
        What was estimated.
    values : array, shape (p,)
        Estimates.
    covariance : array, shape (p, p)
        ``s^2 (J^T J)^-1`` with s^2 from the residual, the uncertainty of the initial state included:
        right if the residual is white noise. With the true variance for s^2 it is the Cramer-Rao bound
        for white Gaussian noise.
    initial : array, shape (states,), or (segments, states) with restarts
        Displacement, velocity and the terms' own states at the first sample, of each segment.
    residual : array, shape (n s,)
        Measured minus predicted motion, stacked (``records.outputs``).
    converged : bool
        Whether the fit arrived at a minimum.
    iterations : int
        Free runs that were made.
    message : str
        How the fit ended, in a sentence.
    first : int
        Sample of the record at which the fitted part begins.
    restarts : tuple of int
        Samples of the record at which segments after the first begin.
    steps_per_sample : int
        Runge-Kutta steps that were taken in each sampling interval.
    outputs : Outputs
        What was fitted.
    noise : tuple of arrays, shape (order + 1,)
        Autoregressive coefficients of each sensor's noise, with which the residual was weighted; empty for white noise.
    undecided : tuple of str
        Keys that the record does not show, or cannot tell apart.
    penalty : array, shape (rows, p)
        Rows times the estimates that were minimised beside the residual (``smoothness``); none without smooth curves.
    elsewhere : tuple of FreeRunFit
        Where the other starts of the search led whose best this is, as far as they were followed (``rivals``).
    """

    model: Model
    keys: tuple[str, ...]
    values: Floats
    covariance: Floats
    initial: Floats
    residual: Floats
    converged: bool
    iterations: int
    message: str
    restarts: tuple[int, ...] = ()
    first: int = 0
    steps_per_sample: int = 2
    outputs: Outputs = DISPLACEMENT
    noise: tuple[Floats, ...] = ()
    undecided: tuple[str, ...] = ()
    penalty: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    elsewhere: tuple["FreeRunFit", ...] = ()

    @property
    def span(self) -> tuple[int, int]:
        """First sample of the record that was fitted, and the one after the last."""
        return self.first, self.first + self.samples

    @property
    def samples(self) -> int:
        """How many samples of the record were fitted."""
        return len(self.residual) // len(self.outputs)

    @property
    def misfit(self) -> Floats:
        """Measured minus predicted motion in the units of the sensors, shape (n, s)."""
        return self.outputs.apart(self.residual)

    @property
    def cost(self) -> float:
        """Mean square of the residual, weighted as it was fitted."""
        return float(np.mean(self.whitened(self.residual) ** 2))

    def whitened(self, stacked: Floats) -> Floats:
        """Stacked values weighted as the residual was."""
        return self.outputs.whitened(stacked, self.noise)

    @property
    def held(self) -> tuple[str, ...]:
        """Keys of the model that were not estimated."""
        return tuple(key for key in self.model.values if key not in self.keys)

    @property
    def rms(self) -> float:
        """Root mean square of the residual, in the unit of a single sensor."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def estimate(self) -> Estimate:
        """Estimates and covariance in the form that every estimator of the project gives."""
        return Estimate(self.keys, self.values, self.covariance)


def released(fit: FreeRunFit) -> FreeRunFit:
    """The same motion with every key of the model to differentiate by, held ones too."""
    numbers = fit.model.numbers()
    return replace(fit, keys=tuple(numbers), values=np.array(list(numbers.values())))


def fit_free_run(
    model: Model,
    record: Record,
    *,
    start: Mapping[str, float] | None = None,
    held: Collection[str] = (),
    outputs: Outputs = DISPLACEMENT,
    steps_per_sample: int = 2,
    span: tuple[int, int] | None = None,
    restarts: Sequence[int] = (),
    max_iterations: int = 60,
    initial: str | Floats = "estimate",
    continuity: float = 0.0,
    offset: float = RELATIVE_OFFSET,
    noise: tuple[Floats, ...] = (),
    lost: Bools | None = None,
    penalty: Floats | None = None,
) -> FreeRunFit:
    """Fit a model in free run.

    Parameters
    ----------
    model : Model
        Which terms act. Values of ``held`` keys are taken from it; so are starting values that ``start`` lacks.
    record, steps_per_sample, span, restarts
        As for :func:`free_run.prepare`. The state after each restart is estimated too.
    outputs : Outputs
        The sensors that are fitted.
    start : mapping of float
        Starting values by key, for example from MI/SO.
    held : collection of str
        Keys that keep the model's value.
    max_iterations : int
        Free runs after which to give up.
    initial : str or array, shape (segments, states)
        ``estimate`` displacement, velocity and the terms' own states at the first sample, or take them
        as zero: ``rest``. An array is estimated too and gives the starting values.
    continuity : float
        Weight of the continuity constraints: gaps between segments are penalised as shares of the spread of the
        states, the residual as a share of the response's. From 100 on the segments are one motion, all but exactly.
    offset : float
        Length of the next step, in standard errors, at which a search has converged.
    noise : tuple of arrays, shape (order + 1,)
        Autoregressive coefficients of each sensor's noise, as :func:`study.support.autoregression.autoregression` gives
        them; the residual filtered with them is minimised. White noise by default, and wherever there are restarts.
    lost : bool array, shape (samples of the record,) or (samples of the record, s), optional
        Samples that say nothing: their residual counts as zero.
    penalty : array, shape (rows, keys), optional
        Rows whose products with what is estimated, in the order of the model, are minimised as well.

    Raises
    ------
    DivergenceError
        If the model diverges with the starting values. A fit that does not converge says so in ``message``.
    StudyError
        If a starting value, a channel or an option is invalid.
    """
    for sensor in outputs.sensors:
        if str(sensor) not in record:
            raise StudyError(f"record {record.name!r} has no {sensor}; it has {', '.join(record.channels)}")
    if isinstance(initial, str) and initial not in ("estimate", "rest"):
        raise StudyError(f"initial is {initial!r}; it must be 'estimate' or 'rest'")
    resting = isinstance(initial, str) and initial == "rest"
    if resting and restarts:
        raise StudyError(f"restarts at {tuple(restarts)} begin from estimated states; initial cannot be 'rest'")
    begin = _starting_values(model, start or {}, held)
    run = prepare(
        model, record, tuple(begin), sensors=outputs.sensors, steps_per_sample=steps_per_sample, span=span,
        restarts=restarts,
    )  # fmt: skip
    first = 0 if span is None else span[0]
    free = 0 if resting else run.states
    states = np.zeros((len(run.cuts) + 1, free))
    if not isinstance(initial, str):
        states[:] = initial
    elif free and model.modal is None:  # how modes begin no sensor shows by itself
        begins = (first, *(first + cut for cut in run.cuts))
        shown = starting_states(record, outputs, begins, coordinates=model.coordinates)
        states[:, : run.moving] = shown[:, : run.moving]
    measured = outputs.stacked(outputs.measured(record, (first, first + run.samples)))
    positive = {key: FARTHEST * begin[key] for entry in model.terms for key in entry.positive if key in begin}
    kept = None if lost is None else outputs.kept(lost[first : first + run.samples])
    coupled = any(t.term.name == "inertia" and t.place.kind != "at" and set(t.keys) & set(begin) for t in model.terms)
    weights = _weights(continuity, measured, states)
    problem = _Problem(
        run,
        model if coupled else None,
        model.modal,
        outputs,
        measured,
        free,
        weights,
        positive,
        noise,
        kept,
        np.zeros((0, len(begin))) if penalty is None else penalty,
    )
    end = problem.search(np.array([*begin.values(), *states.ravel()]), max_iterations, offset)
    return replace(
        _result(model, problem, end), restarts=tuple(restarts), first=first, steps_per_sample=steps_per_sample
    )


def _weights(continuity: float, measured: Floats, states: Floats) -> Floats | None:
    """Weight of a gap in each state, None without continuity constraints."""
    if continuity <= 0.0 or len(states) < 2:
        return None
    spread = np.std(states, axis=0)
    return continuity * float(np.std(measured)) / np.where(spread > 0.0, spread, np.inf)


def _starting_values(model: Model, start: Mapping[str, float], held: Collection[str]) -> dict[str, float]:
    for key in (*start, *held):
        if key not in model.values:
            raise StudyError(f"model {model.name!r} has no {key!r}; it has {', '.join(model.values)}")
    begin: dict[str, float] = {}
    for key, value in model.values.items():
        if key in held:
            continue
        chosen = start.get(key, value)
        if chosen is None or not np.isfinite(chosen):
            raise StudyError(f"model {model.name!r} has the starting value {chosen} for {key}; a number is needed")
        begin[key] = float(chosen)
    return begin


@dataclass(frozen=True)
class _Problem:
    """A search over the keys and, segment by segment, the free initial states."""

    run: FreeRun
    coupled: Model | None  # of which no value may leave the mass matrix without a kinetic energy for some motion
    modal: ModalPart | None  # no mode of which may be faster than samples can show
    outputs: Outputs
    measured: Floats
    free_states: int
    weights: Floats | None
    positive: Mapping[str, float]  # keys above zero, and how far they may run off
    noise: tuple[Floats, ...]
    kept: Floats | None  # 0 for samples that are lost, 1 for others
    penalty: Floats  # rows beside the residual, shape (rows, keys)

    def states(self, x: Floats) -> Floats:
        """Initial states in the variables, shape (segments, states)."""
        states = np.zeros((len(self.run.cuts) + 1, self.run.states))
        states[:, : self.free_states] = x[len(self.run.keys) :].reshape(len(states), self.free_states)
        return states

    def values(self, x: Floats) -> dict[str, float] | None:
        """Values of the keys in the variables; None where no model may have them."""
        values = dict(zip(self.run.keys, (float(v) for v in x), strict=False))
        if any(not 0.0 < values[key] <= max(limit, 0.0) for key, limit in self.positive.items()):
            return None
        if self.coupled is not None and not is_positive(self.coupled, values):
            return None
        if self.modal is not None and np.any(self.modal.rates(values) * self.run.dt > np.pi):
            return None
        return values

    def cost(self, x: Floats) -> float:
        """Sum of squares that :meth:`linearise` has at x; infinite where the model has no finite response there."""
        values, states = self.values(x), self.states(x)
        if values is None:
            return np.inf
        try:
            response, arrivals = self.run.move_by_segment(values, states)
        except DivergenceError:
            return np.inf
        residual = self._weighted(self.measured - self.outputs.stacked(response))
        if len(self.penalty):
            residual = np.concatenate([residual, -self.penalty @ x[: len(self.run.keys)]])
        with np.errstate(over="ignore", invalid="ignore"):  # what is out of range lowers nothing
            if self.weights is not None:
                residual = with_gaps(residual, self.weights * (arrivals - states[1:]))
            return float(residual @ residual)

    def linearise(self, x: Floats) -> Point | None:
        """Residual and Jacobian at x; None where the model has no finite response there."""
        values, states = self.values(x), self.states(x)
        if values is None:
            return None
        try:
            response, jacobian, arrivals = self.run.respond_by_segment(values, states, self.free_states)
        except DivergenceError:
            return None
        continuity = None
        if self.weights is not None:
            with np.errstate(over="ignore", invalid="ignore"):  # what is out of range is refused by point_at
                gaps = self.weights * (arrivals[:, :, 0] - states[1:])
                continuity = ContinuityGaps(gaps, self.weights[:, None] * arrivals[:, :, 1:], self.weights)
        residual = self.measured - self.outputs.stacked(response)
        jacobian = self.outputs.stacked(jacobian, in_place=True)
        residual, jacobian = self._weighted(residual), self._weighted(jacobian)
        begins = (0, *(len(self.outputs) * cut for cut in self.run.cuts))
        if len(self.penalty):
            keys, beside = len(self.run.keys), np.zeros((len(self.penalty), jacobian.shape[1]))
            beside[:, :keys] = self.penalty
            residual = np.concatenate([residual, -self.penalty @ x[:keys]])
            jacobian = np.concatenate([jacobian, beside])
        return point_at(x, residual, jacobian, len(self.run.keys), begins, continuity)

    def _weighted(self, stacked: Floats) -> Floats:
        """Stacked values, zero where samples are lost, weighted by the noise; or columns of them."""
        if self.kept is not None:
            with np.errstate(invalid="ignore"):  # derivatives beyond all numbers where a sample is lost: refused later
                stacked = stacked * (self.kept if stacked.ndim == 1 else self.kept[:, None])
        return self.outputs.whitened(stacked, self.noise)

    def residual(self, x: Floats) -> Floats:
        """Measured minus predicted motion at x, stacked."""
        values = dict(zip(self.run.keys, (float(v) for v in x), strict=False))
        residual = self.measured - self.outputs.stacked(self.run.respond_by_segment(values, self.states(x))[0])
        return residual if self.kept is None else residual * self.kept

    def search(self, x: Floats, max_iterations: int, offset: float) -> End:
        """The minimum near x."""
        point = self.linearise(x)
        if point is None:
            values = ", ".join(f"{key} = {v:g}" for key, v in zip(self.run.keys, x, strict=False))
            raise DivergenceError(f"the free run diverges with the starting values {values}", self.run.start)
        return minimise(self.linearise, point, float(np.linalg.norm(self.measured)), max_iterations, offset, self.cost)


def _result(model: Model, problem: _Problem, end: End) -> FreeRunFit:
    point, keys, message = end.point, problem.run.keys, end.message
    unclear = [key for key, undecided in zip(keys, point.undecided(), strict=False) if undecided]
    if unclear:
        message += f"; this record cannot tell apart or does not show {', '.join(unclear)}"
    states = problem.states(point.x)
    return FreeRunFit(
        model=model.with_values(dict(zip(keys, (float(v) for v in point.x), strict=False))),
        keys=keys,
        values=point.x[: len(keys)],
        covariance=point.covariance(),
        initial=states if problem.run.cuts else states[0],
        residual=problem.residual(point.x) if problem.noise else point.residual[: len(problem.measured)],
        outputs=problem.outputs,
        noise=problem.noise,
        undecided=tuple(unclear),
        penalty=problem.penalty,
        converged=end.converged,
        iterations=end.iterations,
        message=message,
    )
