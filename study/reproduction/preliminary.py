"""Preliminary analysis of measured data (the report's Section 3).

Restoring force from force and acceleration, its patterns over displacement, the lines of a Mathieu
system's response, and histograms beside the Gaussian. What a record or a model lacks for one of them, a ``StudyError``
says with what was expected.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from study.equations.equations_of_motion import acceleration_program
from study.equations.model import Model
from study.records.record import Record
from study.support.arrays import Floats
from study.support.errors import StudyError

POINTS_A_CYCLE = 256


@dataclass(frozen=True)
class Pattern:
    """Restoring force over displacement, in the order in which time runs; arrays of shape (n,)."""

    displacement: Floats
    force: Floats


@dataclass(frozen=True)
class Histogram:
    """How a quantity is distributed, in its own unit, beside a Gaussian of the same mean and variance."""

    edges: Floats  # shape (bins + 1,)
    density: Floats  # probability density, whose integral is one; shape (bins,)
    points: Floats  # where the Gaussian's density is given
    gaussian: Floats  # the Gaussian's density
    mean: float
    deviation: float
    skewness: float  # third standardised moment, 0 for a Gaussian
    kurtosis: float  # fourth standardised moment, 3 for a Gaussian


def restoring_force(record: Record, mass: float) -> Floats:
    """``F - m d2u/dt2`` along a record, (2.2); shape (n,), in the record's unit of force."""
    if "acceleration" not in record:
        raise StudyError(f"{record.name} has no channel 'acceleration'; expected one for the restoring force F - m a")
    if not mass > 0.0:
        raise StudyError(f"the mass is {mass:g}; expected one above zero for the restoring force F - m a")
    return record["force"] - mass * record["acceleration"]


def random_pattern(record: Record, mass: float) -> Pattern:
    """Restoring force over displacement under the force of a record (Figures 2b to 7b)."""
    if "displacement" not in record:
        raise StudyError(f"{record.name} has no channel 'displacement'; expected one for a force/displacement pattern")
    return Pattern(record["displacement"], restoring_force(record, mass))


def model_restoring_force(model: Model, displacement: Floats, velocity: Floats, time: Floats) -> Floats:
    """Restoring force (2.3) of a model that is made to follow a motion, shape (n,).

    It is what the model's own equation of motion gives: ``-m`` times the acceleration under no force. A term that
    remembers the past is refused: its force is no function of this motion alone.
    """
    from study.equations import kernels  # the compiled loops are slow to load; those who draw histograms need none

    if model.states:
        names = ", ".join(t.name for t in model.states)
        raise StudyError(f"model {model.name!r} holds {names}, which remembers the past; simulate it instead")
    if "inertia" not in model:
        raise StudyError(f"model {model.name!r} has no inertia; a restoring force needs it")
    motion = {"u:": displacement, "v:": velocity, "t": time}
    return -model.numbers()["m"] * kernels.evaluate(acceleration_program(model), motion, len(time))[:, 0]


def harmonic_pattern(model: Model, amplitude: float, frequency: float, cycles: int = 1) -> Pattern:
    """Restoring force over displacement for ``u = U sin(2 pi f_0 t)``, (3.1) and (3.2).

    ``amplitude`` is U, in the model's unit of length, ``frequency`` f_0 in hertz; a stiffness that varies with time
    closes its pattern only after several ``cycles``.
    """
    for name, value in (("amplitude", amplitude), ("frequency", frequency)):
        if not value > 0.0:
            raise StudyError(f"the {name} of the harmonic motion is {value:g}; expected a value above zero")
    time = np.arange(cycles * POINTS_A_CYCLE + 1) / (POINTS_A_CYCLE * frequency)
    omega = 2.0 * math.pi * frequency
    displacement = amplitude * np.sin(omega * time)
    velocity = omega * amplitude * np.cos(omega * time)
    return Pattern(displacement, model_restoring_force(model, displacement, velocity, time))


def harmonic_beside(model: Model, record: Record) -> tuple[float, float]:
    """Amplitude and frequency (hertz) of the harmonic motion that a random one is laid beside.

    The amplitude is the record's largest. The captions of Figures 2 to 7 give no frequency; the only one that
    Section 3.2 speaks of is the natural frequency, which the random response is said to fluctuate close to. The
    record's own frequency would fit the one pattern to the other before they are compared.
    """
    return float(np.abs(record["displacement"]).max()), natural_frequency(model.numbers())


def closing_cycles(model: Model, frequency: float) -> int:
    """Cycles of a harmonic motion (``frequency`` in hertz) that span a period of the model's periodic stiffness."""
    slow = model.values.get("periodic_stiffness.f_m")
    return 1 if slow is None or not slow > 0.0 else max(1, math.ceil(frequency / slow - 1e-3))


def natural_frequency(values: Mapping[str, float | None]) -> float:
    """``sqrt(k/m) / (2 pi)`` in hertz, (4.4), from a model's ``values``."""
    mass, stiffness = values.get("m"), values.get("k")
    if mass is None or stiffness is None or not mass > 0.0 or not stiffness > 0.0:
        raise StudyError(f"m = {mass} and k = {stiffness} give no natural frequency; expected both above zero")
    return math.sqrt(stiffness / mass) / (2.0 * math.pi)


def mean_curve(record: Record, mass: float, *powers: int) -> list[float]:
    """Least-squares coefficients of the restoring force on powers of the displacement."""
    columns: Floats = np.column_stack([record["displacement"] ** power for power in powers])
    scale: Floats = np.sqrt(np.mean(columns**2, axis=0))
    scaled: Floats = columns / scale
    solution: Floats = np.linalg.solve(scaled.T @ scaled, scaled.T @ restoring_force(record, mass)) / scale
    return solution.tolist()


def local_damping_ratio(record: Record, mass: float) -> float:
    """Damping beyond 1.5 standard deviations of displacement over that within half of one."""
    u, v = record["displacement"], record["velocity"]
    a, b = mean_curve(record, mass, 1, 3)
    rest, size = restoring_force(record, mass) - (a * u + b * u**3), np.abs(u) / np.std(u)
    outer, inner = (float(np.sum(rest[k] * v[k]) / np.sum(v[k] ** 2)) for k in (size > 1.5, size < 0.5))
    return outer / inner


def read_dead_band(record: Record, mass: float) -> float:
    """The gap that a pattern shows: force of a slope beyond +-u_g, none within, that fits it best."""
    u, v = record["displacement"], record["velocity"]
    rest = restoring_force(record, mass)
    tried = np.linspace(0.0, float(np.max(np.abs(u))), 121)[:-1]  # from none to the largest displacement
    left: list[float] = []
    for gap in tried:
        design = np.column_stack([u - np.clip(u, -gap, gap), v])
        coefficients = np.linalg.solve(design.T @ design, design.T @ rest)
        left.append(float(np.sum((rest - design @ coefficients) ** 2)))
    return float(tried[int(np.argmin(left))])


def mathieu_frequencies(natural: float, modulation: float) -> dict[str, float]:
    """Frequencies at which a Mathieu system's response is strong, by their formulas (Section 3.3).

    All are in hertz, as are f_n of the mean stiffness and the frequency f_m of the stiffness that are given.
    """
    return {"|f_n - f_m|": abs(natural - modulation), "f_n": natural, "|f_n + f_m|": natural + modulation}


def histogram(values: Floats, bins: int = 51) -> Histogram:
    """Distribution of a quantity, shape (n,), over evenly spaced bins that reach its largest excursion."""
    mean, deviation = float(np.mean(values)), float(np.std(values))
    if not deviation > 0.0:
        raise StudyError(f"all {len(values)} values are {mean:g}; expected values that differ, for a histogram")
    reach = float(np.abs(values - mean).max())
    density, edges = np.histogram(values, bins=bins, range=(mean - reach, mean + reach), density=True)
    points = np.linspace(mean - max(reach, 3.5 * deviation), mean + max(reach, 3.5 * deviation), 201)
    z = (points - mean) / deviation
    scaled = (values - mean) / deviation
    return Histogram(
        edges=edges, density=density.astype(np.float64), points=points,
        gaussian=np.exp(-0.5 * z**2) / (deviation * math.sqrt(2.0 * math.pi)), mean=mean, deviation=deviation,
        skewness=float(np.mean(scaled**3)), kurtosis=float(np.mean(scaled**4)),
    )  # fmt: skip
