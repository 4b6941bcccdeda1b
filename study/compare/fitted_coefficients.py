"""The coefficients of a fitted model, each with its interval and unit."""

import math
from dataclasses import dataclass

from scipy.special import ndtri, stdtrit

from study.equations.coefficient_units import coefficient_unit, parameter_units
from study.equations.model import Model, ModelTerm
from study.equations.place import HERE, Place
from study.identify.frequency_domain.coefficients import Estimate
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import linearise, uncertainty
from study.records.prepared import Prepared
from study.records.record import Record


@dataclass(frozen=True)
class Coefficient:
    """A coefficient or shape parameter of a fitted model."""

    key: str
    term: str  # the term it belongs to
    value: float  # estimate, or the value that was held
    error: float | None  # standard error, for a residual that need not be white; None if the value was held
    unit: str  # in the units of the record
    freedom: float = math.inf  # of the standard error
    place: Place = HERE  # where the term acts

    @property
    def held(self) -> bool:
        """Whether the model gave the value."""
        return self.error is None

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % confidence interval, by Student's t; None if the value was held."""
        if self.error is None:
            return None
        quantile = float(stdtrit(self.freedom, 0.975)) if math.isfinite(self.freedom) else float(ndtri(0.975))
        half = quantile * self.error
        return self.value - half, self.value + half


def found_by(fit: FreeRunFit, prepared: Prepared) -> Estimate:
    """All that was fitted, with a covariance that allows for a residual that is no white noise.

    In segments, where a residual has no memory beyond its own, the fit's covariance holds as it is.
    """
    if not fit.keys or fit.restarts:
        return fit.estimate
    count = len(fit.keys)
    return Estimate(fit.keys, fit.values, uncertainty(fit, prepared, linearise(fit, prepared))[:count, :count])


def coefficients(model: Model, found: Estimate, record: Record) -> tuple[Coefficient, ...]:
    """Every coefficient of a fitted model with its standard error and unit, in the order of the model."""
    errors = {key: found.error(key) for key in found.symbols}
    return tuple(
        Coefficient(key, entry.term.name, float(value), errors.get(key), unit, found.freedom, entry.place)
        for entry in model.terms
        for (key, value), unit in zip(entry.values.items(), _units(entry, record), strict=True)
        if value is not None
    )


def _units(entry: ModelTerm, record: Record) -> list[str]:
    own = [coefficient_unit(entry, symbol, record) for symbol in entry.term.symbols]
    return [*own, *parameter_units(entry, record).values()]
