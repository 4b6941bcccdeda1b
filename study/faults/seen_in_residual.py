"""What no physics imitates, or hardly: drift, hum and spikes, as they stand out of what a model leaves.

A force that is missing acts on the structure at all frequencies below its resonance alike; an instrument that drifts
adds its own at the slowest. Hum is a line that the structure did not pass on. A force of one frequency would leave the
same line: what tells them apart is the frequency, that of the mains or one of its multiples, as the sampling shows it;
or a force beyond reason that the line would ask for. Spikes are single samples that differ from their neighbours as no
motion does.
"""

import numpy as np
from scipy.fft import dct, idct, rfft
from scipy.special import fdtrc, stdtr

from study.faults.fault import DRIFT, HUM, SPIKES, Fault
from study.faults.leftover import Columns, SensorResidual, share
from study.identify.time_domain.part_fit import run_of
from study.records.prepared import Prepared
from study.records.record import Sensor
from study.support.arrays import Bools, Floats, Ints
from study.support.thresholds import ALPHA, TOLERANCE

SLOWEST, NEXT = 8, 32  # cosines, of half a period each more than the one before, that are held against the next
ENOUGH_SAMPLES = 256  # to show both
HARMONICS = tuple(sorted(n * mains for n in range(1, 7) for mains in (50.0, 60.0)))  # of the mains, in hertz
WANDER = 1e-3  # share by which the mains' frequency wanders
LINES_BESIDE = 24  # lines on either side that a line is held against
NEAREST = 3  # of them, left out: a line between two shows in its neighbours
DRIFTING = 12  # lines from zero that are drift, not hum
SAMPLES_BESIDE = 8  # on either side, that tell how much a sample differs from its own two neighbours
SPIKE_ROUNDS = 4  # of looking again beside what was found: a spike hides a smaller one near it


def drift(left: SensorResidual, asked: int) -> Fault | None:
    """A drift of the response, None where the slowest lines hold no more than those beside them.

    The F test of both groups of lines, of which a smooth spectrum makes independent numbers of one variance.
    """
    places, residual = _in_time(left)
    found = _slow_lines(residual, asked)
    if found is None:
        return None
    count, noise = found
    lines = np.asarray(dct(residual, norm="ortho"), dtype=np.float64)
    power = max(float(np.sum(lines[1 : count + 1] ** 2)) - count * noise, 0.0) / len(residual)
    if power <= (TOLERANCE * left.size) ** 2:
        return None
    waveform = slow_part(left, count)
    explained = 1.0 - float(np.sum((residual - waveform[places]) ** 2) / np.sum(residual**2))
    error = float(np.sqrt(noise / len(residual)))
    return Fault(DRIFT, left.channel, float(np.sqrt(power)), error, left.unit, explained, waveform)


def slow_response(prepared: Prepared, channel: str, asked: int) -> Fault | None:
    """The slowest lines of a response itself, where they hold more than those beside them and those of no force do.

    A drift larger than the motion takes the coefficients with it: a mass almost without a spring follows any ramp. What
    is said of it here, the mean included, is no more than where a fit that does not follow it may begin.
    """
    places = np.unique(np.concatenate([np.arange(*span) for span in (prepared.plan.fit, prepared.plan.judge)]))
    values, *forces = (prepared.record[name][places] for name in (channel, *prepared.record.forces))
    if _slow_lines(values, asked) is None or any(_slow_lines(force, asked) is not None for force in forces):
        return None
    waveform = _slow(places, values, SLOWEST, len(prepared.record)) + np.mean(values)
    return Fault(DRIFT, channel, float(np.std(waveform)), waveform=waveform)


def mean_response(prepared: Prepared, channel: str) -> Fault:
    """The mean of a response, where a fit that cannot follow it may begin; as a drift that stays the same."""
    values, plan = prepared.record[channel], prepared.plan
    mean = float(np.mean(np.concatenate([values[slice(*plan.fit)], values[slice(*plan.judge)]])))
    return Fault(DRIFT, channel, mean, waveform=np.full(len(prepared.record), mean))


def _slow_lines(values: Floats, asked: int) -> tuple[int, float] | None:
    """How many of the slowest lines stand above the next, and the mean power of these; None without any."""
    if len(values) < ENOUGH_SAMPLES:
        return None
    lines = np.asarray(dct(values, norm="ortho"), dtype=np.float64)
    if _p_value(lines, 1, SLOWEST, NEXT) * asked >= ALPHA:
        return None
    count = SLOWEST  # doubled while their faster half stands above those after it
    while 4 * count < len(lines) // 8 and _p_value(lines, count // 2 + 1, count, 2 * count) < ALPHA:
        count *= 2
    return count, float(np.mean(lines[count + 1 : 3 * count + SLOWEST + 1] ** 2))


def slow_part(left: SensorResidual, count: int) -> Floats:
    """The ``count`` slowest cosines of a residual along the whole record, without their mean, shape (n,)."""
    return _slow(*_in_time(left), count, len(left.prepared.record))


def _slow(places: Ints, values: Floats, count: int, length: int) -> Floats:
    """The slowest cosines of values at these places; a straight line bridges what lies between the parts."""
    first, last = int(places[0]), int(places[-1])
    lines = np.asarray(dct(np.interp(np.arange(first, last + 1), places, values), norm="ortho"), dtype=np.float64)
    lines[0], lines[count + 1 :] = 0.0, 0.0
    return np.pad(np.asarray(idct(lines, norm="ortho"), dtype=np.float64), (first, length - 1 - last), "edge")


def _in_time(left: SensorResidual) -> tuple[Ints, Floats]:
    """Places and residual of both parts in the order of time."""
    places = np.concatenate(left.samples)
    order = np.argsort(places)
    return places[order], left.both[order]


def _p_value(lines: Floats, first: int, last: int, beside: int) -> float:
    """Of the mean power of lines ``first`` to ``last`` over that of the ``beside`` after them."""
    own, next_to = lines[first : last + 1] ** 2, lines[last + 1 : last + 1 + beside] ** 2
    level = float(np.mean(next_to))
    return float(fdtrc(len(own), len(next_to), float(np.mean(own)) / level)) if level > 0.0 else 1.0


def hum(left: SensorResidual, asked: int) -> Fault | None:
    """The strongest line of the residual, None where none stands out of its neighbours by more than chance."""
    frequency = _strongest_line(left, ALPHA / asked)
    if frequency is None:
        return None
    frequency = _refined(frequency, left)
    found = share(left.whole, left.stacked(line(frequency, left)))
    if found is None or not found.significant(asked):
        return None
    amplitude = float(np.hypot(*found.amounts))
    direction = found.amounts / amplitude
    error = float(np.sqrt(max(direction @ found.covariance @ direction, 0.0)))
    turn = 2.0 * np.pi * frequency * left.prepared.dt * np.arange(len(left.prepared.record))
    waveform = found.amounts[0] * np.cos(turn) + found.amounts[1] * np.sin(turn)
    return Fault(HUM, left.channel, amplitude, error, left.unit, found.gain.explained, waveform, frequency=frequency)


def is_of_the_mains(frequency: float, left: SensorResidual) -> bool:
    """Whether a frequency is that of the mains or a multiple, or what the sampling makes of these, to a line."""
    dt = left.prepared.dt
    resolution = 1.0 / (dt * len(left.both))
    for true in HARMONICS:
        seen = abs((true * dt + 0.5) % 1.0 - 0.5) / dt
        if abs(frequency - seen) < max(resolution, WANDER * true if seen == true else 0.0):
            return True
    return False


def line(frequency: float, left: SensorResidual) -> Columns:
    """Cosine and sine on both parts."""
    turns = [2.0 * np.pi * frequency * left.prepared.dt * places for places in left.samples]
    first, second = (np.column_stack([np.cos(turn), np.sin(turn)]) for turn in turns)
    return first, second


def _strongest_line(left: SensorResidual, level: float) -> float | None:
    """Frequency in hertz of the line that stands highest over its neighbours, by the F test of all lines."""
    residual = left.both
    n = len(residual)
    power = np.abs(np.asarray(rfft(residual * np.hanning(n)))) ** 2
    if len(power) < 4 * LINES_BESIDE:
        return None
    kernel = np.ones(2 * LINES_BESIDE + 1)
    kernel[LINES_BESIDE - NEAREST : LINES_BESIDE + NEAREST + 1] = 0.0
    count = np.convolve(np.ones_like(power), kernel, "same")
    level_beside = np.convolve(power, kernel, "same") / count
    ratio = power / np.maximum(level_beside, np.finfo(float).tiny)
    ratio[:DRIFTING] = 0.0
    ratio[-2:] = 0.0
    best = int(np.argmax(ratio))
    # A taper lets neighbours share power: of the lines beside, about half are independent.
    p_value = float(fdtrc(2.0, float(count[best]), float(ratio[best]))) * len(power)
    return best / (n * left.prepared.dt) if p_value < level else None


def _refined(frequency: float, left: SensorResidual) -> float:
    """The frequency at which the line takes most of both parts, within a line to either side."""
    resolution = 1.0 / (left.prepared.dt * len(left.both))
    places, residual = np.concatenate(left.samples), left.both
    taper = np.hanning(len(residual))
    for width in (1.0, 0.2, 0.04, 0.008):
        tried = frequency + width * resolution * np.linspace(-1.0, 1.0, 11)
        turns = np.exp(-2j * np.pi * left.prepared.dt * np.outer(tried, places))
        frequency = float(tried[int(np.argmax(np.abs(turns @ (taper * residual))))])
    return frequency


def spikes(left: SensorResidual, asked: int) -> Fault | None:
    """Spikes on both parts of the record, None without any."""
    lost = np.zeros(len(left.prepared.record), dtype=bool)
    for span, residual, reversed_ in zip(left.whole.spans, left.residual, _reversals(left), strict=True):
        known = (left.kept(span) > 0.0) & ~reversed_
        lost[slice(*span)] = _isolated(residual, known, ALPHA / asked)
    if not np.any(lost):
        return None
    power, places = left.both**2, np.concatenate(left.samples)
    explained = float(np.sum(power[lost[places]]) / np.sum(power))
    if explained * float(np.mean(power)) <= (TOLERANCE * left.size) ** 2:
        return None
    count = float(np.mean(lost[places]))
    beside = lost | np.roll(lost, 1) | np.roll(lost, -1)  # another spike there could not be told from this one
    error = float(np.sqrt(count / len(places)))  # of a count: small ones cannot be told from noise
    return Fault(SPIKES, left.channel, count, error, "1", explained, lost=beside)


def _reversals(left: SensorResidual) -> tuple[Bools, Bools]:
    """Samples beside which dry friction makes the acceleration jump, on both parts; none of another response.

    An error of the model moves such a jump past a sample, which then stands alone as a spike does.
    """
    fit, run = left.whole.fit, left.whole.run
    rough = [e.place for e in fit.model.terms if any("sgn(v)" in c.shape for c in e.term.components)]
    if left.sensor.motion != "acceleration" or not rough:
        return np.zeros(len(left.residual[0]), bool), np.zeros(len(left.residual[1]), bool)
    velocities = [Sensor(coordinate, "velocity") for coordinate in fit.model.coordinates]
    directions = np.column_stack([place.direction(fit.model.coordinates) for place in rough])
    fitted = run_of(fit, left.prepared, sensors=velocities).respond({}, fit.initial)[0]
    return _turning(fitted @ directions), _turning(run.motions(velocities) @ directions)


def _turning(velocity: Floats) -> Bools:
    """Samples on either side of a change of sign of any velocity, shapes (n, places) and (n,).

    What rounding leaves of a velocity that friction holds is none: it would hide where the rest begins.
    """
    held = np.abs(velocity) <= np.finfo(float).eps * np.max(np.abs(velocity), axis=0)
    turns = np.any(np.diff(np.where(held, 0.0, np.sign(velocity)), axis=0) != 0.0, axis=1)
    return np.concatenate([turns, [False]]) | np.concatenate([[False], turns])


def _isolated(residual: Floats, known: Bools, level: float) -> Bools:
    """Samples that differ from the mean of their neighbours by more than chance, and stand alone with it, shape (n,).

    The bend ``r_i - (r_(i-1) + r_(i+1)) / 2`` of a sample is compared with the bends near it, and with those of the
    whole residual: Student's t for the number of these, all samples asked for. A spike bends its neighbours half as
    much the other way, a jump or a kink of a motion does not. Where most of what stands out does that, all of it counts
    as spikes, for two may be neighbours.
    """
    found = np.zeros(len(residual), dtype=bool)
    if len(residual) < 4 * SAMPLES_BESIDE:
        return found
    for _ in range(SPIKE_ROUNDS):
        usable = known & ~found
        whole = usable & np.roll(usable, 1) & np.roll(usable, -1)
        whole[[0, -1]] = False
        bend = np.where(whole, residual - 0.5 * (np.roll(residual, 1) + np.roll(residual, -1)), 0.0)
        spread, freedom = _spread(bend, whole)
        t = np.abs(bend) / spread
        peak = (t >= np.roll(t, 1)) & (t >= np.roll(t, -1)) & whole
        new = peak & (2.0 * stdtr(freedom, -t) * len(residual) < level)
        if not np.any(found) and 2 * np.count_nonzero(new & _single(bend)) <= np.count_nonzero(new):
            break
        if not np.any(new):
            break
        found |= new
    return found


def _single(bend: Floats) -> Bools:
    """Where both neighbours bend the other way, by half as much give or take the half of that, shape (n,)."""
    size = np.where(bend == 0.0, np.inf, bend)
    sides = [np.roll(bend, shift) / size for shift in (1, -1)]
    return np.all([(side > -0.75) & (side < -0.25) for side in sides], axis=0)


def _spread(bend: Floats, whole: Bools) -> tuple[Floats, Floats]:
    """Standard deviation of the bends about each sample, the nearest two left out, and their number, shapes (n,)."""
    kernel = np.ones(2 * SAMPLES_BESIDE + 1)
    kernel[SAMPLES_BESIDE - 2 : SAMPLES_BESIDE + 3] = 0.0
    middle = 1.4826 * float(np.median(np.abs(bend[whole]))) if np.any(whole) else 0.0
    near = np.clip(np.abs(bend), 0.0, 5.0 * middle) if middle > 0.0 else bend  # another spike nearby is no measure
    count = np.convolve(whole, kernel, "same")
    local = np.sqrt(np.convolve(near**2 * whole, kernel, "same") / np.maximum(count, 1.0))
    spread = np.maximum(np.maximum(local, middle), np.finfo(float).tiny)
    return spread, np.maximum(count, 2.0)
