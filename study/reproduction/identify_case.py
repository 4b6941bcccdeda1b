"""Identification of a case of the study: settings and record in, what each estimator finds out."""

from dataclasses import replace

from study.equations.model import Model
from study.equations.terms import get
from study.identify import estimators
from study.identify.estimators.base import Identified, Settings
from study.identify.frequency_domain.local_polynomial import LocalPolynomial
from study.records.record import Record
from study.reproduction.settings import IdentificationSettings
from study.support.errors import DivergenceError


def assumed_model(model: Model, also_assumed: str) -> Model:
    """The model that the identification assumes: the case's own and, where the table says so, a term more."""
    return model.with_term(get(also_assumed)) if also_assumed else model


def estimator_settings(settings: IdentificationSettings) -> Settings:
    """What the estimators themselves are told."""
    low, high = settings.fit_band
    bands = LocalPolynomial(**settings.local_polynomial.model_dump())
    return Settings(settings.segments.segments(), (low, high), bands, settings.settle_periods)


def identify_case(model: Model, record: Record, settings: IdentificationSettings) -> dict[str, Identified]:
    """What each of the configured estimators finds in a record, by the estimator's name.

    One whose model diverges finds nothing, and its note says so: the others are none the worse for it.
    """
    assumed, for_estimators = assumed_model(model, settings.also_assumed), estimator_settings(settings)
    record = replace(record, period=settings.period)
    return {name: _identified(name, assumed, record, for_estimators) for name in settings.estimators}


def _identified(name: str, model: Model, record: Record, settings: Settings) -> Identified:
    try:
        return estimators.identify(name, model, record, settings)
    except DivergenceError as error:
        return Identified((), None, (), note=f"{name} finds nothing in {record.name}: {error}")
