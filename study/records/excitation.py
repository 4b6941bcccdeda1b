"""Seeded force histories, their theoretical autospectra, and the noise on the response.

Every history closes on itself (``periods`` times in the record, swept sines aside) and has no content above its
cut-off but what the ends of sweeps and steps and the flanks of blows add, so that its band-limited interpolation
between the samples is exact. Force and noise use two independent streams of one seed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, rfft

from study.support.arrays import Complexes, Floats, Ints
from study.support.errors import StudyError
from study.support.numbers import LAST_DIGITS

STREAMS = ("force", "noise")  # of random numbers, that one seed gives
READINGS = ("raw", "filtered")
SWEEPS = ("linear", "logarithmic")
SETTINGS = {  # settings of each kind, beside kind, level and periods
    "gaussian_lowpass": ("reading", "cutoff"),
    "pierson_moskowitz": ("peak_frequency", "cutoff"),
    "random_phase_multisine": ("start_frequency", "stop_frequency", "odd_only"),
    "swept_sine": ("start_frequency", "stop_frequency", "sweep"),
    "gaussian_band": ("start_frequency", "stop_frequency"),
    "stepped_sine": ("start_frequency", "stop_frequency", "sweep", "steps"),
    "blows": ("cutoff", "blows"),
}
UP_TO_CUTOFF = ("gaussian_lowpass", "pierson_moskowitz", "blows")  # the others run from one frequency to another


@dataclass(frozen=True)
class Excitation:
    """Kind and settings of a force; :func:`force` gives its history.

    The ``level`` of ``gaussian_lowpass`` (the report's, Section 2.1) is the variance, in expectation, of the ``raw``
    white sequence before its low-pass, of which a share of twice the cut-off over the sampling rate remains, or of the
    ``filtered`` force: that is its ``reading``.
    """

    kind: str = "gaussian_lowpass"  # a key of ``SETTINGS``
    level: float = 1.0  # mean square of the force in N^2
    reading: str = "raw"  # one of ``READINGS``
    cutoff: float = 12.5  # highest frequency in Hz; of blows the first zero of a blow's spectrum
    peak_frequency: float = 3.0  # where the Pierson-Moskowitz autospectrum has its peak, in Hz
    start_frequency: float = 0.1  # lower end of a band; where a sweep or its steps begin, which may fall. In Hz
    stop_frequency: float = 12.5
    odd_only: bool = False  # whether the multisine leaves out the even harmonics of its period
    sweep: str = "linear"  # or ``logarithmic``, in frequency
    steps: int = 12  # frequencies of a stepped sine, each held as long as the others
    blows: int = 8  # of a hammer, one at random in each of as many equal parts of the period
    periods: int = 1  # how often the same history is repeated in the record

    def __post_init__(self) -> None:
        for name, known in (("kind", tuple(_HISTORIES)), ("reading", READINGS), ("sweep", SWEEPS)):
            if getattr(self, name) not in known:
                raise StudyError(f"{name} of the excitation is {getattr(self, name)!r}; it may be {', '.join(known)}")
        if not (np.isfinite(self.level) and self.level >= 0.0):
            raise StudyError(f"level of the excitation is {self.level:g}; a mean square is finite and not negative")
        for name in ("cutoff", "peak_frequency", "start_frequency", "stop_frequency"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise StudyError(f"{name} of the excitation is {value:g} Hz; it must be above zero")
        for name, fewest in (("periods", 1), ("steps", 2), ("blows", 1)):
            if (count := getattr(self, name)) < fewest:
                raise StudyError(f"{name} of the excitation is {count}; at least {fewest} is needed")
        if self.start_frequency == self.stop_frequency:
            raise StudyError(
                f"start_frequency and stop_frequency are both {self.stop_frequency:g} Hz; they must differ"
            )
        if self.kind in ("random_phase_multisine", "gaussian_band") and self.start_frequency > self.stop_frequency:
            raise StudyError(
                f"start_frequency {self.start_frequency:g} Hz lies above stop_frequency {self.stop_frequency:g} Hz; "
                f"the band of a {self.kind} runs from the lower to the higher"
            )

    @property
    def highest(self) -> float:
        """Highest frequency in Hz that the force holds."""
        if self.kind in UP_TO_CUTOFF:
            return self.cutoff
        return max(self.start_frequency, self.stop_frequency)

    @property
    def lowest(self) -> float:
        """Frequency in Hz below which the force holds nothing."""
        if self.kind in UP_TO_CUTOFF:
            return 0.0
        return min(self.start_frequency, self.stop_frequency)


def force(excitation: Excitation, samples: int, dt: float, seed: int) -> Floats:
    """A force history in newtons, shape (samples,); ``samples`` is a multiple of ``excitation.periods``.

    The same seed gives the same bytes. A swept sine is not random and is the same for all.
    """
    length = _checked_period(excitation, samples, dt)
    period = _HISTORIES[excitation.kind](excitation, length, dt, _generator(seed, "force"))
    return np.tile(period, excitation.periods)


def theoretical_autospectrum(excitation: Excitation, frequency: Floats, samples: int, dt: float) -> Floats:
    """One-sided autospectral density in N^2/Hz that a :func:`force` has in expectation, at each ``frequency``.

    A multisine's lines are spread over the band, and a sweep's density is that of stationary phase
    (mean square over the time spent at each frequency): what an estimate of lower resolution shows.
    """
    length = _checked_period(excitation, samples, dt)
    return _DENSITIES[excitation.kind](excitation, np.asarray(frequency, dtype=np.float64), length, dt)


def displacement_noise(displacement: Floats, fraction: float, seed: int) -> Floats:
    """White Gaussian noise to be added to a noise-free displacement (Section 5.4), shape (n,).

    ``fraction`` is its mean square, in expectation, over that of the displacement. The seed may be that of the force:
    the streams are independent.
    """
    if not (np.isfinite(fraction) and fraction >= 0.0):
        raise StudyError(f"noise fraction is {fraction:g}; a ratio of mean squares is finite and not negative")
    scale = np.sqrt(fraction * np.mean(displacement**2))
    return scale * _generator(seed, "noise").standard_normal(len(displacement))


def _generator(seed: int, stream: str) -> np.random.Generator:
    if seed < 0:
        raise StudyError(f"seed is {seed}; it must be a whole number of at least 0")
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(STREAMS.index(stream),))))


def _checked_period(excitation: Excitation, samples: int, dt: float) -> int:
    """Samples of one period, when the settings suit the record."""
    if not (np.isfinite(dt) and dt > 0.0):
        raise StudyError(f"sampling interval is {dt:g} s; it must be above zero")
    if samples < 2 * excitation.periods or samples % excitation.periods:
        raise StudyError(
            f"{samples} samples do not hold {excitation.periods} whole periods of at least 2 samples; "
            "take a multiple of the number of periods"
        )
    nyquist = 0.5 / dt
    if excitation.highest > nyquist * (1.0 + LAST_DIGITS):
        raise StudyError(
            f"the excitation reaches {excitation.highest:g} Hz, above the Nyquist frequency of {nyquist:g} Hz "
            f"at a sampling interval of {dt:g} s; take a lower frequency or a shorter interval"
        )
    return samples // excitation.periods


def _passed(excitation: Excitation, length: int, dt: float) -> int:
    """Number of lines of a real FFT from zero up to and with the cut-off."""
    return min(int(excitation.cutoff * length * dt * (1.0 + LAST_DIGITS)), length // 2) + 1


def _raw_variance(excitation: Excitation, length: int, dt: float) -> float:
    """Variance of the white sequence before the low-pass."""
    if excitation.reading == "raw":
        return excitation.level
    passed = _passed(excitation, length, dt)
    whole = length % 2 == 0 and passed == length // 2 + 1  # zero and Nyquist line stand for one dimension each
    return excitation.level * length / (2 * passed - 1 - int(whole))


def _gaussian_lowpass(excitation: Excitation, length: int, dt: float, generator: np.random.Generator) -> Floats:
    spectrum = rfft(generator.standard_normal(length))
    spectrum[_passed(excitation, length, dt) :] = 0.0
    return np.sqrt(_raw_variance(excitation, length, dt)) * irfft(spectrum, length)


def _gaussian_lowpass_density(excitation: Excitation, frequency: Floats, length: int, dt: float) -> Floats:
    density = 2.0 * dt * _raw_variance(excitation, length, dt)
    return np.where(np.abs(frequency) <= excitation.cutoff * (1.0 + LAST_DIGITS), density, 0.0)


def _pierson_moskowitz(excitation: Excitation, length: int, dt: float, generator: np.random.Generator) -> Floats:
    """A Gaussian process: both quadratures of every line are random, hence its amplitude too."""
    frequency = np.arange(length // 2 + 1) / (length * dt)
    variance = _pierson_moskowitz_density(excitation, frequency, length, dt) / (length * dt)
    normal = generator.standard_normal((2, len(frequency)))
    spectrum: Complexes = 0.5 * length * np.sqrt(variance) * (normal[0] + 1j * normal[1])
    if length % 2 == 0:
        spectrum[-1] = np.sqrt(2.0) * spectrum[-1].real  # one quadrature carries what two carry elsewhere
    return np.asarray(irfft(spectrum, length), dtype=np.float64)


def _pierson_moskowitz_density(excitation: Excitation, frequency: Floats, _length: int, _dt: float) -> Floats:
    """``5 level f_p^4 f^-5 exp(-5/4 (f_p/f)^4)``, whose integral over all frequencies is ``level``.

    The significant level, four root mean squares, is ``4 sqrt(level)``. What lies above the cut-off is omitted.
    """
    inside = (frequency > 0.0) & (frequency <= excitation.cutoff * (1.0 + LAST_DIGITS))
    f = np.where(inside, frequency, excitation.cutoff)
    ratio = (excitation.peak_frequency / f) ** 4
    return np.where(inside, 5.0 * excitation.level * ratio / f * np.exp(-1.25 * ratio), 0.0)


def _lines(excitation: Excitation, length: int, dt: float) -> Ints:
    """Harmonics of the period which a multisine holds."""
    span = length * dt
    first = max(1, int(np.ceil(excitation.start_frequency * span * (1.0 - LAST_DIGITS))))
    last = min(int(excitation.stop_frequency * span * (1.0 + LAST_DIGITS)), (length - 1) // 2)
    lines = np.arange(first, last + 1)
    lines = lines[lines % 2 == 1] if excitation.odd_only else lines
    if len(lines) == 0:
        raise StudyError(
            f"no line of a period of {span:g} s lies from {excitation.start_frequency:g} to "
            f"{excitation.stop_frequency:g} Hz; take a wider band or a longer period"
        )
    return lines


def _random_phase_multisine(excitation: Excitation, length: int, dt: float, generator: np.random.Generator) -> Floats:
    """Equal amplitudes, random phases: the mean square is ``level`` exactly."""
    lines = _lines(excitation, length, dt)
    spectrum = np.zeros(length // 2 + 1, dtype=np.complex128)
    amplitude = np.sqrt(2.0 * excitation.level / len(lines))
    spectrum[lines] = 0.5 * length * amplitude * np.exp(2j * np.pi * generator.random(len(lines)))
    return irfft(spectrum, length)


def _multisine_density(excitation: Excitation, frequency: Floats, length: int, dt: float) -> Floats:
    lines = _lines(excitation, length, dt)
    spacing = (2.0 if excitation.odd_only else 1.0) / (length * dt)
    low, high = lines[0] / (length * dt) - spacing / 2.0, lines[-1] / (length * dt) + spacing / 2.0
    return np.where((frequency >= low) & (frequency <= high), excitation.level / (len(lines) * spacing), 0.0)


def _swept_sine(excitation: Excitation, length: int, dt: float, _random: np.random.Generator) -> Floats:
    first, last, span = excitation.start_frequency, excitation.stop_frequency, length * dt
    time = np.arange(length) * dt
    if excitation.sweep == "linear":
        cycles = first * time + 0.5 * (last - first) * time**2 / span
    else:
        rate = np.log(last / first) / span
        cycles = first * np.expm1(rate * time) / rate
    return np.asarray(np.sqrt(2.0 * excitation.level) * np.sin(2.0 * np.pi * cycles), dtype=np.float64)


def _swept_sine_density(excitation: Excitation, frequency: Floats, _length: int, _dt: float) -> Floats:
    low, high = sorted((excitation.start_frequency, excitation.stop_frequency))
    inside = (frequency >= low) & (frequency <= high)
    if excitation.sweep == "linear":
        return np.where(inside, excitation.level / (high - low), 0.0)
    return np.where(inside, excitation.level / (np.where(inside, frequency, low) * np.log(high / low)), 0.0)


def _gaussian_band(excitation: Excitation, length: int, dt: float, generator: np.random.Generator) -> Floats:
    """A Gaussian process, as white as its band is wide: both quadratures of every line are random."""
    lines = _lines(excitation, length, dt)
    spectrum = np.zeros(length // 2 + 1, dtype=np.complex128)
    normal = generator.standard_normal((2, len(lines)))
    spectrum[lines] = 0.5 * length * np.sqrt(excitation.level / len(lines)) * (normal[0] + 1j * normal[1])
    return irfft(spectrum, length)


def _stepped_sine(excitation: Excitation, length: int, dt: float, _random: np.random.Generator) -> Floats:
    """Whole cycles at each frequency, so that one goes on where the other ends, at zero."""
    bounds: list[int] = [round(length * k / excitation.steps) for k in range(excitation.steps + 1)]
    spaced = np.geomspace if excitation.sweep == "logarithmic" else np.linspace
    wanted = spaced(excitation.start_frequency, excitation.stop_frequency, excitation.steps).tolist()
    values = np.zeros(length)
    for begin, end, frequency in zip(bounds, bounds[1:], wanted, strict=False):
        cycles = max(1, round(frequency * (end - begin) * dt))
        values[begin:end] = np.sin(2.0 * np.pi * cycles * np.arange(end - begin) / max(end - begin, 1))
    return np.asarray(np.sqrt(2.0 * excitation.level) * values, dtype=np.float64)


def _blows(excitation: Excitation, length: int, dt: float, generator: np.random.Generator) -> Floats:
    """Raised cosines of random height, which end before the period does; the mean square is ``level`` exactly."""
    width = _blow_samples(excitation, dt)
    part = length // excitation.blows
    if part <= 2 * width:
        raise StudyError(
            f"{excitation.blows} blows of {width * dt:g} s do not fit into a period of {length * dt:g} s with rests "
            "between them; take fewer, or a longer record"
        )
    pulse, values = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(width) / width), np.zeros(length)
    for k in range(excitation.blows):
        begin = k * part + int(generator.integers(part - width))
        values[begin : begin + width] += generator.uniform(0.5, 1.5) * pulse
    return np.asarray(values * np.sqrt(excitation.level / np.mean(values**2)), dtype=np.float64)


def _blow_samples(excitation: Excitation, dt: float) -> int:
    return max(4, round(2.0 / (excitation.cutoff * dt)))


def _blows_density(excitation: Excitation, frequency: Floats, _length: int, dt: float) -> Floats:
    """That of one blow, as their heights and times are independent of one another."""
    width = _blow_samples(excitation, dt)
    time = np.arange(width) * dt
    pulse = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(width) / width)
    transform = np.abs(np.exp(-2j * np.pi * np.outer(frequency, time)) @ pulse) ** 2
    return np.where(np.abs(frequency) <= 0.5 / dt, 2.0 * dt * excitation.level * transform / np.sum(pulse**2), 0.0)


_HISTORIES: dict[str, Callable[[Excitation, int, float, np.random.Generator], Floats]] = {
    "gaussian_lowpass": _gaussian_lowpass,
    "pierson_moskowitz": _pierson_moskowitz,
    "random_phase_multisine": _random_phase_multisine,
    "swept_sine": _swept_sine,
    "gaussian_band": _gaussian_band,
    "stepped_sine": _stepped_sine,
    "blows": _blows,
}
_DENSITIES: dict[str, Callable[[Excitation, Floats, int, float], Floats]] = {
    "gaussian_lowpass": _gaussian_lowpass_density,
    "pierson_moskowitz": _pierson_moskowitz_density,
    "random_phase_multisine": _multisine_density,
    "swept_sine": _swept_sine_density,
    "gaussian_band": _multisine_density,
    "stepped_sine": _swept_sine_density,
    "blows": _blows_density,
}
