"""Displacement, velocity and acceleration from those of them that were measured.

Derivatives and integrals are taken in the frequency domain, where they are exact for a band-limited
record that closes on itself. A measured record does not close: its ends are continued by linear
prediction (Burg's method, always stable) and faded out smoothly, so that no jump at the ends leaks into
the record. Integration is limited to frequencies above a cut-off: drift and offset of an accelerometer, divided
by (2 pi f)^2, would otherwise dominate. The remaining band is reported, and judgements are limited to it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from study.records.record import ALONE, MOTIONS, Record, Sensor
from study.records.spectra import Segments, autospectrum
from study.support.arrays import Floats
from study.support.autoregression import burg, continued_by
from study.support.errors import StudyError
from study.support.units import A_VOLTAGE, ROLES, parse_unit, role_unit

CONTINUED = 512  # samples by which each end is continued, at least
RINGING = 4.0  # periods of the cut-off frequency by which ends are continued when integrating
UNCERTAIN_PERIODS = 2.0  # of the cut-off frequency, at each end of an integrated channel
NEAR_END = 8  # samples at each end where a derivative, or a filter, depends on the continuation


@dataclass(frozen=True)
class CompletedRecord:
    """A record with displacement, velocity and acceleration in one set of units."""

    record: Record  # forces, the three motions of every measured coordinate and any extra channels
    band: tuple[float, float]  # lowest and highest frequency in hertz at which all motions are valid
    edge: int  # samples at each end that derivatives and integrals leave uncertain; 0 if nothing was computed
    notes: tuple[str, ...]  # what was converted or computed, a sentence each


def complete(record: Record, cutoff: float | None = None) -> CompletedRecord:
    """Fill in the motions that were not measured, of every coordinate of which one was.

    Parameters
    ----------
    record : Record
        Forces and at least one motion.
    cutoff : float, optional
        Lowest frequency in hertz that integration keeps (above it the gain is exactly one, below half of it
        zero). Default: :func:`suggest_cutoff` for each coordinate. If displacement and acceleration of one are both
        measured, the velocity is the derivative of the one below the cut-off and the integral of the other above it;
        without a cut-off it is the derivative of the displacement.
    """
    if not record.sensors:
        raise StudyError(f"{record.name}: no displacement, velocity or acceleration is there; at least one is needed")
    nyquist = 0.5 / record.dt
    if cutoff is not None and not 0.0 < cutoff < nyquist:
        raise StudyError(f"{record.name}: the cut-off is {cutoff:g} Hz; expected it above 0 and below {nyquist:g} Hz")
    record, notes = consistent(record)
    low, edge, said = 0.0, 0, dict[str, list[str]]()
    for coordinate in record.coordinates:
        measured = [m for m in MOTIONS if Sensor(coordinate, m) in record]
        if not measured or len(measured) == len(MOTIONS):
            continue
        if measured == ["displacement", "acceleration"] and cutoff is not None:
            found = _blended(record, coordinate, cutoff)
        else:
            found = _derived(record, coordinate, measured, cutoff)
        motions = {str(Sensor(coordinate, m)): values for m, values in found.motions.items()}
        record = replace(record.with_channels(motions), computed=record.computed.union(motions))
        low, edge = max(low, found.low), max(edge, found.edge)
        for sentence in found.notes:
            said.setdefault(sentence, []).extend([coordinate] if coordinate else [])
    placed = (f"{', '.join(named)}: {sentence}" if named else sentence for sentence, named in said.items())
    return CompletedRecord(record, (low, nyquist), edge, (*notes, *placed))


@dataclass(frozen=True)
class _Filled:
    """Motions of a coordinate that were not measured."""

    motions: dict[str, Floats]
    low: float  # hertz below which they are not valid
    edge: int
    notes: tuple[str, ...]


_OPERATION = {1: "derivative", 2: "second derivative", -1: "integral", -2: "double integral"}


def _derived(record: Record, coordinate: str, measured: list[str], cutoff: float | None) -> _Filled:
    """Each missing motion from the nearest measured one, by derivatives if there is a choice."""
    integrates = MOTIONS.index(measured[0]) > 0
    low = (suggest_cutoff(record, coordinate) if cutoff is None else cutoff) if integrates else 0.0
    missing = [name for name in MOTIONS if name not in measured]  # two of one, or one
    below = [name for name in measured if MOTIONS.index(name) < MOTIONS.index(missing[-1])]
    source = below[-1] if below else measured[0]
    orders = [MOTIONS.index(name) - MOTIONS.index(source) for name in missing]
    motions = dict(zip(missing, derivatives(record[Sensor(coordinate, source)], record.dt, orders, low), strict=True))
    sentences = [
        f"{name} is the {_OPERATION[order]} of the {source}{f' above {low:.4g} Hz' if order < 0 else ''}"
        for name, order in zip(missing, orders, strict=True)
    ]
    return _Filled(motions, low, _edge(record, low) if integrates else NEAR_END, tuple(sentences))


def _edge(record: Record, cutoff: float) -> int:
    """Uncertain samples at each end of an integrated channel."""
    return min(int(np.ceil(UNCERTAIN_PERIODS / (cutoff * record.dt))), len(record) // 4)


def _blended(record: Record, coordinate: str, cutoff: float) -> _Filled:
    """Velocity from both: the integral above the cut-off, the derivative below it."""
    displacement, acceleration = (record[Sensor(coordinate, m)] for m in ("displacement", "acceleration"))
    slow = derivative(displacement, record.dt, 1)
    fast = derivative(acceleration, record.dt, -1, cutoff)
    below = slow - derivative(displacement, record.dt, 1, cutoff)
    note = (
        f"velocity is the derivative of the displacement below {cutoff:.4g} Hz "
        "and the integral of the acceleration above"
    )
    return _Filled({"velocity": fast + below}, 0.0, _edge(record, cutoff), (note,))


def derivative(values: Floats, dt: float, order: int, cutoff: float = 0.0) -> Floats:
    """Derivative, or integral above a cut-off, in the frequency domain, shape (n,).

    Orders 1 and 2 differentiate, -1 and -2 integrate, 0 only removes what lies below the cut-off. The gain is full
    above the cut-off (in hertz; above zero for an integral), zero below half of it, a raised cosine between.
    """
    return derivatives(values, dt, (order,), cutoff)[0]


def derivatives(values: Floats, dt: float, orders: Sequence[int], cutoff: float = 0.0) -> list[Floats]:
    """:func:`derivative` of several orders, whose ends are continued once."""
    reach = max(CONTINUED, int(np.ceil(RINGING / (cutoff * dt)))) if cutoff > 0.0 else CONTINUED
    mean = float(np.mean(values))
    longer = with_continuations(values - mean, min(reach, 8 * len(values)))
    size = next_fast_len(len(longer), real=True)
    spectrum = rfft(longer, size)
    frequency = np.asarray(rfftfreq(size, dt))
    omega = 2.0 * np.pi * frequency
    kept = np.ones_like(frequency)
    if cutoff > 0.0:
        kept = 0.5 - 0.5 * np.cos(np.pi * np.clip(2.0 * frequency / cutoff - 1.0, 0.0, 1.0))
    before, found = (len(longer) - len(values)) // 2, list[Floats]()
    for order in orders:
        if order < 0:
            gain = np.divide(kept, omega**-order, out=kept.copy(), where=omega > 0.0)
        else:
            gain = kept * omega**order
        turned = spectrum * gain * 1j**order
        if size % 2 == 0 and order % 2:
            turned[-1] = 0.0  # the Nyquist line of an odd derivative has no real part
        result = irfft(turned, size)[before : before + len(values)]
        found.append(result + mean if order == 0 and cutoff == 0.0 else np.asarray(result))
    return found


def with_continuations(values: Floats, reach: int) -> Floats:
    """The record between two continuations of ``reach`` samples that fade to zero, shape (n + 2 reach,)."""
    after = _predicted(values, reach)
    before = _predicted(values[::-1], reach)[::-1]
    x = np.arange(1, reach + 1) / (reach + 1)
    fade = 1.0 - x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)  # three smooth derivatives at both ends
    return np.concatenate([before * fade[::-1], values, after * fade])


def _predicted(values: Floats, reach: int) -> Floats:
    """Linear prediction of the samples after the last one, shape (reach,).

    A prediction of high order is stable in exact arithmetic only; one that grows is replaced by a shorter one.
    """
    recent = values[-4096:]  # from which it is estimated
    limit = 2.0 * float(np.max(np.abs(recent)))
    order = min(64, len(recent) // 3)
    while order > 0:
        continued = continued_by(burg(recent, order), recent, reach)
        if float(np.max(np.abs(continued), initial=0.0)) <= limit:
            return continued
        order //= 2
    return np.zeros(reach)


def suggest_cutoff(record: Record, coordinate: str = ALONE) -> float:
    """Frequency in hertz above which a measured acceleration or velocity can be integrated.

    The autospectrum of the displacement is that of the acceleration over (2 pi f)^4. Towards low frequencies that
    of a response levels off, that of noise and drift rises as f^-4. From below, the cut-off is where it first stops
    falling for an octave; at most where the measured motion is strongest.
    """
    sensor = next(s for m in reversed(MOTIONS) if (s := Sensor(coordinate, m)) in record)
    length = min(len(record), max(32, min(4096, len(record) // 8)))
    frequency, power = autospectrum(record[sensor], record.dt, Segments(length))
    frequency, power = frequency[2:], power[2:]
    line = np.arange(len(power))
    half = np.maximum(1, np.floor(line * 0.115)).astype(int)  # of a third of an octave, or of three lines
    first, last = np.maximum(line - half, 0), np.minimum(line + half + 1, len(power))
    total = np.concatenate([[0.0], np.cumsum(power)])
    smooth = (total[last] - total[first]) / (last - first)
    displacement = smooth / frequency ** (2 * MOTIONS.index(sensor.motion))
    strongest = int(np.argmax(power))
    for k in range(strongest):
        octave = (frequency > frequency[k]) & (frequency <= 2.0 * frequency[k])
        if np.all(displacement[octave] >= displacement[k]):
            return float(frequency[k])
    return float(frequency[strongest])


def consistent(record: Record) -> tuple[Record, tuple[str, ...]]:
    """The record with one length for all that translates, radians for all that turns, and seconds.

    Velocity is per second of displacement, acceleration per second of velocity. The length is that of the first of the
    motions that were measured (metres for an acceleration in g). The forces on named coordinates share the unit of the
    first, and a moment is in that times the length. Returned beside a sentence on each conversion.
    """
    sensors = sorted(record.sensors, key=lambda s: (record.coordinates.index(s.coordinate), MOTIONS.index(s.motion)))
    units = {str(s): role_unit(s.motion, record.unit(s)) for s in sensors}
    if len({u.powers.voltage for u in units.values()}) > 1:
        mixed = ", ".join(f"{channel} in {u.text}" for channel, u in units.items())
        raise StudyError(f"{record.name}: {mixed} cannot be compared; expected all calibrated, or all in volts")
    turning = record.rotations
    straight = [units[str(s)] for s in sensors if s.coordinate not in turning]
    first = straight[0].text.replace("/", " ").split()[0] if straight else "m"  # ``mm`` in ``mm/s^2``
    length = first if parse_unit(first).powers in (ROLES["displacement"][0], A_VOLTAGE) else "m"
    wanted: dict[str, str] = {}
    for sensor in (Sensor(c, m) for c in record.coordinates for m in MOTIONS):
        own = "rad" if sensor.coordinate in turning else length
        wanted[str(sensor)] = (own, f"{own}/s", f"{own}/s^2")[MOTIONS.index(sensor.motion)]
    if record.coordinates != (ALONE,):
        per_mass = [f for f in record.forces if parse_unit(record.unit(f)).powers == ROLES["acceleration"][0]]
        forces = {name: role_unit("force", record.unit(name)) for name in record.forces if name not in per_mass}
        first = next((u.text for u in forces.values() if u.powers == ROLES["force"][0]), "N")
        units |= forces
        for name, u in forces.items():
            wanted[name] = u.text if u.powers.uncalibrated else f"{first} {length}" if u.powers.length else first
    channels: dict[str, Floats] = {}
    notes: list[str] = []
    for channel, unit in units.items():
        factor = unit.factor / parse_unit(wanted[channel]).factor
        if unit.powers.voltage == 0 and factor != 1.0:
            channels[channel] = record[channel] * factor
            notes.append(f"{channel} is converted from {unit.text} to {wanted[channel]}")
    return replace(record.with_channels(channels), units={**record.units, **wanted}), tuple(notes)
