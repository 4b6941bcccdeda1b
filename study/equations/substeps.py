"""How many steps a free run of a model needs in each sampling interval of a record."""

from dataclasses import replace

import numpy as np

from study.equations import kernels
from study.equations.free_run import prepare
from study.equations.model import Model
from study.records.outputs import DISPLACEMENT, Outputs
from study.records.record import Record
from study.records.states import angular_rate, starting_states
from study.support.arrays import Floats

POINTS = 64  # points of the motion at which the equation of motion is linearised
ROUGH = 0.5  # largest step times the fastest rate
FINE = 0.125  # largest step times the median rate: a short time of fast rates asks for no smaller steps
FEWEST, MOST = 4, 32  # steps a sample between which the median rate sets the bound


def needed_steps(
    model: Model, record: Record, outputs: Outputs = DISPLACEMENT, most: int | None = None
) -> int:  # fmt: skip
    """Steps in each sampling interval with which a search may begin, the values of the model all known.

    ``most`` are taken at most; the median rate bounds them if it is left out. A Runge-Kutta step h of an oscillation of
    rate w shifts its phase by ``(h w)^5 / 120`` and grows without end above ``h w = 2.8``, which heavy damping or a
    short memory reaches though the motion is slow. So rates are the largest eigenvalues of the equation of motion,
    linearised along the motion.
    """
    rates = _rates(model, record, outputs)
    if not np.all(np.isfinite(rates)):
        return most or FEWEST
    most = most or int(np.clip(np.ceil(np.median(rates) * record.dt / FINE), FEWEST, MOST))
    motions = outputs.measured(record, (0, len(record)))
    fastest = max(float(np.max(rates)), *(angular_rate(motion, record.dt) for motion in motions.T))
    return int(np.clip(np.ceil(fastest * record.dt / ROUGH), 1, most))


def _rates(model: Model, record: Record, outputs: Outputs) -> Floats:
    """Magnitude of the largest eigenvalue at each point, in rad/s, shape (points,)."""
    run = prepare(model, record, sensors=(), steps_per_sample=1)
    samples = np.unique(np.linspace(0, len(record) - 1, POINTS).astype(np.int64))
    motion, n = run.motion, run.motion.dofs
    if run.states == 0:
        return np.zeros(1)
    names = list(motion.program.inputs)  # the time, what drives, displacements and velocities
    moved = names[1 + len(motion.drive) :][: 2 * n]
    states = starting_states(record, outputs, samples.tolist(), coordinates=[name[2:] for name in moved[:n]])
    drive = run.drive[2 * np.array(run.along(samples.tolist()))]
    columns = dict(zip(names[1:], drive.T, strict=False)) | dict(zip(moved, states.T, strict=True))
    partial = replace(motion.program, outputs=motion.slots[:, 1 : 1 + run.states].ravel())
    with np.errstate(all="ignore"):
        slopes = kernels.evaluate(partial, columns | {"t": record.time[samples]}, len(samples))
    if not np.all(np.isfinite(slopes)):
        return np.full(len(samples), np.inf)
    jacobian = np.zeros((len(samples), run.states, run.states))
    jacobian[:, np.arange(n), np.arange(n, 2 * n)] = 1.0
    jacobian[:, n:] = slopes.reshape(len(samples), -1, run.states)
    return np.asarray(np.max(np.abs(np.linalg.eigvals(jacobian)), axis=1), dtype=np.float64)
