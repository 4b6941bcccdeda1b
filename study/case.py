"""A case of the study from end to end: settings -> force -> record -> identification."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from study import estimators
from study.errors import DivergenceError
from study.estimators.base import Identified, Settings
from study.excitation import Excitation, displacement_noise, force
from study.local_polynomial import LocalPolynomial
from study.model import Model
from study.record import Record
from study.simulate import Integrator, simulate
from study.spectra import Segments
from study.terms import get

Table = Mapping[str, Any]


def make_record(model: Model, settings: Table, *, seed: int | None = None, noise_seed: int | None = None) -> Record:
    """Simulate a case, noise on the displacement included.

    Parameters
    ----------
    model : Model
        Every value known.
    settings : mapping
        ``StudyConfig.record_settings`` of the case, or ``ensemble_settings`` where the seeds are given.
    seed, noise_seed : int, optional
        In place of the configured seeds, for ensembles.

    Returns
    -------
    Record
        The velocity and acceleration are the noise-free ones: Section 2.2 adds noise to u(t) alone.

    Raises
    ------
    DivergenceError
        If the response leaves the range of finite numbers.
    """
    sampling, described = settings["sampling"], dict(settings["excitation"])
    own = described.pop("seed", seed)
    excitation = Excitation(level=settings["level"], **described)
    values = force(excitation, sampling["samples"], sampling["dt"], own if seed is None else seed)
    try:
        record = simulate(model, values, sampling["dt"], Integrator(**settings["integrator"]))
    except DivergenceError as error:
        name, level = settings["case"], settings["level"]
        raise DivergenceError(f"case {name!r} at level {level:g}: {error}", error.time) from None
    if settings["noise"] > 0.0:
        stream = settings["noise_seed"] if noise_seed is None else noise_seed
        noise = displacement_noise(record["displacement"], settings["noise"], stream)
        record = record.with_channels({"displacement": record["displacement"] + noise})
    return replace(record, name=settings["case"])


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
