"""The record of a case of the study: settings in, simulated motion out."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from study.equations.model import Model
from study.equations.simulate import Integrator, simulate
from study.records.excitation import displacement_noise, force
from study.records.record import Record
from study.reproduction.settings import RecordSettings
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
    the case, as plain data too; the seeds take the place of the configured ones, for ensembles.

    Raises
    ------
    DivergenceError
        If the response leaves the range of finite numbers.
    StudyError
        If the settings are none, or a seed is neither given nor configured.
    """
    settings = checked(RecordSettings, settings, "settings of a record")
    sampling, excitation = settings.sampling, settings.excitation.at_level(settings.level)
    values = force(excitation, sampling.samples, sampling.dt, _seed(seed, settings.excitation.seed, settings.case))
    try:
        record = simulate(model, values, sampling.dt, Integrator(**settings.integrator.model_dump()))
    except DivergenceError as error:
        raise DivergenceError(f"case {settings.case!r} at level {settings.level:g}: {error}", error.time) from None
    if settings.noise > 0.0:
        stream = _seed(noise_seed, settings.noise_seed, settings.case)
        noise = displacement_noise(record["displacement"], settings.noise, stream)
        record = record.with_channels({"displacement": record["displacement"] + noise})
    return replace(record, name=settings.case)


def _seed(given: int | None, configured: int | None, case: str) -> int:
    seed = configured if given is None else given
    if seed is None:
        raise StudyError(f"case {case!r}: no seed is given or configured; expected a whole number of 0 or more")
    return seed
