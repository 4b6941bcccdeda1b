"""One candidate with what an engineer needs to believe or doubt it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from study.compare.prediction import Prediction
from study.diagnose.candidates import FittedCandidate
from study.diagnose.constancy import CoefficientCurve, changes, curves, wavers
from study.diagnose.held_out import HeldOut, held_out
from study.equations.coefficient_units import coefficient_unit, parameter_units
from study.equations.model import ModelTerm
from study.identify.time_domain.motion_range import motion_range
from study.identify.time_domain.part_fit import run_and_slopes, uncertainty
from study.support import statistics
from study.support.arrays import Floats
from study.support.statistics import Gain
from study.support.thresholds import ENOUGH, GOOD, NEARLY, UNSTEADY


@dataclass(frozen=True, eq=False)
class FittedEffect:
    """One effect of a candidate with what was found of it."""

    entry: ModelTerm
    coefficient: float  # its size: the amplitude, for an effect of any phase
    error: float  # standard error of that
    parameters: dict[str, float]  # shape parameters, and the phase of an effect of any phase
    parameter_errors: dict[str, float]  # their standard errors
    flatness: CoefficientCurve | None  # the coefficient along frequency
    steadiness: CoefficientCurve | None  # the coefficient along amplitude
    idle: str  # why it does not act as itself along this motion, as a clause; empty where it does
    unit: str  # of the coefficient
    parameter_units: dict[str, str]  # of the parameters

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval of the coefficient."""
        return self.coefficient - 1.96 * self.error, self.coefficient + 1.96 * self.error

    @property
    def unsteadiness(self) -> float:
        """By how much, relative to itself, the coefficient changes with frequency or amplitude."""
        return changes(self.flatness, self.steadiness)

    @property
    def clear(self) -> float:
        """The coefficient in its standard errors."""
        return abs(self.coefficient) / self.error if self.error > 0.0 else math.inf


@dataclass(frozen=True, eq=False)
class Ranked(FittedCandidate):
    """One candidate."""

    effects: tuple[FittedEffect, ...]  # each of its effects
    gain: Gain  # what it explains of the held-out residual, with the p value of one comparison
    p_value: float  # that of both parts of the record, with the number of candidates accounted for (Bonferroni)
    held_out: HeldOut  # its residuals on both parts of the record
    tied_with: tuple[str, ...] = ()  # candidates that this record cannot tell from it
    distance: float = math.inf  # standard errors by which it leaves more than the first; 0 for the first

    @property
    def effect(self) -> FittedEffect:
        """The effect; of a set, the one that is known least."""
        return min(self.effects, key=lambda effect: effect.clear)

    @cached_property
    def unphysical(self) -> str:
        """The same; of what the record does not tell from nothing too."""
        return FittedCandidate.unphysical.func(self) or self.idle

    @property
    def idle(self) -> str:
        """Why an effect does not act as itself along this motion; empty if all do."""
        return next((effect.idle for effect in self.effects if effect.idle), "")

    @property
    def residual(self) -> Floats:
        """Held-out residual, stacked."""
        return self.prediction.residual

    @property
    def response_error(self) -> float:
        """Rms of the held-out residual over that of the response."""
        return self.prediction.error

    def wanders(self, asked: int) -> bool:
        """Whether a coefficient, of so many that are asked for, moves as that of a true term would not.

        Where little is left, the faults of the rest of the model move the coefficient of what is added to it: it may
        change by a share of itself then; by no more than itself, where it takes a tenth of what a good model leaves.
        """
        good = self.response_error <= GOOD
        if good and self.gain.explained > 1.0 - NEARLY:
            return self.unsteadiness > 1.0
        if good or self.gain.explained >= ENOUGH:
            return self.unsteadiness > UNSTEADY
        return any(wavers(effect.steadiness, asked) for effect in self.effects)

    @property
    def unsteadiness(self) -> float:
        """By how much, relative to itself, a coefficient changes with frequency or amplitude, at most."""
        found = [effect.unsteadiness for effect in self.effects]
        return max((x for x in found if not math.isnan(x)), default=math.nan)


def ranked_candidate(candidate: FittedCandidate, before: Prediction) -> Ranked:
    """A candidate with its coefficients' errors and constancy; ``before`` is the prediction without it."""
    fit, prepared = candidate.fit, before.prepared
    coarse, jacobian = run_and_slopes(fit, prepared)
    covariance = uncertainty(fit, prepared, coarse, jacobian)
    reach = motion_range(fit, prepared)

    def effect(entry: ModelTerm) -> FittedEffect:
        coefficient, error, parameters, errors = amount(entry, fit.keys, fit.values, covariance)
        along = curves(fit, entry, prepared.dt, jacobian)
        idle = reach.idle(entry.term, np.array(entry.place.direction(fit.model.coordinates)), parameters, errors)
        units = parameter_units(entry, prepared.record) | {"phase": "rad"}
        unit = coefficient_unit(entry, entry.term.symbols[0], prepared.record)
        return FittedEffect(entry, coefficient, error, parameters, errors, *along, idle, unit, units)

    effects = tuple(effect(entry) for entry in candidate.entries)
    return Ranked(
        candidate.entries, fit, candidate.prediction, effects,
        gain=statistics.gain(before.residual, candidate.prediction.residual), p_value=1.0,
        held_out=held_out(fit, candidate.prediction, jacobian, prepared), settled=candidate.settled,
    )  # fmt: skip


def amount(
    entry: ModelTerm, keys: Sequence[str], estimates: Floats, covariance: Floats
) -> tuple[float, float, dict[str, float], dict[str, float]]:
    """Coefficient and shape parameters of a fitted term with standard errors.

    ``estimates`` are those of ``keys``, shape (keys,), and ``covariance`` has them first. Of an effect of any phase the
    coefficient is the amplitude, and the phase is among the parameters.
    """
    place = {key: i for i, key in enumerate(keys)}
    values = {key: float(estimates[i]) for key, i in place.items()}
    errors = {key: math.sqrt(max(float(covariance[i, i]), 0.0)) for key, i in place.items()}
    names = {p.name: f"{entry.name}.{p.name}" for p in entry.term.parameters}
    parameters = {name: values[key] for name, key in names.items() if key in values}
    parameter_errors = {name: errors[key] for name, key in names.items() if key in values}
    if len(entry.symbols) == 1:
        return values[entry.symbols[0]], errors[entry.symbols[0]], parameters, parameter_errors
    if entry.term.variation is not None:  # a curve: its largest change
        most = max(entry.symbols, key=lambda symbol: abs(values[symbol]))
        return values[most], errors[most], parameters, parameter_errors
    a, b = (values[s] for s in entry.symbols)
    size = math.hypot(a, b)
    direction = np.array([a, b]) / size if size > 0.0 else np.array([1.0, 0.0])
    rows = [place[s] for s in entry.symbols]
    block = covariance[np.ix_(rows, rows)]
    across = np.array([direction[1], -direction[0]])
    parameters["phase"] = math.atan2(-b, a)
    parameter_errors["phase"] = math.sqrt(max(float(across @ block @ across), 0.0)) / size if size > 0.0 else math.inf
    return size, math.sqrt(max(float(direction @ block @ direction), 0.0)), parameters, parameter_errors
