"""The experiment of a trial: a linear oscillator, how it is driven, and how it is sampled.

Two ranges are drawn from. ``REPORT_LIKE`` is sampled and damped as the report's systems are, give or take a factor of
two; ``WIDE`` is what laboratories do.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from study.equations.model import Model, ModelTerm
from study.equations.terms import get
from study.records.excitation import Excitation
from study.records.record import MOTIONS

LINEAR = ("inertia", "linear_damping", "linear_stiffness")  # what a linear model has: it cannot be hidden behind one
SLOWEST = 12.5  # samples a period of the linear system from which on the plain number of steps a sample will do
RATES = (5.0, 200.0)  # samples a period
DAMPINGS = (0.001, 0.30)  # share of the critical damping
SAMPLES = (1_000, 200_000)  # in a record
PERIODS = 50.0  # of the linear system, that a record holds at least: half of them are fitted, half judged
MEMORIES = 8.0  # times in which its motion falls to 1/e, that a record holds at least
WHOLE = 16  # samples: a record is a multiple of these, and so of every number of repetitions
REPEATED = (1, 2, 4, 8)  # times that a periodic force is repeated in a record; once is not for a sweep
BETWEEN = 25.0  # periods of the linear system in one repetition, at least
REACH = (1.5, 8.0)  # highest frequency of the force over that of the linear system
SAMPLED = 0.4  # ... and over the sampling rate, at most
KINDS = ("gaussian_lowpass", "pierson_moskowitz", "random_phase_multisine", "linear_sweep", "logarithmic_sweep")


@dataclass(frozen=True)
class Experiment:
    """A linear oscillator under a force."""

    system: Model  # inertia, linear damping, linear stiffness
    damping: float  # share of the critical damping
    frequency: float  # natural frequency in Hz
    dt: float  # sampling interval in seconds
    samples: int  # in the record
    excitation: Excitation
    secant: bool = True  # whether effects are sized by the secant method; seeds of old rest on a slower one

    @property
    def samples_a_period(self) -> float:
        """Samples in a period of the linear system."""
        return 1.0 / (self.frequency * self.dt)

    @property
    def kind(self) -> str:
        """Which of ``KINDS`` drives it."""
        return f"{self.excitation.sweep}_sweep" if self.excitation.kind == "swept_sine" else self.excitation.kind

    def steps(self, plain: int) -> int:
        """Integration steps a sample, for as many a period as ``plain`` ones give a system of ``SLOWEST`` samples."""
        return plain * max(1, int(np.ceil(SLOWEST / self.samples_a_period)))


@dataclass(frozen=True)
class Ranges:
    """What trials are drawn from."""

    responses: tuple[str, ...]  # one of which is measured
    experiment: Callable[[np.random.Generator], Experiment]
    accurate: float  # relative change of the measured motion with half of the integration steps, at most
    drowned: float = math.inf  # rms of a hidden harmonic force over that of the measured one, at most


def report_like(rng: np.random.Generator) -> Experiment:
    """8,192 samples, 12.5 to 25 of them a period, 2 to 10 % of critical damping, low-passed Gaussian force."""
    mass = float(10.0 ** rng.uniform(-2.0, 3.0))
    f_n = float(10.0 ** rng.uniform(-0.5, 2.0))
    zeta = float(rng.uniform(0.02, 0.10))
    dt = float(rng.uniform(0.04, 0.08)) / f_n
    excitation = Excitation(level=float(10.0 ** rng.uniform(-1.0, 5.0)), reading="filtered", cutoff=0.25 / dt)
    return Experiment(_oscillator(mass, f_n, zeta), zeta, f_n, dt, 8192, excitation, secant=False)


def wide(rng: np.random.Generator) -> Experiment:
    """Samples a period and damping evenly on a logarithmic scale, any excitation, and a record that is long enough.

    It holds ``PERIODS`` periods and ``MEMORIES`` memory times of the linear system; above that least length the
    density of the number of samples falls as its inverse square, since long records take long: half of them hold less
    than twice the least. What would need more than the most is drawn again.
    """
    mass = float(10.0 ** rng.uniform(-2.0, 3.0))
    f_n = float(10.0 ** rng.uniform(-0.5, 2.0))
    rate, zeta, least = 0.0, 0.0, float(np.inf)
    while least > SAMPLES[1]:
        rate, zeta = _evenly_in_log(rng, RATES), _evenly_in_log(rng, DAMPINGS)
        least = max(float(SAMPLES[0]), PERIODS * rate, MEMORIES * rate / (2.0 * np.pi * zeta))
    samples = 1.0 / rng.uniform(1.0 / SAMPLES[1], 1.0 / least)
    samples = WHOLE * int(np.clip(np.ceil(samples / WHOLE), SAMPLES[0] // WHOLE + 1, SAMPLES[1] // WHOLE))
    excitation = _excitation(rng, f_n, rate, samples / rate)
    return Experiment(_oscillator(mass, f_n, zeta), zeta, f_n, 1.0 / (rate * f_n), samples, excitation)


def _excitation(rng: np.random.Generator, f_n: float, rate: float, periods: float) -> Excitation:
    """A force around the resonance, for a record of so many periods of it.

    Sweeps are repeated, so that the part to judge is driven at the frequencies of the part to fit.
    """
    kind = str(rng.choice(KINDS))
    level = float(10.0 ** rng.uniform(-1.0, 5.0))
    highest = f_n * _evenly_in_log(rng, (REACH[0], min(REACH[1], SAMPLED * rate)))
    lowest = f_n * _evenly_in_log(rng, (0.1, 0.5))
    peak = f_n * float(rng.uniform(0.4, 1.2))
    repeated = int(rng.choice([n for n in REPEATED if periods / n >= BETWEEN and (n > 1 or "sweep" not in kind)]))
    odd, falls = bool(rng.integers(2)), bool(rng.integers(2))
    match kind:
        case "gaussian_lowpass":
            return Excitation(kind, level, "filtered", highest)
        case "pierson_moskowitz":
            return Excitation(kind, level, cutoff=highest, peak_frequency=peak)
        case "random_phase_multisine":
            return Excitation(
                kind, level, start_frequency=lowest, stop_frequency=highest, odd_only=odd, periods=repeated
            )
        case _:
            first, last = (highest, lowest) if falls else (lowest, highest)
            return Excitation(
                "swept_sine", level, start_frequency=first, stop_frequency=last, sweep=kind.removesuffix("_sweep"),
                periods=repeated,
            )  # fmt: skip


def _oscillator(mass: float, f_n: float, zeta: float) -> Model:
    omega = 2.0 * np.pi * f_n
    values = (mass, 2.0 * zeta * omega * mass, omega**2 * mass)
    return Model("truth", tuple(ModelTerm(get(n), (v,), ()) for n, v in zip(LINEAR, values, strict=True)))


def _evenly_in_log(rng: np.random.Generator, bounds: tuple[float, float]) -> float:
    return math.exp(rng.uniform(math.log(bounds[0]), math.log(bounds[1])))


REPORT_LIKE = Ranges(("displacement", "acceleration"), report_like, 1e-3)
WIDE = Ranges(MOTIONS, wide, 3e-4, drowned=0.5)
