"""The free run of a fitted model along the part of the record that was not fitted."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study.equations.free_run import prepare
from study.identify.time_domain.free_run_fit import FreeRunFit, fit_free_run
from study.records import completion
from study.records.plan import Plan
from study.records.record import MOTIONS, Record

Floats = NDArray[np.float64]
CYCLES = 12  # of the response, in a close-up


@dataclass(frozen=True)
class Judged:
    """Measured and predicted response on the judging part; n samples.

    Attributes
    ----------
    time : array, shape (n,)
        In seconds.
    motion : array, shape (3, n)
        Displacement, velocity and acceleration of the free run.
    row : int
        Place of the measured response in ``MOTIONS``.
    measured : array, shape (n,)
        The response as measured.
    low : float
        Frequency in hertz below which nothing is judged (the cut-off of an integration), or 0.
    dt : float
        Sampling interval in seconds.
    numerical : float
        Rms error of the integration itself: the difference to a run with twice the steps.
    """

    time: Floats
    motion: Floats
    row: int
    measured: Floats
    low: float
    dt: float
    numerical: float

    @property
    def predicted(self) -> Floats:
        """Response of the free run, shape (n,)."""
        return self.motion[self.row]

    @property
    def difference(self) -> Floats:
        """Measured minus predicted response at all frequencies, shape (n,)."""
        return self.measured - self.predicted

    @property
    def residual(self) -> Floats:
        """The difference without what lies below ``low``, shape (n,)."""
        return self.above(self.difference)

    @property
    def size(self) -> float:
        """Rms of the measured response about its mean, without what lies below ``low``."""
        return float(np.std(self.above(self.measured)))

    @property
    def error(self) -> float:
        """Rms of the residual over that of the response."""
        return float(np.sqrt(np.mean(self.residual**2))) / self.size

    @property
    def closeup(self) -> slice:
        """Some cycles of the response about the stretch where the residual is largest."""
        centred = self.measured - np.mean(self.measured)
        crossings = max(int(np.count_nonzero(np.diff(np.signbit(centred)))), 2)
        length = int(np.clip(2 * CYCLES * len(centred) / crossings, 32, len(centred)))
        first = int(np.argmax(np.convolve(self.residual**2, np.ones(length), "valid")))
        return slice(first, first + length)

    def above(self, values: Floats) -> Floats:
        """Values without what lies below ``low``, shape (n,)."""
        return completion.derivative(values, self.dt, 0, self.low) if self.low > 0.0 else values


def judge(found: FreeRunFit, record: Record, how: Plan, low: float = 0.0) -> Judged:
    """Run a fitted model along the judging part.

    Where that follows the fitting part the run goes on through both; elsewhere its initial state, and
    nothing else, is estimated from the judging part (as in ``held_out.held_out_residual``).

    Parameters
    ----------
    found : FreeRunFit
        What was fitted on the fitting part.
    record : Record
        Force and response in consistent units.
    how : Plan
        What is judged.
    low : float
        Frequency in hertz below which nothing is judged.

    Raises
    ------
    DivergenceError
        If the free run leaves the range of finite numbers.
    """
    first, last = how.judge
    span, initial = (how.fit[0], last), found.initial
    if first != how.fit[1]:
        again = fit_free_run(
            found.model, record, held=tuple(found.model.values), response=how.response,
            steps_per_sample=how.steps_per_sample, span=how.judge,
        )  # fmt: skip
        span, initial = how.judge, again.initial
    run = prepare(found.model, record, steps_per_sample=how.steps_per_sample, span=span)
    whole = [replace(run, row=row).respond({}, initial)[0] for row in range(3)]
    motions = np.asarray(whole, dtype=np.float64)[:, first - span[0] :]
    row = MOTIONS.index(how.response)
    twice = prepare(
        found.model, record, response=how.response, steps_per_sample=2 * how.steps_per_sample, span=span
    )  # fmt: skip
    finer, _ = twice.respond({}, initial)
    gap: Floats = np.subtract(finer[first - span[0] :], motions[row])
    numerical = float(np.sqrt(np.mean(gap**2)))
    part = record.part(first, last)
    return Judged(part.time, motions, row, part[how.response], low, record.dt, numerical)
