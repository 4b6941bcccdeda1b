"""The free run of a fitted model along the part of the record that was not fitted, its error and its noise floor.

It has a column for each sensor that is compared; a single mass has one. What shows one sensor's curves asks for it
(:meth:`Prediction.of`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from study.compare.noise import Noise, noise_of
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import JudgingRun, judging_run
from study.records.completion import derivative
from study.records.prepared import Prepared
from study.records.record import Sensor
from study.support.arrays import Floats
from study.support.errors import DivergenceError

CYCLES = 12  # of the response, in a close-up


@dataclass(frozen=True, eq=False)
class Prediction:
    """Measured and predicted response on the judging part; n samples, s sensors."""

    prepared: Prepared  # the record and its parts
    run: JudgingRun | None  # None where it does not stay finite, or where modes of the structure's own run
    predicted: Floats  # response of the free run; shape (n, s)
    numerical: Floats  # rms error of the integration itself: the difference to a run with twice the steps; shape (s,)
    diverged: bool = False  # it does not stay finite: nothing is predicted, the error counts as 100 %

    @property
    def dt(self) -> float:
        """Sampling interval in seconds."""
        return self.prepared.dt

    @property
    def low(self) -> float:
        """Frequency in hertz below which nothing is judged (the cut-off that was given), or 0."""
        return self.prepared.low

    @property
    def time(self) -> Floats:
        """In seconds, shape (n,)."""
        return self.prepared.record.time[slice(*self.prepared.plan.judge)]

    @property
    def measured(self) -> Floats:
        """The response as measured, shape (n, s)."""
        return self.prepared.measured[slice(*self.prepared.plan.judge)]

    @property
    def misfit(self) -> Floats:
        """Measured minus predicted response at all frequencies, zero where a sample is lost, shape (n, s).

        Made whenever it is asked for: kept by every candidate, it would be most of what a long record takes.
        """
        left = self.measured - self.predicted
        kept = self.prepared.known(np.ones(left.size), self.prepared.plan.judge)
        return left * kept.reshape(left.shape)

    @property
    def residual(self) -> Floats:
        """The same without what lies below ``low``, stacked as that of a fit is, shape (n s,)."""
        return self._filtered if self.low > 0.0 else self.prepared.outputs.stacked(self.misfit)

    @cached_property
    def _filtered(self) -> Floats:
        return self.above(self.prepared.outputs.stacked(self.misfit))

    @cached_property
    def size(self) -> Floats:
        """Rms of each measured response about its mean, without what lies below ``low``, shape (s,)."""
        return np.array([view.size for view in self.views])

    @cached_property
    def errors(self) -> Floats:
        """Rms of each sensor's residual over that of its response, shape (s,)."""
        return np.array([view.error for view in self.views])

    @property
    def worst(self) -> "SensorPrediction":
        """What the sensor shows that is missed most."""
        return self.views[int(np.argmax(self.errors))]

    @property
    def error(self) -> float:
        """Root mean square of the sensors' errors."""
        return _rms(self.errors)

    @cached_property
    def floors(self) -> Floats:
        """The part of each sensor's error that no model could explain, as far as this residual shows, shape (s,)."""
        return np.array([view.noise.rms / view.size for view in self.views])

    @property
    def floor(self) -> float:
        """Root mean square of the sensors' floors."""
        return _rms(self.floors)

    @cached_property
    def above_noise(self) -> float:
        """Rms of what stands above the noise over that of the response; zero if noise alone would leave as much.

        Of a free decay that is a systematic residual: no force is there whose noise the motion could have turned into
        one of its own colour. It asks for no derivative, and so sees what is left where the free run has lost the
        motion.
        """
        found = [0.0 if v.noise.alone else float(np.sqrt(v.noise.excess)) / v.size for v in self.views]
        return _rms(np.array(found))

    @cached_property
    def views(self) -> tuple["SensorPrediction", ...]:
        """What each sensor shows; a single mass has one."""
        return tuple(SensorPrediction(self, i) for i in range(len(self.prepared.outputs)))

    def of(self, sensor: int) -> "SensorPrediction":
        """What one of the sensors shows; a single mass has one, the first."""
        return self.views[sensor]

    def motions(self, sensors: Sequence[Sensor]) -> Floats:
        """Motions of the free run that any sensors would show, zero where it diverged, shape (n, sensors)."""
        return np.zeros((len(self.predicted), len(sensors))) if self.run is None else self.run.motions(sensors)

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

    def above(self, stacked: Floats) -> Floats:
        """Stacked values of the judging or fitting part without what lies below ``low``, the same shape."""
        if self.low == 0.0:
            return stacked
        columns = stacked.reshape(-1, len(self.prepared.outputs)).T
        return np.stack([_above(values, self.prepared) for values in columns], axis=1).reshape(stacked.shape)


@dataclass(frozen=True, eq=False)
class SensorPrediction:
    """What one sensor shows of a prediction; arrays of shape (n,)."""

    whole: Prediction
    number: int  # of the sensor among those that are compared

    @property
    def prepared(self) -> Prepared:
        """The record and its parts."""
        return self.whole.prepared

    @property
    def sensor(self) -> Sensor:
        """What it measures."""
        return self.prepared.outputs.sensors[self.number]

    @property
    def dt(self) -> float:
        """Sampling interval in seconds."""
        return self.prepared.dt

    @property
    def time(self) -> Floats:
        """In seconds."""
        return self.whole.time

    @property
    def measured(self) -> Floats:
        """The response as measured."""
        return self.whole.measured[:, self.number]

    @property
    def predicted(self) -> Floats:
        """Response of the free run."""
        return self.whole.predicted[:, self.number]

    @property
    def difference(self) -> Floats:
        """Measured minus predicted response at all frequencies, zero where a sample is lost."""
        return self.whole.misfit[:, self.number]

    @property
    def residual(self) -> Floats:
        """The difference without what lies below ``low``, in the unit of the sensor."""
        return self._filtered if self.whole.low > 0.0 else self.difference

    @cached_property
    def _filtered(self) -> Floats:
        return _above(self.difference, self.prepared)

    @cached_property
    def size(self) -> float:
        """Rms of the measured response about its mean, without what lies below ``low``."""
        return float(np.std(_above(self.measured, self.prepared)))

    @property
    def error(self) -> float:
        """Rms of the residual over that of the response."""
        return _rms(self.residual) / self.size

    @cached_property
    def noise(self) -> Noise:
        """Noise on the response, and what stands above it in the residual."""
        numerical = float(self.whole.numerical[self.number])
        return noise_of(self.difference, self.residual, self.prepared, self.sensor, numerical)

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


def predict(fit: FreeRunFit, prepared: Prepared) -> Prediction:
    """Run a fitted model along the judging part (:class:`study.identify.time_domain.part_fit.JudgingRun`)."""
    try:
        run = judging_run(fit, prepared)
        predicted, finer = (run.motions(finer=times) for times in (1, 2))
    except DivergenceError:
        judged = prepared.measured[slice(*prepared.plan.judge)]
        still = np.broadcast_to(np.mean(judged, axis=0), judged.shape)
        return Prediction(prepared, None, still, np.zeros(len(prepared.outputs)), diverged=True)
    apart = np.asarray(finer - predicted, dtype=np.float64)
    return Prediction(prepared, run, predicted, np.sqrt(np.mean(apart**2, axis=0)))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _above(values: Floats, prepared: Prepared) -> Floats:
    return derivative(values, prepared.dt, 0, prepared.low) if prepared.low > 0.0 else values
