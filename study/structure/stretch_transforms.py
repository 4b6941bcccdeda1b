"""Transforms of a part of a record, stretch by stretch: what happens in one leaves nothing in the next."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, rfft

from study.support.arrays import Complexes, Floats


@dataclass(frozen=True)
class StretchTransforms:
    """Of stretches of up to ``size`` samples, each with room for the response to die away.

    Attributes
    ----------
    runs : tuple of pairs of int
        First sample of each stretch, counted from the beginning of the part, and the one after its last.
    size : int
        Samples of a transform.
    """

    runs: tuple[tuple[int, int], ...]
    size: int

    def lines(self, values: Floats) -> Complexes:
        """Of values (samples, ...), shape (stretches, lines, ...)."""
        parts = [rfft(values[begin:end], self.size, axis=0) for begin, end in self.runs]
        return np.asarray(np.stack(parts), dtype=np.complex128)

    def back(self, lines: Complexes) -> Floats:
        """Values (samples, ...) with these lines."""
        parts: list[Floats] = []
        for x, (begin, end) in zip(lines, self.runs, strict=True):
            parts.append(np.asarray(irfft(x, self.size, axis=0), dtype=np.float64)[: end - begin])
        return np.concatenate(parts)

    def passed(self, path: Complexes, lines: Sequence[Complexes]) -> Floats:
        """What forces with these lines, each (stretches, lines), add to the sensors at the end of a path.

        ``path`` has shape (lines, sensors), the result (samples, sensors, forces).
        """
        return np.stack([self.back(path * force[:, :, None]) for force in lines], axis=2)


def stretch_transforms(runs: Sequence[tuple[int, int]]) -> StretchTransforms:
    """Of the stretches of a record that a part holds, in twice the samples of the longest."""
    first = runs[0][0]
    own = tuple((begin - first, end - first) for begin, end in runs)
    return StretchTransforms(own, 2 * max(end - begin for begin, end in own))
