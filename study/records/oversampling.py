"""Records sampled more finely than their motion asks for: every so-manieth sample behind a low-pass filter.

What lies above the highest frequency at which the measured motion stands above its noise is noise. A filter whose power
and that of its image add up to one leaves white noise white, so that the samples that are kept hold as much of every
coefficient as all of them did, with standard errors that are as true.
"""

import math
from dataclasses import replace

import numpy as np
from scipy.fft import irfft, rfft, rfftfreq
from scipy.special import gammaincc

from study.records.completion import CompletedRecord, continued
from study.records.interpolation import BAND_LIMITED, closes
from study.records.plan import Plan
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Record
from study.records.spectra import Segments, autospectrum
from study.support.arrays import Floats
from study.support.thresholds import ALPHA

ORDER = 3  # products of the motion up to this order do not fold into its band: those of most library terms' forces
LEAST = 512  # samples in either part: what a segment of the spectra takes
LINES = 8192  # samples in a segment of the spectrum, at most
PARTS = 4  # segments that a record holds side by side, at least
EDGE = 8  # samples at each end that the filter takes from what the record is continued by
PASSED = 2.0 / 3.0  # of the new Nyquist frequency, and its mirror image 4/3: where the filter falls


def without_spare_samples(prepared: Prepared) -> Prepared:
    """The record with every so-manieth sample, where it has more than its motion asks for; else itself.

    A record of stretches is left as it is (:func:`completed_without_spare` comes before these are strung together), as
    are one with lost samples, which a filter would spread, and a prescribed motion, whose kinks count.
    """
    if prepared.record.stretches or prepared.lost is not None or prepared.response == FORCE:
        return prepared
    parts = prepared.plan.fit, prepared.plan.judge
    factor = spare_factor(prepared.record, prepared.measured, min(b - a for a, b in parts))
    if factor == 1:
        return prepared
    record = decimated(prepared.record, factor)
    fit, judge = ((-(-a // factor), -(-b // factor)) for a, b in parts)
    lost = np.ones(len(record), dtype=np.bool_)
    lost[EDGE:-EDGE] = False
    return replace(
        prepared, record=record, plan=Plan(prepared.plan.response, fit, judge), band=_band(prepared.band, record),
        edge=max(-(-prepared.edge // factor), EDGE), notes=(*prepared.notes, _said(prepared.record, factor, parts[0])),
        lost=lost, as_sampled=prepared,
    )  # fmt: skip


def completed_without_spare(completed: CompletedRecord, shortest: int) -> CompletedRecord:
    """The same of a record that is to be cut into stretches, of which the shortest part has so many samples."""
    measured = tuple(m for m in MOTIONS if m in completed.record)
    factor = spare_factor(completed.record, measured, shortest)
    if factor == 1:
        return completed
    record = decimated(completed.record, factor)
    edge = max(-(-completed.edge // factor), EDGE)
    said = _said(completed.record, factor, (0, len(completed.record)))
    return replace(
        completed, record=record, band=_band(completed.band, record), edge=edge, notes=(*completed.notes, said)
    )


def spare_factor(record: Record, measured: tuple[str, ...], shortest: int) -> int:
    """The largest whole number by which the sampling may be divided without loss; 1 if none.

    The new Nyquist frequency is ``(ORDER + 1) / 2`` times the highest frequency at which any measured motion stands
    above its noise: products of so many factors then fold to frequencies above that. A force that closes on itself,
    and the period of the excitation, still hold whole numbers of samples, and either part is long enough for spectra.

    Parameters
    ----------
    record : Record
        With completed motions.
    measured : tuple of str
        Those that were measured: the others are louder at high frequencies, not more telling.
    shortest : int
        Samples in the shorter of both parts.
    """
    most = shortest // LEAST
    if most < 2:
        return 1
    highest = max(highest_frequency(record[name], record.dt) for name in measured)
    most = min(most, int(0.5 / record.dt / (0.5 * (ORDER + 1) * max(highest, 1.0 / (len(record) * record.dt)))))
    whole = [n for n in (record.period,) if n]
    if _goes_round(record[FORCE]):
        whole.append(len(record))
    return next((k for k in range(most, 1, -1) if not any(n % k for n in whole)), 1)


def highest_frequency(values: Floats, dt: float) -> float:
    """Highest frequency in hertz at which a channel stands above its noise; the Nyquist frequency if it does up there.

    The noise is the median of the spectrum: of an oversampled channel most lines hold nothing else. A line stands above
    it if chance gives one so high among all in less than ``ALPHA`` of the records, or a third of an octave of them does.
    """
    length = 2 ** int(math.log2(min(len(values) // PARTS, LINES)))
    cut = Segments(length, 0.75, "kaiser")
    frequency, power = autospectrum(values - np.mean(values), dt, cut)
    averages = cut.effective_averages(len(values))
    inner, bins = power[1:-1], frequency[1:-1]
    noise = float(np.median(inner)) / (1.0 - 1.0 / (9.0 * averages)) ** 3  # median of chi square (Wilson, Hilferty)
    if not noise > 0.0:
        return 0.5 / dt
    share = inner / noise
    above = gammaincc(averages, averages * share) * len(share) < 0.5 * ALPHA
    edges = np.unique(np.round(2.0 ** np.arange(0.0, math.log2(len(inner)), 1.0 / 3.0)).astype(int))
    bands = [(int(a), int(b)) for a, b in zip(edges, [*edges[1:], len(inner)], strict=True)]
    for a, b in bands:
        together = averages * max((b - a) / cut.line_inflation(), 1.0)
        if gammaincc(together, together * float(np.mean(share[a:b]))) * len(bands) < 0.5 * ALPHA:
            above[b - 1] = True
    found = np.flatnonzero(above)
    return float(bins[found[-1]]) if len(found) else 0.0


def decimated(record: Record, factor: int) -> Record:
    """Every ``factor``-th sample of a record behind a low-pass filter without phase, the same on every channel.

    A force that is straight or held between its samples is filtered as such.
    """
    channels = {
        name: _filtered(values, factor, record.between if name == FORCE else BAND_LIMITED)
        for name, values in record.channels.items()
    }
    period = None if record.period is None else record.period // factor
    return replace(
        record, dt=record.dt * factor, channels=channels, period=period, between=BAND_LIMITED
    )


def _filtered(values: Floats, factor: int, between: str) -> Floats:
    mean = float(np.mean(values))
    reach = 0 if _goes_round(values) else min(4 * EDGE * factor, len(values) // 2)
    longer = values - mean if reach == 0 else continued(values - mean, reach)
    cycles = np.asarray(rfftfreq(len(longer)))  # of a sample
    low = irfft(np.asarray(rfft(longer)) * _gain(2.0 * factor * cycles) * _held(cycles, between), len(longer))
    return np.asarray(low[reach : reach + len(values)][::factor] + mean)


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
    values = record[next(m for m in MOTIONS if m in record)][slice(*span)]
    power = np.abs(np.asarray(rfft(values - np.mean(values))))
    a_period = len(values) / max(int(np.argmax(power)), 1)
    return (
        f"the record is sampled {a_period:.0f} times a period of its strongest motion, finer than anything in it above "
        f"its noise: every {factor}th sample is used after a low-pass filter, which loses nothing (--as-sampled uses "
        "all)"
    )
