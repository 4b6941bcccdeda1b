"""What a term at a place would explain, by the reverse system of all coordinates.

With the linear part Z of the fitted structure, its nonlinear forces N and the measured motion x, what the equations
leave is ``B F - Z x - N(x)``. Any force that is missing, and any change of a coefficient, is a known history times an
unknown amount, and linear least squares find the amounts, however much the model lacks. Everything is passed through
Z^-1 to the sensors first, where noise is what it was on the motion (the equations of a place and of its other end are
one regression: action equals reaction). The motion is that of the free run with what the sensors show above their
noise; where a sensor is missing it is the free run's. The best points start fits in free run.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import rfftfreq

from study.equations.linear_part import linear_keys, patterns
from study.equations.model import ModelTerm
from study.equations.place import Place
from study.equations.terms import LINEAR
from study.identify.frequency_domain.inputs import input_history, placed_inputs, relative_record
from study.identify.time_domain.part_fit import linearise
from study.records.completion import derivatives
from study.records.noise_floor import band_above_noise, in_band
from study.records.prepared import Prepared
from study.records.record import MOTIONS, Record
from study.records.spectra import StretchTransforms, stretch_transforms
from study.support import work
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares, length_or_one

if TYPE_CHECKING:
    from study.identify.time_domain.shape_search import Baseline, Start


@dataclass(frozen=True, eq=False)
class EquationsAlongMotion:
    """The equations of a fitted structure along its measured motion; n samples, s sensors, c coordinates."""

    base: "Baseline"
    motion: Floats  # displacement, velocity and acceleration of all coordinates, shape (3, n, c)
    transforms: StretchTransforms  # of the stretches of the fitting part
    paths: Complexes  # from a force on each coordinate to each sensor, on their lines; shape (lines, s, c)

    def record(self, place: Place, motion: Floats | None = None) -> Record:
        """Relative motion at a place, with the time at which it was and the channels that formulas may name."""
        fit, source = self.base.fit, self.base.prepared.record
        own = relative_record(place, fit.model, self.motion if motion is None else motion, source.dt)
        further = {name: source[name][slice(*fit.span)] for name in source.extra}
        return replace(own, channels={**own.channels, **further}, start=source.start + fit.first * source.dt)

    @cached_property
    def _omega(self) -> Complexes:
        """j times the angular frequency of each line."""
        dt = self.base.prepared.dt
        return np.asarray(2j * np.pi * rfftfreq(self.transforms.size, dt), dtype=np.complex128)

    def unit_forces(self, entry: ModelTerm, record: Record) -> list[Complexes]:
        """Lines of the force of each component with a unit coefficient along a motion."""
        by_symbol: dict[str, Complexes] = {}
        for item in placed_inputs(entry):
            values = self.transforms.lines(record["displacement"] if item.shape == "u" else input_history(item, record))
            for part in item.parts:
                by_symbol[part.symbol] = values * part.factor * self._omega**part.order
        return [by_symbol[symbol] for symbol in entry.term.symbols]

    def passed(self, place: Place, forces: Sequence[Complexes]) -> Floats:
        """What forces at a place, given by their lines, add to the sensors, shape (n s, forces)."""
        e = np.array(place.direction(self.base.fit.model.coordinates))
        return self.base.fit.outputs.stacked(self.transforms.passed(-(self.paths @ e), forces))

    @cached_property
    def columns(self) -> Floats:
        """What a unit of each key, and of the initial states, adds to the sensors, shape (n s, keys + states).

        That of initial states and of shape parameters is exact; of coefficients it is that along the measured motion.
        """
        fit, model = self.base.fit, self.base.fit.model
        columns = linearise(fit, self.base.prepared)
        own, orders = patterns(model), linear_keys(model)
        for key in orders:
            if key in fit.keys:
                force = self.transforms.lines(self.motion[orders[key]] @ own[key])
                motion = self.transforms.back(-np.einsum("fsc,kfc->kfs", self.paths, force))
                columns[:, fit.keys.index(key)] = fit.outputs.stacked(motion)
        for entry in model.terms:
            if set(entry.symbols) & set(fit.keys) and entry.symbols[0] not in orders:
                added = self.passed(entry.place, self.unit_forces(entry, self.record(entry.place)))
                for i, symbol in enumerate(entry.symbols):
                    if symbol in fit.keys:
                        columns[:, fit.keys.index(symbol)] = added[:, i]
        return columns

    @cached_property
    def basis(self) -> Floats:
        """Orthonormal basis of these."""
        return np.linalg.qr(self.columns / length_or_one(self.columns))[0]

    @cached_property
    def violated(self) -> Floats:
        """What the equations leave, passed to the sensors, shape (n s,).

        The residual, less what the nonlinear forces along the measured motion differ by from those along the free run.
        """
        model = self.base.fit.model
        total = np.zeros_like(self.base.fit.residual)
        for entry in model.terms:
            if entry.term.name not in LINEAR:
                there, here = (
                    self.passed(entry.place, self.unit_forces(entry, self.record(entry.place, motion)))
                    for motion in (self.motion, self.base.motion)
                )
                total += (there - here) @ np.array([c or 0.0 for c in entry.coefficients])
        return self.base.fit.residual - total

    @cached_property
    def unexplained(self) -> Floats:
        """The same less what the model's own coefficients could do, shape (n s,)."""
        return self.beside_own(self.violated)

    def beside_own(self, columns: Floats) -> Floats:
        """Columns, shape (n s, ...), less what the model's own coefficients could do."""
        return columns - self.basis @ (self.basis.T @ columns)

    @cached_property
    def operations(self) -> int:
        """Those that a point takes: its transforms, to the sensors and back, and what the model's own do of it."""
        size = self.transforms.size
        return int((1 + len(self.base.fit.outputs)) * size * np.log2(size)) + self.basis.size

    def point(self, entry: ModelTerm, parameters: tuple[float, ...], record: Record) -> "Start | None":
        """What an effect explains with these shape parameters along the motion at its place; None if it acts nowhere.

        That is what :meth:`record` has of the place, for all points the same.
        """
        from study.identify.time_domain.shape_search import explained_by

        work.add(self.operations)
        given = replace(entry, coefficients=(0.0,) * len(entry.symbols), parameters=parameters)
        try:
            forces = self.unit_forces(given, record)
        except StudyError:
            return None
        added = self.beside_own(self.passed(entry.place, forces))
        if not np.all(np.isfinite(added)) or not np.any(added):
            return None
        return explained_by(added, self.unexplained, parameters)

    def moved(self, entry: ModelTerm, point: "Start", cutoff: float) -> dict[str, float]:
        """Coefficients of the model beside so much of a term."""
        fit = self.base.fit
        known = replace(entry, coefficients=point.coefficients, parameters=point.parameters)
        forces = self.unit_forces(known, self.record(entry.place))
        force = np.sum([c * f for c, f in zip(point.coefficients, forces, strict=True)], axis=0)
        step = least_squares(self.columns, self.violated - self.passed(entry.place, [force])[:, 0], cutoff)
        return dict(zip(fit.keys, (fit.values + step[: len(fit.keys)]).tolist(), strict=True))


def equations_along_motion(base: "Baseline") -> EquationsAlongMotion:
    """The equations of the model that a search stands on, along the measured motion."""
    fit, prepared = base.fit, base.prepared
    free = base.motion.transpose(1, 0, 2).reshape(fit.samples, -1)
    motion = corrected_motion(free, fit.misfit, prepared, fit.model.coordinates, fit.span)
    transforms = stretch_transforms(prepared.record.runs(fit.span))  # of one stretch every other line is the record's
    return EquationsAlongMotion(base, motion, transforms, base.paths(transforms.size))


def corrected_motion(
    free: Floats, difference: Floats, prepared: Prepared, coordinates: Sequence[str], span: tuple[int, int]
) -> Floats:
    """A free run's motions along a span, shape (samples, 3 coordinates), with what of the difference is no noise.

    Shape (3, samples, coordinates). Each stretch is differentiated by itself: at its end the difference jumps.
    """
    runs = [slice(begin - span[0], end - span[0]) for begin, end in prepared.record.runs(span)]
    motion = free.reshape(len(free), len(MOTIONS), -1).transpose(1, 0, 2).copy()
    for sensor, values in zip(prepared.outputs.sensors, difference.T, strict=True):
        band, level = band_above_noise(values, prepared.dt, prepared.band[0]), MOTIONS.index(sensor.motion)
        if band is None:
            continue
        for part in runs:
            seen = values[part] if prepared.record.stretches else in_band(values[part], prepared.dt, *band)
            steps, low = [order - level for order in range(len(MOTIONS))], prepared.band[0]
            summed = derivatives(seen, prepared.dt, [s for s in steps if s < 0], low) if level else []
            for order, change in enumerate(summed + derivatives(seen, prepared.dt, [s for s in steps if s >= 0])):
                if prepared.record.stretches:  # each begins and ends with a step, which no filter may meet before
                    change = in_band(change, prepared.dt, *band)
                motion[order, part, coordinates.index(sensor.coordinate)] += change
    return motion
