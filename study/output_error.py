"""Output error: the model runs free under the measured force and is fitted to the measured response.

The force is taken as known and the noise as additive on the response, so no noisy regressor enters and
the estimate is not biased by noise (the reverse MI/SO estimate is, Section 5.4). The sum of squares is
minimised by the method of Levenberg and Marquardt with exact derivatives (``study.free_run``).
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.errors import DivergenceError, StudyError
from study.free_run import FreeRun, prepare
from study.model import Model
from study.parameters import Estimate
from study.record import Record

Floats = NDArray[np.float64]
OFFSET = 1e-4  # converged when the next step is below this many standard errors (Bates and Watts, 1981)
ROUNDING = 1e-11  # ... or changes the response by less than this share of it
PATIENCE = 8  # free runs that may pass without lowering the error by what matters
MATTERS = 1e-3  # ... as a share of what one standard error brings
INDISTINCT = 1e-12  # eigenvalue of the scaled normal matrix below which coefficients cannot be told apart
POSITIVE = ("m", "u_g", "tau", "f_m", "f")  # coefficients and shape parameters without meaning below zero


@dataclass(frozen=True)
class FreeRunFit:
    """What a fit in free run found; n samples, p keys.

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
    initial : array, shape (states,)
        Displacement, velocity and the terms' own states at the first sample.
    residual : array, shape (n,)
        Measured minus predicted response.
    converged : bool
        Whether the fit arrived at a minimum.
    iterations : int
        Free runs that were made.
    message : str
        How the fit ended, in a sentence.
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

    @property
    def rms(self) -> float:
        """Root mean square of the residual, in the unit of the response."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def estimate(self) -> Estimate:
        """Estimates and covariance in the form that every estimator of the project gives."""
        return Estimate(self.keys, self.values, self.covariance)


def fit_free_run(
    model: Model,
    record: Record,
    *,
    start: Mapping[str, float] | None = None,
    held: Collection[str] = (),
    response: str = "displacement",
    steps_per_sample: int = 2,
    span: tuple[int, int] | None = None,
    max_iterations: int = 60,
    initial: str = "estimate",
) -> FreeRunFit:
    """Fit a model in free run.

    Parameters
    ----------
    model : Model
        Which terms act. Values of ``held`` keys are taken from it; so are starting values that ``start`` lacks.
    record : Record
        Force, response, and the extra channels which the user's own terms name.
    start : mapping of float
        Starting values by key, for example from MI/SO.
    held : collection of str
        Keys that keep the model's value.
    response : str
        The motion to fit: ``displacement``, ``velocity`` or ``acceleration``.
    steps_per_sample : int
        Runge-Kutta steps in each sampling interval.
    span : pair of int, optional
        First sample, and the one after the last; the whole record if left out.
    max_iterations : int
        Free runs after which to give up.
    initial : str
        ``estimate`` displacement, velocity and the terms' own states at the first sample, or take them
        as zero: ``rest``.

    Returns
    -------
    FreeRunFit
        Also where the fit did not converge; ``message`` says why.

    Raises
    ------
    DivergenceError
        If the model diverges with the starting values.
    StudyError
        If a starting value, a channel or an option is not what it has to be.
    """
    if response not in record:
        raise StudyError(f"record {record.name!r} has no {response}; it has {', '.join(record.channels)}")
    if initial not in ("estimate", "rest"):
        raise StudyError(f"initial is {initial!r}; it must be 'estimate' or 'rest'")
    begin = _starting_values(model, start or {}, held)
    keys = tuple(begin)
    run = prepare(model, record, keys, response=response, steps_per_sample=steps_per_sample, span=span)
    first = 0 if span is None else span[0]
    measured = record[response][first : first + run.samples]
    state = _starting_state(measured, run) if initial == "estimate" else np.zeros(0)
    problem = _Problem(run, measured, len(state))
    end = _minimise(problem, np.concatenate([list(begin.values()), state]), max_iterations)
    return _result(model, problem, end)


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


def _starting_state(measured: Floats, run: FreeRun) -> Floats:
    """Displacement and velocity at the first sample as far as the response itself shows them."""
    state = np.zeros(len(run.slots) + 1)
    if run.row == 0:
        state[:2] = measured[0], (measured[1] - measured[0]) / run.dt
    elif run.row == 1:
        state[1] = measured[0]
    return state


@dataclass(frozen=True)
class _Problem:
    run: FreeRun
    measured: Floats
    free_states: int

    def linearise(self, x: Floats) -> "_Point | None":
        """Residual and Jacobian at x; None where the model has no finite response there."""
        keys = self.run.keys
        values = dict(zip(keys, (float(v) for v in x), strict=False))
        if any(v <= 0.0 and key.rpartition(".")[2] in POSITIVE for key, v in values.items()):
            return None
        try:
            response, jacobian = self.run.respond(values, x[len(keys) :], self.free_states)
        except DivergenceError:
            return None
        residual = self.measured - response
        with np.errstate(over="ignore", invalid="ignore"):  # on its way out of range: refused below
            scale = np.sqrt(np.einsum("ij,ij->j", jacobian, jacobian))
        if not np.all(np.isfinite(scale)):
            return None
        scale[scale == 0.0] = 1.0
        jacobian /= scale
        return _Point(x, residual, float(residual @ residual), scale, jacobian.T @ jacobian, jacobian.T @ residual)


@dataclass(frozen=True)
class _Point:
    """A point of the search; ``normal`` and ``gradient`` are those of the Jacobian with columns of unit length."""

    x: Floats
    residual: Floats
    cost: float
    scale: Floats
    normal: Floats
    gradient: Floats

    def decrement(self) -> float:
        """How much the sum of squares would fall in a full Gauss-Newton step, were the model linear."""
        values, vectors = np.linalg.eigh(self.normal)
        known = values > INDISTINCT
        return float(np.sum((vectors.T @ self.gradient)[known] ** 2 / values[known]))


@dataclass(frozen=True)
class _End:
    point: _Point
    converged: bool
    iterations: int
    message: str


def _minimise(problem: _Problem, x: Floats, max_iterations: int) -> _End:
    """Levenberg-Marquardt with Nielsen's damping; the variables are scaled by the Jacobian's columns.

    A trial that diverges is a rejected step. Every test is unchanged by a change of units.
    """
    point = problem.linearise(x)
    if point is None:
        values = ", ".join(f"{key} = {v:g}" for key, v in zip(problem.run.keys, x, strict=False))
        raise DivergenceError(f"the free run diverges with the starting values {values}", problem.run.start)
    size = float(np.linalg.norm(problem.measured))
    freedom = max(len(problem.measured) - len(x), 1)
    damping, growth, costs = 1e-3, 2.0, list[float]()
    for iteration in range(1, max_iterations + 1):
        one = len(x) * point.cost / freedom  # what a step of one standard error brings
        fall = point.decrement()
        if fall <= OFFSET**2 * one or fall <= (ROUNDING * size) ** 2:
            return _End(point, True, iteration, f"converged after {iteration} free runs")
        costs.append(point.cost)
        if len(costs) > PATIENCE and costs[-1 - PATIENCE] - point.cost < MATTERS * one:
            return _End(point, fall <= one, iteration, _stalled(iteration, np.sqrt(fall / one)))
        step = np.linalg.solve(point.normal + damping * np.eye(len(x)), point.gradient)
        trial = problem.linearise(point.x + step / point.scale)
        expected = float(step @ (damping * step + point.gradient))
        gain = -1.0 if trial is None else (point.cost - trial.cost) / expected
        if trial is not None and gain > 0.0:
            point = trial
            damping, growth = max(damping * max(0.1, 1.0 - (2.0 * gain - 1.0) ** 3), INDISTINCT), 2.0
        else:
            damping, growth = damping * growth, 2.0 * growth
    return _End(point, False, max_iterations, f"still falling after {max_iterations} free runs, the most allowed")


def _stalled(iteration: int, offset: float) -> str:
    """Friction and stops make the sum of squares kinked, and its minimum may lie in a kink."""
    if offset <= 1.0:
        return f"converged after {iteration} free runs to where no step lowers the error"
    return f"stuck after {iteration} free runs: no step lowers the error, one of {offset:.1f} standard errors should"


def _result(model: Model, problem: _Problem, end: _End) -> FreeRunFit:
    point, keys = end.point, problem.run.keys
    p = len(keys)
    variance = point.cost / max(len(point.residual) - len(point.x), 1)
    values, vectors = np.linalg.eigh(point.normal)
    inverse = (vectors / np.maximum(values, np.finfo(float).eps)) @ vectors.T
    covariance = variance * inverse / np.outer(point.scale, point.scale)
    message = end.message
    blurred = np.max(np.abs(vectors[:, values <= INDISTINCT]), axis=1, initial=0.0) > 0.1
    names = [key for key, unclear in zip(keys, blurred, strict=False) if unclear]
    if names:
        message += f"; this record cannot tell apart or does not show {', '.join(names)}"
    initial = np.zeros(len(problem.run.slots) + 1)
    initial[: problem.free_states] = point.x[p:]
    estimates = point.x[:p]
    filled = model.with_values(dict(zip(keys, (float(v) for v in estimates), strict=True)))
    return FreeRunFit(
        filled, keys, estimates, covariance[:p, :p], initial, point.residual, end.converged, end.iterations, message
    )
