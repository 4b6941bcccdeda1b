"""Whether two parts of a record are driven at the same frequencies: those of a sweep, or of dwells, are not."""

import numpy as np

from study.records.record import Record
from study.records.spectra import Segments, autospectrum

Span = tuple[int, int]
SEGMENTS = 8  # of each part, side by side, at least


def shared(record: Record, one: Span, other: Span) -> float:
    """The share of the force's power that two parts have at the same frequencies, from 0 to 1.

    The overlap of both autospectra, each over its own power: ``sum(min(G_1, G_2))`` (Weitzman, 1970). Stationary forces
    share nearly all, but for the scatter of their spectra; the halves of one sweep hardly anything.
    """
    force = record["force"]
    parts = [force[slice(*span)] - np.mean(force[slice(*span)]) for span in (one, other)]
    length = 2 ** int(np.log2(max(min(map(len, parts)) // SEGMENTS, 4)))
    densities = [autospectrum(part, record.dt, Segments(length))[1] for part in parts]
    if not all(float(np.sum(d)) > 0.0 for d in densities):
        return 1.0
    first, second = (d / np.sum(d) for d in densities)
    return float(np.sum(np.minimum(first, second)))


def differ(record: Record, one: Span, other: Span) -> bool:
    """Whether most of the power in two parts of a record lies at frequencies that the other has not."""
    return shared(record, one, other) < 0.5
