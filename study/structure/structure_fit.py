"""Output error for structures: the model runs free under the measured forces and is fitted to all sensors together.

As for a single coordinate (``identify.time_domain.free_run_fit``), by Levenberg and Marquardt with exact derivatives.
Every sensor counts in shares of its own size, or in standard deviations of its noise. Residuals of all sensors at one
time stand side by side, so that blocks of time hold all of them.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from study.equations.free_run import FreeRun, prepare
from study.equations.mass_matrix import matrices
from study.equations.model import Model, ModelTerm
from study.records.prepared import Prepared
from study.structure.stretch_beginnings import beginnings
from study.support.arrays import Floats
from study.support.autoregression import autoregression, whitened
from study.support.errors import DivergenceError, StudyError
from study.support.least_squares import least_squares
from study.support.levenberg_marquardt import OFFSET, Point, minimise, point_at
from study.support.statistics import clustered_covariance
from study.support.thresholds import TOLERANCE, K

FEWEST_STEPS, ROUGH = 2, 0.5  # steps in a sampling interval; the largest angle by which a mode turns in one
SHIFT, MOST_STEPS = 0.3, 16  # standard errors by which the integration may shift a coefficient; steps at most
SMALL = 1e-12  # of a mass matrix: an eigenvalue at which it is no longer positive


@dataclass(frozen=True)
class SensorNoise:
    """Noise of each sensor: its standard deviation and autoregressive coefficients."""

    deviation: Floats  # shape (sensors,)
    coefficients: tuple[Floats, ...]

    def weighted(self, values: Floats) -> Floats:
        """Values (samples, sensors, ...) made white with unit variance, the same shape."""
        parts = [
            whitened(values[:, i], a) / d
            for i, (a, d) in enumerate(zip(self.coefficients, self.deviation, strict=True))
        ]
        return np.stack(parts, axis=1)


def sized(scale: Floats) -> SensorNoise:
    """White noise in proportion to each sensor's size."""
    return SensorNoise(scale, tuple(np.ones(1) for _ in scale))


def noise_left(residual: Floats) -> SensorNoise:
    """The noise that a residual, shape (samples, sensors), would be."""
    coefficients = tuple(autoregression(x) for x in residual.T)
    left = [float(np.std(whitened(x, a))) for x, a in zip(residual.T, coefficients, strict=True)]
    floor = 1e-12 * max(float(np.max(np.abs(residual), initial=0.0)), 1e-300)
    return SensorNoise(np.maximum(left, floor), coefficients)


@dataclass(frozen=True)
class StructureFit:
    """A fitted structure; n samples, s sensors, p keys.

    Attributes
    ----------
    model : Model
        With the estimates filled in.
    keys : tuple of str
        What was estimated.
    initial : array, shape (states,)
        State at the first sample.
    residual : array, shape (n, s)
        Measured minus predicted motion, in the units of the sensors.
    converged : bool
        Whether the search arrived at a minimum.
    message : str
        How it ended.
    first : int
        Sample of the record at which the fitted part begins.
    steps : int
        Runge-Kutta steps in each sampling interval.
    noise : SensorNoise
        What the residual was weighted with.
    undecided : tuple of str
        Keys that the record does not show, or cannot tell apart.
    """

    model: Model
    keys: tuple[str, ...]
    initial: Floats
    residual: Floats
    converged: bool
    message: str
    first: int
    steps: int
    noise: SensorNoise
    undecided: tuple[str, ...] = field(default_factory=tuple)

    @property
    def values(self) -> Floats:
        """Estimates, shape (p,)."""
        numbers = self.model.numbers()
        return np.array([numbers[key] for key in self.keys])

    @property
    def held(self) -> tuple[str, ...]:
        """Keys of the model that were not estimated."""
        return tuple(key for key in self.model.values if key not in self.keys)

    @property
    def span(self) -> tuple[int, int]:
        """First sample of the record that was fitted, and the one after the last."""
        return self.first, self.first + len(self.residual)

    @property
    def cost(self) -> float:
        """Mean square of the residual in shares of the sensors' sizes, or of their noise."""
        return float(np.mean(self.noise.weighted(self.residual) ** 2))


@dataclass(frozen=True)
class _Problem:
    """A search over the keys and the initial state."""

    model: Model
    run: FreeRun
    measured: Floats  # (samples, sensors)
    noise: SensorNoise
    positive: tuple[str, ...]

    def linearise(self, x: Floats) -> Point | None:
        """Residual and Jacobian at x; None where the structure has no finite motion there."""
        keys = self.run.keys
        values = dict(zip(keys, (float(v) for v in x), strict=False))
        if any(values[key] <= 0.0 for key in self.positive) or not self.positive_mass(values):
            return None
        try:
            response, jacobian = self.run.respond(values, x[len(keys) :], self.run.states)
        except DivergenceError:
            return None
        residual = self.noise.weighted(self.measured - response)
        slopes = self.noise.weighted(jacobian)
        return point_at(x, residual.ravel(), slopes.reshape(residual.size, -1), len(keys), (0,))

    def positive_mass(self, values: Mapping[str, float]) -> bool:
        """Whether every motion has a kinetic energy."""
        known = {key: value for key, value in self.model.values.items() if value is not None}
        lowest = np.linalg.eigvalsh(matrices(self.model, known | dict(values))[2])
        return bool(lowest[0] > SMALL * lowest[-1])


def positive_keys(entry: ModelTerm) -> tuple[str, ...]:
    """Keys of a term that have no meaning at or below zero; an inertia that couples may have either sign."""
    if entry.term.name == "inertia" and entry.place.kind == "couples":
        return ()
    own = dict(zip(entry.term.keys, entry.keys, strict=True))
    return tuple(own[key] for key in entry.term.positive)


def structure_steps(model: Model, dt: float) -> int:
    """Steps in each sampling interval with which a search may begin, the linear terms all known."""
    stiffness, damping, mass = matrices(model, {key: value or 0.0 for key, value in model.values.items()})
    try:
        inverse = np.asarray(np.linalg.inv(mass), dtype=np.float64)
    except np.linalg.LinAlgError:
        return FEWEST_STEPS
    n = len(mass)
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    fastest = float(np.max(np.abs(np.linalg.eigvals(system))))
    return int(np.clip(np.ceil(fastest * dt / ROUGH), FEWEST_STEPS, MOST_STEPS))


def fit_structure(
    model: Model,
    prepared: Prepared,
    held: Collection[str],
    start: Mapping[str, float] | None = None,
    *,
    steps: int | None = None,
    initial: Floats | None = None,
    max_iterations: int = 60,
    offset: float = OFFSET,
    noise: SensorNoise | None = None,
) -> StructureFit:
    """Fit what is not held on the fitting part, from ``start`` where it has a value and from the model elsewhere.

    Raises
    ------
    DivergenceError
        If the structure diverges with the starting values.
    StudyError
        If a value is missing.
    """
    begun = model.with_values(dict(start or {}))
    keys = tuple(key for key in model.values if key not in held)
    values = begun.numbers()
    steps = steps or structure_steps(begun, prepared.dt)
    run = prepare(
        begun, prepared.record, keys, sensors=prepared.sensors, steps_per_sample=steps, span=prepared.plan.fit
    )
    positive = tuple(key for entry in model.terms for key in positive_keys(entry) if key in keys)
    measured = prepared.measured[slice(*prepared.plan.fit)]
    problem = _Problem(begun, run, measured, noise or sized(prepared.scale), positive)
    own, begins = [values[key] for key in keys], beginnings(initial, run, prepared, model)
    point = next((p for s in begins if (p := problem.linearise(np.array([*own, *s]))) is not None), None)
    if point is None:
        raise DivergenceError(f"the free run of {model.name!r} diverges with the starting values", run.start)
    size = float(np.linalg.norm(problem.noise.weighted(measured)))
    end = minimise(problem.linearise, point, size, max_iterations, offset)
    x = end.point.x
    found = dict(zip(keys, (float(v) for v in x), strict=False))
    response, _ = run.respond(found, x[len(keys) :])
    undecided = tuple(key for key, unclear in zip(keys, end.point.undecided(), strict=False) if unclear)
    return StructureFit(
        begun.with_values(found), keys, x[len(keys) :], measured - response, end.converged, end.message,
        prepared.plan.fit[0], steps, problem.noise, undecided,
    )  # fmt: skip


def same_states(fit: StructureFit, prepared: Prepared) -> Floats | None:
    """The states of a fit, where the fitting part begins as it did; with stretches, where it is the same."""
    first, last = prepared.plan.fit
    return fit.initial if fit.first == first and (fit.span[1] == last or not prepared.record.stretches) else None


def fitted_run(fit: StructureFit, prepared: Prepared, keys: tuple[str, ...], finer: int = 1) -> FreeRun:
    """The free run of a fit along the samples that it was fitted to."""
    return prepare(
        fit.model, prepared.record, keys, sensors=prepared.sensors, steps_per_sample=finer * fit.steps, span=fit.span
    )


def linearise_structure(fit: StructureFit, prepared: Prepared) -> Floats:
    """Derivatives of the motions on the samples that were fitted, shape (n, sensors, keys + states)."""
    run = fitted_run(fit, prepared, fit.keys)
    values = dict(zip(fit.keys, fit.values.tolist(), strict=True))
    return run.respond(values, fit.initial, run.states)[1]


def flat(fit: StructureFit, values: Floats) -> Floats:
    """Values (n, sensors, ...) weighted as the residual of the fit, sensors of one time side by side, (n s, ...)."""
    weighted = fit.noise.weighted(values)
    return weighted.reshape(-1, *weighted.shape[2:])


def structure_shift(fit: StructureFit, prepared: Prepared, jacobian: Floats) -> Floats:
    """By how much halving the steps would move estimates and initial state, by one step of Gauss and Newton."""
    coarse, fine = (fitted_run(fit, prepared, (), n).respond({}, fit.initial)[0] for n in (1, 2))
    return least_squares(flat(fit, jacobian), flat(fit, coarse - fine))


def structure_covariance(fit: StructureFit, prepared: Prepared, jacobian: Floats) -> Floats:
    """Covariance of estimates and initial state: of whatever is left, in blocks of time, and of the integration.

    Variances are those of blocks of time, or of white noise where that has larger ones; correlations are those of white
    noise, as the scatter of a few dozen blocks cannot tell those of as many coefficients as a structure has.
    """
    moved, columns = structure_shift(fit, prepared, jacobian), flat(fit, jacobian)
    length = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(length > 0.0, length, 1.0)
    white = np.linalg.pinv(scaled.T @ scaled, rcond=1e-12, hermitian=True)
    size = np.sqrt(np.maximum(np.diag(white), np.finfo(float).tiny))
    deviation = np.sqrt(np.diag(clustered_covariance(columns, flat(fit, fit.residual))))
    with np.errstate(over="ignore"):
        return white / np.outer(size, size) * np.outer(deviation, deviation) + np.outer(moved, moved)


def settled_structure(fit: StructureFit, prepared: Prepared) -> StructureFit:
    """The fit on the whole fitting part, with enough steps, and weighted with the noise that it leaves.

    Weighting stands where it costs nothing of the response and moves no coefficient by more than its error explains, as
    for a single coordinate (``weighted_fit``).
    """
    if fit.span != prepared.plan.fit or not fit.converged:
        fit = fit_structure(fit.model, prepared, fit.held, steps=fit.steps, initial=same_states(fit, prepared))
    while fit.steps < MOST_STEPS:
        whole = replace(fit, keys=tuple(fit.model.values))  # what the integration does to a held one is left as well
        jacobian = linearise_structure(whole, prepared)
        moved = np.abs(structure_shift(whole, prepared, jacobian))
        deviations = np.sqrt(np.diag(clustered_covariance(flat(fit, jacobian), flat(fit, fit.residual))))
        if np.all(moved <= SHIFT * deviations):
            break
        fit = fit_structure(fit.model, prepared, fit.held, steps=2 * fit.steps, initial=fit.initial)
    return _weighted(fit, prepared)


def _weighted(fit: StructureFit, prepared: Prepared) -> StructureFit:
    if not fit.keys:
        return fit
    noise = noise_left(fit.residual)
    try:
        again = fit_structure(
            fit.model, prepared, fit.held, steps=fit.steps, initial=fit.initial, noise=noise, max_iterations=20
        )
    except StudyError:
        return fit
    deviations = np.sqrt(np.diag(structure_covariance(fit, prepared, linearise_structure(fit, prepared))))[
        : len(fit.keys)
    ]
    alike = np.all(np.abs(again.values - fit.values) <= K * deviations)
    before, after = (np.sqrt(np.mean(f.residual**2, axis=0)) for f in (fit, again))
    good = again.converged and alike and np.all(after <= (1.0 + TOLERANCE) * before)
    return again if good else replace(fit, noise=noise)
