"""Where a free run has to begin anew, because its system forgets nothing and magnifies everything.

In a chaotic system (the report's Dead-Band system is one) any error of the state grows until the free run
has nothing to do with the measured motion, however true the model. Pieces that are short against that
growth, each with an initial state of its own, keep the fit well posed (multiple shooting; H. G. Bock, 1983).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.errors import DivergenceError
from study.free_run import FreeRun, prepare
from study.model import Model
from study.record import Record

Floats = NDArray[np.float64]
GROWTH = 30.0  # by how much a disturbance of the state may be magnified within a piece
SHORTEST = 64  # samples in a piece, at least
REACH = 0.3  # of a period: half width of the cubic that smooths a displacement into a state


def starting_state(record: Record, response: str, sample: int) -> Floats:
    """Displacement and velocity at a sample, as well as the record shows them, shape (2,).

    A displacement is smoothed by a cubic over a part of its period, which yields the velocity too; what
    neither it nor a channel of the record shows is taken as zero.
    """
    if response == "displacement":
        values = record[response]
        half = int(
            np.clip(round(REACH * 2.0 * np.pi / (angular_rate(values, record.dt) * record.dt)), 2, len(values) - 1)
        )
        first = max(0, min(sample - half, len(values) - 2 * half - 1))
        window = values[first : first + 2 * half + 1]
        offset = (first - sample + np.arange(len(window))) / half
        coefficients = np.polynomial.polynomial.polyfit(offset, window, min(3, len(window) - 1))
        return np.array([coefficients[0], coefficients[1] / (half * record.dt)])
    return np.array([record[c][sample] if c in record else 0.0 for c in ("displacement", "velocity")])


def angular_rate(values: Floats, dt: float) -> float:
    """Typical angular frequency of a motion in rad/s: rms of its derivative over its own."""
    size = float(np.std(values))
    return float(np.sqrt(np.mean(np.diff(values) ** 2))) / (dt * size) if size > 0.0 else 1.0 / dt


def restarts(
    model: Model,
    record: Record,
    *,
    response: str = "displacement",
    steps_per_sample: int = 2,
    span: tuple[int, int] | None = None,
) -> tuple[int, ...]:
    """Samples at which a disturbance of the state has been magnified ``GROWTH`` times; none for most systems.

    Parameters
    ----------
    model : Model
        Every value known, at least roughly.
    record, response, steps_per_sample, span
        As :func:`study.free_run.prepare`.

    Raises
    ------
    StudyError
        As :func:`study.free_run.prepare`.
    """
    first, last = span or (0, len(record))
    rate = angular_rate(record[response][first:last], record.dt)
    found: list[int] = []
    while last - first >= 2 * SHORTEST:
        run = prepare(model, record, response=response, steps_per_sample=steps_per_sample, span=(first, last))
        growth = _growth(run, starting_state(record, response, first), rate)
        beyond = np.flatnonzero(growth[SHORTEST : last - first - SHORTEST] > GROWTH)
        if len(beyond) == 0:
            break
        first += SHORTEST + int(beyond[0])
        found.append(first)
    return tuple(found)


def _growth(run: FreeRun, state: Floats, rate: float) -> Floats:
    """By how much a disturbance of the first state of unit energy is magnified, shape (samples,).

    Displacement and velocity are weighed by the angular rate, so that without damping and nonlinearity
    this is one throughout. Where the free run diverges it is infinite.
    """
    growth = np.full(run.samples, np.inf)
    try:
        _, jacobian = run.respond({}, state, 2)
    except DivergenceError as error:
        reached = round((error.time - run.start) / run.dt)
        if reached < 2:
            return growth
        _, jacobian = replace(run, samples=reached).respond({}, state, 2)
    growth[: len(jacobian)] = np.hypot(jacobian[:, 0], rate * jacobian[:, 1]) / rate**run.row
    return growth
