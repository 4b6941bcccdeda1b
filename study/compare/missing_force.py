"""The force that a model lacks, along the record, robust against noise: by equation of motion, and by place.

``r = F - M a - (forces of all terms)`` needs the motion and its derivatives. Those of the measured response
would be swamped by noise; those of the free run know nothing of what is missing. The motion used here
is the free run plus the difference to the measured response in those bands where that stands above the
noise: where the difference is noise, r is zero; where it is not, r is the missing force. (A Wiener filter
instead of a gate leaves a part of the missing motion out everywhere, which flattens powers: a cubic
damping then shows a power of 2.6 at 1 % noise, with the gate 2.8.)

A single mass has one equation, and one place where a force may be missing. In a structure a force that is missing
between two coordinates is in both equations, with opposite signs. Modes have no equation of motion of a coordinate:
there the missing force of a place is what makes, through them, most of what the sensors show beyond the model.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from study.compare.force_map import ForceCurve, curve
from study.compare.noise import Noise
from study.compare.prediction import Prediction
from study.equations import kernels
from study.equations.coefficient_units import units_at
from study.equations.equations_of_motion import acceleration_program
from study.equations.linear_part import alignment, connections, matrices, transfer
from study.equations.model import Model, named_channels
from study.equations.place import HERE, Place
from study.identify.frequency_domain.coefficient_spectra import driven_lines
from study.identify.frequency_domain.inputs import input_history, placed_inputs
from study.identify.frequency_domain.modal_lines import unit_forces
from study.identify.frequency_domain.starting_values import oscillator
from study.identify.time_domain.told_alone import is_alone, prepared_alone
from study.records.completion import UNCERTAIN_PERIODS, derivative
from study.records.noise_floor import AVERAGED, CLEAR
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Record, Sensor
from study.records.spectra import Segments
from study.support.arrays import Bools, Complexes, Floats
from study.support.errors import DivergenceError

LEAST_DAMPING = 0.02  # of critical, in the weight that a line has


@dataclass(frozen=True)
class MissingForce:
    """The force that is missing at one place on the judging part; n samples."""

    displacement: Floats  # relative motion of the place, free of noise; shape (n,)
    velocity: Floats  # the same
    force: Floats  # measured force less inertia and all forces of the model, in the unit of force; shape (n,)
    free: Floats  # its derivatives by each fitted coefficient: what a refit could take over; shape (n, p)
    gate: Bools  # lines of ``frequency`` on which the difference stands above the noise; shape (lines,)
    weight: Floats  # response of the best linear oscillator to a unit force: noise is white behind it; shape (lines,)
    frequency: Floats  # in hertz; shape (lines,)
    noise: float  # mean square of the noise that is left in :meth:`weighted` ``force``
    dt: float  # sampling interval in seconds
    edge: int  # samples at each end which filters and integrals leave unsure

    @property
    def inner(self) -> slice:
        """The samples that filters and integrals leave sure."""
        return slice(self.edge, len(self.force) - self.edge)

    @property
    def known(self) -> tuple[Floats, Floats, Floats]:
        """Displacement, velocity and missing force on these samples."""
        return self.displacement[self.inner], self.velocity[self.inner], self.force[self.inner]

    def weighted(self, force: Floats) -> Floats:
        """A force as it shows in the response, in the bands that stand above the noise, shape (n,)."""
        return _filtered(force, self.dt, self.frequency, self.weight * self.gate)


@dataclass(frozen=True, eq=False)
class Unbalanced:
    """What the equations of motion leave on the judging part; n samples, s sensors, each with an equation, p keys."""

    model: Model  # the fitted one
    record: Record  # which it is of, for its units
    coordinates: tuple[str, ...]  # that are measured
    motion: Floats  # displacement, velocity and acceleration of all coordinates, free of noise; (3, n, coordinates)
    force: Floats  # measured forces less inertia and all forces of the model; shape (n, s)
    free: Floats  # its derivatives by each fitted coefficient; shape (n, s, p)
    inertia: Floats  # rms force of inertia, to compare with; shape (s,)
    gates: Bools  # lines on which each difference stands above its noise; shape (lines, s)
    stiffness: Complexes  # force in each equation for a unit of what each sensor shows; shape (lines, s, s)
    frequency: Floats  # in hertz; shape (lines,)
    noise: Floats  # mean square of each sensor's noise that the gate lets through; shape (s,)
    aligned: tuple[tuple[Place, float], ...]  # share of what is left of the motions that a single force could make
    dt: float  # sampling interval in seconds
    edge: int  # samples at each end which filters and integrals leave unsure

    @property
    def equations(self) -> tuple[str, ...]:
        """Coordinates whose equations of motion these are; none where the linear part is a sum of modes."""
        return () if self.model.modal else self.coordinates

    @property
    def inner(self) -> slice:
        """The samples that filters and integrals leave sure."""
        return slice(self.edge, len(self.force) - self.edge)

    @property
    def lacking(self) -> tuple[str, ...]:
        """Coordinates that no sensor shows."""
        return tuple(c for c in self.model.coordinates if c not in self.coordinates)

    @property
    def rms(self) -> Floats:
        """Rms force that is left, shape (s,)."""
        return np.sqrt(np.mean(self.force[self.inner] ** 2, axis=0))

    @property
    def share(self) -> float:
        """Power of what is left over that of the forces of inertia; not a number where there is no equation."""
        if not self.equations:
            return math.nan
        power = float(np.sum(self.inertia**2))
        return float(np.sum(self.rms**2)) / power if power > 0.0 else 0.0

    @property
    def matrix(self) -> Floats:
        """Shares of the power of what is left that two equations hold with opposite signs, shape (s, s).

        On the diagonal, of what acts from outside or the ground.
        """
        left = self.force[self.inner]
        power = left.T @ left
        total = float(np.trace(power))
        if total == 0.0:
            return np.zeros_like(power)
        between = np.maximum(-power, 0.0)
        np.fill_diagonal(between, 0.0)
        alone = np.maximum(np.diag(power) - np.sum(between, axis=1), 0.0)
        return (2.0 * between + np.diag(alone)) / total

    @property
    def shown(self) -> tuple[Place, ...]:
        """Places whose coordinates are all measured, that which could make most of what is left first."""
        known = self.model.coordinates if self.model.prescribed else self.coordinates
        return tuple(p for p, _ in self.aligned if set(p.moving) <= set(known))

    @cached_property
    def curves(self) -> dict[str, ForceCurve]:
        """Missing force over relative displacement of each of these by its label: a restoring-force map."""
        found = ((place, self.at(place)) for place in self.shown)
        return {place.label: curve(f.displacement[f.inner], f.force[f.inner]) for place, f in found}

    def units(self, label: str) -> dict[str, str]:
        """Units of force and displacement of the map of a place, or of the equation of a coordinate."""
        place = next((p for p, _ in self.aligned if p.label == label), None) or Place("at", (label,))
        return dict(zip(("force", "displacement"), units_at(place, self.record), strict=True))

    def at(self, place: Place) -> MissingForce:
        """The force that is missing at a place, as the equations that it is in have it."""
        everywhere, e = (np.array(place.direction(c)) for c in (self.model.coordinates, self.coordinates))
        size = float(e @ e)
        u, v = (x @ everywhere for x in self.motion[:2])
        ends = np.flatnonzero(e)
        largest = float(np.max(self.noise[ends]))
        noise = self.noise / largest if largest > 0.0 else np.ones(len(e))
        paths = np.abs(np.einsum("i,fis->fs", e, self.stiffness)) / size
        power = np.sqrt(np.sum(noise * paths**2, axis=1))
        return MissingForce(
            displacement=u, velocity=v, force=self.force @ e / size, free=np.einsum("nip,i->np", self.free, e) / size,
            gate=np.any(self.gates[:, ends], axis=1), weight=1.0 / np.maximum(power, np.finfo(float).tiny),
            frequency=self.frequency, noise=largest, dt=self.dt, edge=self.edge,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class BesideModes(Unbalanced):
    """The same of a modal linear part: no equation, but what the sensors show beyond the model.

    The force f of a term that is missing along e takes ``H e f`` from what they show, with H the paths of the linear
    part: so f follows at each line by least squares over the sensors, each in shares of its size.
    """

    sensors: tuple[Sensor, ...]
    lacking_motion: Floats  # what they show less than the model, over the size of each; shape (n, s)
    slopes: Floats  # its derivatives by each fitted coefficient; shape (n, s, p)
    size: Floats  # rms of each sensor's motion; shape (s,)

    def at(self, place: Place) -> MissingForce:
        """The force that is missing at a place, as all sensors together have it."""
        e, n = np.array(place.direction(self.model.coordinates)), len(self.lacking_motion)
        both = np.concatenate([self.lacking_motion[:, :, None], self.slopes], axis=2)
        longer, edge = _continued(both, self.frequency, self.dt)
        size, gate = next_fast_len(len(longer), real=True), np.any(self.gates, axis=1)
        lines = np.asarray(rfft(longer, size, axis=0), dtype=np.complex128)
        at = np.asarray(rfftfreq(size, self.dt), dtype=np.float64)
        sure = np.asarray(np.interp(at, self.frequency, gate.astype(np.float64)), dtype=np.float64)
        found = _history(np.einsum("f,fs,fsp->fp", sure, self._inverse(e, size), lines), size)[edge : edge + n]
        largest = float(np.max(self.noise))
        noise = self.noise / largest if largest > 0.0 else np.ones(len(self.size))
        inverse = np.abs(self._inverse(e, 2 * (len(self.frequency) - 1))) / self.size
        power = np.sqrt(np.sum(noise * inverse**2, axis=1))
        u, v = (x @ e for x in self.motion[:2])
        return MissingForce(
            displacement=u, velocity=v, force=found[:, 0], free=found[:, 1:], gate=gate,
            weight=1.0 / np.maximum(power, np.finfo(float).tiny), frequency=self.frequency, noise=largest, dt=self.dt,
            edge=self.edge,
        )  # fmt: skip

    def _inverse(self, e: Floats, size: int) -> Complexes:
        """Force along e for what each sensor shows over its size, shape (lines, s), on lines of ``size`` samples."""
        paths = transfer(self.model, self.sensors, self.dt, size) @ e / self.size
        return paths.conj() / np.maximum(np.sum(np.abs(paths) ** 2, axis=1), np.finfo(float).tiny)[:, None]


def missing_force(model: Model, keys: Sequence[str], prediction: Prediction) -> MissingForce:
    """The missing force of a single mass; see :func:`unbalanced`."""
    return unbalanced(model, keys, prediction).at(HERE)


def unbalanced(model: Model, keys: Sequence[str], prediction: Prediction) -> Unbalanced:
    """What each equation leaves. Every value of the model is known; ``keys`` are what was fitted of it.

    Raises
    ------
    StudyError
        If the model is incomplete, or names a channel that the record lacks.
    """
    if prediction.prepared.response == FORCE:
        return _along_a_known_motion(model, keys, prediction)
    prepared, noises = prediction.prepared, [view.noise for view in prediction.views]
    frequency, low = noises[0].frequency, prepared.band[0]
    gates = np.stack([lines_above_noise(noise, low) for noise in noises], axis=1)
    if model.modal:
        return _beside_modes(model, keys, prediction, gates)
    motion = _motion(model, prediction, gates, frequency)
    forces, inertia = _forces(model, keys, motion, prepared.record.part(*prepared.plan.judge))
    rows = [model.coordinates.index(c) for c in prepared.coordinates]
    forces, inertia, stiffness = forces[:, rows], inertia[:, rows], _stiffness(model, prepared, frequency)[:, rows]
    width = float(frequency[1])
    edge = _edge(prediction, width)
    noise = [float(np.sum(n.density[gate]) * width) for n, gate in zip(noises, gates.T, strict=True)]
    return Unbalanced(
        model, prepared.record, prepared.coordinates, motion, forces[:, :, 0], forces[:, :, 1:],
        np.std(inertia[edge : len(inertia) - edge], axis=0), gates, stiffness, frequency, np.array(noise),
        _aligned(model, prediction, gates, frequency), prediction.dt, edge,
    )  # fmt: skip


def _along_a_known_motion(model: Model, keys: Sequence[str], prediction: Prediction) -> Unbalanced:
    """The same where the motion is prescribed: what is left of the measured force, at all frequencies."""
    prepared, run, noises = prediction.prepared, prediction.run, [view.noise for view in prediction.views]
    part, sensors = prepared.record.part(*prepared.plan.judge), len(noises)
    free = np.zeros((len(part), sensors, len(keys)))
    if run is not None:
        free = prepared.outputs.apart(run.derivatives(run.fit)[:, : len(keys)])
    lines = np.broadcast_to(np.eye(sensors, dtype=np.complex128), (len(noises[0].frequency), sensors, sensors))
    left = (prediction.misfit / np.where(prediction.size > 0.0, prediction.size, 1.0)).astype(np.complex128)
    seen = {p: np.array(p.direction(prepared.coordinates), dtype=np.complex128) for p in connections(model)}
    shares = [(p, alignment(e[None], left)) for p, e in seen.items() if np.any(e)]
    return Unbalanced(
        model, prepared.record, prepared.coordinates, np.stack([part.motion(c) for c in model.coordinates], axis=2),
        prediction.misfit, free, prediction.size, np.ones((len(lines), sensors), dtype=np.bool_), lines,
        noises[0].frequency, np.array([noise.rms**2 for noise in noises]),
        _ordered(shares), prediction.dt, 0,
    )  # fmt: skip


def _beside_modes(model: Model, keys: Sequence[str], prediction: Prediction, gates: Bools) -> BesideModes:
    """The same where the linear part is a sum of modes, in the band that the forces drive: they are known in no other.

    The terms act along the motion of the structure, not along that of the free run: what they would add to it for that
    passes through the modes as well.
    """
    prepared, run, noises = prediction.prepared, prediction.run, [view.noise for view in prediction.views]
    part, frequency, n = prepared.record.part(*prepared.plan.judge), noises[0].frequency, len(prediction.misfit)
    cut = Segments(length=2 * (len(frequency) - 1))
    gates &= np.any([driven_lines(part[force], prepared.dt, cut) for force in part.forces], axis=0)[:, None]
    motion = _motion(model, prediction, gates, frequency)
    free = prediction.motions([Sensor(c, m) for m in MOTIONS for c in model.coordinates])
    acting = [unit_forces(model, part, x) for x in (motion, free.reshape(n, len(MOTIONS), -1).transpose(1, 0, 2))]
    beyond, size = prediction.misfit.copy(), next_fast_len(2 * n, real=True)
    paths, values = transfer(model, prepared.sensors, prepared.dt, size), model.numbers()
    places = [(symbol, entry.place) for entry in model.terms for symbol in entry.symbols]
    for (symbol, place), along, before in zip(places, *acting, strict=True):
        lines = np.asarray(rfft(values[symbol] * (along - before), size), dtype=np.complex128)
        through = paths @ np.array(place.direction(model.coordinates)) * lines[:, None]
        beyond += _history(through, size)[:n]
    slopes = np.zeros((beyond.size, len(keys)))
    if run is not None and keys:
        with suppress(DivergenceError):
            slopes = run.derivatives(run.fit)[:, : len(keys)]
    slopes = slopes.reshape(*beyond.shape, len(keys)) / np.array(prepared.outputs.weights)[:, None]
    width = float(frequency[1])
    noise = [float(np.sum(x.density[gate]) * width) for x, gate in zip(noises, gates.T, strict=True)]
    return BesideModes(
        model, prepared.record, prepared.coordinates, motion, np.zeros((n, 0)), np.zeros((n, 0, len(keys))),
        np.zeros(0), gates, np.zeros((len(frequency), 0, len(noises)), dtype=np.complex128), frequency,
        np.array(noise), _aligned(model, prediction, gates, frequency), prediction.dt, _edge(prediction, width),
        prepared.sensors, -beyond / prediction.size, slopes / prediction.size[:, None], prediction.size,
    )  # fmt: skip


def _edge(prediction: Prediction, width: float) -> int:
    """Half the memory of the gate, and what an integration needs to settle; at most an eighth of all."""
    memory = 0.5 / (width * prediction.dt)
    low = prediction.prepared.band[0]
    settling = UNCERTAIN_PERIODS / (low * prediction.dt) if low > 0.0 else 0.0
    return min(round(max(memory, settling)), len(prediction.measured) // 8)


def lines_above_noise(noise: Noise, low: float) -> Bools:
    """Lines on which the residual, averaged over a few of them, surely stands above the noise."""
    few = np.ones(AVERAGED)
    level = np.convolve(noise.residual, few, "same") / np.convolve(np.ones_like(noise.residual), few, "same")
    spread = CLEAR / np.sqrt(noise.averages * AVERAGED / 2.0)  # 2: neighbouring lines share a taper
    return (level > noise.density * (1.0 + spread)) & (noise.frequency >= low)


def _motion(model: Model, prediction: Prediction, gates: Bools, frequency: Floats) -> Floats:
    """Displacement, velocity and acceleration of all coordinates: free run plus what is sure of the difference.

    Shape (3, n, coordinates). The difference is integrated before it is gated: a gate blurs the ends, which an
    integration would blow up.
    """
    prepared, shape = prediction.prepared, (len(MOTIONS), len(model.coordinates))
    free = prediction.motions([Sensor(c, motion) for motion in MOTIONS for c in model.coordinates])
    motion = np.ascontiguousarray(free.T).reshape(*shape, len(free))
    for sensor, seen, gate in zip(prepared.outputs.sensors, prediction.misfit.T, gates.T, strict=True):
        for row in range(len(MOTIONS)):
            order = row - MOTIONS.index(sensor.motion)
            low = prepared.band[0] if order < 0 else 0.0
            moved = derivative(seen, prepared.dt, order, low) if order else seen
            sure = _filtered(moved, prepared.dt, frequency, gate.astype(np.float64))
            motion[row, model.coordinates.index(sensor.coordinate)] += sure
    return motion.transpose(0, 2, 1)


def _forces(model: Model, keys: Sequence[str], motion: Floats, part: Record) -> tuple[Floats, Floats]:
    """``F - M a - (forces of all terms)`` along a motion, then its derivatives by some keys, and the forces of inertia.

    Shapes (n, coordinates, 1 + keys) and (n, coordinates).
    """
    values, n = model.numbers(), motion.shape[1]
    columns = {f"{x}:{c}": motion[order][:, i] for order, x in enumerate("uv") for i, c in enumerate(model.coordinates)}
    columns |= {f"drive:{name}": part[name] for name in (*dict(model.forces), *named_channels(model, part.extra))}
    for entry in model.states:
        item = next(item for item in placed_inputs(entry) if item.state is not None)
        along = motion @ np.array(entry.place.direction(model.coordinates))
        columns[f"z:{entry.name}"] = input_history(item, part.relative(along))
    made = kernels.evaluate(acceleration_program(model, keys), columns | {"t": part.time}, n)
    left = made.reshape(n, len(model.coordinates), 1 + len(keys))
    left[:, :, 0] -= motion[2]
    mass = matrices(model, values)[2]
    return np.einsum("ij,njk->nik", mass, left), motion[2] @ mass.T


def _stiffness(model: Model, prepared: Prepared, frequency: Floats) -> Complexes:
    """Force in each equation for a unit of what each sensor shows, shape (lines, coordinates, sensors).

    Of a single mass that of the best linear oscillator, whose resonance is never sharper than the least damping.
    """
    if model.named and not is_alone(model):
        stiffness, damping, mass = matrices(model, model.numbers())
    else:
        own = oscillator(prepared_alone(prepared) if model.named else prepared)
        least = 2.0 * LEAST_DAMPING * float(np.sqrt(abs(own["k"]) * own["m"]))
        stiffness, damping, mass = (np.array([[x]]) for x in (own["k"], max(abs(own["c"]), least), own["m"]))
    omega = 2.0 * np.pi * np.maximum(frequency, 0.5 * frequency[1])[:, None, None]
    dynamic = stiffness - mass * omega**2 + 1j * omega * damping
    sensors = prepared.outputs.sensors
    orders = np.array([MOTIONS.index(s.motion) for s in sensors])
    return dynamic[:, :, [model.coordinates.index(s.coordinate) for s in sensors]] / omega**orders


def _aligned(
    model: Model, prediction: Prediction, gates: Bools, frequency: Floats
) -> tuple[tuple[Place, float], ...]:  # fmt: skip
    """What share of what is left of the motions a single force at each place could make, the largest first.

    Of all connections, neighbours and the ground. Unlike the shares of the equations it needs no derivatives of noisy
    motions.
    """
    places = connections(model) if model.named else (HERE,)
    if len(places) == 1:
        return ((places[0], 1.0),)
    prepared, pairs = prediction.prepared, zip(prediction.misfit.T, gates.T, strict=True)
    seen = [_filtered(x, prepared.dt, frequency, gate.astype(np.float64)) for x, gate in pairs]
    size = next_fast_len(2 * len(seen[0]), real=True)
    lines = np.asarray(rfft(np.stack(seen, axis=1) / prediction.size, size, axis=0), dtype=np.complex128)
    paths = transfer(model, prepared.sensors, prepared.dt, size) / prediction.size[:, None]
    found = [(p, alignment(paths @ np.array(p.direction(model.coordinates)), lines)) for p in places]
    return _ordered(found)


def _ordered(shares: Sequence[tuple[Place, float]]) -> tuple[tuple[Place, float], ...]:
    """Places with the largest share first; through a single mode all explain the same, but for the last digits."""
    return tuple(sorted(shares, key=lambda item: -round(item[1], 9)))


def _filtered(values: Floats, dt: float, frequency: Floats, gain: Floats) -> Floats:
    """Values through a real gain without delay; the ends are continued by point reflection."""
    longer, edge = _continued(values, frequency, dt)
    size = next_fast_len(len(longer), real=True)
    lines = np.asarray(rfftfreq(size, dt))
    spectrum = rfft(longer, size) * np.interp(lines, frequency, gain)
    return np.asarray(irfft(spectrum, size)[edge : edge + len(values)], dtype=np.float64)


def _history(lines: Complexes, size: int) -> Floats:
    """Histories of so many samples, side by side, from their lines."""
    return np.asarray(irfft(lines, size, axis=0), dtype=np.float64)


def _continued(values: Floats, frequency: Floats, dt: float) -> tuple[Floats, int]:
    """Values with point reflections at both ends, and how many samples of them there are at each."""
    edge = min(len(values) - 1, round(2.0 / (float(frequency[1]) * dt)))
    before, after = 2.0 * values[0] - values[edge:0:-1], 2.0 * values[-1] - values[-2 : -edge - 2 : -1]
    return np.concatenate([before, values, after]), edge
