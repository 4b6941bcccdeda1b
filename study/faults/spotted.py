"""Faults that a channel shows by itself, without a model: clipping, steps of the converter, drop-outs.

Measured values hardly ever repeat exactly. Where they do, the instrument says something: at the extremes that its range
has ended, in one place that nothing was read, everywhere that it counts in steps.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from study.faults.fault import CLIPPING, CONVERTER_STEPS, DROP_OUTS, Fault
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.statistics import SMALLEST_GAIN

REPEATED = 0.5  # of the samples of a channel: whose values recur so often comes in steps
RUN = 3  # samples in a row with the same value: a channel that counts in no steps has stood still
STANDING = 0.05  # of the samples: a channel that stands still longer is at rest, and has not dropped out


def spotted(prepared: Prepared, asked: Sequence[str]) -> tuple[Fault, ...]:
    """Those of the three that the measured response shows and that are asked for."""
    values, name = prepared.record[prepared.response], prepared.response
    unit = prepared.record.units.get(name, "")
    found: list[Fault] = []
    step = converter_step(values)
    if step is not None and CONVERTER_STEPS in asked:
        found.append(Fault(CONVERTER_STEPS, name, step, unit=unit))
    clipped = at_the_limits(values, step)
    if clipped is not None and CLIPPING in asked:
        found.append(Fault(CLIPPING, name, _limit(values, clipped), unit=unit, lost=clipped))
    gone = dropped_out(values, step, clipped)
    if gone is not None and DROP_OUTS in asked:
        found.append(Fault(DROP_OUTS, name, float(np.mean(gone)), unit="1", lost=gone))
    return tuple(found)


def converter_step(values: Floats) -> float | None:
    """Distance of neighbouring values of a channel whose values are few, None of others."""
    levels = np.unique(values)
    inner = np.diff(levels)
    if len(levels) > REPEATED * len(values) or len(levels) < 3:
        return None
    step = float(np.median(inner))
    counts = inner / step
    lattice = np.abs(counts - np.round(counts)) < 1e-3 * np.maximum(1.0, counts)
    if not np.all(lattice) or step / math.sqrt(12.0) < SMALLEST_GAIN * float(np.std(values)):
        return None
    return float(np.sum(inner) / np.sum(np.round(counts)))


def at_the_limits(values: Floats, step: float | None) -> NDArray[np.bool_] | None:
    """Samples at the largest or smallest value, where these recur in a row as values of a motion do not.

    A smooth motion in steps rests at an extreme for a while too: there a limit counts that is reached, in runs, more
    often than the value next to it.
    """
    limits = (float(np.min(values)), float(np.max(values)))
    masks = [values == limit for limit in limits]
    reached = [mask for mask, limit in zip(masks, limits, strict=True) if _recurs(values, mask, limit, step)]
    return np.any(reached, axis=0) if reached else None


def _recurs(values: Floats, mask: NDArray[np.bool_], limit: float, step: float | None) -> bool:
    count, runs = int(np.count_nonzero(mask)), _runs(mask)
    if _switches(values) or count < 4 or len(runs) < 2:
        return False
    if step is None:
        return True
    inward = limit + step if limit < float(np.mean(values)) else limit - step
    beside = int(np.count_nonzero(np.abs(values - inward) < 0.25 * step))
    return count > beside + 5.0 * math.sqrt(beside + count)


def _switches(values: Floats) -> bool:
    """Whether a channel has three values or fewer, as one that switches."""
    return len(np.unique(values[: 4096])) <= 3


def dropped_out(values: Floats, step: float | None, clipped: NDArray[np.bool_] | None) -> NDArray[np.bool_] | None:
    """Samples in runs of one value, of a channel that counts in no steps and is not clipped there."""
    if step is not None:
        return None
    same = np.diff(values) == 0.0
    mask = np.zeros(len(values), dtype=np.bool_)
    for first, last in _runs(same):
        if last - first + 1 >= RUN:
            mask[first : last + 1] = True
    if clipped is not None:
        mask &= ~clipped
    share = float(np.mean(mask))
    return mask if 0.0 < share < STANDING else None


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First sample and the one after the last of each run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _limit(values: Floats, clipped: NDArray[np.bool_]) -> float:
    """Half the range of a channel clipped on both sides, or the one limit."""
    shown = np.unique(values[clipped])
    return float(0.5 * (shown[-1] - shown[0])) if len(shown) > 1 else abs(float(shown[0]))
