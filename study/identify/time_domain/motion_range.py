"""How far a motion reaches, and which effects act as themselves within it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from study.equations.model import ModelTerm
from study.equations.term import OF_VARIATION, Term
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import run_of
from study.records.prepared import Prepared
from study.records.record import MOTIONS, Sensor
from study.support.arrays import Floats

SLIGHT = 0.05  # of a loop's yield displacement: a motion that goes no farther bends nothing


@dataclass(frozen=True, eq=False)
class MotionRange:
    """How far a motion reaches that a model was fitted to; what an effect needs to act lies within."""

    motion: Floats  # displacement and velocity of each coordinate along the free run, shape (2, n, c)
    dt: float  # sampling interval in seconds

    def idle(self, term: Term, direction: Floats, values: Mapping[str, float], errors: Mapping[str, float]) -> str:
        """Why an effect does not act as itself along this motion, as a clause; empty where it does.

        A gap that is never reached is no stop, and a band that is never left a spring; a loop that closes at once is
        dry friction, a relaxation that outlasts the record a spring, a pitch beyond the stroke a curved one. What the
        record does not tell from zero may be any of these. ``direction`` is that of its place, shape (c,); ``values``
        and ``errors`` are those of its shape parameters.
        """
        u, v = self.motion @ direction
        for parameter in term.parameters:
            value, error = values.get(parameter.name, math.nan), errors.get(parameter.name, 0.0)
            otherwise = parameter.quantity in ("frequency", "number", OF_VARIATION)
            if math.isnan(value) or parameter.relative or otherwise:
                continue
            low, high = self._limits(parameter.quantity, u, v)
            if parameter.signed and parameter.quantity == "length":
                low, high, size = float(np.min(u)), float(np.max(u)), value
            else:
                size = abs(value)
            if not low < size < high:
                reached = f"{low:.3g} to {high:.3g}"
                return f"its {parameter.meaning}, {value:.4g}, is outside of what this motion reaches ({reached})"
            if not parameter.signed and value < 1.96 * error:
                return f"the record does not tell its {parameter.meaning} ({value:.3g} +- {1.96 * error:.2g})"
        return ""

    def _limits(self, quantity: str, u: Floats, v: Floats) -> tuple[float, float]:
        """Between which sizes of such a quantity an effect acts."""
        match quantity:
            case "time":
                return self.dt, len(u) * self.dt
            case "velocity":
                return 0.0, float(np.max(np.abs(v)))
            case "1/length":
                return SLIGHT / float(np.max(np.abs(u))), math.inf
            case _:
                return 0.0, float(np.max(np.abs(u)))


def motion_range(fit: FreeRunFit, prepared: Prepared) -> MotionRange:
    """How far the free run of a fit reaches along the samples that it was fitted to."""
    motions = tuple(Sensor(c, m) for m in MOTIONS[:2] for c in fit.model.coordinates)
    free = run_of(fit, prepared, sensors=motions).respond({}, fit.initial)[0]
    return MotionRange(free.reshape(len(free), 2, -1).transpose(1, 0, 2), prepared.dt)


def idle_effects(fit: FreeRunFit, entries: Sequence[ModelTerm], prepared: Prepared) -> str:
    """Why one of some effects of a fit does not act as itself along its motion; empty where all do."""
    reach: MotionRange | None = None
    for entry in entries:
        if entry.term.parameters:
            reach = reach or motion_range(fit, prepared)
            direction = np.array(entry.place.direction(fit.model.coordinates))
            values = {p.name: fit.model.numbers()[f"{entry.name}.{p.name}"] for p in entry.term.parameters}
            if said := reach.idle(entry.term, direction, values, {}):
                return said
    return ""
