"""Records driven by a motion rather than a force: of the base a structure stands on, or of a component itself.

Base excitation: with the displacement u relative to the base, of which ``a_b`` is the acceleration,
``m (u'' + a_b) + forces = 0``: the base acts as the force ``-m a_b``. Without a mass that the model gives, all is per
unit mass. A component's motion is prescribed and measured: its velocity is wanted without the lag and the noise of a
difference.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from study.records.completion import consistent, derivative
from study.records.noise_floor import floor
from study.records.record import FORCE, MOTIONS, OF_THE_GROUND, SI_UNITS, Record, Sensor
from study.records.spectra import Segments, autospectrum, segment_length
from study.support.arrays import Floats
from study.support.errors import StudyError, at, expect
from study.support.numbers import LAST_DIGITS
from study.support.units import parse_unit

BASE = tuple(f"base_{motion}" for motion in MOTIONS)
BASE_MOVES = "the base moves: its acceleration, sign reversed, is the force"
PER_MASS = "all coefficients are per unit mass (give the inertia in the model for those of the structure)"


def on_a_moving_base(record: Record) -> bool:
    """Whether the base was measured and no force."""
    return record.unforced and any(channel in record for channel in BASE)


def relative_to_base(record: Record, mass: float | None, absolute: bool) -> tuple[Record, tuple[str, ...]]:
    """The record with the force of the base, and motions relative to it; and sentences on that.

    Of several coordinates the base's acceleration stands for the force, which each mass makes of it.

    Parameters
    ----------
    record : Record
        With one or more of the channels ``base_displacement``, ``base_velocity``, ``base_acceleration``.
    mass : float or None
        That the model gives; None for coefficients per unit mass.
    absolute : bool
        Whether the response was measured absolutely: the base's own motion is then subtracted.
    """
    record, notes = consistent(record)
    length = record.force_and_length[1]
    base = dict[str, Floats]()
    for motion, wanted in zip(MOTIONS, (length, f"{length}/s", f"{length}/s^2"), strict=True):
        if (channel := f"base_{motion}") in record:
            text, target = record.units.get(channel) or SI_UNITS[motion], parse_unit(wanted)
            with at(f"{record.name}: {channel}"):
                unit, usual = parse_unit(text), f"expected {SI_UNITS[motion]} or the like"
                expect(unit.powers == target.powers, f"{text!r} is no unit of {motion}; {usual}")
            base[motion] = record[channel] * (unit.factor / target.factor)
    known = next(motion for motion in reversed(MOTIONS) if motion in base)
    order = MOTIONS.index("acceleration") - MOTIONS.index(known)
    acceleration = base[known] if order == 0 else derivative(base[known], record.dt, order)
    base["acceleration"] = acceleration
    driving, channels = FORCE, {FORCE: -(1.0 if mass is None else mass) * acceleration}
    said = [*notes, BASE_MOVES if mass is not None else f"{BASE_MOVES}, and {PER_MASS}"]
    if absolute:
        for sensor in record.sensors:
            if (motion := sensor.motion) not in base:
                raise StudyError(
                    f"{record.name}: the {motion} is absolute and the base's was not measured; expected a column "
                    f"base_{motion}, or the response relative to the base"
                )
            channels[str(sensor)] = record[sensor] - base[motion]
        said.append("the response is taken relative to the base")
    unit = f"{length}/s^2" if mass is None else "N" if length == "m" else f"kg {length}/s^2"
    kept = {c: v for c, v in record.channels.items() if c not in (*BASE, *record.forces)}
    if len(record.coordinates) > 1:
        driving, unit = OF_THE_GROUND, f"{length}/s^2"
        channels[driving] = acceleration
        del channels[FORCE]
    units = {**record.units, driving: unit}
    return replace(record, channels={**kept, **channels}, units=units, forces=(driving,)), tuple(said)


def with_prescribed_motion(record: Record) -> tuple[Record, tuple[str, ...]]:
    """A record whose velocity may be trusted beside its displacement, and sentences on what was changed.

    A velocity that is the difference of the displacement over the sample before lags by half a sample, which opens
    loops of force over velocity that are none: it gives way to the derivative of the displacement. That is taken, here
    and where no velocity was measured, up to the frequency at which the motion drowns in its noise.
    """
    record, notes = consistent(record)
    channels, said = dict[str, Floats](), list(notes)
    for coordinate in record.coordinates:
        displacement, velocity, acceleration = (Sensor(coordinate, motion) for motion in MOTIONS)
        if displacement not in record:
            continue
        u = record[displacement]
        if velocity in record:
            difference = np.diff(u, prepend=u[0]) / record.dt
            size = float(np.std(record[velocity]))
            # a velocity that differs from a difference of the displacement by 2 % of its rms is that difference
            if size == 0.0 or float(np.std(record[velocity] - difference)) > 0.02 * size:
                continue
            lags = "which lags by half a sample"
            said.append(f"the {velocity} in the file is the difference to the sample before, {lags}")
        u = _without_flicker(u)
        cut = Segments(segment_length(len(u), held=4, most=256))
        frequency, power = autospectrum(u - np.mean(u), record.dt, cut)
        noise = floor(u - np.mean(u), record.dt).noise ** 2 * 2.0 * record.dt
        # the motion is followed up to the highest line at which it stands ten times above its noise
        above = np.flatnonzero(power > 10.0 * noise)
        highest = float(frequency[above[-1]]) if len(above) else 0.5 / record.dt
        slope = _smooth_slope(u, record.dt, highest)
        channels |= {str(velocity): slope, str(acceleration): np.gradient(slope, record.dt)}
        below = f"below {highest:.3g} Hz, above which that is noise"
        said.append(f"{velocity} is the derivative of the {displacement} {below}")
    return record.with_channels(channels), tuple(said)


def with_forces_by_coordinate(record: Record, forces: Sequence[tuple[str, str]]) -> Record:
    """A record whose forces are called after the coordinates that they act on: ``left force``, the sum of those there.

    Raises
    ------
    StudyError
        If one of the coordinates has no motion: of a component all are prescribed.
    """
    for coordinate in record.coordinates:
        expect(
            any(sensor.coordinate == coordinate for sensor in record.sensors),
            f"{record.name}: nothing measures the motion of {coordinate!r}, and in a model without inertia all motion "
            f"is prescribed; expected a column '{coordinate} displacement', or the inertia of what moves by itself",
        )
    record, _ = consistent(record)
    kept = {name: values for name, values in record.channels.items() if name not in record.forces}
    units = {name: unit for name, unit in record.units.items() if name not in record.forces}
    for name, coordinate in forces:
        own = str(Sensor(coordinate, FORCE))
        kept[own] = kept.get(own, 0.0) + record[name]
        units.setdefault(own, record.unit(name))
    together = tuple(dict.fromkeys(str(Sensor(coordinate, FORCE)) for _, coordinate in forces))
    return replace(record, channels=kept, units=units, forces=together)


def _without_flicker(u: Floats) -> Floats:
    """A digitised displacement that rests where it flickers by a step of its converter, shape (n,).

    At rest the flicker is no motion, and would wear off what a component remembers. The value follows as a pointer with
    the play of one step does, half a step behind either way; a displacement that is not in steps stays as it is.
    """
    change = np.abs(np.diff(u))
    steps = change[change > LAST_DIGITS * float(np.ptp(u))]
    step = float(np.min(steps)) if len(steps) else 0.0
    # a displacement is digitised where nearly all changes are whole steps
    if step == 0.0 or float(np.mean(np.abs(steps / step - np.rint(steps / step)) < 0.05)) < 0.95:
        return u
    held, follower = np.empty_like(u), float(u[0])
    for i, value in enumerate(u.tolist()):
        follower = min(max(follower, value - 0.5 * step), value + 0.5 * step)
        held[i] = follower
    return held


def _smooth_slope(u: Floats, dt: float, highest: float) -> Floats:
    """Derivative of a displacement behind a Gaussian low-pass, its ends continued by point reflection, shape (n,)."""
    n, slope = len(u), float(u[-1] - u[0]) / max(len(u) - 1, 1)
    u = u - (u[0] + slope * np.arange(n))  # the continued record then closes, and its ends do not ring
    longer = np.concatenate([-u[:0:-1], u, -u[-2::-1]])
    lines = np.fft.rfftfreq(len(longer), dt)
    gain = np.exp(-0.5 * (lines / highest) ** 2) * 2j * np.pi * lines
    moved = np.fft.irfft(np.fft.rfft(longer) * gain, len(longer))[n - 1 : 2 * n - 1]
    return np.asarray(moved + slope / dt, dtype=np.float64)
