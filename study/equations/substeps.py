"""How many steps a free run of a model needs in each sampling interval of a record."""

import numpy as np

from study.equations import kernels
from study.equations.free_run import FreeRun, prepare
from study.equations.model import Model
from study.records.outputs import DISPLACEMENT, Outputs
from study.records.record import Record
from study.records.states import angular_rate, starting_states
from study.support.arrays import Floats, Ints

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
    run = prepare(model, record, steps_per_sample=1)
    samples = np.unique(np.linspace(0, len(record) - 1, POINTS).astype(np.int64))
    if run.known:
        return _rates_of_memories(run, record, samples)
    states = run.states
    point = np.column_stack([starting_states(record, outputs, samples.tolist()), record.time[samples]])
    data = np.column_stack([point, run.drive[2 * np.array(run.along(samples.tolist()))]])
    columns = np.arange(data.shape[1], dtype=np.int64)
    partial = np.empty((len(samples), (states - 1) * states))
    with np.errstate(all="ignore"):
        kernels.evaluate(
            run.program.code, run.program.first, run.program.registers.copy(), columns, data,
            run.variation.slots[:, 1 : 1 + states].ravel(), partial,
        )  # fmt: skip
    if not np.all(np.isfinite(partial)):
        return np.full(len(samples), np.inf)
    jacobian = np.zeros((len(samples), states, states))
    jacobian[:, 0, 1] = 1.0
    jacobian[:, 1:] = partial.reshape(len(samples), states - 1, states)
    return np.asarray(np.max(np.abs(np.linalg.eigvals(jacobian)), axis=1), dtype=np.float64)


def _rates_of_memories(run: FreeRun, record: Record, samples: Ints) -> Floats:
    """The same of a model without inertia: how fast the terms' own states change beside a prescribed motion."""
    states = run.states
    if states == 0:
        return np.zeros(1)
    drive = run.drive[2 * np.array(run.along(samples.tolist()))]
    data = np.column_stack([drive[:, :2], record.time[samples], drive[:, 2:]])
    columns = np.array([0, 1, 2, *range(4, data.shape[1] + 1)], dtype=np.int64)
    partial = np.empty((len(samples), states * states))
    kernels.evaluate(
        run.program.code, run.program.first, run.program.registers.copy(), columns, data,
        run.variation.slots[1:, 1 : 1 + states].ravel(), partial,
    )  # fmt: skip
    return np.max(np.abs(partial), axis=1)
