"""Force and response in each other's place: what physics says about a record that is read the wrong way round."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.records.record import MOTIONS, Record, Sensor
from study.records.spectra import Segments, cross_spectra

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
AVERAGES = 16  # segments, at least
LONGEST = 1024  # samples in a segment: 500 lines are plenty for three coefficients
CONTENT = 1e-6  # of its maximum: autospectra below are leakage
COHERENT = 0.3  # lines less coherent than this say little
FEWEST_LINES = 8
BETTER = 0.7  # the swapped reading must miss by less than this share of what the given one misses by


@dataclass(frozen=True)
class _Fit:
    """Mass, damping and stiffness that come nearest to a reverse frequency response function."""

    mass: float
    damping: float
    stiffness: float
    error: float  # rms of the relative difference, weighted by coherence


def suspect_swapped(record: Record) -> str | None:
    """A sentence if force and response seem to stand in each other's place.

    The reverse function A_1(f) = force over displacement of anything with a mass is k - (2 pi f)^2 m + j 2 pi f c,
    (4.25) of the report: it grows as f^2 above resonance, the response lags, and m and c are above zero. The
    record is read both ways, and suspected if only the other reading comes out so. What has no spring (force over
    acceleration a constant) looks the same both ways.
    The measured motion nearest to displacement is used. A record that is too short, or whose band holds no resonance
    and no mass, cannot tell.
    """
    (force,), sensor = record.forces, next(s for m in MOTIONS if (s := Sensor(record.coordinates[0], m)) in record)
    length = min(LONGEST, 2 * len(record) // AVERAGES)
    if length < 4 * FEWEST_LINES:
        return None
    matrix = cross_spectra([record[force], record[sensor]], record.dt, Segments(length))
    g, frequency = matrix.density, matrix.frequency
    drive, response, cross = g[:, 0, 0].real, g[:, 1, 1].real, g[:, 1, 0]
    weight = np.abs(cross) ** 2 / np.maximum(drive * response, np.finfo(float).tiny)
    keep = (weight > COHERENT) & (drive > CONTENT * drive.max()) & (response > CONTENT * response.max())
    keep[:2] = False  # offset and drift
    if np.count_nonzero(keep) < FEWEST_LINES:
        return None
    omega, weight = 2.0 * np.pi * frequency[keep], weight[keep]
    turn = (1j * omega) ** MOTIONS.index(sensor.motion)  # from this motion to what it is the derivative of
    ratio = np.sqrt(drive[keep] / response[keep]) * cross[keep] / np.abs(cross[keep])  # the same for both readings
    given = _fit(omega, ratio * turn, weight)
    swapped = _fit(omega, turn / ratio, weight)
    if _is_mechanical(given) or not _is_mechanical(swapped) or swapped.error > BETTER * given.error:
        return None
    if swapped.mass * omega.max() ** 2 < abs(swapped.stiffness):  # a spring alone fits too much
        return None
    named = str(sensor).replace(" ", ".")
    return (
        f"{force} and {sensor} seem to be swapped: read the other way round, their ratio is that of a mass on a spring "
        f"to within {100.0 * swapped.error:.0f} %, as given it misses by {100.0 * given.error:.0f} % (mass "
        f"{given.mass:.3g}, damping {given.damping:.3g}); expected --column {force}=... --column {named}=... "
        "with the names exchanged (or --accept-swapped, 'accept_swapped: true' beside the file, if the record is like "
        "that)"
    )


def _is_mechanical(fit: _Fit) -> bool:
    return fit.mass > 0.0 and fit.damping > 0.0


def _fit(omega: Floats, ratio: Complexes, weight: Floats) -> _Fit:
    """Weighted least squares of the relative difference, real coefficients."""
    scale = omega.max()
    x = omega / scale
    powers = np.stack([-(x**2), 1j * x, np.ones_like(x)], axis=1)
    rows = powers * (np.sqrt(weight) / np.abs(ratio))[:, None]
    target = np.sqrt(weight) * ratio / np.abs(ratio)
    stacked, goal = np.concatenate([rows.real, rows.imag]), np.concatenate([target.real, target.imag])
    parameters = np.linalg.lstsq(stacked, goal, rcond=None)[0]
    error = float(np.sqrt(np.sum((stacked @ parameters - goal) ** 2) / np.sum(weight)))
    mass, damping, stiffness = (float(value) for value in parameters / [scale**2, scale, 1.0])
    return _Fit(mass, damping, stiffness, error)
