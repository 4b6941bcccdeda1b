"""Structure and forces in, record out."""

from collections.abc import Mapping, Sequence

import numpy as np

from study.equations.model import Model
from study.records.record import MOTIONS, Record, Sensor, record_of
from study.structure.mass_matrix import checked_mass_matrix
from study.structure.structure_run import prepare_run
from study.support.arrays import Floats
from study.support.errors import DivergenceError, StudyError, expect


def simulate_structure(
    model: Model,
    forces: Mapping[str, Floats],
    dt: float,
    *,
    samples: int | None = None,
    steps_per_sample: int = 8,
    initial: Sequence[float] = (),
    sensors: Sequence[Sensor] | None = None,
    extra: Mapping[str, Floats] | None = None,
) -> Record:
    """Motion of a structure under forces.

    Parameters
    ----------
    model : Model
        Every value known.
    forces : mapping of arrays, shape (n,)
        Samples of each of its forces.
    dt : float
        Sampling interval in seconds.
    samples : int, optional
        How many, where nothing drives the structure.
    steps_per_sample : int
        Runge-Kutta steps in each sampling interval.
    initial : sequence of float
        Displacements, velocities and the terms' own states at the first sample; zero where left out.
    sensors : sequence of Sensor, optional
        The motions that are kept; all of them if left out.
    extra : mapping of arrays, optional
        Further channels, for the user's own terms to name.

    Raises
    ------
    DivergenceError
        If the motion leaves the range of finite numbers; names model and time.
    StudyError
        If the model is not complete, its mass matrix is not positive definite, or a channel is not finite.
    """
    model.numbers()
    checked_mass_matrix(model)
    for name, values in {**forces, **(extra or {})}.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise StudyError(f"the channel {name!r} is {values[bad[0]]} at sample {bad[0]}; a simulation needs numbers")
    count = samples or min((len(values) for values in forces.values()), default=0)
    expect(count > 1, f"{model.name!r} has no force; expected a number of samples for its free decay")
    wanted = tuple(sensors or (Sensor(c, m) for m in MOTIONS for c in model.coordinates))
    still = record_of(dt, forces, {s: np.zeros(count) for s in wanted}, extra, model.name)
    try:
        run = prepare_run(model, still, sensors=wanted, steps_per_sample=steps_per_sample)
        response, _ = run.respond({}, np.array(initial, dtype=np.float64))
    except DivergenceError as error:
        raise DivergenceError(
            f"the simulation of {model.name!r} diverged at t = {error.time:.4g} s; take more steps per sample than "
            f"{steps_per_sample}, a lower level, or check the signs of the coefficients",
            error.time,
        ) from None
    return still.with_motions(dict(zip(wanted, response, strict=True)))
