"""Output error with a measured linear part: modes and coefficients of the terms that let the structure run free best.

The state-space model of modes with the nonlinear forces fed back (Noel and Kerschen, Mechanical Systems and Signal
Processing 40, 2013) runs under the measured forces alone, so that noise on the sensors biases nothing. Derivatives are
exact; damping may couple the modes.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from study.equations.model import Model
from study.records import noise_floor
from study.records.interpolation import between_samples
from study.records.record import MOTIONS
from study.structure.measured_start import modal_starts
from study.structure.modal_program import ModalKeys, modal_program
from study.structure.prepared_structure import PreparedStructure
from study.structure.structure_fit import MOST_STEPS, ROUGH, SHIFT
from study.structure.structure_record import Sensor
from study.structure.structure_run import StructureRun
from study.support.arrays import Floats
from study.support.errors import DivergenceError, StudyError
from study.support.levenberg_marquardt import Point, minimise, point_at
from study.support.statistics import clustered_covariance

TRIALS, TRIED = 60, 6  # free runs of a search; of one with more modes, before it has to be the better
PATIENCE = 2  # numbers of modes in turn that are no better: more are not tried


@dataclass(frozen=True, eq=False)
class ModalRun:
    """Free runs of a structure by modes along a stretch of a record.

    Attributes
    ----------
    model : Model
        Its terms.
    modal : ModalKeys
        Names of its linear part.
    run : StructureRun
        Of the modal motions.
    sensors : tuple of Sensor
        What is wanted.
    """

    model: Model
    modal: ModalKeys
    run: StructureRun
    sensors: tuple[Sensor, ...]

    @property
    def keys(self) -> tuple[str, ...]:
        """Every number of it."""
        return self.run.keys

    def respond(self, values: Mapping[str, float], initial: Floats, free: bool = True) -> tuple[Floats, Floats]:
        """Motions at the sensors, shape (samples, sensors), and their derivatives by all keys and the initial state.

        Without ``free`` there are none.

        Raises
        ------
        DivergenceError
            If a motion leaves the range of finite numbers.
        """
        kinds = list(dict.fromkeys(s.motion for s in self.sensors))
        run = self.run if free else replace(self.run, keys=())
        if not free:
            registers = self.run.program.program.registers.copy()
            for key in self.keys:
                registers[self.run.program.program.inputs[key]] = values[key]
            program = replace(self.run.program.program, registers=registers)
            run = replace(run, program=replace(self.run.program, program=program, by_key=self.run.program.by_key[:0]))
        own, slopes = run.respond(values, initial, range(len(initial)) if free else ())
        n = self.modal.modes
        motion, change = np.empty((self.run.samples, len(self.sensors))), list[Floats]()
        for i, sensor in enumerate(self.sensors):
            rows = slice(kinds.index(sensor.motion) * n, (kinds.index(sensor.motion) + 1) * n)
            shape = np.array([values[key] for key in self.modal.shape(sensor.coordinate)])
            motion[:, i] = shape @ own[rows]
            if free:
                slope = np.einsum("r,rsk->sk", shape, slopes[rows])
                slope[:, [self.keys.index(key) for key in self.modal.shape(sensor.coordinate)]] += own[rows].T
                change.append(slope)
        return motion, np.stack(change, axis=1) if free else np.zeros((*motion.shape, 0))


def modal_run(
    model: Model, modal: ModalKeys, prepared: PreparedStructure, sensors: tuple[Sensor, ...], steps: int,
    span: tuple[int, int],
) -> ModalRun:  # fmt: skip
    """A structure by modes ready to run along a stretch of its record, ``steps`` Runge-Kutta steps a sample."""
    record, (first, last) = prepared.record, span
    columns = [record.forces[name] for name, _ in model.forces] + [record.extra[name] for name in model.channels]
    part = slice(2 * steps * first, 2 * steps * (last - 1) + 1)
    drive = np.stack([between_samples(values, 2 * steps)[part] for values in columns], axis=1)
    program = modal_program(model, modal, tuple(record.extra))
    kinds = list(dict.fromkeys(s.motion for s in sensors))
    rows = [MOTIONS.index(kind) * modal.modes + r for kind in kinds for r in range(modal.modes)]
    start = record.start + first * record.dt
    run = StructureRun(
        program, (*model.values, *modal.all), drive, record.dt, steps, start, last - first, np.array(rows, np.int64)
    )
    return ModalRun(model, modal, run, sensors)


@dataclass(frozen=True, eq=False)
class MeasuredFit:
    """A structure with a measured linear part, fitted; p keys, m states.

    Attributes
    ----------
    model : Model
        With the estimates of its terms filled in.
    modal : ModalKeys
        Names of its linear part.
    values : dict of float
        Of every key of both.
    initial : array, shape (m,)
        Modal state at the first sample that was fitted.
    keys : tuple of str
        What was estimated.
    covariance : array, shape (p, p)
        Of these.
    residual : array, shape (samples, sensors)
        Of the fitting part.
    converged : bool
        Whether the search arrived at a minimum.
    message : str
        How it ended.
    steps : int
        Runge-Kutta steps in each sampling interval.
    """

    model: Model
    modal: ModalKeys
    values: dict[str, float]
    initial: Floats
    keys: tuple[str, ...]
    covariance: Floats
    residual: Floats
    converged: bool
    message: str
    steps: int

    def error(self, key: str) -> float:
        """Standard error of one number; zero if it was held."""
        if key not in self.keys:
            return 0.0
        i = self.keys.index(key)
        return float(np.sqrt(max(self.covariance[i, i], 0.0)))


def fit_measured(model: Model, prepared: PreparedStructure) -> MeasuredFit:
    """Modes and coefficients from the fitting part; values that the model gives are held.

    There are as many modes as the Bayesian information criterion of the free run asks for, from one on.

    Raises
    ------
    StudyError
        If no sensor is where a force acts, a term's place has none, or the record shows no mode.
    DivergenceError
        If the structure diverges with the starting values.
    """
    held = {key: value for key, value in model.values.items() if value is not None}
    best: MeasuredFit | None = None
    worse = 0
    for modal, start in modal_starts(model, prepared):
        worse += 1
        if worse > PATIENCE:
            break
        values = {**start, **held}
        steps = _steps(modal, values, prepared.dt)
        try:
            fit = _fitted(model, modal, prepared, values, tuple(held), steps, TRIED)
        except DivergenceError:
            continue
        if best is not None and _criterion(fit, prepared) >= _criterion(best, prepared):
            continue
        best, worse = _settled(fit, model, prepared, tuple(held)), 0
    if best is None:
        raise StudyError(f"forces and motions of {prepared.record.name!r} show no mode in the band that is driven")
    return best


def _settled(fit: MeasuredFit, model: Model, prepared: PreparedStructure, held: tuple[str, ...]) -> MeasuredFit:
    """The fit at its minimum, with as many steps that halving them moves no coefficient by what its error notices.

    What too coarse an integration leaves would else be taken for a mode.
    """
    while True:
        if not fit.converged:
            fit = _fitted(model, fit.modal, prepared, fit.values, held, fit.steps, TRIALS, fit.initial)
        if 2 * fit.steps > MOST_STEPS:
            return fit
        finer = _fitted(model, fit.modal, prepared, fit.values, held, 2 * fit.steps, TRIALS, fit.initial)
        moved = np.array([finer.values[key] - fit.values[key] for key in model.values if key not in held])
        errors = np.array([fit.error(key) for key in model.values if key not in held])
        if np.all(np.abs(moved) <= SHIFT * errors) and _criterion(finer, prepared) > _criterion(fit, prepared) - 2.0:
            return fit
        fit = finer


def _steps(modal: ModalKeys, values: Mapping[str, float], dt: float) -> int:
    fastest = float(np.sqrt(max(values[key] for key in modal.stiffness)))
    return int(np.clip(np.ceil(fastest * dt / ROUGH), 1, MOST_STEPS))


def _criterion(fit: MeasuredFit, prepared: PreparedStructure) -> float:
    """The Bayesian information criterion for white noise in proportion to each sensor (Schwarz, 1978)."""
    weighted = fit.residual / prepared.scale
    count = weighted.size
    return count * float(np.log(np.mean(weighted**2))) + (len(fit.keys) + len(fit.initial)) * float(np.log(count))


def _fitted(
    model: Model, modal: ModalKeys, prepared: PreparedStructure, start: Mapping[str, float], held: Collection[str],
    steps: int, trials: int, initial: Floats | None = None,
) -> MeasuredFit:  # fmt: skip
    runs = modal_run(model, modal, prepared, prepared.sensors, steps, prepared.fit)
    measured, scale = prepared.measured[slice(*prepared.fit)], prepared.scale
    keys = tuple(key for key in runs.keys if key not in held)
    columns = [runs.keys.index(key) for key in keys]
    states, known = runs.run.program.states, dict(start)

    def point(x: Floats) -> Point | None:
        values = known | dict(zip(keys, x.tolist(), strict=False))
        try:
            motion, slopes = runs.respond(values, x[len(keys) :])
        except DivergenceError:
            return None
        own = slopes[:, :, [*columns, *range(len(runs.keys), slopes.shape[2])]] / scale[:, None]
        return point_at(x, ((measured - motion) / scale).ravel(), own.reshape(measured.size, -1), len(keys), (0,))

    first = point(np.array([*(known[key] for key in keys), *(np.zeros(states) if initial is None else initial)]))
    if first is None:
        raise DivergenceError(f"the free run of {model.name!r} diverges with the starting values", runs.run.start)
    end = minimise(point, first, float(np.linalg.norm(measured / scale)), trials)
    x = end.point.x
    values = known | dict(zip(keys, x.tolist(), strict=False))
    motion, slopes = runs.respond(values, x[len(keys) :])
    residual = measured - motion
    own = slopes[:, :, [*columns, *range(len(runs.keys), slopes.shape[2])]] / scale[:, None]
    covariance = clustered_covariance(own.reshape(measured.size, -1), (residual / scale).ravel())
    estimates = {key: values[key] for key in model.values}
    return MeasuredFit(
        model.with_values(estimates), modal, values, x[len(keys) :], keys, covariance[: len(keys), : len(keys)],
        residual, end.converged, end.message, steps,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class MeasuredPrediction:
    """The free run of such a structure along the judging part; n samples, s sensors."""

    fit: MeasuredFit
    prepared: PreparedStructure
    predicted: Floats  # shape (n, s)

    @cached_property
    def residual(self) -> Floats:
        """Measured minus predicted, shape (n, s)."""
        return self.prepared.measured[slice(*self.prepared.judge)] - self.predicted

    @cached_property
    def size(self) -> Floats:
        """Rms of each measured motion about its mean, shape (s,)."""
        return np.std(self.prepared.measured[slice(*self.prepared.judge)], axis=0)

    @cached_property
    def errors(self) -> Floats:
        """Rms of the residual over that of the motion, shape (s,)."""
        return np.sqrt(np.mean(self.residual**2, axis=0)) / self.size

    @property
    def error(self) -> float:
        """Root mean square of the sensors' errors."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @cached_property
    def floors(self) -> Floats:
        """White noise in what is left of each sensor, over the rms of its motion, shape (s,)."""
        return np.array([noise_floor.floor(x, self.prepared.dt).noise for x in self.residual.T]) / self.size

    @property
    def floor(self) -> float:
        """Root mean square of the sensors' floors."""
        return float(np.sqrt(np.mean(self.floors**2)))


def predict_measured(fit: MeasuredFit, prepared: PreparedStructure) -> MeasuredPrediction:
    """Run a fitted structure along the judging part, on from the fitting part or from rest where that is elsewhere."""
    follows = prepared.judge[0] == prepared.fit[1]
    begin = prepared.fit[0] if follows else prepared.judge[0]
    runs = modal_run(fit.model, fit.modal, prepared, prepared.sensors, fit.steps, (begin, prepared.judge[1]))
    initial = fit.initial if follows else np.zeros_like(fit.initial)
    motion, _ = runs.respond(fit.values, initial, free=False)
    return MeasuredPrediction(fit, prepared, motion[prepared.judge[0] - begin :])
