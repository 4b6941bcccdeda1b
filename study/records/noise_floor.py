"""How much of a residual is noise, and how much stands above it?

Sensor noise is assumed to be white: its density is that of the quietest bands of the residual's
autospectrum. The excess in other bands is systematic: a better model could explain it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from study.records.spectra import Segments, autospectrum, segment_length
from study.support.arrays import Floats
from study.support.errors import StudyError

SIGNIFICANT = 5.0  # standard errors by which a residual must stand above the noise
CLEAR = 3.0  # standard errors by which a line must stand above the noise, to be used
AVERAGED = 5  # lines that are
BANDS = 20  # bands of the spectrum, or as many as there are lines
FEWEST_NOISE_LINES = 8  # to show a noise floor
QUIETEST_BANDS = 5  # that give the floor


@dataclass(frozen=True)
class Floor:
    """Noise, and what stands above it, in a residual."""

    noise: float  # root mean square of white noise at the density of the quietest bands
    excess: float  # mean square above it
    excess_error: float  # standard error of the excess if there were noise alone

    @property
    def significance(self) -> float:
        return self.excess / self.excess_error if self.excess_error > 0.0 else np.inf


def floor(residual: Floats, dt: float, low: float = 0.0) -> Floor:
    """Split a residual into noise floor and what stands above it, both above the frequency ``low`` (hertz)."""
    from scipy.special import ndtri

    segments = Segments(segment_length(len(residual), held=8, fewest=32, most=1024))
    frequency, density = autospectrum(residual, dt, segments)
    averages = segments.effective_averages(len(residual))
    kept = density[1:-1][frequency[1:-1] >= low]
    if len(kept) < FEWEST_NOISE_LINES:
        raise StudyError(
            f"{len(residual)} samples are judged, of whose spectrum {len(kept)} lines lie above {low:.3g} Hz; "
            f"{FEWEST_NOISE_LINES} or more show a noise floor: judge a longer part"
        )
    count = min(BANDS, len(kept))
    quietest = max(1, count * QUIETEST_BANDS // BANDS)
    bands = np.array_split(kept, count)
    means, lines = (np.array([measure(band) for band in bands]) for measure in (np.mean, len))
    spread = 1.0 / np.sqrt(averages * lines / segments.line_inflation())
    quiet = np.argsort(means)[:quietest]
    # The quietest of many equal bands lie below their common level by about one standard deviation: by the mean of the
    # lowest of so many normal numbers (Blom, 1958).
    below = -float(np.mean(ndtri((np.arange(1, quietest + 1) - 0.375) / (count + 0.25))))
    level = float(np.mean(means[quiet])) * (1.0 + below * float(np.mean(spread)))
    width = float(frequency[1])
    above = np.clip(means - level, 0.0, None) * lines * width
    error = float(np.sqrt(np.sum((level * spread * lines * width) ** 2)))
    bias = 0.4 * error * np.sqrt(count)  # what clipping at zero adds for noise alone: 0.4 sigma a band
    return Floor(float(np.sqrt(level * (0.5 / dt - low))), max(float(np.sum(above)) - bias, 0.0), error)


def band_above_noise(values: Floats, dt: float, low: float) -> tuple[Floats, Floats] | None:
    """Frequencies in hertz, and 1 at those where a density stands above that of white noise, 0 at others.

    None if noise alone would do.
    """
    found = floor(values, dt, low)
    if found.significance <= SIGNIFICANT:
        return None
    cut = Segments(segment_length(len(values), held=8, fewest=32, most=1024))
    frequency, density = autospectrum(values, dt, cut)
    white = found.noise**2 / (0.5 / dt - low)
    smooth = np.convolve(np.pad(density, AVERAGED // 2, mode="edge"), np.ones(AVERAGED) / AVERAGED, "valid")
    limit = white * (1.0 + CLEAR / np.sqrt(cut.effective_averages(len(values)) * AVERAGED / cut.line_inflation()))
    return frequency, ((smooth > limit) & (frequency >= low)).astype(np.float64)


def in_band(values: Floats, dt: float, frequency: Floats, gate: Floats) -> Floats:
    """Values, shape (n,), of which each frequency is kept to its share."""
    size = next_fast_len(2 * len(values), real=True)
    at = np.asarray(rfftfreq(size, dt), dtype=np.float64)
    weight = np.asarray(np.interp(at, frequency, gate), dtype=np.float64)
    lines = np.asarray(rfft(values, size), dtype=np.complex128)
    return np.asarray(irfft(lines * weight, size), dtype=np.float64)[: len(values)]
