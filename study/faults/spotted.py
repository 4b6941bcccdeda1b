"""Faults that a channel shows by itself, by values that recur: clipping, steps of the converter, drop-outs.

Measured values hardly ever repeat exactly. Where they do, the instrument says something: at the extremes that its range
has ended, in one place that nothing was read, everywhere that it counts in steps.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import fdtrc

from study.faults.fault import CLIPPING, CONVERTER_STEPS, DROP_OUTS, Fault
from study.faults.leftover import SensorResidual
from study.records.plan import moving
from study.records.prepared import Prepared
from study.support.arrays import Bools, Floats, Ints
from study.support.thresholds import ALPHA, TOLERANCE

REPEATED = 0.5  # of the samples of a channel: whose values recur so often comes in steps
MARGIN = 2.0  # standard deviations of the noise from a limit, within which a sample may have been clipped
RUN = 3  # samples in a row with the same value: a channel that counts in no steps has stood still
STANDING = 0.05  # of the samples: a channel that stands still longer is at rest, and has not dropped out


def spotted(prepared: Prepared, name: str, asked: Sequence[str]) -> tuple[Fault, ...]:
    """Clipping and steps of the converter, where a measured response shows them and they are asked for."""
    values, unit = prepared.record[name], prepared.record.units.get(name, "")
    found: list[Fault] = []
    step = converter_step(values)
    if step is not None and CONVERTER_STEPS in asked:
        found.append(Fault(CONVERTER_STEPS, name, step, unit=unit))
    clipped = at_the_limits(values, step)
    if clipped is not None and CLIPPING in asked:
        shown = np.unique(values[clipped])  # of a channel clipped on both sides the value is half its range
        limit = float(0.5 * (shown[-1] - shown[0])) if len(shown) > 1 else abs(float(shown[0]))
        found.append(Fault(CLIPPING, name, limit, unit=unit, lost=clipped))
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
    if not np.all(lattice) or step / math.sqrt(12.0) < TOLERANCE * float(np.std(values)):
        return None
    return float(np.sum(inner) / np.sum(np.round(counts)))


def at_the_limits(values: Floats, step: float | None) -> Bools | None:
    """Samples at the largest or smallest value, where these recur in a row as values of a motion do not.

    A smooth motion in steps rests at an extreme for a while too: there a limit counts that is reached, in runs, more
    often than the value next to it.
    """
    limits = (float(np.min(values)), float(np.max(values)))
    masks = [values == limit for limit in limits]
    reached = [mask for mask, limit in zip(masks, limits, strict=True) if _recurs(values, mask, limit, step)]
    return np.any(reached, axis=0) if reached else None


def _recurs(values: Floats, mask: Bools, limit: float, step: float | None) -> bool:
    count, runs = int(np.count_nonzero(mask)), _runs(mask)
    if len(np.unique(values[:4096])) <= 3 or count < 4 or len(runs) < 2:  # with so few values it switches
        return False
    apart = np.diff([first for first, _ in runs])
    if count == len(runs) and int(np.gcd.reduce(apart)) == int(np.min(apart)):
        return False  # at multiples of one time, as the one largest value of a repeated motion is
    if step is None:
        return True
    inward = limit + step if limit < float(np.mean(values)) else limit - step
    beside = int(np.count_nonzero(np.abs(values - inward) < 0.25 * step))
    return count > beside + 5.0 * math.sqrt(beside + count)


def drop_outs(left: SensorResidual, asked: int) -> Fault | None:
    """Samples in runs of one value, which noise does not repeat; None without any.

    A system at rest, as one that friction holds, stands still too. Without noise a run counts where the model says that
    the motion went on, by the F test of what is left there against what is left elsewhere, each run a single number. Of
    a channel that counts in steps nothing can be said.
    """
    values = left.prepared.record[left.channel]
    if converter_step(values) is not None:
        return None
    places = np.concatenate(left.samples)
    used = np.zeros(len(values), dtype=bool)
    used[places] = True
    begun, over = moving(values)
    used[: begun + 1], used[over:] = False, False  # at rest before or behind
    mask, runs = _standing(values)
    mask &= used
    power = left.both**2
    if not 0.0 < float(np.mean(mask[places])) < STANDING:
        return None
    noisy = _noise(left.both) > TOLERANCE * left.size
    if left.sensor.motion != "displacement" and not np.any(values[mask]):  # what a system that friction holds shows
        mask = _moving(mask, places, power, ALPHA / (asked * runs), noisy)
    there = mask[places]
    if not np.any(there):
        return None
    elsewhere = float(np.mean(power[~there]))
    ratio = np.mean(power[there]) / elsewhere if elsewhere > 0.0 else np.inf
    if not noisy and float(fdtrc(runs, len(power), ratio)) * asked >= ALPHA:
        return None
    explained = float(np.sum(power[there]) / np.sum(power))
    return Fault(DROP_OUTS, left.channel, float(np.mean(there)), unit="1", explained=explained, lost=mask)


def _moving(mask: Bools, places: Ints, power: Floats, level: float, noisy: bool) -> Bools:
    """The runs of a mask in which more is left than elsewhere, by the F test of each as a single number, shape (n,).

    All of them, if there is any, where noise lies on the channel: what is at rest under noise does not stand still. The
    samples at both ends of a run do not count: friction may catch a mass, or let it go, on either side of them.
    """
    left = np.full(len(mask), np.nan)
    left[places] = power
    elsewhere = max(float(np.nanmean(left[~mask])), np.finfo(float).tiny)
    runs = _runs(mask & ~np.isnan(left))
    inside = [np.mean(left[first + 1 : last - 1] if last - first > 2 else left[first:last]) for first, last in runs]
    sure = [float(fdtrc(1, len(power), power_inside / elsewhere)) < level for power_inside in inside]
    kept = np.zeros_like(mask)
    for (first, last), lost in zip(runs, sure, strict=True):
        kept[first:last] = lost or (noisy and any(sure))
    return kept


def _standing(values: Floats) -> tuple[Bools, int]:
    """Samples in runs of ``RUN`` or more of the same value, away from the extremes, and the number of runs."""
    mask, count = np.zeros(len(values), dtype=bool), 0
    limits = float(np.min(values)), float(np.max(values))
    for first, last in _runs(np.diff(values) == 0.0):
        if last - first + 1 >= RUN and values[first] not in limits:
            mask[first : last + 1] = True
            count += 1
    return mask, count


def widened(fault: Fault, given: Prepared, left: SensorResidual) -> Fault:
    """Clipping with all samples lost whose true motion may be beyond the limit, as the free run tells.

    Noise decides whether a sample near the limit is clipped. If those that are not were kept, their noise would not
    have zero mean, and the coefficients a bias. What was read far from the limit was not clipped, wherever the free run
    of a model that lacks something goes.
    """
    values = given.record[left.channel]
    clipped = at_the_limits(values, converter_step(values))
    if clipped is None:
        return fault
    lost = clipped.copy()
    # Either is the noise and more: what is left by edges of what is lost, and the measured motion by its own bends.
    margin = MARGIN * min(_noise(left.both), _noise(values))
    for limit in np.unique(values[clipped]).tolist():
        sign = 1.0 if limit > float(np.mean(values)) else -1.0
        for span, predicted in zip(left.whole.spans, left.predicted, strict=True):
            near = sign * (values[slice(*span)] - limit) > -3.0 * margin
            lost[slice(*span)] |= near & (sign * (predicted - limit) > -margin)
    return replace(fault, lost=lost)


def _noise(residual: Floats) -> float:
    """Standard deviation of white noise in a residual that may hold a smooth motion too, from its sixth differences."""
    bend = np.diff(residual, 6)
    bend = bend[bend != 0.0]  # where samples are lost
    return 1.4826 * float(np.median(np.abs(bend))) / math.sqrt(924.0) if len(bend) else 0.0


def _runs(mask: Bools) -> list[tuple[int, int]]:
    """First sample and the one after the last of each run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
