"""The measured motions that free runs are held against, side by side.

Residuals of all sensors at one time stand next to each other in one long array, each in shares of its sensor's size, so
that blocks of time hold all of them and one statistic serves any number of sensors. A single sensor's are as they are,
in its own unit.
"""

from dataclasses import dataclass

import numpy as np

from study.records.record import ALONE, Record, Sensor
from study.support.arrays import Bools, Floats
from study.support.autoregression import whitened

Noise = tuple[Floats, ...]  # autoregressive coefficients of each sensor's noise, the first of which weighs it


@dataclass(frozen=True)
class Outputs:
    """Sensors, and what a unit of each counts."""

    sensors: tuple[Sensor, ...]
    weights: tuple[float, ...]  # one for each sensor; 1 for a single one

    def __len__(self) -> int:
        return len(self.sensors)

    def measured(self, record: Record, span: tuple[int, int]) -> Floats:
        """What the sensors show along a span, shape (n, sensors)."""
        return record.columns(self.sensors, span)

    def stacked(self, values: Floats, *, in_place: bool = False) -> Floats:
        """Values (n, sensors, ...) weighted, those of one time side by side, shape (n sensors, ...).

        ``in_place`` they are weighted where they stand: of derivatives a copy takes as long as their sums of products.
        """
        if len(self.sensors) == 1:
            return values[:, 0]
        weights = np.array(self.weights).reshape(-1, *[1] * (values.ndim - 2))
        with np.errstate(over="ignore"):  # what a motion that runs off leaves is beyond all measure
            weighted = np.multiply(values, weights, out=values if in_place else None)
        return weighted.reshape(len(values) * len(self.sensors), *values.shape[2:])

    def kept(self, lost: Bools) -> Floats:
        """1 for stacked values that count and 0 for those of lost samples, shape (n s,).

        ``lost`` has a column for each sensor, or is (n,) where a sample of all is lost together.
        """
        each = lost if lost.ndim == 2 else lost[:, None]
        return (~np.broadcast_to(each, (len(lost), len(self.sensors)))).ravel().astype(np.float64)

    def apart(self, stacked: Floats) -> Floats:
        """The inverse of :meth:`stacked`: shape (n, sensors, ...), in the units of the sensors."""
        values = stacked.reshape(len(stacked) // len(self.sensors), len(self.sensors), *stacked.shape[1:])
        return values / np.array(self.weights).reshape(-1, *[1] * (values.ndim - 2))

    def whitened(self, stacked: Floats, noise: Noise) -> Floats:
        """Stacked values filtered with the autoregressive coefficients of each sensor's noise, the same shape."""
        if not noise:
            return stacked
        values = stacked.reshape(len(stacked) // len(self.sensors), len(self.sensors), *stacked.shape[1:])
        parts = [whitened(values[:, i], own) for i, own in enumerate(noise)]
        return (parts[0] if len(parts) == 1 else np.stack(parts, axis=1)).reshape(stacked.shape)


def alone(motion: str) -> Outputs:
    """One motion of a single mass, or the force on it where its motion is prescribed."""
    return Outputs((Sensor(ALONE, motion),), (1.0,))


DISPLACEMENT = alone("displacement")
