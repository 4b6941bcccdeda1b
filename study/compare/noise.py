"""The noise floor of the response: what no model could explain.

Where the excitation is periodic, what differs between periods is noise, whatever its spectrum
(Pintelon and Schoukens, System Identification, 2012, Section 2.5). Elsewhere noise is taken as white, at
the level of the quietest bands of the residual (``noise_floor``).
"""

from dataclasses import dataclass, replace

import numpy as np

from study.records import noise_floor
from study.records.prepared import Prepared
from study.records.record import Sensor
from study.records.spectra import Segments, autospectrum, segment_length
from study.support.arrays import Floats

SAME_FORCE = 1e-3  # rms by which that of two periods may differ, over its own
WHITE, SCATTER, INTEGRATION = "quietest bands of the residual", "scatter between periods", "error of the integration"


@dataclass(frozen=True)
class Noise:
    """Noise on the response, and what stands above it in the residual; arrays of shape (lines,)."""

    frequency: Floats  # in hertz
    density: Floats  # autospectral density of the noise
    residual: Floats  # that of the residual
    rms: float  # of the noise, above the frequency below which nothing is judged
    error: float  # standard error of ``rms``
    excess: float  # mean square of what stands above the noise in the residual
    significance: float  # the excess in its own standard errors
    averages: float  # effective number of averages of the densities
    source: str  # what the estimate rests on

    @property
    def alone(self) -> bool:
        """Whether noise alone would leave such a residual."""
        return self.significance <= noise_floor.SIGNIFICANT


def segments_of(samples: int) -> Segments:
    """Segments for the spectra of a comparison."""
    return Segments(segment_length(samples, held=8, fewest=32, most=1024))  # segments without overlap, at least


def noise_of(
    difference: Floats, residual: Floats, prepared: Prepared, sensor: Sensor, numerical: float
) -> Noise:  # fmt: skip
    """Noise of the response at a sensor on the judging part.

    ``difference`` is the measured minus the predicted response, ``residual`` the same without what lies below the
    frequencies that are judged; shape (samples to judge,). ``prepared`` is the whole record, whose ``period`` is made
    use of; ``numerical`` is the rms error of the integration, below which no noise can be seen.
    """
    low, dt = prepared.low, prepared.dt
    cut = segments_of(len(difference))
    frequency, density = autospectrum(difference, dt, cut)
    floor = noise_floor.floor(difference, dt, low)
    averages = cut.effective_averages(len(difference))
    white = floor.noise**2 / (0.5 / dt - low)
    quiet = averages * len(frequency) / cut.line_inflation() * noise_floor.QUIETEST_BANDS / noise_floor.BANDS
    noise = Noise(
        frequency, np.full_like(frequency, white), density, floor.noise, 0.5 * floor.noise / np.sqrt(quiet),
        floor.excess, floor.significance, averages, WHITE,
    )  # fmt: skip
    scatter = _between_periods(prepared, sensor)
    if scatter is not None:
        noise = _with_density(noise, autospectrum(scatter, dt, cut)[1], low, len(difference), len(scatter))
    if noise.rms < numerical:
        noise = replace(noise, rms=numerical, source=INTEGRATION)
    # Noise is a part of what is left: an estimate of it that scatters above all of that is cut back to it.
    return replace(noise, rms=min(noise.rms, float(np.sqrt(np.mean(residual**2)))))


def _between_periods(prepared: Prepared, sensor: Sensor) -> Floats | None:
    """Differences of the response between neighbouring periods with the variance of the noise, strung together.

    Periods are counted back from the end of the judging part, where the motion has settled; the whole
    record serves, because scatter says nothing of a model. None if there are not two alike.
    """
    record, last = prepared.record, prepared.plan.judge[1]
    period = record.period
    if period is None or last // period < 2:
        return None
    count = min(last // period, 6)
    first = last - count * period
    motion = record[sensor][first:last].reshape(count, period)
    alike = np.ones(count - 1, dtype=np.bool_)
    for name in record.forces:
        force = record[name][first:last].reshape(count, period)
        alike &= np.sqrt(np.mean(np.diff(force, axis=0) ** 2, axis=1)) < SAME_FORCE * float(np.std(force))
    settled = np.diff(motion, axis=0)[alike] / np.sqrt(2.0)
    if not len(settled):
        return None
    return settled[1:].ravel() if len(settled) > 2 else settled[-1]  # the first may still hold the beginning


def _with_density(noise: Noise, density: Floats, low: float, judged: int, samples: int) -> Noise:
    """The same with a noise density that was measured."""
    keep = noise.frequency >= low
    width = float(noise.frequency[1])
    rms = float(np.sqrt(np.sum(density[keep]) * width))
    cut = segments_of(judged)
    lines = np.count_nonzero(keep) / cut.line_inflation()
    own = cut.effective_averages(samples)
    spread = density * np.sqrt(1.0 / noise.averages + 1.0 / own)
    error = float(np.sqrt(np.sum((spread * width)[keep] ** 2) * cut.line_inflation()))
    above = float(np.sum((noise.residual - density)[keep]) * width)
    return replace(
        noise, density=density, rms=rms, error=0.5 * rms / np.sqrt(own * lines),
        excess=max(above, 0.0), significance=above / error if error > 0.0 else np.inf, source=SCATTER,
    )  # fmt: skip
