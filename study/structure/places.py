"""Where an effect may sit: the connections of a model, neighbours, and the ground; and how a force there shows."""

from collections.abc import Sequence

import numpy as np
from scipy.fft import rfftfreq

from study.equations.model import Model
from study.equations.place import GROUND, Place
from study.records.record import MOTIONS, Sensor
from study.support.arrays import Complexes, Floats


def connections(model: Model) -> tuple[Place, ...]:
    """Every pair where an effect may be missing: between the ground and each coordinate, and between neighbours.

    Neighbours are what a term of the model ties together. Two coordinates that inertia couples are motions of one body,
    as heave and pitch: nothing lies between them.
    """
    found: dict[frozenset[str], Place] = {}
    for entry in model.terms:
        if entry.place.kind == "between":
            found.setdefault(entry.place.path, entry.place)
    for name in model.coordinates:
        found.setdefault(frozenset((GROUND, name)), Place("between", (GROUND, name)))
    return tuple(found.values())


def transfer(linear: Floats, sensors: Sequence[Sensor], coordinates: Sequence[str], dt: float, size: int) -> Complexes:
    """From a force on each coordinate to each sensor, shape (lines, sensors, coordinates).

    ``linear`` holds stiffness, damping and mass matrix; the lines are those of a transform of ``size`` samples.
    """
    omega = np.asarray(2j * np.pi * rfftfreq(size, dt), dtype=np.complex128)
    omega[0] = omega[1]  # a structure that nothing ties down has no response to a constant
    stiffness, damping, mass = linear
    dynamic = mass * omega[:, None, None] ** 2 + damping * omega[:, None, None] + stiffness
    inverse = np.asarray(np.linalg.inv(dynamic), dtype=np.complex128)
    rows = [list(coordinates).index(s.coordinate) for s in sensors]
    order = np.stack([omega ** MOTIONS.index(s.motion) for s in sensors], axis=1)
    return np.asarray(inverse[:, rows] * order[:, :, None], dtype=np.complex128)


def alignment(paths: Complexes, residual: Complexes) -> float:
    """Share of the residuals' power, shape (lines, sensors), that a single force along ``paths`` could make.

    Any force: one number a line. With a single sensor every place explains all.
    """
    power = np.sum(np.abs(paths) ** 2, axis=1)
    along = np.abs(np.sum(paths.conj() * residual, axis=1)) ** 2 / np.where(power > 0.0, power, np.inf)
    total = float(np.sum(np.abs(residual) ** 2))
    return float(np.sum(along)) / total if total > 0.0 else 0.0
