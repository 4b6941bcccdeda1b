"""Frequency and damping ratio against amplitude: what a free decay shows, and what the fitted model makes of it.

The analytic signal of the response (D. Gabor, 1946; M. Feldman, Mechanical Systems and Signal Processing 25, 2011) has
an amplitude and a phase at each instant. Over windows of some periods straight lines through its phase and through the
logarithm of its amplitude give the frequency, and the rate at which the motion decays.

An analytic signal knows too little near an end of the record, and a window of some periods holds their mean, while a
stiffening structure changes its frequency fastest where it is let go. There a carrier with slowly changing amplitude
and phase (complex demodulation: P. Bloomfield, Fourier Analysis of Time Series, 1976), fitted to the first periods
alone by least squares, is evaluated where they begin; it needs nothing from outside of the window.
"""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import fft, fftfreq, ifft

from study.compare.comparison import Comparison
from study.equations.free_run import prepare
from study.identify.frequency_domain.starting_values import frequency_and_rate
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.records.outputs import Outputs
from study.records.prepared import Prepared
from study.records.record import Record, Stretch
from study.records.states import starting_states
from study.support.arrays import Floats
from study.support.errors import DivergenceError

WINDOW = 6.0  # periods over which a frequency is taken
PASS_BAND = (0.5, 1.6)  # of the frequency: what lies outside is offset, drift and overtones
ENDS = 2.0  # periods at each end where the analytic signal knows too little
OVER_FLOOR = 4.0  # amplitude over the noise floor's rms: below, nothing is read


@dataclass(frozen=True)
class Decay:
    """Frequency and damping against amplitude; arrays of shape (windows,)."""

    amplitude: Floats  # in the unit of the response
    frequency: Floats  # in hertz
    damping: Floats  # share of the critical damping
    frequency_error: Floats  # standard errors, from the scatter about the straight lines
    damping_error: Floats


@dataclass(frozen=True)
class Decays:
    """As measured, and as the fitted model has it; the model's is None where it does not stay finite."""

    measured: Decay
    predicted: Decay | None

    def plain(self) -> dict[str, dict[str, list[float]] | None]:
        """As plain rows of numbers."""
        parts = {"measured": self.measured, "predicted": self.predicted}
        return {k: d and {n: np.asarray(x).tolist() for n, x in vars(d).items()} for k, d in parts.items()}


def decays_of(comparison: Comparison, number: int = 0) -> Decays | None:
    """Those of a comparison as one of its sensors shows them; None where it is no free decay, or too short a one."""
    prepared, seen = comparison.prediction.prepared, comparison.prediction.of(number)
    return decays(comparison.fit, prepared, seen.noise.rms, number) if prepared.free else None


def decays(fit: FreeRunFit, prepared: Prepared, floor: float, number: int = 0) -> Decays | None:
    """Both along each free stretch of a record, from its loudest sample on; None where all are too short.

    ``floor`` is the rms of the noise on what the sensor of this number shows. Of a structure they are those of the
    frequency in which that swings most.
    """
    response = str(prepared.outputs.sensors[number])
    omega, _ = frequency_and_rate(prepared.record.part(*prepared.plan.fit), response)
    wholes = _whole_stretches(prepared.record)
    least = OVER_FLOOR * floor
    measured = [_decay(s.source[response][s.first : s.last], prepared.dt, omega, least) for s in wholes]
    predicted: Decay | None = None
    if not fit.model.modal:  # no sensor shows the state of a mode
        with suppress(DivergenceError):
            motions = [_free_motion(fit, prepared.outputs, stretch)[:, number] for stretch in wholes]
            predicted = _joined([_decay(motion, prepared.dt, omega, least) for motion in motions])
    joined = _joined(measured)
    return Decays(joined, predicted) if len(joined.amplitude) else None


def _whole_stretches(record: Record) -> list[Stretch]:
    """Each piece of a source that the stretches cover together, from the first to the last of them."""
    wholes: list[Stretch] = []
    for stretch in sorted(
        record.stretches or (Stretch(record, 0, len(record)),), key=lambda s: (id(s.source), s.first)
    ):
        before = wholes[-1] if wholes else None
        if before is not None and before.source is stretch.source and stretch.first <= before.last + 1:
            wholes[-1] = replace(before, last=max(before.last, stretch.last))
        else:
            wholes.append(replace(stretch, continues=False))
    return wholes


def _free_motion(fit: FreeRunFit, outputs: Outputs, stretch: Stretch) -> Floats:
    """The fitted model let go where a stretch begins, shape (n, sensors)."""
    run = prepare(
        fit.model, stretch.source, sensors=outputs.sensors, steps_per_sample=max(fit.steps_per_sample, 2),
        span=(stretch.first, stretch.last),
    )  # fmt: skip
    begun = starting_states(stretch.source, outputs, (stretch.first,), coordinates=fit.model.coordinates)[0]
    return run.respond({}, np.pad(begun, (0, run.states - len(begun))))[0]


def _decay(values: Floats, dt: float, omega: float, least: float) -> Decay:
    """Frequency and damping of one decay."""
    signal = _analytic(values, dt, omega)
    period = 2.0 * np.pi / (omega * dt)
    first, last, width = round(ENDS * period), len(values) - round(ENDS * period), round(WINDOW * period)
    rows: list[tuple[float, ...]] = []
    for begin in range(first, last - width + 1, max(width // 2, 1)):
        part = signal[begin : begin + width]
        if float(np.median(np.abs(part))) > least:
            rows.append(_window(part, dt))
    if rows and rows[0][0] > least:  # where it begins, which no window of an analytic signal reaches
        rows.insert(0, at_the_release(values[:width], dt, 2.0 * np.pi * rows[0][1], 2.0 * WINDOW))
    return Decay(*np.array(rows).reshape(-1, 5).T)


def _analytic(values: Floats, dt: float, omega: float) -> np.ndarray:
    """Analytic signal of a band about the frequency; the ends are continued by point reflection."""
    n = len(values)
    edge = min(n - 1, round(8.0 * 2.0 * np.pi / (omega * dt)))
    before, after = 2.0 * values[0] - values[edge:0:-1], 2.0 * values[-1] - values[-2 : -edge - 2 : -1]
    longer = np.concatenate([before, values, after])
    lines = fftfreq(len(longer), dt) * 2.0 * np.pi / omega
    rise = np.clip((lines / PASS_BAND[0] - 0.5) / 0.5, 0.0, 1.0) * np.clip(
        (1.25 * PASS_BAND[1] - lines) / (0.25 * PASS_BAND[1]), 0.0, 1.0
    )
    return np.asarray(ifft(2.0 * rise * fft(longer)))[edge : edge + n]


def _window(part: np.ndarray, dt: float) -> tuple[float, ...]:
    """Amplitude, frequency, damping ratio and the errors of these in one window."""
    at = dt * (np.arange(len(part)) - 0.5 * (len(part) - 1))
    size = float(at @ at)
    phase, level = np.unwrap(np.angle(part)), np.log(np.abs(part))
    slopes, errors = list[float](), list[float]()
    for line in (phase, level):
        centred = line - np.mean(line)
        slope = float(at @ centred) / size
        left = centred - slope * at
        # What is left swings with the motion: a window of some periods holds about two independent values in each.
        errors.append(float(np.sqrt(np.mean(left**2) * len(part) / (2.0 * WINDOW) / size)))
        slopes.append(slope)
    rate, fall = slopes
    natural = float(np.hypot(rate, fall))
    return (
        float(np.exp(np.mean(level))), natural / (2.0 * np.pi), -fall / natural,
        errors[0] / (2.0 * np.pi), errors[1] / natural,
    )  # fmt: skip


def _joined(parts: list[Decay]) -> Decay:
    names = ("amplitude", "frequency", "damping", "frequency_error", "damping_error")
    return Decay(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


CARRIER_DEGREE = 3  # of the polynomial that the carrier's complex amplitude is
OVERTONES = 3  # of the motion, which a carrier alone would leave


def at_the_release(values: Floats, dt: float, omega: float, independent: float) -> tuple[float, ...]:
    """Amplitude, natural frequency in Hz, damping ratio, and the standard errors of these two.

    Parameters
    ----------
    values : array of shape (n,)
        The first periods of a decay.
    dt : float
        Sampling interval in seconds.
    omega : float
        Of the carrier, near that of the motion, in rad/s.
    independent : float
        How many independent values the samples hold: what is left swings with the motion.
    """
    t = dt * np.arange(len(values))
    turn = omega * t
    slow = np.asarray(t[:, None] ** np.arange(CARRIER_DEGREE + 1), dtype=np.float64)
    around = [slow * np.cos(turn)[:, None], -slow * np.sin(turn)[:, None]]
    carrier: Floats = np.stack(around, axis=2).reshape(len(t), -1)
    beside: list[Floats] = [f(n * turn) for n in range(2, OVERTONES + 1) for f in (np.cos, np.sin)]
    design = np.asarray(np.column_stack([carrier, *beside, np.ones_like(t)]), dtype=np.float64)
    size = np.asarray(np.linalg.norm(design, axis=0), dtype=np.float64)
    scaled: Floats = design / size
    inverse = np.asarray(np.linalg.pinv(scaled.T @ scaled), dtype=np.float64)
    found: Floats = inverse @ (scaled.T @ values)
    left = values - scaled @ found
    spare = max(independent * (1.0 - scaled.shape[1] / len(values)), 1.0)
    covariance: Floats = inverse[:4, :4] * float(left @ left) / spare
    a, b, da, db = (float(x) for x in found[:4] / size[:4])
    z, slope = complex(a, b), complex(da, db)
    growth = slope / z  # rate of the amplitude's logarithm, and of the phase beside the carrier's
    fall, rate = growth.real, omega + growth.imag
    natural = float(np.hypot(rate, fall))
    gradient = np.array([-growth / z, -1j * growth / z, 1.0 / z, 1j / z]) / size[:4]
    errors = [float(np.sqrt(part @ covariance @ part)) for part in (gradient.imag, gradient.real)]
    return abs(z), natural / (2.0 * np.pi), -fall / natural, errors[0] / (2.0 * np.pi), errors[1] / natural
