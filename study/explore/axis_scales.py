"""How the axes of a page are scaled: one unit for each quantity of what is looked at, wherever it is drawn."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.compare.comparison import Comparison
from study.compare.connection_spectra import highest_frequency
from study.compare.missing_force import MissingForce
from study.compare.prediction import SensorPrediction
from study.equations.coefficient_units import units_at
from study.equations.place import Place
from study.explore.page_units import Scale, motion, power
from study.support.arrays import Floats

Columns = dict[str, Any]
LEAST_FORCE = 0.005  # of its rms
EVEN_BELOW, THREE_BELOW, TWO_BELOW = 0.5, 1.4, 2.6  # decades of an axis with even ticks, three or two in a decade
AXIS_MARGIN = 1.2  # by which an axis reaches beyond what it shows, at most


@dataclass(frozen=True, eq=False)
class Focus:
    """What is looked at: a comparison with one record, one of its sensors, and one of the places.

    With the units in which the numbers of these are easy to read.
    """

    comparison: Comparison
    number: int  # of the sensor among those that are compared
    place: Place  # one where a force that is missing shows

    @property
    def sensor(self) -> SensorPrediction:
        """What the sensor shows of the prediction."""
        return self.comparison.prediction.of(self.number)

    @cached_property
    def lacking(self) -> MissingForce:
        """The force that is missing at the place."""
        known = self.place.path == self.comparison.place.path
        return self.comparison.missing_force if known else self.comparison.missing.at(self.place)

    @cached_property
    def within(self) -> tuple[Floats, Floats, Floats]:
        """Displacement, velocity and missing force at the place where these are known, without the record's ends."""
        return self.lacking.known

    @cached_property
    def response(self) -> Scale:
        """Of the motion that the sensor measures, or of a force that is predicted."""
        return motion(self._unit, _largest(self.sensor.measured))

    @cached_property
    def difference(self) -> Scale:
        """Of what the model misses of that."""
        return motion(self._unit, _largest(self.sensor.residual))

    @cached_property
    def displacement(self) -> Scale:
        """Of the relative motion at the place."""
        return motion(units_at(self.place, self.comparison.record)[1], _largest(self.lacking.displacement))

    @cached_property
    def velocity(self) -> Scale:
        """The same of its velocity."""
        return motion(f"{units_at(self.place, self.comparison.record)[1]}/s", _largest(self.lacking.velocity))

    @cached_property
    def force(self) -> Scale:
        """Of the force that is missing at the place."""
        largest = max(LEAST_FORCE * rms_force(self.comparison), _largest(self.within[2]))
        return power(units_at(self.place, self.comparison.record)[0], largest)

    @property
    def _unit(self) -> str:
        return self.comparison.record.unit(self.sensor.sensor)


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values), initial=0.0))


def rms_force(comparison: Comparison) -> float:
    """Rms of all measured forces together."""
    return math.hypot(*(float(np.std(comparison.record[force])) for force in comparison.record.forces))


def highest(comparison: Comparison) -> float:
    """Frequency in hertz at which the axes of frequency end."""
    alone = len(comparison.model.coordinates) == 1 and comparison.forces
    return comparison.forces[0].highest if alone else highest_frequency(comparison)


def heard(comparison: Comparison, frequency: Floats) -> NDArray[np.bool_]:
    """Which lines the axes of frequency show."""
    return (frequency > 0.0) & (frequency <= highest(comparison))


def log_axis(*columns: Any) -> tuple[float, float]:
    """Ends of the logarithmic axis of what is drawn."""
    values = np.concatenate([np.asarray(column, dtype=np.float64) for column in columns])
    values = values[np.isfinite(values) & (values > 0.0)]
    return (float(np.min(values)), float(np.max(values))) if len(values) else (1.0, 1.0)


def log_ticks(low: float, high: float) -> list[float]:
    """Ticks of a logarithmic axis that do not collide: 1, 2, 5 of a decade, 1 and 3, or decades alone."""
    reach = math.log10(high / low)
    if reach < EVEN_BELOW:
        return even_ticks(low / AXIS_MARGIN, high * AXIS_MARGIN)
    mantissas = (1.0, 2.0, 5.0) if reach < THREE_BELOW else (1.0, 3.0) if reach < TWO_BELOW else (1.0,)
    every = max(1, math.ceil(reach / 5.0))  # five ticks or so
    first, last = math.floor(math.log10(low)) - 1, math.ceil(math.log10(high)) + 1
    return [m * 10.0**power for power in range(first, last + 1) if power % every == 0 for m in mantissas]


def even_ticks(low: float, high: float) -> list[float]:
    """Three to eight ticks at equal distances of 1, 2 or 5 in their last digit."""
    least = (high - low) / 7.0
    power = 10.0 ** math.floor(math.log10(least))
    step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= least)
    return [step * k for k in range(max(math.ceil(low / step), 1), math.floor(high / step) + 1)]
