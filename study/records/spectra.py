"""One-sided cross-spectral density matrices from overlapped, windowed segments.

Conventions, kept in this one place: ``G_xy(f) = 2/T E[X* Y]`` (the first index is conjugated, as in
Bendat and Piersol and in ``scipy.signal.csd``), densities in units^2/Hz, the window's power corrected
for, zero and Nyquist frequency not doubled.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import irfft, rfft, rfftfreq

from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError

CHUNK = 64  # segments transformed at a time: they stay in the cache, and memory does not grow with the record


@dataclass(frozen=True)
class Segments:
    """Segments of a record for spectra by Welch's method; the defaults are the report's.

    ``window`` is any that ``scipy.signal.get_window`` knows, or ``kaiser``, whose side lobes lie at the rounding of
    what a converter, or a simulation, gives.
    """

    length: int = 512  # samples in a segment
    overlap: float = 0.5  # fraction that neighbours share
    window: str = "hann"

    def __post_init__(self) -> None:
        if self.length < 4:
            raise StudyError(f"segment length is {self.length}; at least 4 samples are needed")
        if not 0.0 <= self.overlap < 1.0:
            raise StudyError(f"overlap is {self.overlap:g}; it must be at least 0 and below 1")
        try:
            self.taper()
        except (ValueError, TypeError):
            raise StudyError(f"there is no window {self.window!r}; scipy.signal.get_window lists them") from None

    @property
    def hop(self) -> int:
        """Samples from the start of one segment to the start of the next."""
        return max(1, round(self.length * (1.0 - self.overlap)))

    def taper(self) -> Floats:
        """The window's samples, shape (length,)."""
        if self.window == "hann":  # SciPy's signal package takes longer to load than most steps of the study to run
            return np.hanning(self.length + 1)[:-1]
        if self.window == "kaiser":
            return np.kaiser(self.length + 1, 20.0)[:-1]  # side lobes at -150 dB
        if self.window == "boxcar":
            return np.ones(self.length)
        from scipy.signal import get_window

        return np.asarray(get_window(self.window, self.length), dtype=np.float64)

    def count(self, samples: int) -> int:
        """Number of whole segments in a record; refuses a record that is shorter than one segment."""
        if samples < self.length:
            raise StudyError(f"the record has {samples} samples, fewer than the segment length {self.length}")
        return 1 + (samples - self.length) // self.hop

    def effective_averages(self, samples: int) -> float:
        """Number of independent averages that the overlapped segments are worth.

        Segments k hops apart share ``rho_k`` of their window's power, and the variance of an average
        of n is ``(1 + 2 sum_k (1 - k/n) rho_k^2) / n`` (Welch, 1967, eq. 19).
        """
        n, taper = self.count(samples), self.taper()
        spread = 1.0
        for k in range(1, min(n, -(-self.length // self.hop))):
            shift = k * self.hop
            rho = np.sum(taper[shift:] * taper[: self.length - shift]) / np.sum(taper**2)
            spread += 2.0 * (1.0 - k / n) * float(rho) ** 2
        return n / spread

    def line_inflation(self) -> float:
        """Factor on the variance of a sum over neighbouring frequency lines.

        The errors at two lines of frequency response estimates correlate as the products of the tapers
        of every pair of overlapping segments do. Summed over all lines that is, by Parseval,
        ``N sum_k sum_t p_k(t)^2 / sum_k (sum_t p_k(t))^2`` with ``p_k(t) = w(t) w(t + k hop)``: 1.94
        for Hann without overlap, 2 with a half.
        """
        taper, together, alone = self.taper(), 0.0, 0.0
        for k in range(-(-self.length // self.hop)):
            product = taper[k * self.hop :] * taper[: self.length - k * self.hop]
            pairs = 1.0 if k == 0 else 2.0
            together += pairs * self.length * float(np.sum(product**2))
            alone += pairs * float(np.sum(product)) ** 2
        return together / alone


def segment_length(samples: int, held: int, fewest: int = 1, most: int = 1 << 62) -> int:
    """A power of two, of which so many samples hold a number (``held``) side by side, within two bounds."""
    return max(fewest, min(most, 2 ** int(math.log2(max(samples // held, 1)))))


@dataclass(frozen=True)
class SpectralMatrix:
    """Cross-spectral densities of several channels."""

    frequency: Floats  # (lines,), in hertz
    density: Complexes  # (lines, channels, channels): density[:, i, j] = G_ij, in units_i units_j / Hz
    averages: float  # effective number of independent averages
    segments: Segments

    def band(self, low: float, high: float) -> "SpectralMatrix":
        keep = (self.frequency >= low) & (self.frequency <= high)
        return SpectralMatrix(self.frequency[keep], self.density[keep], self.averages, self.segments)


def cross_spectra(channels: Sequence[Floats], dt: float, segments: Segments | None = None) -> SpectralMatrix:
    """Cross-spectral density matrix of all channels.

    Parameters
    ----------
    channels : sequence of arrays, each of shape (n,)
        Inputs first, output last.
    dt : float
        Sampling interval in seconds.
    segments : Segments, optional
        Default: the report's 512-point Hann segments with half overlap.
    """
    return cross_spectra_in_pieces([channels], dt, segments)


def cross_spectra_within(
    channels: Sequence[Floats], begins: Sequence[int], dt: float, segments: Segments
) -> SpectralMatrix:  # fmt: skip
    """:func:`cross_spectra` of a record that is strung together at ``begins``: no segment reaches across a joint.

    Stretches shorter than a segment are left out; where all are, segments are as long as the longest holds.
    """
    bounds = [0, *begins, len(channels[0])]
    lengths = np.diff(bounds)
    if np.max(lengths) < segments.length:
        segments = replace(segments, length=2 ** int(np.log2(np.max(lengths))))
    total = np.zeros((segments.length // 2 + 1, len(channels), len(channels)), dtype=np.complex128)
    scale, averages, count = np.ones(len(total)), 0.0, 0
    for begin, length in zip(bounds, lengths.tolist(), strict=False):
        if length >= segments.length:
            own = segments.count(length)
            _add_products(total, [c[begin : begin + length] for c in channels], own, segments)
            averages, count = averages + segments.effective_averages(length), count + own
    scale *= 2.0 * dt / (count * np.sum(segments.taper() ** 2))
    scale[[0, -1]] /= 2.0
    frequency = np.asarray(rfftfreq(segments.length, dt), dtype=np.float64)
    return SpectralMatrix(frequency, total * scale[:, None, None], averages, segments)


def cross_spectra_in_pieces(
    pieces: Iterable[Sequence[Floats]], dt: float, segments: Segments | None = None
) -> SpectralMatrix:
    """:func:`cross_spectra` of a record that is read in consecutive pieces of any length, each with all channels.

    Segments reach across the joints: the result is that for the whole record, to rounding. Memory is that of one piece.
    """
    cut = segments or Segments()
    total, left, samples = np.zeros((cut.length // 2 + 1, 0, 0), dtype=np.complex128), list[Floats](), 0
    for piece in pieces:
        if any(len(c) != len(piece[0]) for c in piece):
            raise StudyError(f"channels have {[len(c) for c in piece]} samples; all must have the same number")
        samples += len(piece[0])
        if not left:
            total = np.zeros((len(total), len(piece), len(piece)), dtype=np.complex128)
        elif len(piece) != len(left):
            raise StudyError(f"a piece has {len(piece)} channels; the pieces before it have {len(left)}")
        channels = [np.concatenate(pair) for pair in zip(left, piece, strict=True)] if left else piece
        count = max(0, 1 + (len(channels[0]) - cut.length) // cut.hop)
        _add_products(total, channels, count, cut)
        left = [channel[count * cut.hop :].copy() for channel in channels]
    scale = np.full(len(total), 2.0 * dt / (cut.count(samples) * np.sum(cut.taper() ** 2)))
    scale[0] /= 2.0
    if cut.length % 2 == 0:
        scale[-1] /= 2.0
    frequency = np.asarray(rfftfreq(cut.length, dt), dtype=np.float64)
    return SpectralMatrix(frequency, total * scale[:, None, None], cut.effective_averages(samples), cut)


def _add_products(total: Complexes, channels: Sequence[Floats], count: int, cut: Segments) -> None:
    """Add ``X_i* X_j`` of the first ``count`` segments to ``total``, shape (lines, channels, channels)."""
    if count == 0:
        return
    taper, products = cut.taper(), np.zeros_like(total)
    views = [np.lib.stride_tricks.sliding_window_view(c, cut.length)[:: cut.hop] for c in channels]
    most = min(CHUNK, count)
    room = np.empty((len(views), most, cut.length))  # reused: fresh memory costs as much as a transform
    transformed = np.empty((len(views), most, len(total)), dtype=np.complex128)
    turned = np.empty((len(total), len(views), most), dtype=np.complex128)
    for first in range(0, count, most):
        size = min(most, count - first)
        tapered, lines = room[:, :size], turned[..., :size]
        for view, out in zip(views, tapered, strict=True):
            np.multiply(view[first : first + size], taper, out=out)
        np.fft.rfft(tapered, out=transformed[:, :size])
        lines[:] = transformed[:, :size].transpose(2, 0, 1)
        for i in range(len(views)):  # those of i with j are those of j with i, conjugated
            products[:, i, i:] += np.vecdot(lines[:, i, None], lines[:, i:])
    above, below = np.triu_indices(len(views), 1)
    products[:, below, above] = products[:, above, below].conj()
    total += products


def autospectrum(values: Floats, dt: float, segments: Segments | None = None) -> tuple[Floats, Floats]:
    """Frequency in hertz and one-sided autospectral density in units^2/Hz, both of shape (lines,)."""
    matrix = cross_spectra([values], dt, segments)
    return matrix.frequency, matrix.density[:, 0, 0].real


@dataclass(frozen=True)
class StretchTransforms:
    """Of stretches of up to ``size`` samples, each with room for the response to die away."""

    runs: tuple[tuple[int, int], ...]  # first sample of each stretch, from the part's beginning, and one after its last
    size: int  # samples of a transform

    def lines(self, values: Floats) -> Complexes:
        """Of values (samples, ...), shape (stretches, lines, ...)."""
        parts = [rfft(values[begin:end], self.size, axis=0) for begin, end in self.runs]
        return np.asarray(np.stack(parts), dtype=np.complex128)

    def back(self, lines: Complexes) -> Floats:
        """Values (samples, ...) with these lines."""
        parts: list[Floats] = []
        for x, (begin, end) in zip(lines, self.runs, strict=True):
            parts.append(np.asarray(irfft(x, self.size, axis=0), dtype=np.float64)[: end - begin])
        return np.concatenate(parts)

    def passed(self, path: Complexes, lines: Sequence[Complexes]) -> Floats:
        """What forces with these lines, each (stretches, lines), add to the sensors at the end of a path.

        ``path`` has shape (lines, sensors), the result (samples, sensors, forces).
        """
        return np.stack([self.back(path * force[:, :, None]) for force in lines], axis=2)


def stretch_transforms(runs: Sequence[tuple[int, int]]) -> StretchTransforms:
    """Of the stretches of a record that a part holds, in twice the samples of the longest."""
    first = runs[0][0]
    own = tuple((begin - first, end - first) for begin, end in runs)
    return StretchTransforms(own, 2 * max(end - begin for begin, end in own))
