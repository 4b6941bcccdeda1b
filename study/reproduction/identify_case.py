"""Identification of a case of the study: settings and record in, what each estimator finds out."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from study.equations.model import Model
from study.equations.terms import get
from study.identify import estimators
from study.identify.estimators.base import Identified, Settings
from study.identify.frequency_domain.local_polynomial_method import LocalPolynomial
from study.records.record import Record
from study.records.spectra import Segments
from study.support.errors import DivergenceError

Table = Mapping[str, Any]


def assumed_model(model: Model, settings: Table) -> Model:
    """The model that the identification assumes: the case's own and, where the table says so, a term more."""
    extra = settings["also_assumed"]
    return model.with_term(get(extra)) if extra else model


def estimator_settings(settings: Table) -> Settings:
    """The estimators' settings from a case's identification settings; what these leave out is as by default."""
    low, high = settings["fit_band"]
    bands = LocalPolynomial(**settings.get("local_polynomial", {}))
    return Settings(Segments(**settings["segments"]), (low, high), bands, settings.get("settle_periods", 1))


def identify_case(model: Model, record: Record, settings: Table) -> dict[str, Identified]:
    """What each of the configured estimators finds in a record, by the estimator's name.

    One whose model diverges finds nothing, and its note says so: the others are none the worse for it.
    """
    assumed, told = assumed_model(model, settings), estimator_settings(settings)
    record = replace(record, period=settings.get("period", record.period))
    return {name: _identified(name, assumed, record, told) for name in settings["estimators"]}


def _identified(name: str, model: Model, record: Record, told: Settings) -> Identified:
    try:
        return estimators.identify(name, model, record, told)
    except DivergenceError as error:
        return Identified((), None, (), note=f"{name} finds nothing in {record.name}: {error}")
