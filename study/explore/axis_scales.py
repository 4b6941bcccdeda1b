"""How the axes of a page are scaled: one unit for each quantity of a comparison, wherever it is drawn."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.compare.comparison import Comparison
from study.compare.missing_force import MissingForce
from study.explore.page_units import Scale, length, power, rate

Floats = NDArray[np.float64]
Columns = dict[str, Any]
LEAST = 0.005  # of the rms force


@dataclass(frozen=True)
class Scales:
    """How the axes of a model are scaled."""

    response: Scale
    difference: Scale
    displacement: Scale
    velocity: Scale
    force: Scale


def scales_of(comparison: Comparison) -> Scales:
    """Units in which the numbers of a comparison are easy to read."""
    units, lacking, prediction = comparison.record.units, comparison.missing_force, comparison.prediction.of(0)
    motion = rate if comparison.plan.response != "displacement" else length
    unit = units.get(comparison.plan.response, "")
    least = least_force(comparison)
    return Scales(
        response=motion(unit, _largest(prediction.measured)),
        difference=motion(unit, _largest(prediction.residual)),
        displacement=length(units.get("displacement", ""), _largest(lacking.displacement)),
        velocity=rate(units.get("velocity", ""), _largest(lacking.velocity)),
        force=power(units.get("force", ""), max(least, _largest(lacking.force[lacking.inner]))),
    )


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values), initial=0.0))


def least_force(comparison: Comparison) -> float:
    """Missing force down to which axes are drawn: below lies nothing to be seen."""
    return LEAST * float(np.std(comparison.record["force"]))


def within(lacking: MissingForce) -> tuple[Floats, Floats, Floats]:
    """Displacement, velocity and missing force where these are known, without the ends of the record."""
    u, v, force = (x[lacking.inner] for x in (lacking.displacement, lacking.velocity, lacking.force))
    return u, v, force


def heard(comparison: Comparison, frequency: Floats) -> NDArray[np.bool_]:
    """Which lines the axes of frequency show."""
    return (frequency > 0.0) & (frequency <= comparison.force.highest)
