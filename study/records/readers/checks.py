"""What a channel must not be: with gaps, constant, saturated; unevenly sampled; force and response exchanged."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from study.records.record import MOTIONS, Record, Sensor
from study.records.spectra import Segments, cross_spectra
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError, expect
from study.support.numbers import LARGEST, LAST_DIGITS, SMALLEST

FEWEST_SAMPLES = 16
SHORTEST, LONGEST = 1e-15, 1e15  # seconds between samples
FEWEST_CLIPPED = 10  # samples at the very same extreme value ...
CLIPPED_SHARE = 1e-3  # ... and this share of the record ...
CLIPPED_RATIO = 10.0  # ... and this many times as many as at the values next to it: then it is clipped
FEWEST_VALUES = 20  # with fewer different values it is a switched signal, not a clipped one
JITTER = 0.01  # of the sampling interval: what is uneven by less is even, and what is off by less is the same
COARSEST_ROUNDING = 0.4  # of the sampling interval: of printed times that still show a lost sample
CONTENT = 1e-6  # of its maximum: autospectra below are leakage
COHERENT = 0.3  # lines less coherent than this say little
FEWEST_COHERENT = 8  # lines
BETTER = 0.7  # the swapped reading must miss by less than this share of what the given one misses by


def not_finite(values: Floats, place: Callable[[int], str]) -> str | None:
    """A sentence on the first sample without a number."""
    bad = np.flatnonzero(~np.isfinite(values))
    if not len(bad):
        return None
    value = "no number" if np.isnan(values[bad[0]]) else "an infinite value"
    more = f" and {len(bad) - 1} more" if len(bad) > 1 else ""
    first = place(int(bad[0]))
    return f"has {value} in {first}{more}; fill the gap, or cut it away by 'samples: [first, last]' in its .record.yaml"


def beyond(values: Floats, place: Callable[[int], str]) -> str | None:
    """A sentence on a number of a size that no unit makes: its square, or its derivatives', may be no number."""
    size = np.abs(values)
    large = np.flatnonzero(size > LARGEST)
    if len(large):
        return f"holds {values[large[0]]:g} in {place(int(large[0]))}; expected numbers below {LARGEST:g}"
    if 0.0 < float(np.ptp(values)) < SMALLEST:
        return f"moves by {np.ptp(values):g} alone; expected a signal of more than {SMALLEST:g} in its unit"
    return None


def constant(values: Floats) -> str | None:
    """A sentence on a channel that does not move."""
    if np.ptp(values) > 0.0:
        return None
    return f"is {values[0] + 0.0:g} throughout; expected a signal that moves"


def change_after(values: Floats, period: int) -> float:
    """Rms of the change of a channel after so many samples over its own standard deviation; 0 in a single period."""
    later, size = values[period:] - values[: len(values) - period], float(np.std(values))
    return float(np.sqrt(np.mean(later**2))) / size if len(later) and size > 0.0 else 0.0


def saturated(values: Floats) -> str | None:
    """A sentence on a channel that rests at its highest or lowest value.

    A signal passes its extreme once, a coarsely digitised one a few times more often than the values next
    to it. A clipped one rests there. Signals of a few values (square waves, steps) and a lowest or highest
    value of zero (blows of a hammer) are no sign of clipping.
    """
    for extreme, side in ((float(np.max(values)), "highest"), (float(np.min(values)), "lowest")):
        count = int(np.count_nonzero(values == extreme))
        if extreme == 0.0 or count < max(FEWEST_CLIPPED, CLIPPED_SHARE * len(values)):
            continue
        below = np.rint(
            np.abs(values - extreme) / (LAST_DIGITS * np.ptp(values))
        )  # 0 at the extreme, whole numbers elsewhere
        different, times = np.unique(below, return_counts=True)
        if len(different) < FEWEST_VALUES:
            continue
        near = (different > 0.0) & (different <= 0.05 / LAST_DIGITS)  # of the range: the values next to the extreme
        usual = float(np.mean(times[near])) if near.any() else float(np.median(times))
        if count > CLIPPED_RATIO * usual and not _comes_to_rest(values, extreme):
            return (
                f"rests at its {side} value {extreme:g} for {count} of {len(values)} samples, as a saturated channel "
                "does; expected a wider measuring range (or --accept-saturated, 'accept_saturated: true' beside "
                "the file, if the signal is like that)"
            )
    return None


def _comes_to_rest(values: Floats, extreme: float) -> bool:
    """Whether a digitised motion slows down to rest at its extreme, as an axis does at the end of its moves.

    It comes there and leaves by the smallest step of its converter every time. What is clipped is cut off at the speed
    that it has, of many steps a sample; where the whole motion has no more than a step or two nothing can be told.
    """
    change = np.abs(np.diff(values))
    moving = change[change > LAST_DIGITS * float(np.ptp(values))]
    there = values == extreme
    edges = change[there[1:] != there[:-1]]
    step = float(np.min(moving, initial=np.inf))
    fast = float(np.mean(moving)) > CLIPPED_RATIO * step if len(moving) else False
    return bool(fast and len(edges) and np.all(edges < 1.5 * step))


def even_interval(path: Path, time: Floats, place: Callable[[int], str]) -> tuple[float, float]:
    """Sampling interval and first time in seconds; ``place`` says where in the file a sample stands.

    The interval is the shortest decimal (of itself or of its inverse) that the times allow; times that lie exactly on
    a grid are met to the last bit. They may leave it by 1 % of the interval, or by what the decimals that they are
    printed with explain.
    """
    steps = np.diff(time)
    mean = float(time[-1] - time[0]) / (len(time) - 1)
    back = int(np.argmax(steps <= 0.0))
    fault = "stands still" if steps[back] == 0.0 else "runs backwards"
    times = f"{time[back]:.9g} s, then {time[back + 1]:.9g} s"
    expect(steps[back] > 0.0, f"{path}: time {fault} in {place(back + 1)} ({times}); expected times that grow")
    grid = np.arange(len(time), dtype=np.float64)
    away = 0.5 * float(np.ptp(time - mean * grid))  # from the line that lies in the middle
    rounding = _rounding(time)
    allowed = max(JITTER * mean, min(rounding, COARSEST_ROUNDING * mean))
    if away > allowed:  # both ends may be off
        mean, away = _nearest_line(time, mean, away)
    if away > allowed:
        usual, widest = float(np.median(steps)), int(np.argmax(steps))
        worst = int(np.argmax(np.abs(steps - usual)))
        how = f"sampling is uneven ({usual:.6g} s usually, {steps[worst]:.6g} s before {place(worst + 1)})"
        if steps[widest] > 1.5 * usual:
            gap = f"{steps[widest]:.6g} s instead of {usual:.6g} s"
            how = f"a gap of {gap} follows the time {time[widest]:.9g} s, before {place(widest + 1)}"
        raise StudyError(f"{path}: {how}; expected even sampling (within 1 % of the interval)")
    exact = next((dt for dt in _candidates(mean) if np.array_equal(time[0] + dt * grid, time)), None)
    if exact is not None:
        return exact, float(time[0])
    slack = (2.0 * away + rounding) / (len(time) - 1)
    return shortest_decimal(mean, slack), float(time[0])


def _nearest_line(time: Floats, slope: float, away: float) -> tuple[float, float]:
    """Slope of the line that times by their number leave least at most, and how far they do; begun at one beside it.

    How far they do is convex in the slope, and a line that leaves them by no more has about that slope.
    """
    from scipy.optimize import minimize_scalar

    grid, reach = np.arange(len(time), dtype=np.float64), 4.0 * away / (len(time) - 1)
    found: Any = minimize_scalar(
        lambda tried: 0.5 * float(np.ptp(time - tried * grid)), bounds=(slope - reach, slope + reach), method="bounded",
        options={"xatol": 1e-6 * reach},
    )  # fmt: skip
    return float(found.x), float(found.fun)


def shortest_decimal(interval: float, slack: float) -> float:
    """The interval that a rounded one stands for: of those within ``slack``, the fewest digits (or of its inverse)."""
    return next((dt for dt in _decimals(interval) if abs(dt - interval) <= slack), interval)


def _rounding(time: Floats) -> float:
    """The last decimal place that the times are printed with, as a number of seconds."""
    largest = float(np.max(np.abs(time)))
    sample = time[:: max(1, len(time) // 1000)]
    for digits in range(10):
        scaled = sample * 10.0**digits
        if np.all(np.abs(scaled - np.rint(scaled)) <= 4.0 * np.spacing(largest * 10.0**digits)):
            return 10.0**-digits
    return 0.0


def _candidates(mean: float) -> Iterator[float]:
    """Intervals that the times may have been made with, the likeliest first."""
    yield from _decimals(mean)
    yield mean
    below = above = mean
    for _ in range(8):
        below, above = math.nextafter(below, 0.0), math.nextafter(above, math.inf)
        yield below
        yield above


def _decimals(interval: float) -> Iterator[float]:
    for digits in range(16):
        yield float(f"{interval:.{digits}e}")
        yield 1.0 / float(f"{1.0 / interval:.{digits}e}")


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
    lines = _lines(record)
    if lines is None:
        return None
    given, swapped = lines.fit(), lines.swapped()
    if _is_mechanical(given) or not _is_mechanical(swapped) or swapped.error > BETTER * given.error:
        return None
    if swapped.mass * lines.omega.max() ** 2 < abs(swapped.stiffness):  # a spring alone fits too much
        return None
    force, named = record.forces[0], str(lines.sensor).replace(" ", ".")
    return (
        f"{force} and {lines.sensor} seem to be swapped: read the other way round, their ratio is that of a mass on a "
        f"spring to within {100.0 * swapped.error:.0f} %, as given it misses by {100.0 * given.error:.0f} % (mass "
        f"{given.mass:.3g}, damping {given.damping:.3g}); expected --column {force}=... --column {named}=... "
        "with the names exchanged (or --accept-swapped, 'accept_swapped: true' beside the file, if the record is like "
        "that)"
    )


def suspect_sign(record: Record) -> str | None:
    """A sentence if the force seems to have the wrong sign: read with the other one it drives a mass on a spring.

    Told as in :func:`suspect_swapped`; doubted only where mass, damping and stiffness all come out negative.
    """
    lines = _lines(record)
    given = None if lines is None else lines.fit()
    if given is None or max(given.mass, given.damping, given.stiffness) >= 0.0 or given.error > BETTER:
        return None
    force = record.forces[0]
    return (
        f"the sign of {force} seems to be wrong: as given it asks for a negative mass, damping and stiffness, with the "
        f"other sign all are positive (--scale {force}=-1 turns it round)"
    )


@dataclass(frozen=True, eq=False)
class _Lines:
    """Force over displacement, line by line, as far as force and motion are coherent."""

    sensor: Sensor
    omega: Floats
    ratio: Complexes  # of force over this motion, of the same size as motion over force
    turn: Complexes  # from this motion to what it is the derivative of
    weight: Floats

    def fit(self) -> _Fit:
        return _fit(self.omega, self.ratio * self.turn, self.weight)

    def swapped(self) -> _Fit:
        return _fit(self.omega, self.turn / self.ratio, self.weight)


def _lines(record: Record) -> _Lines | None:
    """None where a record is too short or too incoherent to tell."""
    (force,), sensor = record.forces, next(s for m in MOTIONS if (s := Sensor(record.coordinates[0], m)) in record)
    length = min(1024, len(record) // 8)  # 500 lines are plenty for three coefficients
    if length < 4 * FEWEST_COHERENT:
        return None
    matrix = cross_spectra([record[force], record[sensor]], record.dt, Segments(length))
    g, frequency = matrix.density, matrix.frequency
    drive, response, cross = g[:, 0, 0].real, g[:, 1, 1].real, g[:, 1, 0]
    weight = np.abs(cross) ** 2 / np.maximum(drive * response, np.finfo(float).tiny)
    keep = (weight > COHERENT) & (drive > CONTENT * drive.max()) & (response > CONTENT * response.max())
    keep[:2] = False  # offset and drift
    if np.count_nonzero(keep) < FEWEST_COHERENT:
        return None
    omega = 2.0 * np.pi * frequency[keep]
    ratio = np.sqrt(drive[keep] / response[keep]) * cross[keep] / np.abs(cross[keep])
    turn = np.asarray((1j * omega) ** MOTIONS.index(sensor.motion), dtype=np.complex128)
    return _Lines(sensor, omega, ratio, turn, weight[keep])


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
