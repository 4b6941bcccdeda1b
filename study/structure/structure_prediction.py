"""The free run of a fitted structure along the part that was not fitted: its error by sensor, and the noise floors."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from study.compare.noise import SIGNIFICANT
from study.equations.free_run import prepare
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import JudgingRun, judging_run
from study.records import noise_floor
from study.records.prepared import Prepared
from study.records.record import Sensor
from study.support.arrays import Floats
from study.support.errors import DivergenceError


@dataclass(frozen=True, eq=False)
class StructurePrediction:
    """Measured and predicted motions on the judging part; n samples, s sensors."""

    fit: FreeRunFit
    prepared: Prepared
    first: int  # sample of the record at which the run begins
    initial: Floats  # state there
    predicted: Floats  # shape (n, s)
    numerical: Floats  # rms error of the integration itself, the difference to a run with twice the steps; shape (s,)
    diverged: bool = False  # the free run does not stay finite: the error counts as 100 %

    @property
    def measured(self) -> Floats:
        """Shape (n, s)."""
        return self.prepared.measured[slice(*self.prepared.plan.judge)]

    @cached_property
    def residual(self) -> Floats:
        """Measured minus predicted, shape (n, s)."""
        return self.measured - self.predicted

    @cached_property
    def size(self) -> Floats:
        """Rms of each measured motion about its mean, shape (s,)."""
        return np.std(self.measured, axis=0)

    @cached_property
    def errors(self) -> Floats:
        """Rms of the residual over that of the motion, of each sensor, shape (s,)."""
        return np.sqrt(np.mean(self.residual**2, axis=0)) / self.size

    @property
    def error(self) -> float:
        """Root mean square of the sensors' errors."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @cached_property
    def floors(self) -> Floats:
        """Noise of each sensor, what no model could explain, over the rms of its motion, shape (s,)."""
        noise = [noise_floor.floor(x, self.prepared.dt).noise for x in self.residual.T]
        rms = np.sqrt(np.mean(self.residual**2, axis=0))
        return np.minimum(np.maximum(noise, self.numerical), rms) / self.size

    @cached_property
    def above_noise(self) -> float:
        """Rms of what stands above white noise in the residual, over that of the motions; 0 where chance does as much.

        Of a free decay it is structure: no force is there whose noise the motion could have turned into one of its own
        colour. It asks for no derivative, and so sees what is left where the free run has lost the motion.
        """
        found = [noise_floor.floor(x, self.prepared.dt) for x in self.residual.T]
        power = [f.excess if f.significance > SIGNIFICANT else 0.0 for f in found]
        return float(np.sqrt(np.mean(np.array(power) / self.size**2)))

    @property
    def floor(self) -> float:
        """Root mean square of the sensors' floors."""
        return float(np.sqrt(np.mean(self.floors**2)))

    def motion(self, sensors: tuple[Sensor, ...], span: tuple[int, int] | None = None) -> Floats:
        """Motions of the free run on the judging part, or another that it covers, shape (samples, sensors)."""
        begin, end = span or self.prepared.plan.judge
        run = prepare(
            self.fit.model, self.prepared.record, sensors=sensors, steps_per_sample=self.fit.steps_per_sample,
            span=(self.first, end),
        )  # fmt: skip
        return run.respond({}, self.initial)[0][begin - self.first :]

    def derivatives(self, fit: FreeRunFit) -> Floats:
        """Stacked derivatives on the judging part by the keys of a fit with the same motion, then by the states."""
        return JudgingRun(fit, self.prepared, self.first, self.initial).derivatives(fit)


def predict_structure(fit: FreeRunFit, prepared: Prepared) -> StructurePrediction:
    """Run a fitted structure along the judging part.

    Where that follows the fitting part the run goes on through both; elsewhere its initial state, and nothing else, is
    estimated from the judging part.
    """
    try:
        run = judging_run(fit, prepared)
        predicted, finer = (run.motions(finer=n) for n in (1, 2))
    except DivergenceError:
        judged = prepared.measured[slice(*prepared.plan.judge)]
        still = np.broadcast_to(np.mean(judged, axis=0), judged.shape).copy()
        none = np.zeros(judged.shape[1])
        return StructurePrediction(fit, prepared, fit.first, fit.initial, still, none, diverged=True)
    moved = np.sqrt(np.mean(np.subtract(finer, predicted) ** 2, axis=0))
    return StructurePrediction(fit, prepared, run.first, run.initial, predicted, np.asarray(moved, dtype=np.float64))
