"""Trials of a force on a mass and spring: a linear oscillator, how it is driven, and how it is sampled.

Two ranges are drawn from. ``REPORT_LIKE`` is sampled and damped as the report's systems are, give or take a factor of
two; ``LABORATORIES`` is what laboratories do. Half of the systems have a known nonlinearity of the report's kind.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from study.equations.free_run import predict_response
from study.equations.model import Model, ModelTerm, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import LINEAR, get
from study.records.excitation import Excitation, displacement_noise, force
from study.records.record import MOTIONS, Record
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.trials import effects
from study.trials.effects import SHARE, Asked, Rig, Shares, Sizing, evenly_in_log, linear_oscillator, share_of

EXCITATIONS = ("gaussian_lowpass", "pierson_moskowitz", "random_phase_multisine", "linear_sweep", "logarithmic_sweep")
KNOWN_EFFECTS = ("none", "none", "cubic_stiffness", "van_der_pol_damping")  # of which one is drawn
PLAIN_RATE = 12.5  # samples a period of the linear system from which on the plain number of steps a sample will do
FINE_STEPS = 32  # per sample of the record, and more where there are few samples a period


@dataclass(frozen=True)
class Experiment:
    """A linear oscillator under a force."""

    system: Model  # inertia, linear damping, linear stiffness
    damping: float  # share of the critical damping
    frequency: float  # natural frequency in Hz
    dt: float  # sampling interval in seconds
    samples: int  # in the record
    excitation: Excitation

    @property
    def samples_a_period(self) -> float:
        """Samples in a period of the linear system."""
        return 1.0 / (self.frequency * self.dt)

    @property
    def kind(self) -> str:
        """Which of ``EXCITATIONS`` drives it."""
        return f"{self.excitation.sweep}_sweep" if self.excitation.kind == "swept_sine" else self.excitation.kind

    def steps(self, plain: int) -> int:
        """Integration steps a sample: as many a period as ``plain`` ones are at ``PLAIN_RATE`` samples a period."""
        return plain * max(1, int(np.ceil(PLAIN_RATE / self.samples_a_period)))


@dataclass(frozen=True)
class Ranges:
    """What trials are drawn from: where nothing else is said, what laboratories do."""

    experiment: Callable[[np.random.Generator, "Ranges"], Experiment]
    responses: tuple[str, ...] = MOTIONS  # one of which is measured
    known: float = 0.15  # share of the restoring force that a known nonlinearity carries
    accurate: float = 3e-4  # relative change of the measured motion with half of the integration steps, at most
    drowned: float = 0.5  # rms of a hidden harmonic force over that of the measured one, at most
    secant: bool = True  # whether effects are sized by the secant method; seeds of old rest on a slower one
    rates: tuple[float, float] = (5.0, 200.0)  # samples a period
    dampings: tuple[float, float] = (0.001, 0.30)  # share of the critical damping
    samples: tuple[int, int] = (1_000, 200_000)  # in a record
    periods: float = 50.0  # of the linear system, that a record holds at least: half are fitted, half judged
    memories: float = 8.0  # times in which its motion falls to 1/e, that a record holds at least
    whole: int = 16  # samples: a record is a multiple of these, and so of every number of repetitions
    repeated: tuple[int, ...] = (1, 2, 4, 8)  # times that a periodic force is repeated; once is not for a sweep
    between: float = 25.0  # periods of the linear system in one repetition, at least
    reach: tuple[float, float] = (1.5, 8.0)  # highest frequency of the force over that of the linear system
    sampled: float = 0.4  # ... and over the sampling rate, at most


def driven_rig(rng: np.random.Generator, asked: Asked, ranges: Ranges) -> Rig:
    """A linear oscillator under a force, every second one with a known nonlinearity."""
    experiment = ranges.experiment(rng, ranges)
    drive = force(experiment.excitation, experiment.samples, experiment.dt, asked.seed)

    def simulated(model: Model, steps: int, drive: Floats = drive) -> Record:
        return simulate(model, drive, experiment.dt, Integrator("rk4", experiment.steps(steps)))

    def motion(model: Model) -> Record:
        return simulated(model, 2)

    def strength(unit: ModelTerm, record: Record) -> tuple[float, float]:
        restoring = drive - (experiment.system.values["m"] or 0.0) * record["acceleration"]
        return effects.beyond_linear(effects.force_along(unit, record), [record[c] for c in MOTIONS]), float(
            np.std(restoring)
        )

    def recorded(truth: Model, _: Shares) -> tuple[Record, Shares]:
        record = simulated(truth, 8)
        size = float(np.std(record["displacement"])) / float(np.std(linear["displacement"]))
        expect(0.1 < size < 10.0, "the motion is of another size than the linear one, by which shapes were drawn")
        push = min(20, int(np.ceil(experiment.samples_a_period / 2.0)))  # samples: not more than half a period
        calm = effects.forgets(lambda f: simulated(truth, 2, f)["displacement"], drive, push)
        expect(calm, "the motion does not forget how it began")
        # On a resonance a harmonic force would have to be many times larger than the measured one to be the wanted
        # share of the restoring force, and what the measured force does then lies below the noise.
        harmonic = math.hypot(truth.values.get("fh_cos") or 0.0, truth.values.get("fh_sin") or 0.0)
        most = ranges.drowned * math.sqrt(2.0) * float(np.std(drive))
        expect(harmonic <= most, "the harmonic force drowns the measured one")
        shares = tuple(share_of(truth, name, record) for name in asked.hidden)
        expect(all(SHARE[0] <= share <= SHARE[1] for share in shares), "an effect has changed the share of another")
        fine, coarse = (
            predict_response(truth, record, response=asked.response, steps_per_sample=experiment.steps(FINE_STEPS) // n)
            for n in (1, 2)
        )
        accurate = float(np.std(fine - coarse)) < ranges.accurate * float(np.std(fine))
        expect(accurate, "so many steps do not give the motion")
        if asked.noise > 0.0:
            fine = fine + displacement_noise(fine, asked.noise, asked.seed)
        return Record(experiment.dt, {"force": drive, asked.response: fine}, record.units), shares

    base, quiet = experiment.system, simulated(experiment.system, 4)
    linear, sizing = quiet, Sizing(12, secant=ranges.secant)
    rig = Rig(base, lambda term: effects.drawn_effect(rng, free(term), quiet), motion, strength, recorded, sizing, {})
    known = str(rng.choice(KNOWN_EFFECTS))
    if known != "none" and known not in asked.hidden:
        with suppress(StudyError):  # without it, where it cannot be so strong
            base, _ = effects.grown(base, replace(free(get(known)), coefficients=(1.0,)), ranges.known, rig)
    if base is not experiment.system:
        quiet = simulated(base, 4)
    # A steady force moves a system to another place, which only a displacement shows if no force depends on the place.
    # Linear stiffness does not count: it is the same everywhere.
    hidden = [get(name) for name in asked.hidden]
    moves = any(term.steady for term in hidden) and all(t.placeless for t in (*hidden, *(e.term for e in base.terms)))
    expect(asked.response == "displacement" or not moves, f"the {asked.response} does not show them")
    about = {
        "samples_a_period": experiment.samples_a_period, "samples": experiment.samples,
        "damping": experiment.damping, "excitation": experiment.kind,
        "known": "+".join(t.name for t in base.terms[len(LINEAR) :]) or "linear",
    }  # fmt: skip
    return replace(rig, base=base, about=about)


def report_like(rng: np.random.Generator, _: Ranges) -> Experiment:
    """8,192 samples, 12.5 to 25 of them a period, 2 to 10 % of critical damping, low-passed Gaussian force."""
    mass = float(10.0 ** rng.uniform(-2.0, 3.0))
    f_n = float(10.0 ** rng.uniform(-0.5, 2.0))
    zeta = float(rng.uniform(0.02, 0.10))
    dt = float(rng.uniform(0.04, 0.08)) / f_n
    excitation = Excitation(level=float(10.0 ** rng.uniform(-1.0, 5.0)), reading="filtered", cutoff=0.25 / dt)
    return Experiment(linear_oscillator(mass, f_n, zeta), zeta, f_n, dt, 8192, excitation)


def wide(rng: np.random.Generator, ranges: Ranges) -> Experiment:
    """Samples a period and damping evenly on a logarithmic scale, any excitation, and a record that is long enough.

    It holds so many periods and memory times of the linear system; above that least length the density of the number of
    samples falls as its inverse square, since long records take long: half of them hold less than twice the least. What
    would need more than the most is drawn again.
    """
    mass = float(10.0 ** rng.uniform(-2.0, 3.0))
    f_n = float(10.0 ** rng.uniform(-0.5, 2.0))
    (fewest, most), whole = ranges.samples, ranges.whole
    rate, zeta, least = 0.0, 0.0, math.inf
    while least > most:
        rate, zeta = evenly_in_log(rng, *ranges.rates), evenly_in_log(rng, *ranges.dampings)
        least = max(float(fewest), ranges.periods * rate, ranges.memories * rate / (2.0 * np.pi * zeta))
    samples = 1.0 / rng.uniform(1.0 / most, 1.0 / least)
    samples = whole * int(np.clip(np.ceil(samples / whole), fewest // whole + 1, most // whole))
    excitation = _excitation(rng, ranges, f_n, rate, samples / rate)
    return Experiment(linear_oscillator(mass, f_n, zeta), zeta, f_n, 1.0 / (rate * f_n), samples, excitation)


def _excitation(rng: np.random.Generator, ranges: Ranges, f_n: float, rate: float, periods: float) -> Excitation:
    """A force around the resonance, for a record of so many periods of it.

    Sweeps are repeated, so that the part to judge is driven at the frequencies of the part to fit.
    """
    kind = str(rng.choice(EXCITATIONS))
    level = float(10.0 ** rng.uniform(-1.0, 5.0))
    highest = f_n * evenly_in_log(rng, ranges.reach[0], min(ranges.reach[1], ranges.sampled * rate))
    lowest = f_n * evenly_in_log(rng, 0.1, 0.5)
    peak = f_n * float(rng.uniform(0.4, 1.2))
    least = 2 if "sweep" in kind else 1
    repeated = int(rng.choice([n for n in ranges.repeated if periods / n >= ranges.between and n >= least]))
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
            sweep = kind.removesuffix("_sweep")
            return Excitation(
                "swept_sine", level, start_frequency=first, stop_frequency=last, sweep=sweep, periods=repeated
            )


LABORATORIES = Ranges(wide)
REPORT_LIKE = Ranges(report_like, ("displacement", "acceleration"), accurate=1e-3, drowned=math.inf, secant=False)
