"""The noise floor of the response: what no model could explain.

Where the excitation is periodic, what differs between periods is noise, whatever its spectrum
(Pintelon and Schoukens, System Identification, 2012, Section 2.5). Elsewhere noise is taken as white, at
the level of the quietest bands of the residual (``noise_floor``).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study.compare.prediction import Judged
from study.records import noise_floor
from study.records.record import MOTIONS, Record
from study.records.spectra import Segments, autospectrum

Floats = NDArray[np.float64]
AVERAGES = 8  # segments without overlap, at least
LONGEST = 1024  # samples in a segment
SAME = 1e-3  # rms by which the force of two periods may differ, over its own
SIGNIFICANT = 5.0  # standard errors by which structure must stand above the noise
WHITE, SCATTER, EXACT = "quietest bands of the residual", "scatter between periods", "error of the integration"


@dataclass(frozen=True)
class Noise:
    """Noise on the response, and what stands above it in the residual; arrays of shape (lines,).

    Attributes
    ----------
    frequency : array
        In hertz.
    density : array
        Autospectral density of the noise.
    residual : array
        That of the residual.
    rms : float
        Of the noise, above the frequency below which nothing is judged.
    error : float
        Standard error of ``rms``.
    excess : float
        Mean square of what stands above the noise in the residual.
    significance : float
        The excess in its own standard errors.
    averages : float
        Effective number of averages of the densities.
    source : str
        What the estimate rests on.
    """

    frequency: Floats
    density: Floats
    residual: Floats
    rms: float
    error: float
    excess: float
    significance: float
    averages: float
    source: str

    @property
    def alone(self) -> bool:
        """Whether noise alone would leave such a residual."""
        return self.significance <= SIGNIFICANT


def segments_of(samples: int) -> Segments:
    """Segments for the spectra of a comparison."""
    return Segments(length=max(32, min(LONGEST, 2 ** int(np.log2(max(samples // AVERAGES, 32))))))


def noise_of(judged: Judged, record: Record, last: int) -> Noise:
    """Noise of the response on the judging part.

    Parameters
    ----------
    judged : Judged
        Measured and predicted response.
    record : Record
        The whole record; its ``period``, if it has one, is made use of.
    last : int
        The sample after the last of the judging part: periods are counted back from it.
    """
    cut = segments_of(len(judged.residual))
    frequency, residual = autospectrum(judged.difference, judged.dt, cut)
    floor = noise_floor.floor(judged.difference, judged.dt, judged.low)
    scatter = _between_periods(record, judged.row, last)
    nyquist, averages = 0.5 / judged.dt, cut.effective_averages(len(judged.residual))
    white = floor.noise**2 / (nyquist - judged.low)
    quiet = averages * len(frequency) / cut.line_inflation() * noise_floor.QUIET / noise_floor.BANDS
    white_error = 0.5 * floor.noise / np.sqrt(quiet)
    found = Noise(
        frequency, np.full_like(frequency, white), residual, floor.noise, white_error,
        floor.excess, floor.significance, averages, WHITE,
    )  # fmt: skip
    if scatter is not None:
        found = _with_density(found, autospectrum(scatter, judged.dt, cut)[1], judged, len(scatter))
    if found.rms < judged.numerical:
        found = replace(found, rms=judged.numerical, source=EXACT)
    return found


def _between_periods(record: Record, row: int, last: int) -> Floats | None:
    """Differences of the response between neighbouring periods with the variance of the noise, strung together.

    Periods are counted back from the end of the judging part, where the motion has settled; the whole
    record serves, because scatter says nothing of a model. None if there are not two alike.
    """
    period = record.period
    if period is None or last // period < 2:
        return None
    count = min(last // period, 6)
    first = last - count * period
    force = record["force"][first:last].reshape(count, period)
    motion = record[MOTIONS[row]][first:last].reshape(count, period)
    alike = np.sqrt(np.mean(np.diff(force, axis=0) ** 2, axis=1)) < SAME * float(np.std(force))
    settled = np.diff(motion, axis=0)[alike] / np.sqrt(2.0)
    if not len(settled):
        return None
    return settled[1:].ravel() if len(settled) > 2 else settled[-1]  # the first may still hold the beginning


def _with_density(found: Noise, density: Floats, judged: Judged, samples: int) -> Noise:
    """The same with a noise density that was measured."""
    keep = found.frequency >= judged.low
    width = float(found.frequency[1])
    rms = float(np.sqrt(np.sum(density[keep]) * width))
    cut = segments_of(len(judged.residual))
    lines = np.count_nonzero(keep) / cut.line_inflation()
    own = cut.effective_averages(samples)
    spread = density * np.sqrt(1.0 / found.averages + 1.0 / own)
    error = float(np.sqrt(np.sum((spread * width)[keep] ** 2) * cut.line_inflation()))
    above = float(np.sum((found.residual - density)[keep]) * width)
    return replace(
        found, density=density, rms=rms, error=0.5 * rms / np.sqrt(own * lines),
        excess=max(above, 0.0), significance=above / error if error > 0.0 else np.inf, source=SCATTER,
    )  # fmt: skip
