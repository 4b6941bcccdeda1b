"""Do the coefficients move with the level of excitation? The right model's do not (the report's criterion)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from study.compare.fitted_coefficients import Coefficient

MOVES = 0.01  # of the p value, the number of coefficients accounted for
RESOLUTION = 1e-3  # of the coefficient: smaller differences are those of the numerical integration


@dataclass(frozen=True)
class Level:
    """One coefficient at several levels; one entry a record, in the order of the records."""

    key: str
    unit: str
    force: tuple[float, ...]  # rms force of the fitting part, in the record's unit
    value: tuple[float, ...]  # the estimates
    error: tuple[float, ...]  # their standard errors
    p_value: float  # probability of such differences if the coefficient is the same at all levels (chi-square)
    moves: bool  # whether that is significant, the number of coefficients accounted for, and above numerical errors
    change: float  # largest less smallest estimate, over the size of their weighted mean

    @property
    def chance(self) -> str:
        """The p value in words: one that is next to nothing is not written out."""
        return f"= {self.p_value:.2g}" if self.p_value > 1e-9 else "< 1e-09"


def across_levels(force: Sequence[float], records: Sequence[Sequence[Coefficient]]) -> tuple[Level, ...]:
    """Hold the estimates of several records against each other; what was held is left out.

    ``force`` is the rms force of each record's fitting part, ``records`` the same model's coefficients in each.
    """
    by_key = [c for c in zip(*records, strict=True) if not c[0].held]
    return tuple(_level(tuple(force), row, len(by_key)) for row in by_key)


def _level(force: tuple[float, ...], row: Sequence[Coefficient], tests: int) -> Level:
    value = np.array([c.value for c in row])
    error = np.array([c.error or 0.0 for c in row])
    weight = 1.0 / np.maximum(error, np.finfo(float).eps * np.max(np.abs(value))) ** 2
    mean = float(np.sum(weight * value) / np.sum(weight))
    p_value = float(chdtrc(len(row) - 1, np.sum(weight * (value - mean) ** 2)))
    change = float(np.ptp(value)) / abs(mean) if mean else 0.0
    return Level(
        row[0].key, row[0].unit, force, tuple(float(v) for v in value), tuple(float(e) for e in error),
        p_value, p_value < MOVES / tests and change > RESOLUTION, change,
    )  # fmt: skip
