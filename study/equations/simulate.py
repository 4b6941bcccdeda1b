"""Model and force in, record out.

The report integrates with an Adams-Bashforth predictor-corrector of order 4 at one step a sample
(Section 2.2). Here the steps per sample are a setting, a classical Runge-Kutta is the alternative, and
the force between the samples is its band-limited interpolation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from study.equations import kernels
from study.equations.model import Model, forward_program, named_channels
from study.records.interpolation import between_samples
from study.records.record import SI_UNITS, Record
from study.support.arrays import Floats
from study.support.errors import DivergenceError, StudyError

PLENTY = 8  # steps per sample with which a stable system is integrated stably
METHODS = {"abm4": kernels.integrate_abm4, "rk4": kernels.integrate_rk4}


@dataclass(frozen=True)
class Integrator:
    """How to integrate.

    Attributes
    ----------
    method : str
        ``abm4`` (the report's) or ``rk4``.
    steps_per_sample : int
        Steps in each sampling interval; the report took one.
    """

    method: str = "abm4"
    steps_per_sample: int = 8

    def __post_init__(self) -> None:
        """Refuse what no integrator can do."""
        if self.method not in METHODS:
            raise StudyError(f"there is no integrator {self.method!r}; known are {', '.join(METHODS)}")
        if self.steps_per_sample < 1:
            raise StudyError(f"steps_per_sample is {self.steps_per_sample}; at least 1 is needed")


def simulate(
    model: Model,
    force: Floats,
    dt: float,
    integrator: Integrator | None = None,
    *,
    initial: Sequence[float] = (0.0, 0.0),
    start: float = 0.0,
    extra: Mapping[str, Floats] | None = None,
    units: Mapping[str, str] | None = None,
) -> Record:
    """Response of a model to a force.

    Parameters
    ----------
    model : Model
        Every value known.
    force : array, shape (n,)
        Samples of the force.
    dt : float
        Sampling interval in seconds.
    integrator : Integrator, optional
        Default: the report's method with eight steps a sample.
    initial : sequence of float
        Displacement, velocity and, if given, the terms' own states at the first sample.
    start : float
        Time of the first sample (matters to terms that depend on time).
    extra : mapping of arrays, optional
        Further channels, for the user's own terms to name.
    units : mapping of str, optional
        Units of the channels; SI where left out.

    Raises
    ------
    DivergenceError
        If the response leaves the range of finite numbers; names model, time and level.
    StudyError
        If the model is not complete, a channel is not finite, or there are more initial values than states.
    """
    settings = integrator or Integrator()
    extra = extra or {}
    channels = named_channels(model, extra)
    _check(model, {"force": force, **{name: extra[name] for name in channels}}, initial)
    program = forward_program(model, channels)
    factor = 2 * settings.steps_per_sample
    drive = between_samples(force, factor)[:, None]
    if channels:  # copying a long record takes longer than the integration
        drive = np.column_stack([drive, *(between_samples(extra[name], factor) for name in channels)])
    state = np.zeros(2 + len(model.states))
    state[: len(initial)] = initial
    out = np.empty((len(force), 1 + len(state)))
    failed = METHODS[settings.method](
        program.code, program.first, program.registers.copy(), program.outputs,
        start, dt, settings.steps_per_sample, drive, state, out,
    )  # fmt: skip
    if failed >= 0:
        _diverged(model, force, settings.steps_per_sample, start + failed * dt)
    motion = {"force": force, "displacement": out[:, 0], "velocity": out[:, 1], "acceleration": out[:, 2]}
    return Record(dt, {**motion, **extra}, {**SI_UNITS, **(units or {})}, model.name, start)


def _check(model: Model, channels: Mapping[str, Floats], initial: Sequence[float]) -> None:
    """Refuse what would only show as a divergence."""
    for name, values in channels.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise StudyError(f"the channel {name!r} is {values[bad[0]]} at sample {bad[0]}; a simulation needs numbers")
    states = 2 + len(model.states)
    if len(initial) > states:
        raise StudyError(f"{len(initial)} initial values were given; model {model.name!r} has {states} states")


def _diverged(model: Model, force: Floats, steps: int, time: float) -> None:
    """Raise with advice: more steps where there are few; with many the system itself diverges."""
    level = float(np.mean(force**2))
    if steps < PLENTY:
        advice = f"take more steps per sample than {steps}, a lower level, or check the signs of the coefficients"
    else:
        advice = (
            f"at {steps} steps per sample it is the system itself that runs away at this level; take a lower level or "
            "another stiffness, or check the signs of the coefficients"
        )
    raise DivergenceError(
        f"the simulation of {model.name!r} diverged at t = {time:.4g} s under a force of mean square {level:.4g}; "
        + advice,
        time,
    )
