"""Band-limited values between the samples.

A measured force is known at its samples only. A hold or linear interpolation would add harmonics and a delay, which
an integrator with several steps a sample would respond to. Band-limited interpolation is exact for a record without
content above its Nyquist frequency.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from study.records.completion import CONTINUED
from study.records.record import Record, Stretch
from study.support.arrays import Floats, Ints
from study.support.recent import Recent

BAND_LIMITED = "band_limited"
BETWEEN_SAMPLES = (BAND_LIMITED, "straight", "held")
WORDS = {"straight": "goes in straight lines from sample to sample", "held": "is held from each sample to the next"}


def between_samples(
    values: Floats, factor: int, reading: str = BAND_LIMITED, span: tuple[int, int] | None = None
) -> Floats:  # fmt: skip
    """Values on a grid ``factor`` times as fine, shape (factor (n - 1) + 1,); every ``factor``-th is the sample itself.

    Of a ``span`` of samples only those are made that lie in it, n being its length.

    A record that closes on itself is taken as periodic, which is exact for a periodic excitation; otherwise its ends
    are continued by point reflection and faded, which confines the error to the first and last few samples. A jump
    from the last sample to the first is recognised by its power up to the Nyquist frequency.

    ``reading`` is one of :data:`BETWEEN_SAMPLES`: a force that a program made may be straight or held there.
    Where a held one jumps, the mean of both values stands: an integrator's steps on both sides then add up to the jump.
    """
    n = len(values)
    first, last = span or (0, n)
    wanted = slice(factor * first, factor * (last - 1) + 1)
    if factor == 1 or n == 1:
        return values[first:last].copy()
    if reading == "straight":
        return np.interp(np.arange(factor * (n - 1) + 1) / factor, np.arange(n), values)[wanted]
    if reading == "held":
        fine = np.append(np.repeat(values[:-1], factor), values[-1])
        fine[factor:-1:factor] = 0.5 * (values[:-2] + values[1:-1])
        return fine[wanted]
    whole = values if closes(values) else _reflected(values, min(CONTINUED, n - 1))
    edge = (len(whole) - n) // 2
    return _periodic(whole, factor, edge + first, edge + last)[: factor * (last - first - 1) + 1]


def between_samples_kept(
    kept: Recent, values: Floats, factor: int, reading: str = BAND_LIMITED, span: tuple[int, int] | None = None
) -> Floats:  # fmt: skip
    """As :func:`between_samples`, not to be written to: what was made last is ``kept``, by the values themselves.

    It serves every span of them, unless it takes more than there is room for: then no more is made than is asked for.
    """
    own = values.tobytes()
    first, last = span or (0, len(values))
    part = (first, last) if len(own) * (1 + factor) > kept.room else (0, len(values))

    def made() -> Floats:
        fine = between_samples(np.frombuffer(own), factor, reading, part)
        fine.flags.writeable = False
        return fine

    fine = kept.get((own, factor, reading, part), len(own) + 8 * factor * (part[1] - part[0]), made)
    return fine[factor * (first - part[0]) : factor * (last - 1 - part[0]) + 1]


def in_columns(values: Sequence[Floats], n: int) -> Floats:
    """Channels side by side, shape (n, channels); a single one of a long record is not copied: no run changes it."""
    if len(values) == 1:
        return values[0][:, None]
    return np.column_stack(values) if values else np.zeros((n, 0))


def largest_between(values: Floats, factor: int) -> float:
    """Largest absolute value of channels, between their samples too, shape (n, channels); zero of no channel."""
    return max((float(np.max(np.abs(between_samples(own, factor)))) for own in values.T), default=0.0)


def closes(values: Floats) -> bool:
    """Whether a record goes on from its last sample to its first without a jump, as a period of a force does."""
    n = len(values)
    edge = min(CONTINUED, n - 1)
    if edge == CONTINUED:  # to a length of small factors, of which a transform takes a fraction of the time and room
        length = n + 2 * edge
        while (length := next_fast_len(length, real=True)) % 2 != n % 2:
            length += 1
        edge = min((length - n) // 2, n - 1)
    # a record that does not close has ten times the energy there of one whose ends are continued
    return _top_energy(values) <= 10.0 * _top_energy(_reflected(values, edge))


def _reflected(values: Floats, edge: int) -> Floats:
    """A record continued at both ends by point reflection that is faded out, shape (n + 2 edge,)."""
    fade = 0.5 - 0.5 * np.cos(np.pi * np.arange(edge) / edge)
    before = (2.0 * values[0] - values[edge:0:-1]) * fade
    after = (2.0 * values[-1] - values[-2 : -edge - 2 : -1]) * fade[::-1]
    return np.concatenate([before, values, after])


def runs_of(record: Record) -> tuple[tuple[Stretch, ...], Ints]:
    """The motions of a record that is strung together, and the place of each of its samples in them, shape (n,).

    One motion runs along stretches that continue each other, and what lies between.
    """
    runs, places, begin = list[Stretch](), list[Ints](), 0
    for stretch in record.stretches:
        if stretch.continues and runs:
            runs[-1] = Stretch(runs[-1].source, runs[-1].first, stretch.last)
        else:
            begin += len(runs[-1]) if runs else 0
            runs.append(Stretch(stretch.source, stretch.first, stretch.last))
        places.append(begin - runs[-1].first + np.arange(stretch.first, stretch.last))
    return tuple(runs), np.concatenate(places)


def between_runs(
    record: Record, name: str, factor: int, between: Callable[[Floats, int, str], Floats] = between_samples
) -> Floats:  # fmt: skip
    """A channel along the motions of a record that is strung together, on a grid ``factor`` times as fine.

    Each as its source has it, so that no joint is seen; between two motions the last value holds. A channel that the
    record has of its own (``changed``) is taken as straight where a motion runs on between two stretches. ``between``
    is :func:`between_samples`, or what keeps its results.
    """
    parts: list[Floats] = []
    runs, places = runs_of(record)
    own, begin = name in record.changed, 0
    for run in runs:
        inside = (places >= begin) & (places < begin + len(run))
        along = np.interp(np.arange(begin, begin + len(run)), places[inside], record[name][inside]) if own else None
        fine = between(run.source[name] if along is None else along, factor, record.reading(name))
        fine = fine[0 if own else factor * run.first :][: factor * len(run)]
        parts.append(np.pad(fine, (0, factor * len(run) - len(fine)), mode="edge"))
        begin += len(run)
    return np.concatenate(parts)


def _top_energy(values: Floats) -> float:
    """Energy in the uppermost tenth of the lines."""
    lines = np.asarray(rfft(values))
    return float(np.sum(np.abs(lines[int(0.9 * len(lines)) :]) ** 2)) / len(values)


def _periodic(values: Floats, factor: int, first: int, last: int) -> Floats:
    """Samples ``first`` to ``last``, and between them the record shifted by one part of an interval after the other.

    Transforms of the record's length take a tenth of the time of one that is ``factor`` times as long, at 1e6 samples.
    """
    n = len(values)
    spectrum = np.asarray(rfft(values), dtype=np.complex128)
    shift = np.exp(2j * np.pi / (factor * n) * np.arange(len(spectrum)))
    fine = np.empty((last - first, factor))
    fine[:, 0] = values[first:last]
    for part in range(1, factor):
        spectrum *= shift
        fine[:, part] = irfft(spectrum, n)[first:last]
    return fine.reshape(-1)
