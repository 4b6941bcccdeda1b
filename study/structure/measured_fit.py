"""Output error with a measured linear part: modes and coefficients of the terms that let the structure run free best.

The state-space model of modes with the nonlinear forces fed back (Noel and Kerschen, Mechanical Systems and Signal
Processing 40, 2013) runs under the measured forces alone, so that noise on the sensors biases nothing. Derivatives are
exact; damping may couple the modes.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from study.equations.free_run import ROUGH, FreeRun, prepare
from study.equations.modal_keys import ModalKeys
from study.equations.model import Model, ModelTerm
from study.identify.time_domain.settling import SHIFT
from study.records.prepared import Prepared
from study.records.record import Sensor
from study.structure.measured_start import modal_starts
from study.support.arrays import Floats
from study.support.errors import DivergenceError, StudyError
from study.support.levenberg_marquardt import Point, minimise, point_at
from study.support.statistics import clustered_covariance

FINEST = 16  # steps in a sampling interval
TRIALS, TRIED = 30, 6  # free runs of a search; of one with more modes, before it has to be the better
PATIENCE = 2  # numbers of modes in turn that are no better: more are not tried


def modal_run(
    model: Model, modal: ModalKeys, prepared: Prepared, sensors: tuple[Sensor, ...], steps: int,
    span: tuple[int, int], values: Mapping[str, float], keys: tuple[str, ...] = (),
) -> FreeRun:  # fmt: skip
    """A structure by modes ready to run along a stretch of its record, ``steps`` Runge-Kutta steps a sample.

    What is not in ``keys`` keeps its value.
    """
    return prepare(
        model, prepared.record, keys, sensors=sensors, steps_per_sample=steps, span=span, modal=modal, held=values
    )


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


def fit_measured(model: Model, prepared: Prepared) -> MeasuredFit:
    """Modes and coefficients from the fitting part; values that the model gives are held.

    There are as many modes as the Bayesian information criterion of the free run asks for, from one on; damping couples
    them where it asks for that.

    Raises
    ------
    StudyError
        If no sensor is where a force acts, a term's place has none, or the record shows no mode.
    DivergenceError
        If the structure diverges with the starting values.
    """
    given = {key: value for key, value in model.values.items() if value is not None}
    best: MeasuredFit | None = None
    worse = 0
    for modal, start in modal_starts(model, prepared):
        worse += 1
        if worse > PATIENCE:
            break
        values, held = {**start, **given}, (*given, *modal.coupling)
        steps = _steps(modal, values, prepared.dt)
        try:
            fit = _fitted(model, modal, prepared, values, held, steps, TRIED)
        except DivergenceError:
            continue
        if best is not None and _criterion(fit, prepared) >= _criterion(best, prepared):
            continue
        best, worse = _settled(fit, model, prepared, held, TRIED), 0
    if best is None:
        raise StudyError(f"forces and motions of {prepared.record.name!r} show no mode in the band that is driven")
    best = _settled(best, model, prepared, (*given, *best.modal.coupling), TRIALS)
    if best.modal.modes == 1:
        return best
    coupled = _fitted(model, best.modal, prepared, best.values, tuple(given), best.steps, TRIALS, best.initial)
    return coupled if _criterion(coupled, prepared) < _criterion(best, prepared) else best


def fit_with_term(model: Model, entry: ModelTerm, prepared: Prepared) -> MeasuredFit:
    """A model with a term more, whose shape parameters have values: fitted with these, then with them free.

    Raises as :func:`fit_measured`.
    """
    fit, shapes = fit_measured(model.with_term(entry), prepared), entry.keys[len(entry.symbols) :]
    return (
        refined_fit(fit, prepared, [k for k in fit.model.values if k not in fit.keys and k not in shapes])
        if shapes
        else fit
    )


def refined_fit(fit: MeasuredFit, prepared: Prepared, held: Collection[str]) -> MeasuredFit:
    """A fit gone on with from where it ended, with what it held beside ``held`` free; its modes stay as many.

    Raises
    ------
    DivergenceError
        If the structure diverges from there.
    """
    names = (*held, *(key for key in fit.modal.coupling if key not in fit.keys))
    model = fit.model.with_values({key: fit.values[key] for key in fit.model.values})
    again = _fitted(model, fit.modal, prepared, fit.values, names, fit.steps, TRIALS, fit.initial)
    return _settled(again, model, prepared, names, TRIALS)


def _settled(fit: MeasuredFit, model: Model, prepared: Prepared, held: tuple[str, ...], trials: int) -> MeasuredFit:
    """The fit at its minimum, or so many trials nearer, with enough steps.

    Halving them then moves no coefficient by what its error notices: what too coarse an integration leaves would else
    be taken for a mode.
    """
    while True:
        if not fit.converged:
            fit = _fitted(model, fit.modal, prepared, fit.values, held, fit.steps, trials, fit.initial)
        if 2 * fit.steps > FINEST or _fine(fit, prepared):
            return fit
        finer = _fitted(model, fit.modal, prepared, fit.values, held, 2 * fit.steps, trials, fit.initial)
        moved = np.array([finer.values[key] - fit.values[key] for key in model.values if key not in held])
        errors = np.array([fit.error(key) for key in model.values if key not in held])
        if np.all(np.abs(moved) <= SHIFT * errors) and _criterion(finer, prepared) > _criterion(fit, prepared) - 2.0:
            return fit
        fit = finer
        if trials < TRIALS and not fit.converged:
            return fit


def _fine(fit: MeasuredFit, prepared: Prepared) -> bool:
    """Whether halving the steps changes the motions by too little to move any estimate by what its error notices."""
    coarse, fine = (
        modal_run(
            fit.model, fit.modal, prepared, prepared.sensors, k * fit.steps, prepared.plan.fit, fit.values
        ).respond(fit.values, fit.initial)[0]
        for k in (1, 2)
    )
    moved, left = ((x / prepared.scale).ravel() for x in (fine - coarse, fit.residual))
    return float(np.linalg.norm(moved)) <= SHIFT * float(np.std(left))


def _steps(modal: ModalKeys, values: Mapping[str, float], dt: float) -> int:
    fastest = float(np.sqrt(max(values[key] for key in modal.stiffness)))
    return int(np.clip(np.ceil(fastest * dt / ROUGH), 1, FINEST))


def _criterion(fit: MeasuredFit, prepared: Prepared) -> float:
    """The Bayesian information criterion for white noise in proportion to each sensor (Schwarz, 1978)."""
    weighted = fit.residual / prepared.scale
    count = weighted.size
    return count * float(np.log(np.mean(weighted**2))) + (len(fit.keys) + len(fit.initial)) * float(np.log(count))


def _fitted(
    model: Model, modal: ModalKeys, prepared: Prepared, start: Mapping[str, float], held: Collection[str],
    steps: int, trials: int, initial: Floats | None = None,
) -> MeasuredFit:  # fmt: skip
    known = dict(start)
    keys = tuple(key for key in (*model.values, *modal.all) if key not in held)
    runs = modal_run(model, modal, prepared, prepared.sensors, steps, prepared.plan.fit, known, keys)
    measured, scale = prepared.measured[slice(*prepared.plan.fit)], prepared.scale
    begin = np.zeros(runs.states) if initial is None else initial

    def point(x: Floats) -> Point | None:
        try:
            motion, slopes = runs.respond(dict(zip(keys, x.tolist(), strict=False)), x[len(keys) :], runs.states)
        except DivergenceError:
            return None
        own = (slopes / scale[:, None]).reshape(measured.size, -1)
        return point_at(x, ((measured - motion) / scale).ravel(), own, len(keys), (0,))

    first = point(np.array([*(known[key] for key in keys), *begin]))
    if first is None:
        raise DivergenceError(f"the free run of {model.name!r} diverges with the starting values", runs.start)
    end = minimise(point, first, float(np.linalg.norm(measured / scale)), trials)
    x = end.point.x
    values = known | dict(zip(keys, x.tolist(), strict=False))
    motion, slopes = runs.respond(values, x[len(keys) :], runs.states)
    residual = measured - motion
    own = (slopes / scale[:, None]).reshape(measured.size, -1)
    covariance = clustered_covariance(own, (residual / scale).ravel())
    estimates = {key: values[key] for key in model.values}
    return MeasuredFit(
        model.with_values(estimates), modal, values, x[len(keys) :], keys, covariance[: len(keys), : len(keys)],
        residual, end.converged, end.message, steps,
    )  # fmt: skip
