"""Records sampled more finely than their motion asks for, or too coarsely.

Of the first some of the samples are used, behind a low-pass filter.

What lies above the highest frequency at which the measured motion stands above its noise is noise. A filter whose power
and that of its image add up to one leaves white noise white, so that the samples that are kept hold as much of every
coefficient as all of them did, with standard errors that are as true.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.fft import irfft, rfft, rfftfreq
from scipy.special import gammaincc

from study.records.completion import NEAR_END, CompletedRecord, with_continuations
from study.records.interpolation import BAND_LIMITED, closes
from study.records.plan import Plan
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Record, Sensor
from study.records.spectra import Segments, autospectrum, segment_length
from study.support.arrays import Floats
from study.support.errors import expect
from study.support.thresholds import ALPHA

ORDER = 3  # products of the motion up to this order do not fold into its band: those of most library terms' forces
BIAS = 0.1  # standard errors by which what is left out may shift a coefficient
JUMP = 2.0  # power of the frequency with which the density of an acceleration that jumps falls
LEAST_SAMPLES = 512  # in either part: what a segment of the spectra takes
TOO_COARSE = 2.0 / 3.0  # of the power above half the Nyquist frequency: of white noise half of it is there
PASSED = 2.0 / 3.0  # of the new Nyquist frequency, and its mirror image 4/3: where the filter falls


def without_spare_samples(prepared: Prepared) -> Prepared:
    """The record without the samples that its motion does not ask for; itself where it asks for all.

    A record of stretches is left as it is (:func:`completed_without_spare` comes before these are strung together), as
    are one with lost samples, which a filter would spread, a prescribed motion, whose kinks count, and a free decay,
    which tells most at its very beginning.
    """
    if prepared.record.stretches or prepared.lost is not None or prepared.response == FORCE or prepared.free:
        return prepared
    parts = prepared.plan.fit, prepared.plan.judge
    factor = spare_factor([prepared.record], min(b - a for a, b in parts))
    if factor == 1:
        return prepared
    record = decimated(prepared.record, factor)
    fit, judge = ((-(-a // factor), -(-b // factor)) for a, b in parts)
    lost = np.ones(len(record), dtype=np.bool_)
    lost[NEAR_END:-NEAR_END] = False
    return replace(
        prepared, record=record, plan=Plan(prepared.plan.response, fit, judge), band=_band(prepared.band, record),
        edge=max(-(-prepared.edge // factor), NEAR_END), lost=lost, every=factor, as_sampled=prepared,
        notes=(*prepared.notes, _said(prepared.record, factor, parts[0])),
    )  # fmt: skip


def completed_without_spare(
    completed: Sequence[CompletedRecord], shortest: int
) -> tuple[list[CompletedRecord], int]:  # fmt: skip
    """The same of driven records that are to be cut into stretches, and how many of their samples there are to one.

    ``shortest`` as for :func:`spare_factor`.
    """
    factor = spare_factor([c.record for c in completed], shortest)
    if factor == 1:
        return list(completed), 1
    fewer: list[CompletedRecord] = []
    for whole in completed:
        record, edge = decimated(whole.record, factor), max(-(-whole.edge // factor), NEAR_END)
        notes = (*whole.notes, _said(whole.record, factor, (0, len(whole.record))))
        fewer.append(CompletedRecord(record, _band(whole.band, record), edge, notes))
    return fewer, factor


def spare_factor(records: Sequence[Record], shortest: int) -> int:
    """The largest whole number by which the sampling may be divided without loss; 1 if none.

    Each measured motion allows a new Nyquist frequency (:meth:`Content.enough`): what was computed is louder at high
    frequencies, not more telling. A force that closes on itself, and the
    period of the excitation, still hold whole numbers of samples, and either part is long enough for spectra.

    Parameters
    ----------
    records : sequence of Record
        With completed motions.
    shortest : int
        Samples in the shorter of both parts.
    """
    most = shortest // LEAST_SAMPLES
    if most < 2:
        return 1
    needed = max(content(record[s], record.dt).enough for record in records for s in record.sensors)
    most = min(most, int(0.5 / records[0].dt / needed))
    whole = [record.period for record in records if record.period]
    whole += [len(record) for record in records if any(_goes_round(record[force]) for force in record.forces)]
    return next((k for k in range(most, 1, -1) if not any(n % k for n in whole)), 1)


@dataclass(frozen=True)
class Content:
    """What a channel holds above its noise.

    Above ``highest`` a density is assumed that equals that of the noise there and falls on.
    """

    highest: float  # frequency in hertz at which it stands above its noise
    fall: float  # power of the frequency with which its density falls there: 2 for an acceleration that jumps, or more
    energy: float  # of what is assumed to lie above, in mean squares of the noise at a sample
    signal: float  # energy of the whole channel in the same measure

    @property
    def enough(self) -> float:
        """The Nyquist frequency in hertz that suffices.

        First, ``(ORDER + 1) / 2`` times ``highest``: products of so many factors fold to frequencies above that.
        Second, what lies above folds too, or is lost, and shifts coefficients: by as many standard errors, at most, as
        its energy over the root of the signal's, if a coefficient moves it as it moves the whole.
        """
        excess = self.energy / (BIAS * math.sqrt(self.signal)) if self.signal > 0.0 else 1.0
        return self.highest * max(0.5 * (ORDER + 1), excess ** (1.0 / (self.fall - 1.0)))


def content(values: Floats, dt: float) -> Content:
    """What a channel of shape (n,) holds above its noise; up to the Nyquist frequency where no noise is seen.

    The noise is the median of the spectrum: of an oversampled channel most lines hold nothing else. A line stands above
    it if chance gives one so high among all in less than ``ALPHA`` of the records, alone or with a third of an octave.
    """
    cut = Segments(segment_length(len(values), held=4, most=8192), 0.75, "kaiser")
    frequency, power = autospectrum(values - np.mean(values), dt, cut)
    averages = cut.effective_averages(len(values))
    inner, nyquist = power[1:-1], 0.5 / dt
    noise = float(np.median(inner)) / (1.0 - 1.0 / (9.0 * averages)) ** 3  # median of chi square (Wilson, Hilferty)
    if not noise > 0.0:
        return Content(nyquist, JUMP, 0.0, 0.0)
    last = _last_above(inner / noise, averages, cut.line_inflation())
    highest, samples = float(frequency[last + 1]), len(values)
    fall = _fall(inner / noise - 1.0, last + 1, averages / cut.line_inflation())
    energy = samples * highest / ((fall - 1.0) * nyquist)
    return Content(highest, fall, energy, samples * max(float(np.mean(inner)) / noise - 1.0, 0.0))


def _last_above(share: Floats, averages: float, inflation: float) -> int:
    """The last line whose density, in that of the noise, stands above it; 0 if there is none."""
    above = gammaincc(averages, averages * share) * len(share) < 0.5 * ALPHA
    edges = np.unique(np.round(2.0 ** np.arange(0.0, math.log2(len(share)), 1.0 / 3.0)).astype(int)).tolist()
    bands = list(pairwise([*edges, len(share)]))
    for a, b in bands:
        together = averages * max((b - a) / inflation, 1.0)
        if gammaincc(together, together * float(np.mean(share[a:b]))) * len(bands) < 0.5 * ALPHA:
            above[b - 1] = True
    return int(np.max(np.flatnonzero(above), initial=0))


def _fall(excess: Floats, last: int, averages: float) -> float:
    """The power of the frequency with which a density falls over the octave up to a line, by its two halves.

    Less what chance may have added; at least ``JUMP``: no motion of a mass falls more slowly.
    """
    lower, middle = last // 2, round(last / math.sqrt(2.0))
    if middle - lower < 1 or last - middle < 1:
        return JUMP
    (one, sure), (other, unsure) = (
        (float(np.mean(part)), float(np.mean(part + 1.0)) / math.sqrt(max(averages * len(part), 1.0)))
        for part in (excess[lower:middle], excess[middle:last])
    )
    ratio = (one - 2.0 * sure) / max(other + 2.0 * unsure, 1e-300)
    return max(2.0 * math.log2(ratio), JUMP) if ratio > 0.0 else JUMP


def decimated(record: Record, factor: int) -> Record:
    """Every ``factor``-th sample of a record behind a low-pass filter without phase, the same on every channel.

    A force that is straight or held between its samples is filtered as such.
    """
    channels = dict[str, Floats]()
    for name, values in record.channels.items():
        mean = float(np.mean(values))
        reach = 0 if _goes_round(values) else min(4 * NEAR_END * factor, len(values) // 2)
        longer = values - mean if reach == 0 else with_continuations(values - mean, reach)
        cycles = np.asarray(rfftfreq(len(longer)))  # of a sample
        held = _held(cycles, record.reading(name))
        low = irfft(np.asarray(rfft(longer)) * _gain(2.0 * factor * cycles) * held, len(longer))
        channels[name] = np.asarray(low[reach : reach + len(values)][::factor] + mean)
    period = None if record.period is None else record.period // factor
    return replace(record, dt=record.dt * factor, channels=channels, period=period, between=BAND_LIMITED)


def low_passed(record: Record, highest: float) -> tuple[Record, str]:
    """A record without what lies above a frequency in hertz, and a sentence on that.

    Forces and motions go through one filter, which a linear equation does not see; what a nonlinear one makes above the
    limit is lost.

    Raises
    ------
    StudyError
        If it is sampled too coarsely for the filter.
    """
    nyquist = 0.5 / record.dt
    factor = int(nyquist * PASSED / highest)
    most = 0.5 * nyquist * PASSED
    expect(factor > 1, f"{record.name}: --up-to is {highest:g} Hz; expected {most:.3g} Hz or less")
    said = (
        f"force and motion fade out from {highest:g} Hz to {2.0 * highest:g} Hz; a mode in between still shows, so "
        "choose at most half the frequency of the first mode to be left out"
    )
    return decimated(record, factor), said


def _goes_round(values: Floats) -> bool:
    """Whether a channel closes on itself, by no larger a step than it takes elsewhere: noise may hide a jump."""
    return closes(values) and abs(float(values[0] - values[-1])) <= float(np.max(np.abs(np.diff(values))))


def _gain(relative: Floats) -> Floats:
    """Gain over frequency in new Nyquist frequencies: that of Meyer's scaling function (Daubechies, 1992, (4.2.1)).

    Its square and that of its mirror image about 1 add up to 1, so that folded white noise is white.
    """
    x = np.clip((relative - PASSED) / (2.0 - 2.0 * PASSED), 0.0, 1.0)
    return np.cos(0.5 * np.pi * x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3))


def _held(cycles: Floats, between: str) -> Floats:
    """What a hold, or straight lines, between the samples make of each frequency; complex for the delay of a hold."""
    if between == BAND_LIMITED:
        return np.ones_like(cycles)
    return np.sinc(cycles) ** 2 if between == "straight" else np.sinc(cycles) * np.exp(-1j * np.pi * cycles)


def _band(band: tuple[float, float], record: Record) -> tuple[float, float]:
    return band[0], min(band[1], PASSED * 0.5 / record.dt)


def _said(record: Record, factor: int, span: tuple[int, int]) -> str:
    """A sentence on what was done, by the period of the strongest line of the motion."""
    moved = [s for c in record.coordinates if (s := Sensor(c, MOTIONS[0])) in record]
    motions = [record[s][slice(*span)] for s in moved]
    power = np.sum([np.abs(np.asarray(rfft(x - np.mean(x)))) ** 2 / max(float(np.var(x)), 1e-300) for x in motions], 0)
    a_period = (span[1] - span[0]) / max(int(np.argmax(power)), 1)
    ordinal = {2: "second", 3: "third"}.get(factor, f"{factor}th")
    return (
        f"the record {record.name} is sampled {a_period:.0f} times a period of its strongest motion, more finely than "
        f"anything but noise in it asks for: every {ordinal} sample is used after a low-pass filter, which "
        "loses nothing (--as-sampled uses all)"
    )


def too_coarse(prepared: Prepared) -> str:
    """A sentence on a motion most of whose power lies above half the Nyquist frequency; empty where it does not.

    There are fewer than four samples in a period then: the third harmonic of such a motion, which any odd nonlinearity
    makes, folds to frequencies within it, and a motion from above the Nyquist frequency looks no different. The power
    is that of the displacement, which falls above the resonance, whatever motion was measured.
    """
    if prepared.response == FORCE or prepared.free:
        return ""
    values = prepared.outputs.apart(prepared.fitted)
    windowed = np.asarray((values - np.mean(values, axis=0)) * np.hanning(len(values))[:, None], dtype=np.float64)
    frequency = np.asarray(rfftfreq(len(values), prepared.dt))
    inside = frequency >= max(prepared.band[0], frequency[1])
    orders = np.array([MOTIONS.index(s.motion) for s in prepared.outputs.sensors])
    each = np.abs(np.asarray(rfft(windowed, axis=0), dtype=np.complex128)[inside]) ** 2 / frequency[inside, None] ** (
        2 * orders
    )
    power = np.sum(each / np.maximum(np.sum(each, axis=0), np.finfo(float).tiny), axis=1)
    total, nyquist = np.cumsum(power), 0.5 / prepared.dt
    above = 1.0 - np.interp(0.5 * nyquist, frequency[inside], total) / total[-1]
    if above <= TOO_COARSE:
        return ""
    middle = float(frequency[inside][np.searchsorted(total, 0.5 * total[-1])])
    return (
        f"the record {prepared.record.name} is sampled too coarsely: {1.0 / (middle * prepared.dt):.1f} times a period "
        f"of its motion at {middle:.3g} Hz, or aliased from above {nyquist:.3g} Hz; a fit means little, "
        " as third harmonics fold onto the motion itself; expected four samples a period or more"
    )
