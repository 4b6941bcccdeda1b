"""The coefficients of a fitted model, each with its interval and unit."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri, stdtrit

from study.equations import dimensions
from study.equations.model import ModelTerm
from study.equations.terms import QUANTITIES
from study.identify.frequency_domain.coefficients import Estimate
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import linearise, uncertainty
from study.records.prepared import Prepared


@dataclass(frozen=True)
class Coefficient:
    """A coefficient or shape parameter of a fitted model."""

    key: str
    term: str  # the term it belongs to
    value: float  # estimate, or the value that was held
    error: float | None  # standard error, for a residual that need not be white; None if the value was held
    unit: str  # in the units of the record
    freedom: float = math.inf  # of the standard error

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


def coefficients(fit: FreeRunFit, prepared: Prepared, known: Estimate | None = None) -> tuple[Coefficient, ...]:
    """Every coefficient with its standard error and unit, in the order of the model.

    ``known`` is what was not found by this fit.
    """
    errors = {key: known.error(key) for key in known.symbols} if known else standard_errors(fit, prepared)
    freedom = known.freedom if known else math.inf
    force, length = prepared.record.units.get("force", "N"), prepared.record.units.get("displacement", "m")
    return tuple(
        Coefficient(key, entry.name, float(value), errors.get(key), _unit(entry, key, force, length), freedom)
        for entry in fit.model.terms
        for key, value in entry.values.items()
        if value is not None
    )


def standard_errors(fit: FreeRunFit, prepared: Prepared) -> dict[str, float]:
    """Standard error of everything that was fitted, allowing for a residual that is no white noise.

    In segments, where a residual has no memory beyond its own, the fit's covariance holds as it is.
    """
    if not fit.keys:
        return {}
    if fit.restarts:
        return {key: fit.estimate.error(key) for key in fit.keys}
    deviations = np.sqrt(np.diag(uncertainty(fit, prepared, linearise(fit, prepared))))
    return dict(zip(fit.keys, deviations.tolist(), strict=False))


def _unit(entry: ModelTerm, key: str, force: str, length: str) -> str:
    if key in entry.term.symbols:
        return entry.term.unit(key, force, length)
    parameter = next(p for p in entry.term.parameters if key == f"{entry.name}.{p.name}")
    powers = QUANTITIES[parameter.quantity]
    unit = dimensions.compose("", length, (-powers[0], -powers[1])).strip()
    return "Hz" if parameter.quantity == "frequency" else unit.replace("/", "1/")
