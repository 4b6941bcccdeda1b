"""Coefficients of a structure's nonlinear terms line by line, which must be real and flat.

With forces F and those of the terms as inputs, what each sensor shows is ``y = H_F F - sum of H_e coefficient g(e.u)``.
By reciprocity the sensor where a force acts answers a force along e as the motion along e answers that force, so that
``coefficient(f) = -A_g / (e . H_F)`` (Richards and Singh, Journal of Sound and Vibration 213, 1998; Adams and Allemang,
Mechanical Systems and Signal Processing 14, 2000). No form of the linear part is assumed. Instruments from the free run
take the bias of noise on the motions away (``instruments``).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.equations.model import Model
from study.equations.place import HERE, Place
from study.identify.frequency_domain import instruments
from study.identify.frequency_domain.coefficients import Responses
from study.identify.frequency_domain.inputs import Input, input_history, reverse_inputs
from study.identify.frequency_domain.linear_start import FAINT
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import run_of
from study.records import spectra
from study.records.prepared import Prepared
from study.records.record import MOTIONS, Record, Sensor
from study.records.spectra import Segments, segment_length
from study.support.arrays import Bools, Complexes, Floats


@dataclass(frozen=True, eq=False)
class CoefficientSpectrum:
    """A coefficient at every line that the forces drive.

    Attributes
    ----------
    key : str
        The coefficient; several stand for an input that carries several.
    place : Place
        Where it acts.
    frequency : array, shape (lines,)
        In hertz.
    values : complex array, shape (lines,)
        The coefficient.
    error : array, shape (lines,)
        Standard error of the complex estimate.
    inflation : float
        Factor on the variance of a mean over lines: neighbouring ones are not independent.
    """

    key: str
    place: Place
    frequency: Floats
    values: Complexes
    error: Floats
    inflation: float

    @property
    def mean(self) -> tuple[float, float]:
        """Mean of the real part, lines weighted by their errors, with its standard error."""
        return self._weighted(self.values.real)

    @property
    def imaginary(self) -> tuple[float, float]:
        """The same of the imaginary part: zero but for its error."""
        return self._weighted(self.values.imag)

    @property
    def trend(self) -> tuple[float, float]:
        """Rise of the real part from one end of the band to the other, with its error: zero where it is flat."""
        weight = 1.0 / self.error**2
        middle = float(np.sum(weight * self.frequency) / np.sum(weight))
        off = (self.frequency - middle) / float(np.ptp(self.frequency))
        power = float(np.sum(weight * off**2))
        slope = float(np.sum(weight * off * self.values.real)) / power
        return slope, float(np.sqrt(0.5 * self.inflation / power))

    def _weighted(self, values: Floats) -> tuple[float, float]:
        weight = 1.0 / self.error**2
        total = float(np.sum(weight))
        return float(np.sum(weight * values)) / total, float(np.sqrt(0.5 * self.inflation / total))


def coefficient_spectra(fit: FreeRunFit, prepared: Prepared) -> tuple[CoefficientSpectrum, ...]:
    """Every coefficient of a fitted structure's terms, line by line, from its fitting part."""
    model, (first, last) = fit.model, prepared.plan.fit
    measured = {c: prepared.record.motion(c)[:, first:last] for c in prepared.coordinates}
    clean = _free_motion(fit, prepared)
    groups = _inputs(model)
    forces = [prepared.record[name][first:last] for name, _ in model.forces]
    instrument, corrected = list(forces), list(forces)
    for place, inputs in groups:
        e = place.direction(model.coordinates)
        seen, free = (_relative(prepared, model, e, motion) for motion in (measured, clean))
        instrument += [input_history(item, free) for item in inputs]
        corrected += instruments.inputs_without_noise(inputs, seen, free)
    runs = prepared.record.runs((first, last))
    cut = Segments(segment_length(min(b - a for a, b in runs), held=6, fewest=16, most=2048))
    begins = [a - first for a, _ in runs[1:]]
    by_sensor = {
        sensor.coordinate: _responses(sensor, [*instrument, *corrected, y[first:last]], prepared.dt, cut, begins)
        for sensor, y in zip(prepared.sensors, prepared.measured.T, strict=True)
    }
    at = next(k for k, (_, where) in enumerate(model.forces) if where in by_sensor)
    keep = driven_lines(forces[at], prepared.dt, cut)
    found, row = list[CoefficientSpectrum](), len(forces)
    for place, inputs in groups:
        for item in inputs:
            answers = _answers(model, place, by_sensor, at, row)
            found.append(_spectrum(item, place, answers, by_sensor[model.forces[at][1]].frequency, keep, cut))
            row += 1
    return tuple(found)


def _free_motion(fit: FreeRunFit, prepared: Prepared) -> dict[str, Floats]:
    """Displacement and velocity of each measured coordinate in the free run, shape (2, samples)."""
    wanted = tuple(Sensor(c, m) for c in prepared.coordinates for m in MOTIONS[:2])
    motion, _ = run_of(fit, prepared, sensors=wanted).respond({}, fit.initial)
    return {c: motion[:, 2 * i : 2 * i + 2].T for i, c in enumerate(prepared.coordinates)}


def _inputs(model: Model) -> list[tuple[Place, tuple[Input, ...]]]:
    """Inputs of the terms at each place, as if they were a single mass's."""
    places = dict.fromkeys(t.place for t in model.terms)
    return [
        (place, reverse_inputs(Model("alone", tuple(replace(t, place=HERE) for t in model.terms if t.place == place))))
        for place in places
    ]


def _relative(
    prepared: Prepared, model: Model, direction: Sequence[float], motion: dict[str, Floats]
) -> Record:  # fmt: skip
    total = np.sum([w * motion[c][:2] for c, w in zip(model.coordinates, direction, strict=True) if w], axis=0)
    return prepared.record.relative(total, prepared.plan.fit)


def _responses(
    sensor: Sensor, channels: Sequence[Floats], dt: float, cut: Segments, begins: Sequence[int]
) -> Responses:  # fmt: skip
    """Displacement at a sensor by every input; stretches after the first begin at ``begins``."""
    matrix = spectra.cross_spectra_within([x - np.mean(x) for x in channels], begins, dt, cut)
    found = instruments.instrumental_responses(matrix)
    order = (2j * np.pi * np.maximum(found.frequency, found.frequency[1])) ** MOTIONS.index(sensor.motion)
    size = np.abs(order)[:, None, None] ** 2
    return replace(found, response=found.response / order, covariance=found.covariance / size)


@dataclass(frozen=True, eq=False)
class _Answers:
    """What the sensor of a force shows of a term's force, and how a place moves under the measured one; by line."""

    own: Complexes
    along: Complexes
    own_variance: Floats
    along_variance: Floats
    shared: Complexes  # E[d own d along*]: noises of two sensors are taken as independent


def _answers(model: Model, place: Place, by_sensor: dict[str, Responses], at: int, row: int) -> _Answers:
    driven = model.forces[at][1]
    own, lines = by_sensor[driven], len(by_sensor[driven].frequency)
    along, variance, shared = np.zeros(lines, np.complex128), np.zeros(lines), np.zeros(lines, np.complex128)
    for c, w in zip(model.coordinates, place.direction(model.coordinates), strict=True):
        if w != 0.0:
            along += w * by_sensor[c].response[at]
            variance += by_sensor[c].covariance[:, at, at].real
            shared += w * own.covariance[:, row, at] if c == driven else 0.0
    return _Answers(own.response[row], along, own.covariance[:, row, row].real, variance, shared)


def driven_lines(force: Floats, dt: float, cut: Segments) -> Bools:
    """The lines on which a force of shape (n,) has power."""
    _, power = spectra.autospectrum(force - np.mean(force), dt, cut)
    driven = power > FAINT * float(np.max(power))
    driven[[0, -1]] = False
    return driven


def _spectrum(
    item: Input, place: Place, answers: _Answers, frequency: Floats, keep: Bools, cut: Segments
) -> CoefficientSpectrum:
    """The ratio line by line, less what the errors of both sides that go together add to it."""
    f, part = frequency[keep], item.parts[0]
    power = part.factor * (2j * np.pi * f) ** part.order if len(item.parts) == 1 else np.ones(len(f), np.complex128)
    own, along, shared = -answers.own[keep], answers.along[keep], -answers.shared[keep]
    variance, moved = answers.own_variance[keep], answers.along_variance[keep]
    product, square = own * along.conj() - shared, np.abs(along) ** 2 - moved
    weight = 1.0 / variance
    size = np.sum(weight * (product * power.conj()).real) / np.sum(weight * square * np.abs(power) ** 2)
    square = np.maximum(square, 0.5 * np.abs(along) ** 2)  # where noise is half of it nothing is known anyway
    spread = variance + np.abs(size * power) ** 2 * moved - 2.0 * (size * power.conj() * shared).real
    error = np.sqrt(np.maximum(spread, 0.0) / np.maximum(square, np.finfo(float).tiny)) / np.abs(power)
    key = " + ".join(f"{p.symbol}[{place.label}]" for p in item.parts)
    return CoefficientSpectrum(key, place, f, product / square / power, error, cut.line_inflation())
