"""Which coordinate's equation is violated, by how many newtons, and between which places the missing force acts.

``r = M a - (forces - forces of all terms)`` needs the motion. As for a single coordinate (``compare.missing_force``) it
is that of the free run plus the difference to the measured one in those bands where that stands above the noise: where
the difference is noise, r is zero. A missing force between two coordinates is in both equations, with opposite signs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from study.compare.force_map import ForceCurve, curve
from study.compare.noise import SIGNIFICANT
from study.compare.prediction import Prediction
from study.equations import kernels
from study.equations.coefficient_units import units_at
from study.equations.equations_of_motion import acceleration_program
from study.equations.linear_part import alignment, checked_mass_matrix, connections, transfer
from study.equations.model import Model, ModelTerm
from study.equations.place import Place
from study.identify.frequency_domain.inputs import input_history, placed_inputs
from study.records import noise_floor
from study.records.completion import derivative
from study.records.prepared import Prepared
from study.records.record import MOTIONS, Record, Sensor
from study.records.spectra import Segments, autospectrum
from study.support.arrays import Floats

CLEAR = 3.0  # standard errors by which the difference must stand above the noise, for a line to be used
SMOOTH = 5  # lines that are averaged
MARGIN = 16  # one part of so many at each end, which filters leave unsure


@dataclass(frozen=True, eq=False)
class MissingForces:
    """What the equation of each measured coordinate leaves on the judging part.

    Attributes
    ----------
    coordinates : tuple of str
        Those that are measured.
    lacking : tuple of str
        Those that no sensor shows.
    displacement, velocity : array, shape (samples, all coordinates)
        The motion, free of noise.
    residual : array, shape (samples, coordinates)
        Force that is left, or moment on a rotation.
    size : array, shape (coordinates,)
        Rms force of inertia, to compare it with.
    matrix : array, shape (coordinates, coordinates)
        Shares of the power of what is left that two equations hold with opposite signs; on the diagonal, of what acts
        from outside or the ground.
    aligned : tuple of (Place, float)
        Share of what is left of the motions that a single force at a place could make, the largest first: of all
        connections, neighbours and the ground. Unlike the matrix it needs no derivatives of noisy motions.
    curves : dict of str
        Force over relative displacement of each of these places by label: a restoring-force map.
    record : Record
        Which it is of, for its units.
    """

    coordinates: tuple[str, ...]
    lacking: tuple[str, ...]
    displacement: Floats
    velocity: Floats
    residual: Floats
    size: Floats
    matrix: Floats
    aligned: tuple[tuple[Place, float], ...]
    curves: dict[str, ForceCurve]
    record: Record

    def units(self, label: str) -> dict[str, str]:
        """Units of force and displacement of the map of a place, or of the equation of a coordinate."""
        place = next((p for p, _ in self.aligned if p.label == label), None) or Place("at", (label,))
        return dict(zip(("force", "displacement"), units_at(place, self.record), strict=True))

    @property
    def rms(self) -> Floats:
        """Rms force that is left, shape (coordinates,)."""
        return np.sqrt(np.mean(self.residual**2, axis=0))

    @property
    def share(self) -> float:
        """Power of what is left over that of the forces of inertia."""
        power = float(np.sum(self.size**2))
        return float(np.sum(self.rms**2)) / power if power > 0.0 else 0.0


def missing_forces(model: Model, prediction: Prediction) -> MissingForces:
    """What each equation of a fitted structure leaves on the judging part."""
    measured = [s.coordinate for s in prediction.prepared.sensors]
    motion = gated_motion(model, prediction)
    residual, inertia = unbalanced_forces(model, motion, prediction)
    rows = [model.coordinates.index(c) for c in measured]
    inner = slice(len(residual) // MARGIN, len(residual) - len(residual) // MARGIN)
    left, size = residual[inner][:, rows], np.std(inertia[inner][:, rows], axis=0)
    matrix = _shares(left)
    aligned = _aligned(model, prediction)
    known = [p for p, _ in aligned if set(p.moving) <= set(measured)]
    return MissingForces(
        tuple(measured), tuple(c for c in model.coordinates if c not in measured), motion[0][inner], motion[1][inner],
        left, size, matrix, aligned, _maps(known, measured, motion[0][inner][:, rows], left),
        prediction.prepared.record,
    )  # fmt: skip


def gated_motion(model: Model, prediction: Prediction) -> Floats:
    """Displacement, velocity and acceleration of all coordinates on the judging part, shape (3, samples, coordinates).

    The free run's, and of those that are measured, what stands above the noise of the difference besides.
    """
    prepared, coordinates = prediction.prepared, model.coordinates
    free = prediction.motions([Sensor(c, m) for m in MOTIONS for c in coordinates])
    return corrected_motion(free, prediction.misfit, prepared, coordinates, prepared.plan.judge)


def corrected_motion(
    free: Floats, difference: Floats, prepared: Prepared, coordinates: Sequence[str], span: tuple[int, int]
) -> Floats:
    """A free run's motions along a span, shape (samples, 3 coordinates), with what of the difference is no noise.

    Shape (3, samples, coordinates). Each stretch is differentiated by itself: at its end the difference jumps.
    """
    runs = [slice(begin - span[0], end - span[0]) for begin, end in prepared.record.runs(span)]
    motion = free.reshape(len(free), len(MOTIONS), -1).transpose(1, 0, 2).copy()
    for sensor, values in zip(prepared.sensors, difference.T, strict=True):
        band, level = band_above_noise(values, prepared.dt, prepared.band[0]), MOTIONS.index(sensor.motion)
        if band is None:
            continue
        for part in runs:
            seen = values[part] if prepared.record.stretches else in_band(values[part], prepared.dt, *band)
            for order in range(len(MOTIONS)):
                steps = order - level
                change = derivative(seen, prepared.dt, steps, prepared.band[0] if steps < 0 else 0.0)
                if prepared.record.stretches:  # each begins and ends with a step, which no filter may meet before
                    change = in_band(change, prepared.dt, *band)
                motion[order, part, coordinates.index(sensor.coordinate)] += change
    return motion


def _above_noise(values: Floats, dt: float, low: float) -> Floats:
    """Values in those bands where their density stands above that of white noise; none if noise alone would do."""
    found = band_above_noise(values, dt, low)
    return np.zeros_like(values) if found is None else in_band(values, dt, *found)


def band_above_noise(values: Floats, dt: float, low: float) -> tuple[Floats, Floats] | None:
    """Frequencies in hertz, and 1 at those where a density stands above that of white noise, 0 at others.

    None if noise alone would do.
    """
    floor = noise_floor.floor(values, dt, low)
    if floor.significance <= SIGNIFICANT:
        return None
    cut = Segments(length=max(32, min(1024, 2 ** int(np.log2(len(values) / 8)))))
    frequency, density = autospectrum(values, dt, cut)
    white = floor.noise**2 / (0.5 / dt - low)
    smooth = np.convolve(np.pad(density, SMOOTH // 2, mode="edge"), np.ones(SMOOTH) / SMOOTH, "valid")
    limit = white * (1.0 + CLEAR / np.sqrt(cut.effective_averages(len(values)) * SMOOTH / cut.line_inflation()))
    return frequency, ((smooth > limit) & (frequency >= low)).astype(np.float64)


def in_band(values: Floats, dt: float, frequency: Floats, gate: Floats) -> Floats:
    """Values, shape (n,), of which each frequency is kept to its share."""
    size = next_fast_len(2 * len(values), real=True)
    at = np.asarray(rfftfreq(size, dt), dtype=np.float64)
    weight = np.asarray(np.interp(at, frequency, gate), dtype=np.float64)
    lines = np.asarray(rfft(values, size), dtype=np.complex128)
    return np.asarray(irfft(lines * weight, size), dtype=np.float64)[: len(values)]


def unbalanced_forces(model: Model, motion: Floats, prediction: Prediction) -> tuple[Floats, Floats]:
    """What the equations leave along a motion, and the forces of inertia, each of shape (samples, coordinates)."""
    prepared = prediction.prepared
    part = slice(*prepared.plan.judge)
    record = prepared.record
    columns = {f"{x}:{c}": motion[order][:, i] for order, x in enumerate("uv") for i, c in enumerate(model.coordinates)}
    columns |= {f"drive:{name}": record[name][part] for name in (*dict(model.forces), *model.channels)}
    columns |= {f"z:{entry.name}": _state(entry, model, motion, prepared.dt) for entry in model.states}
    out = kernels.evaluate(acceleration_program(model), columns | {"t": record.time[part]}, len(motion[0]))
    mass = checked_mass_matrix(model)
    inertia = motion[2] @ mass.T
    return inertia - out @ mass.T, inertia


def _state(entry: ModelTerm, model: Model, motion: Floats, dt: float) -> Floats:
    """A term's own state along a motion, from rest."""
    item = next(i for i in placed_inputs(entry) if i.state is not None)
    return input_history(item, relative_record(entry.place, model, motion, dt))


def relative_record(place: Place, model: Model, motion: Floats, dt: float) -> Record:
    """Relative motion at a place as a record of a single coordinate; ``motion`` as :func:`corrected_motion` has it."""
    e = np.array(place.direction(model.coordinates))
    displacement, velocity = (np.asarray(x @ e, dtype=np.float64) for x in motion[:2])
    return Record(dt, {"force": np.zeros(len(displacement)), "displacement": displacement, "velocity": velocity})


def _shares(residual: Floats) -> Floats:
    power = residual.T @ residual
    total = float(np.trace(power))
    if total == 0.0:
        return np.zeros_like(power)
    between = np.maximum(-power, 0.0)
    np.fill_diagonal(between, 0.0)
    alone = np.maximum(np.diag(power) - np.sum(between, axis=1), 0.0)
    return (2.0 * between + np.diag(alone)) / total


def _aligned(model: Model, prediction: Prediction) -> tuple[tuple[Place, float], ...]:
    prepared = prediction.prepared
    seen = np.stack([_above_noise(x, prepared.dt, prepared.band[0]) for x in prediction.misfit.T], axis=1)
    if not np.any(seen):
        return ()
    size = next_fast_len(2 * len(seen), real=True)
    lines = np.asarray(rfft(seen / prediction.size, size, axis=0), dtype=np.complex128)
    paths = transfer(model, prepared.sensors, prepared.dt, size) / prediction.size[:, None]
    found = [(p, alignment(paths @ np.array(p.direction(model.coordinates)), lines)) for p in connections(model)]
    return tuple(sorted(found, key=lambda item: -item[1]))


def _maps(places: Sequence[Place], names: list[str], displacement: Floats, residual: Floats) -> dict[str, ForceCurve]:
    """Missing restoring force over relative displacement of each place, as the two equations that it is in have it."""
    found: dict[str, ForceCurve] = {}
    for place in places:
        e = np.array(place.direction(names))
        found[place.label] = curve(displacement @ e, -(residual @ e) / float(e @ e))
    return found
