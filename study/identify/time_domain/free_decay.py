"""Where the fit of a structure begins that nothing drives: its linear terms from the motion itself.

``M a + C v + K u = 0`` along the measured motions, with the masses held: without a force nothing else tells their size.
The equation stands for motions that all have passed one filter: those frequencies are left out where the motions do not
stand above their noise, which two derivatives would make larger than any force.
"""

from collections.abc import Mapping

import numpy as np

from study.equations.linear_part import linear_keys, patterns
from study.equations.model import Model
from study.records.noise_floor import band_above_noise, in_band
from study.records.plan import SHORTEST_PART
from study.records.prepared import Prepared
from study.support.arrays import Floats, Ints
from study.support.errors import StudyError, expect
from study.support.least_squares import least_squares


def free_decay_start(model: Model, prepared: Prepared, held: Mapping[str, float]) -> dict[str, float]:
    """Linear coefficients that are not held, by least squares along the fitting part.

    Raises
    ------
    StudyError
        If a mass is open, or a coordinate is not measured.
    """
    orders, own = linear_keys(model), patterns(model)
    free = [key for key in orders if key not in held]
    if not free:
        return {}
    open_masses = ", ".join(key for key in free if orders[key] == 2)
    sentence = f"nothing drives {model.name!r}: its motion says nothing of {open_masses}; expected a value for each"
    expect(not open_masses, sentence)
    lacking = ", ".join(c for c in model.coordinates if c not in prepared.coordinates)
    if lacking:
        raise StudyError(
            f"nothing drives {model.name!r} and no sensor is at {lacking}; expected one at each coordinate"
        )
    motion = _free_of_noise(prepared, model)
    weight = 1.0 / np.std(motion[2], axis=1)
    columns = {key: ((own[key] @ motion[orders[key]]) * weight[:, None]).ravel() for key in orders}
    target = -np.sum([held[key] * columns[key] for key in orders if key in held], axis=0)
    amounts = least_squares(np.column_stack([columns[key] for key in free]), target)
    return dict(zip(free, amounts.tolist(), strict=True))


def _free_of_noise(prepared: Prepared, model: Model) -> Floats:
    """Motions along the fitting part in the band where any of them stands above noise, shape (3, n, samples)."""
    record = prepared.record.stretches[0].source if prepared.record.stretches else prepared.record
    bands = [band_above_noise(record[s], prepared.dt, prepared.band[0]) for s in prepared.sensors]
    known = [band for band in bands if band is not None]
    edge, motion = prepared.edge, np.stack([record.motion(c) for c in model.coordinates], axis=1)
    if known:
        frequency, gate = known[0][0], np.max([band[1] for band in known], axis=0)
        motion = np.apply_along_axis(in_band, 2, motion, prepared.dt, frequency, gate)
        width = float(np.sum(gate)) * float(frequency[1] - frequency[0])
        edge += round(1.0 / (width * prepared.dt)) if width > 0.0 else 0
    return motion[:, :, _fitted_samples(prepared, len(record), edge)]


def _fitted_samples(prepared: Prepared, whole: int, edge: int) -> Ints:
    """Samples of the whole record that are fitted, without those at its ends."""
    samples = np.arange(len(prepared.record))
    if prepared.record.stretches:
        samples = np.concatenate([np.arange(s.first, s.last) for s in prepared.record.stretches])
    last = whole - edge
    fitted = samples[slice(*prepared.plan.fit)]
    kept = fitted[(fitted >= edge) & (fitted < last)]
    return kept if len(kept) > SHORTEST_PART else fitted
