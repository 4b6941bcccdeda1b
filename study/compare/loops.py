"""The energy that a component takes out of each cycle of a prescribed motion: the area of its loops."""

import itertools
from dataclasses import dataclass

import numpy as np

from study.compare.comparison import Comparison
from study.equations.model import Model
from study.equations.place import GROUND, Place
from study.support.arrays import Floats


@dataclass(frozen=True)
class Loops:
    """Force along motion on the judging part, n samples, and its cycles, from one upward crossing of the mean on."""

    stroke: Floats  # largest less smallest displacement of each cycle, shape (cycles,)
    measured: Floats  # energy, the integral of force over displacement, in force times displacement; shape (cycles,)
    predicted: Floats  # the same of the predicted force
    displacement: Floats  # along which the force does its work, shape (n,)
    velocity: Floats
    across: str  # whose motion that is: ``left − right``; empty where there is one alone


def loops(comparison: Comparison, sensor: int = 0) -> Loops:
    """Cycles that lie within a stretch of the record, with the energy that each dissipates.

    A force does its work along the motion of its coordinate: relative to the other where that is the only one that it
    is tied to.
    """
    seen, model = comparison.prediction.of(sensor), comparison.fit.model
    part = comparison.record.part(*comparison.plan.judge)
    place = stroke_of(model, seen.sensor.coordinate)
    weights = zip(model.coordinates, place.direction(model.coordinates), strict=True)
    u, v = sum((weight * part.motion(c)[:2] for c, weight in weights if weight != 0.0), np.zeros((2, len(part))))
    joints, above = set(part.joints), u - np.mean(u) > 0.0
    crossings = np.flatnonzero(~above[:-1] & above[1:]) + 1
    largest, rows = float(np.ptp(u)), list[tuple[float, float, float]]()
    for first, last in itertools.pairwise(crossings):
        stroke = float(np.ptp(u[first : last + 1]))
        # a cycle of a twentieth of the largest stroke is a rest
        if stroke < 0.05 * largest or any(first < joint <= last for joint in joints):
            continue
        cycle = slice(first, last + 1)
        measured, predicted = (_energy(f[cycle], u[cycle]) for f in (seen.measured, seen.predicted))
        rows.append((stroke, measured, predicted))
    strokes, *energies = np.array(rows).reshape(-1, 3).T
    return Loops(strokes, energies[0], energies[1], u, v, along_what(place))


def stroke_of(model: Model, coordinate: str) -> Place:
    """Along what the force on a coordinate does its work."""
    tied = {entry.place.path for entry in model.terms if coordinate in entry.place.ends}
    (other,) = tied.pop() - {coordinate} if len(tied) == 1 else (GROUND,)
    return Place("at", (coordinate,)) if other == GROUND else Place("between", (other, coordinate))


def along_what(place: Place) -> str:
    """Whose motion that is in short, ``left − right``; empty of a component with one motion."""
    return " − ".join(reversed(place.moving))


def _energy(force: Floats, u: Floats) -> float:
    """Area by trapezoids, the loop closed by a straight line."""
    around = np.append(force, force[0]), np.append(u, u[0])
    return float(np.sum(0.5 * (around[0][1:] + around[0][:-1]) * np.diff(around[1])))
