"""The energy that a component takes out of each cycle of a prescribed motion: the area of its loops."""

import itertools
from dataclasses import dataclass

import numpy as np

from study.compare.prediction import Prediction
from study.support.arrays import Floats

SMALL = 0.05  # of the largest stroke: a cycle of less is a rest


@dataclass(frozen=True)
class Loops:
    """Cycles of the judging part, from one upward crossing of the mean position to the next; shape (cycles,)."""

    stroke: Floats  # largest less smallest displacement
    measured: Floats  # energy, the integral of force over displacement, in force times displacement
    predicted: Floats  # the same of the predicted force


def loops(prediction: Prediction) -> Loops:
    """Cycles that lie within a stretch of the record, with the energy that each dissipates."""
    prepared, seen = prediction.prepared, prediction.of(0)
    part = prepared.record.part(*prepared.plan.judge)
    u, joints = part["displacement"], set(part.joints)
    above = u - np.mean(u) > 0.0
    crossings = np.flatnonzero(~above[:-1] & above[1:]) + 1
    largest, rows = float(np.ptp(u)), list[tuple[float, float, float]]()
    for first, last in itertools.pairwise(crossings):
        stroke = float(np.ptp(u[first : last + 1]))
        if stroke < SMALL * largest or any(first < joint <= last for joint in joints):
            continue
        cycle = slice(first, last + 1)
        measured, predicted = (_energy(f[cycle], u[cycle]) for f in (seen.measured, seen.predicted))
        rows.append((stroke, measured, predicted))
    return Loops(*np.array(rows).reshape(-1, 3).T)


def _energy(force: Floats, u: Floats) -> float:
    """Area by trapezoids, the loop closed by a straight line."""
    around = np.append(force, force[0]), np.append(u, u[0])
    return float(np.sum(0.5 * (around[0][1:] + around[0][:-1]) * np.diff(around[1])))
