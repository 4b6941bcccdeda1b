"""The fit that a comparison stands on: what the model leaves open, estimated on the fitting part."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit

from study.equations import dimensions
from study.equations.free_run import prepare
from study.equations.model import Model, ModelTerm
from study.equations.terms import LIBRARY, QUANTITIES
from study.identify.frequency_domain.coefficients import Estimate
from study.identify.frequency_domain.inputs import history, reverse_inputs
from study.identify.time_domain import held_out, shape_search
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.multiple_shooting import fit_in_pieces
from study.records.completion import complete
from study.records.plan import Plan
from study.records.record import Record
from study.records.states import angular_rate
from study.support.errors import DivergenceError, StudyError
from study.support.statistics import clustered_covariance

Floats = NDArray[np.float64]
POOR = 0.05  # of the rms response: a fit that leaves more is tried again from pieces
PERIODS = 50.0  # of the motion, in the stretch that the pieces are cut from ...
SHORT, LONG = 512, 2048  # ... and its limits in samples
SHIFT = 0.3  # standard errors by which the integration may shift a coefficient
MOST_STEPS = 8  # per sample


@dataclass(frozen=True)
class Coefficient:
    """A coefficient or shape parameter of a fitted model.

    Attributes
    ----------
    key, term : str
        Its name, and that of the term it belongs to.
    value : float
        Estimate, or the value that was held.
    error : float or None
        Standard error, which allows for a residual that is no white noise; None if the value was held.
    unit : str
        In the units of the record.
    freedom : float
        Degrees of freedom of the standard error.
    """

    key: str
    term: str
    value: float
    error: float | None
    unit: str
    freedom: float = math.inf

    @property
    def held(self) -> bool:
        """Whether the model gave the value."""
        return self.error is None

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % confidence interval, by Student's t; None if the value was held."""
        if self.error is None:
            return None
        half = _quantile(self.freedom) * self.error
        return self.value - half, self.value + half


def _quantile(freedom: float) -> float:
    """Standard errors on either side that hold 95 %."""
    return float(stdtrit(freedom, 0.975)) if math.isfinite(freedom) else float(ndtri(0.975))


def fit_model(
    model: Model, record: Record, how: Plan, start: Mapping[str, float] | None = None
) -> tuple[FreeRunFit, Plan]:
    """Fit all that the model leaves open; shape parameters that it leaves out are searched for.

    With ``start``, a value for everything that is left open, the fit begins there and nothing is searched for.

    Returns
    -------
    FreeRunFit, Plan
        The plan's steps are doubled until the error of the integration matters no more.

    Raises
    ------
    StudyError
        If the model cannot be fitted.
    """
    if "inertia" not in model:
        raise StudyError(f"model {model.name!r} has no inertia; a free run needs it")
    _check_own_formulas(model, record)
    held = model.held_keys
    if start is not None:
        return _refined(held_out.fit(model, record, how, held, start), record, how, held)
    unknown = tuple(t for t in model.terms if None in t.parameters)
    grown = replace(model, terms=tuple(t for t in model.terms if t not in unknown))
    found = _from_afar(grown, record, how, _held(grown, held))
    for entry in unknown:
        found = _with_shape(found, entry, record, how, held)
    ordered = replace(model, terms=tuple(_named(found.model, t.name) for t in model.terms))
    return _refined(replace(found, model=ordered), record, how, held)


def _check_own_formulas(model: Model, record: Record) -> None:
    """A user's formula must be a number all along the measured motion: a fit that it stops would be blamed else."""
    if all(term.name in LIBRARY for term in model.terms):
        return
    completed = complete(record)
    motion = completed.record.part(completed.edge, len(record) - completed.edge)
    known = replace(model, terms=tuple(t for t in model.terms if None not in t.parameters))
    for item in reverse_inputs(known):
        if any(name not in LIBRARY for name in item.terms):
            history(item, motion)


def _from_afar(model: Model, record: Record, how: Plan, held: tuple[str, ...]) -> FreeRunFit:
    """A fit from the linear start; if it is poor, also one that begins with pieces of a few periods.

    A free run of a strongly nonlinear system with somewhat wrong coefficients drifts out of step with the
    measured motion, and the sum of squares has side valleys there. Within pieces nothing drifts far.
    """
    measured = record[how.response][slice(*how.fit)]
    try:
        found = held_out.fit(model, record, how, held)
    except DivergenceError:  # the linear start, with the values that are held, is no system that stays finite
        return from_pieces(model, record, how, held)
    if not found.keys or (found.converged and found.rms < POOR * float(np.std(measured))):
        return found
    try:
        again = from_pieces(model, record, how, held)
    except StudyError:
        return found
    return again if again.rms < found.rms else found


def from_pieces(model: Model, record: Record, how: Plan, held: tuple[str, ...]) -> FreeRunFit:
    """A fit that begins where one in pieces of about a period ends, which knows no side valleys.

    Raises
    ------
    StudyError
        If the model cannot run even in pieces.
    """
    measured = record[how.response][slice(*how.fit)]
    length = round(PERIODS * 2.0 * np.pi / (angular_rate(measured, record.dt) * record.dt))
    span = (how.fit[0], min(how.fit[0] + int(np.clip(length, SHORT, LONG)), how.fit[1]))
    start = {key: v for key, v in held_out.linear_start(model, record, how).items() if key not in held}
    near = fit_in_pieces(model, record, start=start, held=held, response=how.response, span=span)
    return held_out.fit(model, record, how, held, dict(zip(near.keys, near.values.tolist(), strict=True)))


def _refined(found: FreeRunFit, record: Record, how: Plan, held: tuple[str, ...]) -> tuple[FreeRunFit, Plan]:
    """The fit with so many steps per sample that halving them shifts no coefficient by what its error shows."""
    while found.keys and how.steps_per_sample < MOST_STEPS:
        jacobian = held_out.linearise(found, record, how)
        finer = replace(how, steps_per_sample=2 * how.steps_per_sample)
        runs = [
            prepare(found.model, record, response=p.response, steps_per_sample=p.steps_per_sample, span=p.fit)
            for p in (how, finer)
        ]
        coarse, fine = (run.respond({}, found.initial)[0] for run in runs)
        scale = np.maximum(np.sqrt(np.sum(jacobian**2, axis=0)), 1e-300)
        moved = np.asarray(
            np.linalg.lstsq(jacobian / scale, np.subtract(coarse, fine), rcond=1e-12)[0], dtype=np.float64
        )
        deviations = np.sqrt(np.diag(clustered_covariance(jacobian, found.residual)))
        if np.all(np.abs(moved / scale) <= SHIFT * deviations):
            break
        how = finer
        start = dict(zip(found.keys, found.values.tolist(), strict=True))
        found = held_out.fit(found.model, record, how, held, start)
    return found, how


def _held(model: Model, held: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(key for key in held if key in model.values)


def _named(model: Model, name: str) -> ModelTerm:
    return next(t for t in model.terms if t.name == name)


def _with_shape(
    before: FreeRunFit, entry: ModelTerm, record: Record, how: Plan, held: tuple[str, ...]
) -> FreeRunFit:  # fmt: skip
    """The fit with one term more, the best of those that begin at the best points of a search."""
    given = {key: value for key, value in entry.values.items() if value is not None}
    known = {key: value for key, value in before.model.values.items() if value is not None}
    grown = before.model.with_term(entry)
    fits: list[FreeRunFit] = []
    for point in shape_search.starts(entry.term, shape_search.baseline(before, record, how), record, how):
        begin = known | dict(zip(entry.keys, point.coefficients + point.parameters, strict=True)) | given
        try:
            fits.append(held_out.fit(grown.with_values(begin), record, how, _held(grown, held), begin))
        except StudyError:
            continue
    if not fits:
        missing = ", ".join(key for key, value in entry.values.items() if value is None)
        raise StudyError(f"no values of {missing} let {entry.name} follow {record.name}; give them in the model file")
    return min(fits, key=lambda f: f.rms)


def coefficients(
    found: FreeRunFit, record: Record, how: Plan, known: Estimate | None = None
) -> tuple[Coefficient, ...]:
    """Every coefficient with its standard error and unit, in the order of the model.

    ``known`` is what was not found by this fit.
    """
    errors = {key: known.error(key) for key in known.symbols} if known else {}
    freedom = known.freedom if known else math.inf
    if found.keys:
        covariance = clustered_covariance(held_out.linearise(found, record, how), found.residual)
        deviations = np.sqrt(np.diag(covariance))
        errors |= {key: float(deviations[i]) for i, key in enumerate(found.keys)}
    force, length = record.units.get("force", "N"), record.units.get("displacement", "m")
    return tuple(
        Coefficient(key, entry.name, float(value), errors.get(key), _unit(entry, key, force, length), freedom)
        for entry in found.model.terms
        for key, value in entry.values.items()
        if value is not None
    )


def _unit(entry: ModelTerm, key: str, force: str, length: str) -> str:
    if key in entry.term.symbols:
        return entry.term.unit(key, force, length)
    parameter = next(p for p in entry.term.parameters if key == f"{entry.name}.{p.name}")
    powers = QUANTITIES[parameter.quantity]
    unit = dimensions.compose("", length, (-powers[0], -powers[1])).strip()
    return "Hz" if parameter.quantity == "frequency" else unit.replace("/", "1/")
