"""A linear part that is a sum of modes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from study.support.arrays import Floats


@dataclass(frozen=True)
class ModalPart:
    """So many modes, felt and driven at the coordinates of a model; modes count from 1.

    ``q'' + G q' + W q = p`` and ``u = phi^T q``: any structure with symmetric mass, damping and stiffness matrices, of
    which some modes are kept. W is diagonal, the squares of the natural frequencies; G is the symmetric matrix of modal
    damping. By reciprocity a mode is felt and driven at a point alike: a sensor where a force acts makes the
    coefficients of the terms known in newtons.
    """

    points: tuple[str, ...]  # the coordinates
    count: int = 0  # of modes; zero until a record has been asked how many it shows
    numbers: tuple[float | None, ...] = ()  # in the order of ``keys``; None where one is to be fitted

    def of(self, count: int) -> "ModalPart":
        """So many modes at the same points, of which nothing is known yet."""
        part = replace(self, count=count)
        return replace(part, numbers=(None,) * len(part.keys))

    @property
    def stiffness(self) -> tuple[str, ...]:
        """Keys of the squares of the natural angular frequencies, ``w2[1]``."""
        return tuple(f"w2[{r}]" for r in range(1, self.count + 1))

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Rows and columns of the damping matrix, counted from zero."""
        return tuple((r, s) for r in range(self.count) for s in range(r, self.count))

    @property
    def damping(self) -> tuple[str, ...]:
        """Keys of the elements of the modal damping matrix, ``g[1,2]``."""
        return tuple(f"g[{r + 1},{s + 1}]" for r, s in self.pairs)

    @property
    def coupling(self) -> tuple[str, ...]:
        """Those off its diagonal."""
        return tuple(key for (r, s), key in zip(self.pairs, self.damping, strict=True) if r != s)

    def shape(self, point: str) -> tuple[str, ...]:
        """Keys of the amplitudes of the modes at a point, ``phi[tip,1]``."""
        return tuple(f"phi[{point},{r}]" for r in range(1, self.count + 1))

    @property
    def keys(self) -> tuple[str, ...]:
        """Every key."""
        return (*self.stiffness, *self.damping, *(key for point in self.points for key in self.shape(point)))

    @property
    def values(self) -> dict[str, float | None]:
        """Every number by key."""
        return dict(zip(self.keys, self.numbers, strict=True))

    def rates(self, values: Mapping[str, float]) -> Floats:
        """Of each mode by itself (:func:`rates_of`), some of its numbers replaced by given values."""
        known = {**self.values, **values}
        keys = self.stiffness, [f"g[{r},{r}]" for r in range(1, self.count + 1)]
        w2, g = (np.array([known[key] for key in own], dtype=np.float64) for own in keys)
        return rates_of(w2, g)

    def with_values(self, values: Mapping[str, float | None]) -> "ModalPart":
        """The same modes with those of the given values that are their own."""
        return replace(self, numbers=tuple(values.get(key, old) for key, old in self.values.items()))


def rates_of(w2: Floats, g: Floats) -> Floats:
    """Rates in rad/s at which modes oscillate, or the faster ones at which they decay beyond critical damping."""
    half = 0.5 * np.abs(g)
    return np.abs(half + np.sqrt((half**2 - w2).astype(np.complex128)))
