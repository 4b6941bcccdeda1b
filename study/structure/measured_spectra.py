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
from study.equations.place import Place
from study.identify.frequency_domain import instruments
from study.identify.frequency_domain.inputs import Input, history, reverse_inputs
from study.identify.frequency_domain.responses import Responses
from study.records import spectra
from study.records.record import MOTIONS, Record
from study.records.spectra import Segments
from study.structure.measured_fit import MeasuredFit, modal_run
from study.structure.prepared_structure import PreparedStructure
from study.structure.structure_record import Sensor
from study.support.arrays import Complexes, Floats

LONGEST, SHARE = 2048, 6  # samples in a segment at most, and parts of the record
FAINT = 1e-3  # of the strongest line's force


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


def coefficient_spectra(fit: MeasuredFit, prepared: PreparedStructure) -> tuple[CoefficientSpectrum, ...]:
    """Every coefficient of a fitted structure's terms, line by line, from its fitting part."""
    model, (first, last) = fit.model, prepared.fit
    measured = {c: x[:, first:last] for c, x in prepared.complete.items()}
    clean = _free_motion(fit, prepared)
    groups = _inputs(model)
    forces = [prepared.record.forces[name][first:last] for name, _ in model.forces]
    instrument, corrected = list(forces), list(forces)
    for place, inputs in groups:
        e = place.direction(model.coordinates)
        seen, free = (_relative(prepared, model, e, motion) for motion in (measured, clean))
        instrument += [history(item, free) for item in inputs]
        corrected += instruments.corrected(inputs, seen, free)
    cut = Segments(length=min(LONGEST, 2 ** int(np.log2(max((last - first) // SHARE, 16)))))
    by_sensor = {
        sensor.coordinate: _responses(sensor, [*instrument, *corrected, y[first:last]], prepared.dt, cut)
        for sensor, y in zip(prepared.sensors, prepared.measured.T, strict=True)
    }
    at = next(k for k, (_, where) in enumerate(model.forces) if where in by_sensor)
    keep = _driven(forces[at], prepared.dt, cut)
    found, row = list[CoefficientSpectrum](), len(forces)
    for place, inputs in groups:
        along = _along(place, model, by_sensor, at)
        for item in inputs:
            own = _entry(by_sensor[model.forces[at][1]], row)
            found.append(_spectrum(item, place, own, along, by_sensor[model.forces[at][1]].frequency, keep, cut))
            row += 1
    return tuple(found)


def _free_motion(fit: MeasuredFit, prepared: PreparedStructure) -> dict[str, Floats]:
    """Displacement and velocity of each measured coordinate in the free run, shape (2, samples)."""
    wanted = tuple(Sensor(c, m) for c in prepared.complete for m in MOTIONS[:2])
    run = modal_run(fit.model, fit.modal, prepared, wanted, fit.steps, prepared.fit)
    motion, _ = run.respond(fit.values, fit.initial, free=False)
    return {c: motion[:, 2 * i : 2 * i + 2].T for i, c in enumerate(prepared.complete)}


def _inputs(model: Model) -> list[tuple[Place, tuple[Input, ...]]]:
    """Inputs of the terms at each place, as if they were a single mass's."""
    places = dict.fromkeys(t.place for t in model.terms if t.place is not None)
    return [
        (place, reverse_inputs(Model("alone", tuple(replace(t, place=None) for t in model.terms if t.place == place))))
        for place in places
    ]


def _relative(
    prepared: PreparedStructure, model: Model, direction: Sequence[float], motion: dict[str, Floats]
) -> Record:  # fmt: skip
    first, last = prepared.fit
    total = np.sum([w * motion[c][:2] for c, w in zip(model.coordinates, direction, strict=True) if w], axis=0)
    extra = {name: x[first:last] for name, x in prepared.record.extra.items()}
    channels = {"force": np.zeros(last - first), **dict(zip(MOTIONS[:2], total, strict=True)), **extra}
    return Record(prepared.dt, channels, start=prepared.record.start + first * prepared.dt)


def _responses(sensor: Sensor, channels: Sequence[Floats], dt: float, cut: Segments) -> Responses:
    """Displacement at a sensor by every input."""
    matrix = spectra.cross_spectra([x - np.mean(x) for x in channels], dt, cut)
    found = instruments.responses(matrix)
    order = (2j * np.pi * np.maximum(found.frequency, found.frequency[1])) ** MOTIONS.index(sensor.motion)
    size = np.abs(order)[:, None, None] ** 2
    return replace(found, response=found.response / order, covariance=found.covariance / size)


def _entry(found: Responses, row: int) -> tuple[Complexes, Floats]:
    """One input's function and its variance."""
    return found.response[row], found.covariance[:, row, row].real


def _along(place: Place, model: Model, by_sensor: dict[str, Responses], at: int) -> tuple[Complexes, Floats]:
    """Motion along a place by one of the forces, and its variance: noises of two sensors are taken as independent."""
    pairs = zip(model.coordinates, place.direction(model.coordinates), strict=True)
    parts = [(w, *_entry(by_sensor[c], at)) for c, w in pairs if w != 0.0]
    total = np.sum([w * values for w, values, _ in parts], axis=0)
    return np.asarray(total, dtype=np.complex128), np.sum([variance for *_, variance in parts], axis=0)


def _driven(force: Floats, dt: float, cut: Segments) -> Floats:
    _, power = spectra.autospectrum(force - np.mean(force), dt, cut)
    driven = power > FAINT * float(np.max(power))
    driven[[0, -1]] = False
    return driven


def _spectrum(
    item: Input, place: Place, own: tuple[Complexes, Floats], along: tuple[Complexes, Floats], frequency: Floats,
    keep: Floats, cut: Segments,
) -> CoefficientSpectrum:  # fmt: skip
    f = frequency[keep]
    part = item.parts[0]
    power = part.factor * (2j * np.pi * f) ** part.order if len(item.parts) == 1 else np.ones(len(f), np.complex128)
    values = -own[0][keep] / (along[0][keep] * power)
    relative = own[1][keep] / np.abs(own[0][keep]) ** 2 + along[1][keep] / np.abs(along[0][keep]) ** 2
    key = " + ".join(f"{p.symbol}[{place.label}]" for p in item.parts)
    return CoefficientSpectrum(key, place, f, values, np.abs(values) * np.sqrt(relative), cut.line_inflation())
