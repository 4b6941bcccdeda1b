"""Model and forces in, record out.

The report integrates with an Adams-Bashforth predictor-corrector of order 4 at one step a sample
(Section 2.2). Here the steps per sample are a setting, a classical Runge-Kutta is the alternative, and
the forces between the samples are their band-limited interpolation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.equations import kernels
from study.equations.linear_part import checked_mass_matrix
from study.equations.model import Model, named_channels
from study.equations.motion_program import motion_program
from study.records.interpolation import between_samples_kept, in_columns
from study.records.record import MOTIONS, Record, Sensor, record_of
from study.support.arrays import Floats
from study.support.errors import DivergenceError, StudyError, expect
from study.support.recent import Recent

PLENTY = 8  # steps per sample with which a stable system is integrated stably
TURN = 0.05  # rad in a step: an integrator of order four errs by about its fourth power, less than an effect
METHODS = {"abm4": kernels.Method.ADAMS, "rk4": kernels.Method.ONE_BY_ONE}
_DRIVES = Recent(most=32, largest=1 << 24)  # between samples: several systems run under the same; no long ones


@dataclass(frozen=True)
class Integrator:
    """How to integrate; Runge-Kutta alone cuts a step where dry friction switches."""

    method: str = "abm4"  # the report's, or ``rk4``
    steps_per_sample: int = 8  # in each sampling interval; the report took one

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise StudyError(f"there is no integrator {self.method!r}; known are {', '.join(METHODS)}")
        if self.steps_per_sample < 1:
            raise StudyError(f"steps_per_sample is {self.steps_per_sample}; at least 1 is needed")


def simulate(
    model: Model,
    force: Floats | Mapping[str, Floats],
    dt: float,
    integrator: Integrator | None = None,
    *,
    samples: int | None = None,
    initial: Sequence[float] = (),
    start: float = 0.0,
    sensors: Sequence[Sensor] | None = None,
    extra: Mapping[str, Floats] | None = None,
    units: Mapping[str, str] | None = None,
) -> Record:
    """Motions of a model under forces.

    Parameters
    ----------
    model : Model
        Every value known.
    force : array, shape (n,), or mapping of these
        Samples of the force on a single mass; of each force by name, and of motions that are prescribed.
    dt : float
        Sampling interval in seconds.
    integrator : Integrator, optional
        Default: the report's method with eight steps a sample.
    samples : int, optional
        How many, where nothing drives the model.
    initial : sequence of float
        Displacements, velocities and the terms' own states at the first sample; zero where left out.
    start : float
        Time of the first sample in seconds (matters to terms that depend on time).
    sensors : sequence of Sensor, optional
        The motions that are wanted; all of them if left out.
    extra : mapping of arrays, optional
        Further channels, for the user's own terms to name.
    units : mapping of str, optional
        Units of the channels; SI where left out.

    Raises
    ------
    DivergenceError
        If the motion leaves the range of finite numbers; names model, time and level.
    """
    forces, integrator = force if isinstance(force, Mapping) else {"force": force}, integrator or Integrator()
    channels, extra = {**forces, **(extra or {})}, extra or {}
    wanted = [Sensor(c, m) for m in MOTIONS for c in model.coordinates] if sensors is None else list(sensors)
    model = model.with_values(model.numbers())
    named_channels(model, extra)
    heavy = any(entry.term.name == "inertia" for entry in model.terms)
    expect(heavy or model.modal, f"model {model.name!r} has no inertia; a simulation needs it")
    motion = motion_program(model, (), wanted, switching=integrator.method != "abm4")
    if model.named:
        checked_mass_matrix(model)
    for name in motion.drive:
        bad = np.flatnonzero(~np.isfinite(channels[name]))
        if len(bad):
            raise StudyError(
                f"the channel {name!r} is {channels[name][bad[0]]} at sample {bad[0]}; a simulation needs numbers"
            )
    count = samples or min((len(channels[name]) for name in motion.drive), default=0)
    expect(count > 0, f"{model.name!r} has no force; expected a number of samples for its free decay")
    steps = integrator.steps_per_sample
    if len(initial) > motion.states:
        raise StudyError(f"{len(initial)} initial values were given; model {model.name!r} has {motion.states} states")
    columns = [between_samples_kept(_DRIVES, channels[name], 2 * steps) for name in motion.drive]
    drive = in_columns(columns, 2 * steps * count)
    state = np.zeros((1, motion.states, 1))
    state[0, : len(initial), 0] = initial
    out = np.empty((count, len(wanted), 1))
    failed, _ = kernels.integrate(
        motion, np.array([start]), dt, steps, drive, np.array([0, count]), state, out, METHODS[integrator.method]
    )
    if failed >= 0:
        _diverged(model, channels, steps, start + failed * dt)
    record = record_of(dt, forces, dict(zip(wanted, out[:, :, 0].T, strict=True)), extra, model.name, start)
    return replace(record, units={**record.units, **(units or {})})


def _diverged(model: Model, channels: Mapping[str, Floats], steps: int, time: float) -> None:
    """Raise with advice: more steps where there are few; with many the system itself diverges."""
    levels = [float(np.mean(channels[name] ** 2)) for name, _ in model.forces if name in channels]
    under = f" under a force of mean square {max(levels):.4g}" if levels else ""
    if steps < PLENTY:
        advice = f"take more steps per sample than {steps}, a lower level, or check the signs of the coefficients"
    else:
        advice = (
            f"at {steps} steps per sample it is the system itself that runs away at this level; take a lower level or "
            "another stiffness, or check the signs of the coefficients"
        )
    raise DivergenceError(f"the simulation of {model.name!r} diverged at t = {time:.4g} s{under}; {advice}", time)
