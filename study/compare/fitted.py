"""The fit that a comparison stands on: what the model leaves open, estimated on the fitting part."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study import fitting, units
from study.diagnose import search
from study.diagnose.score import clustered_covariance
from study.errors import StudyError
from study.fitting import Plan
from study.model import Model, ModelTerm
from study.output_error import FreeRunFit
from study.record import Record
from study.terms import QUANTITIES

Floats = NDArray[np.float64]
TWO_SIDED_95 = 1.959964  # standard errors


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
    """

    key: str
    term: str
    value: float
    error: float | None
    unit: str

    @property
    def held(self) -> bool:
        """Whether the model gave the value."""
        return self.error is None

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % confidence interval; None if the value was held."""
        if self.error is None:
            return None
        return self.value - TWO_SIDED_95 * self.error, self.value + TWO_SIDED_95 * self.error


def fit_model(model: Model, record: Record, how: Plan) -> FreeRunFit:
    """Fit all that the model leaves open; shape parameters that it leaves out are searched for.

    Raises
    ------
    StudyError
        If the model cannot be fitted.
    """
    held = fitting.held_keys(model)
    unknown = tuple(t for t in model.terms if None in t.parameters)
    if not unknown:
        return fitting.fit(model, record, how, held)
    grown = replace(model, terms=tuple(t for t in model.terms if t not in unknown))
    found = fitting.fit(grown, record, how, _held(grown, held))
    for entry in unknown:
        found = _with_shape(found, entry, record, how, held)
    ordered = replace(model, terms=tuple(_named(found.model, t.name) for t in model.terms))
    return replace(found, model=ordered)


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
    for point in search.starts(entry.term, search.baseline(before, record, how), record, how):
        begin = known | dict(zip(entry.keys, point.coefficients + point.parameters, strict=True)) | given
        try:
            fits.append(fitting.fit(grown.with_values(begin), record, how, _held(grown, held), begin))
        except StudyError:
            continue
    if not fits:
        missing = ", ".join(key for key, value in entry.values.items() if value is None)
        raise StudyError(f"no values of {missing} let {entry.name} follow {record.name}; give them in the model file")
    return min(fits, key=lambda f: f.rms)


def coefficients(found: FreeRunFit, record: Record, how: Plan) -> tuple[Coefficient, ...]:
    """Every coefficient with its standard error and unit, in the order of the model."""
    errors: dict[str, float] = {}
    if found.keys:
        covariance = clustered_covariance(fitting.linearise(found, record, how), found.residual)
        deviations = np.sqrt(np.diag(covariance))
        errors = {key: float(deviations[i]) for i, key in enumerate(found.keys)}
    force, length = record.units.get("force", "N"), record.units.get("displacement", "m")
    return tuple(
        Coefficient(key, entry.name, float(value), errors.get(key), _unit(entry, key, force, length))
        for entry in found.model.terms
        for key, value in entry.values.items()
        if value is not None
    )


def _unit(entry: ModelTerm, key: str, force: str, length: str) -> str:
    if key in entry.term.symbols:
        return entry.term.unit(key, force, length)
    parameter = next(p for p in entry.term.parameters if key == f"{entry.name}.{p.name}")
    powers = QUANTITIES[parameter.quantity]
    unit = units.compose("", length, (-powers[0], -powers[1])).strip()
    return "Hz" if parameter.quantity == "frequency" else unit.replace("/", "1/")
