"""Spikes: single samples of the residual that stand out of their neighbours as no motion does."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from study.faults.fault import SPIKES, Fault
from study.faults.leftover import FittedResidual
from study.identify.time_domain.part_fit import run_of
from study.records.outputs import alone
from study.support.arrays import Floats
from study.support.thresholds import ALPHA, TOLERANCE

NEIGHBOURS = 8  # samples on either side that tell how much a sample differs from its own two neighbours
ROUNDS = 4  # of looking again beside what was found: a spike hides a smaller one near it


def spikes(left: FittedResidual, asked: int) -> Fault | None:
    """Spikes on both parts of the record, None without any."""
    record, prepared = left.prepared.record, left.prepared
    lost = np.zeros(len(record), dtype=np.bool_)
    spans = left.fit.span, prepared.plan.judge
    for span, residual, reversed_ in zip(spans, left.residual, reversals(left), strict=True):
        known = (prepared.known(np.ones(len(residual)), span) > 0.0) & ~reversed_
        lost[slice(*span)] = isolated(residual, known, ALPHA / asked)
    if not np.any(lost):
        return None
    power = np.concatenate(left.residual) ** 2
    places = np.concatenate(left.samples).astype(np.int64)
    explained = float(np.sum(power[lost[places]]) / np.sum(power))
    if explained * float(np.mean(power)) <= (TOLERANCE * left.size) ** 2:
        return None
    count = float(np.mean(lost[places]))
    beside = lost | np.roll(lost, 1) | np.roll(lost, -1)  # another spike there could not be told from this one
    error = float(np.sqrt(count / len(places)))  # of a count: small ones cannot be told from noise
    return Fault(SPIKES, prepared.response, count, error, "1", explained, lost=beside)


def reversals(left: FittedResidual) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Samples beside which dry friction makes the acceleration jump, on both parts; none of another response.

    An error of the model moves such a jump past a sample, which then stands alone as a spike does.
    """
    jumps = any("sgn(v)" in c.shape for entry in left.fit.model.terms for c in entry.term.components)
    if left.prepared.response != "acceleration" or not jumps or left.prediction.run is None:
        return np.zeros(len(left.residual[0]), np.bool_), np.zeros(len(left.residual[1]), np.bool_)
    fitted = run_of(left.fit, left.prepared, sensors=alone("velocity").sensors).respond({}, left.fit.initial)[0][:, 0]
    return _turning(fitted), _turning(left.prediction.run.motion("velocity"))


def _turning(velocity: Floats) -> NDArray[np.bool_]:
    """Samples on either side of a change of sign, shape (n,)."""
    turns = np.diff(np.sign(velocity)) != 0.0
    return np.concatenate([turns, [False]]) | np.concatenate([[False], turns])


def isolated(residual: Floats, known: NDArray[np.bool_], level: float) -> NDArray[np.bool_]:
    """Samples that differ from the mean of their neighbours by more than chance, and stand alone with it, shape (n,).

    The bend ``r_i - (r_(i-1) + r_(i+1)) / 2`` of a sample is compared with the bends near it, and with those of the
    whole residual: Student's t for the number of these, all samples asked for. A spike bends its neighbours half as
    much the other way, a jump or a kink of a motion does not. Where most of what stands out does that, all of it counts
    as spikes, for two may be neighbours.
    """
    found = np.zeros(len(residual), dtype=np.bool_)
    if len(residual) < 4 * NEIGHBOURS:
        return found
    for _ in range(ROUNDS):
        usable = known & ~found
        whole = usable & np.roll(usable, 1) & np.roll(usable, -1)
        whole[[0, -1]] = False
        bend = np.where(whole, residual - 0.5 * (np.roll(residual, 1) + np.roll(residual, -1)), 0.0)
        spread, freedom = _spread(bend, whole)
        t = np.abs(bend) / spread
        peak = (t >= np.roll(t, 1)) & (t >= np.roll(t, -1)) & whole
        new = peak & (2.0 * stdtr(freedom, -t) * len(residual) < level)
        if not np.any(found) and 2 * np.count_nonzero(new & _single(bend)) <= np.count_nonzero(new):
            break
        if not np.any(new):
            break
        found |= new
    return found


def _single(bend: Floats) -> NDArray[np.bool_]:
    """Where both neighbours bend the other way, by half as much give or take the half of that, shape (n,)."""
    size = np.where(bend == 0.0, np.inf, bend)
    sides = [np.roll(bend, shift) / size for shift in (1, -1)]
    return np.all([(side > -0.75) & (side < -0.25) for side in sides], axis=0)


def _spread(bend: Floats, whole: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Standard deviation of the bends about each sample, the nearest two left out, and their number, shapes (n,)."""
    kernel = np.ones(2 * NEIGHBOURS + 1)
    kernel[NEIGHBOURS - 2 : NEIGHBOURS + 3] = 0.0
    middle = 1.4826 * float(np.median(np.abs(bend[whole]))) if np.any(whole) else 0.0
    near = np.clip(np.abs(bend), 0.0, 5.0 * middle) if middle > 0.0 else bend  # another spike nearby is no measure
    count = np.convolve(whole, kernel, "same")
    local = np.sqrt(np.convolve(near**2 * whole, kernel, "same") / np.maximum(count, 1.0))
    spread = np.maximum(np.maximum(local, middle), np.finfo(float).tiny)
    return spread, np.maximum(count, 2.0)
