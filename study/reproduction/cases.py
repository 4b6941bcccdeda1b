"""A case of the study: settings in, simulated record out; record in, what each estimator finds out."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from study.equations.model import Model
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.identify import estimators
from study.identify.estimators.base import Identified, Settings
from study.identify.frequency_domain.local_polynomial import LocalPolynomial
from study.records.excitation import displacement_noise, force
from study.records.record import Record
from study.reproduction.settings import IdentificationSettings, RecordSettings
from study.support.config_files import checked
from study.support.errors import DivergenceError, StudyError


def make_record(
    model: Model,
    settings: RecordSettings | Mapping[str, Any],
    *,
    seed: int | None = None,
    noise_seed: int | None = None,
) -> Record:
    """Simulate a case, noise on the displacement included.

    Velocity and acceleration are the noise-free ones: Section 2.2 adds noise to u(t) alone. ``settings`` are those of
    the case, as plain data too; the seeds take the place of the configured ones, for ensembles. A response that leaves
    the range of finite numbers raises a ``DivergenceError``.
    """
    settings = checked(RecordSettings, settings, "settings of a record")
    sampling, excitation = settings.sampling, settings.excitation.at_level(settings.level)

    def stream(given: int | None, configured: int | None) -> int:
        used = configured if given is None else given
        if used is None:
            raise StudyError(
                f"case {settings.case!r}: no seed is given or configured; expected a whole number of 0 or more"
            )
        return used

    values = force(excitation, sampling.samples, sampling.dt, stream(seed, settings.excitation.seed))
    try:
        record = simulate(model, values, sampling.dt, Integrator(**settings.integrator.model_dump()))
    except DivergenceError as error:
        raise DivergenceError(f"case {settings.case!r} at level {settings.level:g}: {error}", error.time) from None
    if settings.noise > 0.0:
        noise = displacement_noise(record["displacement"], settings.noise, stream(noise_seed, settings.noise_seed))
        record = record.with_channels({"displacement": record["displacement"] + noise})
    return replace(record, name=settings.case)


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
    assumed, told = assumed_model(model, settings.also_assumed), estimator_settings(settings)
    record = replace(record, period=settings.period)
    found: dict[str, Identified] = {}
    for name in settings.estimators:
        try:
            found[name] = estimators.identify(name, assumed, record, told)
        except DivergenceError as error:
            found[name] = Identified((), None, (), note=f"{name} finds nothing in {record.name}: {error}")
    return found
