"""The record of a case of the study: settings in, simulated motion out."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from study.equations.model import Model
from study.equations.simulate import Integrator, simulate
from study.records.excitation import Excitation, displacement_noise, force
from study.records.record import Record
from study.support.errors import DivergenceError

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
