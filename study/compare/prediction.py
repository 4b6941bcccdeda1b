"""The free run of a fitted model along the part of the record that was not fitted, its error and its noise floor."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from study.compare.noise import Noise, noise_of
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import JudgingRun, judging_run
from study.records.completion import derivative
from study.records.prepared import Prepared
from study.records.record import MOTIONS
from study.support.errors import DivergenceError

Floats = NDArray[np.float64]
CYCLES = 12  # of the response, in a close-up


@dataclass(frozen=True, eq=False)
class Prediction:
    """Measured and predicted response on the judging part; n samples."""

    prepared: Prepared  # the record and its parts
    run: JudgingRun | None  # None where it does not stay finite: nothing is predicted, the error counts as 100 %
    predicted: Floats  # response of the free run; shape (n,)
    numerical: float  # rms error of the integration itself: the difference to a run with twice the steps

    @property
    def diverged(self) -> bool:
        """Whether the free run does not stay finite."""
        return self.run is None

    @property
    def dt(self) -> float:
        """Sampling interval in seconds."""
        return self.prepared.dt

    @property
    def low(self) -> float:
        """Frequency in hertz below which nothing is judged (the cut-off that was given), or 0."""
        return self.prepared.low

    @property
    def row(self) -> int:
        """Place of the measured response in ``MOTIONS``, which a prescribed motion's force has none in."""
        return MOTIONS.index(self.prepared.response)

    @property
    def time(self) -> Floats:
        """In seconds, shape (n,)."""
        return self.prepared.record.time[slice(*self.prepared.plan.judge)]

    @property
    def measured(self) -> Floats:
        """The response as measured, shape (n,)."""
        return self.prepared.judged

    @property
    def difference(self) -> Floats:
        """Measured minus predicted response at all frequencies, zero where a sample is lost, shape (n,)."""
        return self.prepared.known(self.measured - self.predicted, self.prepared.plan.judge)

    @cached_property
    def motion(self) -> Floats:
        """Displacement, velocity and acceleration of the free run, shape (3, n)."""
        if self.run is None:
            return np.zeros((len(MOTIONS), len(self.predicted)))
        return np.stack([self.run.motion(name) for name in MOTIONS])

    @cached_property
    def residual(self) -> Floats:
        """The difference without what lies below ``low``, shape (n,)."""
        return self.above(self.difference)

    @cached_property
    def size(self) -> float:
        """Rms of the measured response about its mean, without what lies below ``low``."""
        return float(np.std(self.above(self.measured)))

    @property
    def error(self) -> float:
        """Rms of the residual over that of the response."""
        return float(np.sqrt(np.mean(self.residual**2))) / self.size

    @cached_property
    def noise(self) -> Noise:
        """Noise on the response, and what stands above it in the residual."""
        return noise_of(self.difference, self.residual, self.prepared, self.numerical)

    @property
    def floor(self) -> float:
        """The part of the error that no model could explain, as far as this residual shows."""
        return self.noise.rms / self.size

    @property
    def structure(self) -> float:
        """Rms of what stands above the noise over the rms of the response; zero if noise alone would leave as much."""
        return 0.0 if self.noise.alone else float(np.sqrt(self.noise.excess)) / self.size

    @property
    def closeup(self) -> slice:
        """Some cycles of the response about the stretch where the residual is largest; no time is left out of them."""
        centred = self.measured - np.mean(self.measured)
        crossings = max(int(np.count_nonzero(np.diff(np.signbit(centred)))), 2)
        length = int(np.clip(2 * CYCLES * len(centred) / crossings, 32, len(centred)))
        first = int(np.argmax(np.convolve(self.residual**2, np.ones(length), "valid")))
        gaps = np.flatnonzero(np.abs(np.diff(self.time[first : first + length]) - self.dt) > 0.5 * self.dt)
        ends = [first, *(first + 1 + gaps).tolist(), first + length]
        pieces = [slice(a, b) for a, b in pairwise(ends)]
        return max(pieces, key=lambda piece: float(np.sum(self.residual[piece] ** 2)))

    def along(self, part: Prepared) -> "Prediction":
        """The same free run along a part of what is judged, at whose first sample the motion begins anew."""
        if part.plan.judge == self.prepared.plan.judge:
            return self
        begin, (first, last) = self.prepared.plan.judge[0], part.plan.judge
        run, predicted = self.run, self.predicted[first - begin : last - begin]
        if run is None:
            return replace(self, prepared=part, predicted=predicted)
        starts = [begin, *(b for b in self.prepared.record.begins if b > begin)]
        states = np.atleast_2d(run.initial)[starts.index(first) : np.searchsorted(starts, last)]
        own = replace(run, prepared=part, first=first, initial=states)
        return replace(self, prepared=part, run=own, predicted=predicted)

    def above(self, values: Floats) -> Floats:
        """Values of the judging or fitting part without what lies below ``low``, shape (n,)."""
        return derivative(values, self.dt, 0, self.low) if self.low > 0.0 else values


def predict(fit: FreeRunFit, prepared: Prepared) -> Prediction:
    """Run a fitted model along the judging part (:class:`study.identify.time_domain.part_fit.JudgingRun`)."""
    try:
        run = judging_run(fit, prepared)
        predicted, finer = (run.motions(finer=times)[:, 0] for times in (1, 2))
    except DivergenceError:
        return Prediction(prepared, None, np.full_like(prepared.judged, np.mean(prepared.judged)), 0.0)
    return Prediction(prepared, run, predicted, float(np.sqrt(np.mean(np.subtract(finer, predicted) ** 2))))
