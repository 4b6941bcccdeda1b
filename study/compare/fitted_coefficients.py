"""The coefficients of a fitted model: interval and unit, where minima fit alike, and whether the level moves them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, ndtri, stdtrit

from study.compare.prediction import Prediction, predict
from study.equations.coefficient_units import coefficient_unit, parameter_units
from study.equations.model import Model, ModelTerm
from study.equations.place import HERE, Place
from study.identify.frequency_domain.coefficients import Estimate
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import run_and_slopes, uncertainty
from study.identify.time_domain.rivals import larger
from study.records.prepared import Prepared
from study.records.record import Record
from study.support.numbers import digits_between, in_one_notation, percent


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


def value_and_interval(found: Coefficient) -> tuple[str, str]:
    """Both as they are shown: with the digits that tell the ends of the interval apart, or ``held``."""
    if found.interval is None:
        return f"{found.value:.5g}", "held"
    low, high = found.interval
    digits = digits_between(found.value, high - low)
    value, low_end, high_end = in_one_notation((found.value, low, high), digits)
    return value, f"{low_end} to {high_end}"


def found_by(fit: FreeRunFit, prepared: Prepared) -> Estimate:
    """All that was fitted, with a covariance that allows for a residual that is no white noise.

    In segments, where a residual has no memory beyond its own, the fit's covariance holds as it is.
    """
    if not fit.keys or fit.restarts:
        return fit.estimate
    count = len(fit.keys)
    return Estimate(fit.keys, fit.values, uncertainty(fit, prepared, *run_and_slopes(fit, prepared))[:count, :count])


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


COUNTS = ("two", "three", "four", "five", "six")


def rivals_note(fit: FreeRunFit, rivals: Sequence[FreeRunFit], prediction: Prediction) -> str | None:
    """A sentence that names the values in which the minima differ, with the error of each; None where there is one.

    A rival that is significantly worse on the judging part fits the record less well, and is not named.
    """
    prepared = prediction.prepared
    foretold = [(rival, predict(rival, prepared)) for rival in rivals]
    alike = [(rival, p) for rival, p in foretold if not p.diverged and not larger(p.residual, prediction.residual)]
    if not alike:
        return None
    fits = (fit, *(rival for rival, _ in alike))
    own, *others = (coefficients(one.model, found_by(one, prepared), prepared.record) for one in fits)
    keys = {key for other in others for key in _differing(own, other)}
    errors = [prediction.error, *(p.error for _, p in alike)]
    told = [f"{_values(values, keys)} (error {percent(e)})" for values, e in zip((own, *others), errors, strict=True)]
    count = COUNTS[len(alike) - 1] if len(alike) <= len(COUNTS) else str(len(told))
    return (
        f"{count} minima fit this record alike: {'; '.join(told[:-1])}; and {told[-1]}. The first, which leaves least "
        "on the fitting part, is shown here; a longer record, or a value that is known and held, would decide"
    )


def _differing(one: Sequence[Coefficient], other: Sequence[Coefficient]) -> list[str]:
    """Coefficients of which neither interval holds the other's value; the one that moves most if there is none."""
    pairs = [(a, b) for a, b in zip(one, other, strict=True) if not a.held]
    apart = [a.key for a, b in pairs if not (_holds(a, b.value) or _holds(b, a.value))]
    return apart or [max(pairs, key=lambda p: abs(p[1].value - p[0].value) / ((p[0].error or 0.0) or 1.0))[0].key]


def _holds(coefficient: Coefficient, value: float) -> bool:
    low, high = coefficient.interval or (value, value)
    return low <= value <= high


def _values(row: Sequence[Coefficient], keys: set[str]) -> str:
    named = [f"{c.key} = {c.value:.4g} {c.unit}".rstrip() for c in row if c.key in keys]
    return named[0] if len(named) == 1 else f"{', '.join(named[:-1])} and {named[-1]}"


MOVES = 0.01  # of the p value, the number of coefficients accounted for
RESOLUTION = 1e-3  # of the coefficient: smaller differences are those of the numerical integration


@dataclass(frozen=True)
class Level:
    """One coefficient at several levels; one entry a record, in the order of the records."""

    key: str
    unit: str
    force: tuple[float, ...]  # rms force of the fitting part, in the record's unit
    value: tuple[float, ...]  # the estimates
    error: tuple[float, ...]  # their standard errors
    p_value: float  # probability of such differences if the coefficient is the same at all levels (chi-square)
    moves: bool  # whether that is significant, the number of coefficients accounted for, and above numerical errors
    change: float  # largest less smallest estimate, over the size of their weighted mean

    @property
    def chance(self) -> str:
        """The p value in words: one that is next to nothing is not written out."""
        return f"= {self.p_value:.2g}" if self.p_value > 1e-9 else "< 1e-09"


def across_levels(force: Sequence[float], records: Sequence[Sequence[Coefficient]]) -> tuple[Level, ...]:
    """Hold the estimates of several records against each other; what was held is left out.

    ``force`` is the rms force of each record's fitting part, ``records`` the same model's coefficients in each.
    """
    by_key = [c for c in zip(*records, strict=True) if not c[0].held]
    return tuple(_level(tuple(force), row, len(by_key)) for row in by_key)


def _level(force: tuple[float, ...], row: Sequence[Coefficient], tests: int) -> Level:
    value = np.array([c.value for c in row])
    error = np.array([c.error or 0.0 for c in row])
    weight = 1.0 / np.maximum(error, np.finfo(float).eps * np.max(np.abs(value))) ** 2
    mean = float(np.sum(weight * value) / np.sum(weight))
    p_value = float(chdtrc(len(row) - 1, np.sum(weight * (value - mean) ** 2)))
    change = float(np.ptp(value)) / abs(mean) if mean else 0.0
    return Level(
        row[0].key, row[0].unit, force, tuple(float(v) for v in value), tuple(float(e) for e in error),
        p_value, p_value < MOVES / tests and change > RESOLUTION, change,
    )  # fmt: skip
