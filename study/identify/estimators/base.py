"""Settings and results of all estimators."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from study.equations.model import Model
from study.equations.term import Term
from study.equations.terms import LIBRARY
from study.identify.frequency_domain.coefficients import Estimate, Responses
from study.identify.frequency_domain.conditioned import MisoResult
from study.identify.frequency_domain.inputs import Input
from study.identify.frequency_domain.local_polynomial import LocalPolynomial
from study.records.record import Record
from study.records.spectra import Segments


@dataclass(frozen=True)
class Settings:
    """Settings of the estimators."""

    segments: Segments  # of Welch's method, for estimators that use it
    band: tuple[float, float]  # lines that the parameters are fitted to, in hertz
    local_polynomial: LocalPolynomial = field(default_factory=LocalPolynomial)  # for the estimator of this name
    settle_periods: int = 1  # at the beginning of a periodic record, which ``errors_in_variables`` leaves out
    curves: bool = True  # whether estimators whose parameters need no A_j(f) and no coherences give them too


@dataclass(frozen=True)
class Parameter:
    """A number an engineer asks for; ``error`` is its standard error, nan where the recipe gives none."""

    name: str
    value: float
    error: float


@dataclass(frozen=True)
class Identified:
    """Result of an estimator."""

    inputs: tuple[Input, ...]  # of the reverse system
    responses: Responses | None  # for estimators that have some of their own; a ``MisoResult`` has coherences too
    parameters: tuple[Parameter, ...]
    estimate: Estimate | None = None  # coefficients as the model names them, for estimators that find them together
    note: str = ""  # a warning, such as that a search did not converge; mostly empty
    shapes: Estimate | None = None  # shape parameters, where they are not part of ``estimate``
    analysis: MisoResult | None = None  # coherences, for estimators whose ``responses`` have none of their own


class Estimator(Protocol):
    """A function from model and record to parameters."""

    def __call__(self, model: Model, record: Record, settings: Settings) -> Identified:
        """Identify; coefficients of the model are ignored, its shape parameters are used where it gives them."""
        ...


def named_parameters(estimate: Estimate) -> tuple[Parameter, ...]:
    """Coefficients and what follows from them, under the report's names.

    ``f_n`` and ``zeta`` by (4.4) and (4.5), ``k_m`` and ``phase`` by (4.9), ``k_dead_band`` by (4.10);
    their standard errors to first order from the covariance of the coefficients. Shape parameters go by their
    own names: ``u_g``, ``f_m``.
    """
    plain = {s: Parameter(s.rpartition(".")[2], estimate[s], estimate.error(s)) for s in estimate.symbols}
    named = {s: plain.pop(s) for s in ("m", "c", "k") if s in plain}
    if {"m", "c", "k"} <= set(named) and named["k"].value > 0.0 and named["m"].value > 0.0:
        named |= {p.name: p for p in _modal(estimate)}
    for term in (t for t in LIBRARY.values() if t.reported and t.symbols[0] in plain):
        own = [plain.pop(symbol) for symbol in term.symbols]
        turned = (Parameter(term.reported[0], term.as_reported([own[0].value])[0], own[0].error),)
        named |= {p.name: p for p in (turned if len(own) == 1 else _phasor(estimate, term))}
    return (*named.values(), *plain.values())


def true_parameters(values: Mapping[str, float | None]) -> dict[str, float]:
    """The same names for a model's own values."""
    known = {key: value for key, value in values.items() if value is not None}
    estimate = Estimate(tuple(known), np.array(list(known.values())), np.zeros((len(known), len(known))))
    return {p.name: p.value for p in named_parameters(estimate)}


def _modal(e: Estimate) -> tuple[Parameter, Parameter]:
    m, c, k = e["m"], e["c"], e["k"]
    f_n = math.sqrt(k / m) / (2.0 * math.pi)
    zeta = c / (4.0 * math.pi * f_n * m)
    f_n_error = e.derived_error({"k": f_n / (2.0 * k), "m": -f_n / (2.0 * m)})
    zeta_error = e.derived_error({"c": 0.5 / math.sqrt(k * m), "k": -zeta / (2.0 * k), "m": -zeta / (2.0 * m)})
    return Parameter("f_n", f_n, f_n_error), Parameter("zeta", zeta, zeta_error)


def _phasor(e: Estimate, term: Term) -> tuple[Parameter, Parameter]:
    """Amplitude and phase of a cosine and a sine."""
    (cosine, sine), (amplitude, phase) = term.symbols, term.reported
    a, b = e[cosine], e[sine]
    size, angle = term.as_reported((a, b))
    if size == 0.0:
        return Parameter(amplitude, 0.0, e.error(cosine)), Parameter(phase, 0.0, math.inf)
    length = e.derived_error({cosine: a / size, sine: b / size})
    turn = e.derived_error({cosine: b / size**2, sine: -a / size**2})
    return Parameter(amplitude, size, length), Parameter(phase, angle, turn)
