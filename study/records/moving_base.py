"""Base excitation: the motion of the base in place of a force.

With the displacement u relative to the base, of which ``a_b`` is the acceleration, ``m (u'' + a_b) + forces = 0``: the
base acts as the force ``-m a_b``. Without a mass that the model gives, all is per unit mass.
"""

from dataclasses import replace

import numpy as np

from study.records.completion import consistent, derivative
from study.records.record import MOTIONS, SI_UNITS, Record
from study.support.arrays import Floats
from study.support.errors import StudyError, at, expect
from study.support.units import parse_unit

BASE = tuple(f"base_{motion}" for motion in MOTIONS)
SAID = "the base moves: its acceleration, the other way round, is the force"
PER_MASS = "all coefficients are per unit mass (give the inertia in the model for those of the structure)"


def on_a_moving_base(record: Record) -> bool:
    """Whether the base was measured and no force."""
    return not np.any(record["force"]) and any(channel in record for channel in BASE)


def relative_to_base(record: Record, mass: float | None, absolute: bool) -> tuple[Record, tuple[str, ...]]:
    """The record with the force of the base, and motions relative to it; and sentences on that.

    Parameters
    ----------
    record : Record
        With one or more of the channels ``base_displacement``, ``base_velocity``, ``base_acceleration``.
    mass : float or None
        That the model gives; None for coefficients per unit mass.
    absolute : bool
        Whether the response was measured absolutely: the base's own motion is then subtracted.

    Raises
    ------
    StudyError
        If the base's motion that has to be subtracted was not measured, or a unit is none of it.
    """
    record, notes = consistent(record)
    length = record.units["displacement"]
    base = {motion: _converted(record, motion, length) for motion in MOTIONS if f"base_{motion}" in record}
    known = next(motion for motion in reversed(MOTIONS) if motion in base)
    order = MOTIONS.index("acceleration") - MOTIONS.index(known)
    acceleration = base[known] if order == 0 else derivative(base[known], record.dt, order)
    base["acceleration"] = acceleration
    channels = {"force": -(1.0 if mass is None else mass) * acceleration}
    said = [*notes, SAID if mass is not None else f"{SAID}, and {PER_MASS}"]
    if absolute:
        for motion in (m for m in MOTIONS if m in record):
            if motion not in base:
                raise StudyError(
                    f"{record.name}: the {motion} is absolute and the base's was not measured; expected a column "
                    f"base_{motion}, or the response relative to the base"
                )
            channels[motion] = record[motion] - base[motion]
        said.append("the response is taken relative to the base")
    unit = f"{length}/s^2" if mass is None else "N" if length == "m" else f"kg {length}/s^2"
    kept = {c: v for c, v in record.channels.items() if c not in BASE}
    units = {**record.units, "force": unit}
    return replace(record, channels={**kept, **channels}, units=units), tuple(said)


def _converted(record: Record, motion: str, length: str) -> Floats:
    """A motion of the base in the unit of the response's."""
    channel = f"base_{motion}"
    text = record.units.get(channel) or SI_UNITS[motion]
    wanted = (length, f"{length}/s", f"{length}/s^2")[MOTIONS.index(motion)]
    with at(f"{record.name}: {channel}"):
        unit, target = parse_unit(text), parse_unit(wanted)
        expect(
            unit.powers == target.powers, f"{text!r} is no unit of {motion}; expected {SI_UNITS[motion]} or the like"
        )
    return record[channel] * (unit.factor / target.factor)
