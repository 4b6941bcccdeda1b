"""Section 3.2: restoring force over displacement."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from study.equations.model import Model
from study.records.record import Record
from study.reproduction.claims.common import COMBINED, READ_OFF, SYSTEMS
from study.reproduction.claims.evidence import Drive, Evidence
from study.reproduction.claims.judgement import Condition, at_least, claims, near, within_share
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, average
from study.reproduction.ensemble import threaded
from study.reproduction.preliminary import harmonic_beside, harmonic_pattern, model_restoring_force, restoring_force

Floats = NDArray[np.float64]
BY_EYE = 0.10  # share that an eye may be off when it reads a cloud of points
OVALS = (("as in Table 1", 1, 1, 1), ("twice c", 2, 1, 1), ("twice U", 1, 2, 1), ("twice f_0", 1, 1, 2))  # c, U, f_0
GAPS = 120  # half widths tried between none and the largest displacement


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
    tried = np.linspace(0.0, float(np.max(np.abs(u))), GAPS + 1)[:-1]
    left: list[float] = []
    for gap in tried:
        design = np.column_stack([u - np.clip(u, -gap, gap), v])
        coefficients = np.linalg.solve(design.T @ design, design.T @ rest)
        left.append(float(np.sum((rest - design @ coefficients) ** 2)))
    return float(tried[int(np.argmin(left))])


def oval_width(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """The width gives the value: the branches stand at +-(2 pi f_0) c U, (3.2), whatever c, U and f_0 are."""
    model, size = evidence.model(Drive("linear")), 1e-3
    c, f_0 = reported.table_1("linear", "c"), reported.table_1("linear", "f_n")
    for label, *times in OVALS:
        damped = model.with_values({"c": times[0] * model.numbers()["c"]})
        half = 0.5 * _width(damped, times[1] * size, times[2] * f_0)
        stated = math.prod(times) * 2.0 * math.pi * f_0 * c * size
        yield Condition(
            f"{label}: half the width at u = 0 within 0.1 % of (2 pi f_0) c U",
            f"{label}: half the width {half:.5g} N, (2 pi f_0) c U {stated:.5g} N",
            math.isclose(half, stated, rel_tol=1e-3),
        )


def _width(model: Model, amplitude: float, frequency: float) -> float:
    """From branch to branch at u = 0."""
    pattern = harmonic_pattern(model, amplitude, frequency)
    return float(np.ptp(pattern.force[np.abs(pattern.displacement) < 1e-9 * amplitude]))


def patterns_alike(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Random patterns fill the harmonic envelope of their largest displacement and stay within it."""
    for system in SYSTEMS[:-1]:  # the Extreme system has no natural frequency to swing at
        inside, filled = _envelopes(evidence, system, reported.table_1(system, "m"))
        why = (
            f"the random pattern of {system} is {filled.mean:.3g} times as wide as the harmonic one: the width is the "
            f"damping force at u = 0, which grows with the speed, and the random motion swings at "
            f"{_pace(evidence, system):.2f} Hz on average, the harmonic one of Figures 2 to 7 at f_n"
        )
        yield at_least(f"{system}: share of points within the envelope", inside, 0.95)
        yield near(f"{system}: widest random over harmonic width at u = 0", filled, 1.0, 0.3, why)


def _envelopes(evidence: Evidence, system: str, mass: float) -> tuple[Sample, Sample]:
    """Both numbers of :func:`envelope` for each record."""
    model = evidence.model(Drive(system))
    pairs = threaded(lambda r: envelope(model, r, mass), evidence.records(Drive(system)))
    return Sample.own_first(inside for inside, _ in pairs), Sample.own_first(width for _, width in pairs)


def _pace(evidence: Evidence, system: str) -> float:
    """Mean frequency of the response: root mean square velocity over that of the displacement, in hertz."""
    pace = evidence.each(Drive(system), lambda r: float(np.std(r["velocity"]) / np.std(r["displacement"])))
    return pace.mean / (2.0 * math.pi)


def envelope(model: Model, record: Record, mass: float) -> tuple[float, float]:
    """Share of the points within the harmonic envelope, and the random over the harmonic width at u = 0.

    The harmonic motion is that of Figures 2 to 7.
    """
    u, t = record["displacement"], record.time
    largest, frequency = harmonic_beside(model, record)
    speed = 2.0 * math.pi * frequency * np.sqrt(np.clip(largest**2 - u**2, 0.0, None))
    random = restoring_force(record, mass)
    upper, middle, lower = (model_restoring_force(model, u, s * speed, t) for s in (1.0, 0.0, -1.0))
    slack = 1e-9 * float(np.max(np.abs(random)))
    inside = (random <= upper + slack) & (random >= lower - slack)
    centre = np.abs(u) < 0.05 * largest
    width = float(np.max(np.abs(random - middle)[centre]) / np.max((upper - middle)[centre]))
    return average(inside), width


def _slope(evidence: Evidence, reported: Reported, system: str, within: float, label: str) -> Condition:
    """The slope of the mean of F_r at given u is the linear stiffness."""
    m, k = reported.table_1(system, "m"), reported.table_1(system, "k")
    return within_share(label, evidence.each(Drive(system), lambda r: mean_curve(r, m, 1)[0]), k, within)


def _hardening(evidence: Evidence, reported: Reported, system: str) -> Condition:
    """The mean of F_r at given u is k u + k3 u^3."""
    m, k3 = reported.table_1(system, "m"), reported.table_1(system, "k3")
    cubic = evidence.each(Drive(system), lambda r: mean_curve(r, m, 1, 3)[1])
    return within_share("cubic part of the mean", cubic, k3, READ_OFF)


def _damping_ratio(evidence: Evidence, reported: Reported, system: str) -> Sample:
    m = reported.table_1(system, "m")
    return evidence.each(Drive(system), lambda r: local_damping_ratio(r, m))


def _bulbous(evidence: Evidence, reported: Reported, system: str) -> Condition:
    """The damping grows with the displacement."""
    ratio = _damping_ratio(evidence, reported, system)
    return at_least(f"{system}: damping at large over that at small displacement", ratio, 1.5)


def van_der_pol_pattern(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Constant mean slope, damping that grows outwards; the linear pattern's does not."""
    system, m = "van_der_pol", reported.table_1("van_der_pol", "m")

    def cubic_over_linear(record: Record) -> float:
        a, b = mean_curve(record, m, 1, 3)
        return b * (2.0 * float(np.std(record["displacement"]))) ** 2 / a

    bend, straight = evidence.each(Drive(system), cubic_over_linear), _damping_ratio(evidence, reported, "linear")
    yield _slope(evidence, reported, system, READ_OFF, "mean slope")
    yield near("cubic over linear part of the mean at two standard deviations", bend, 0.0, READ_OFF)
    yield _bulbous(evidence, reported, system)
    yield near("linear: damping at large over that at small displacement", straight, 1.0, BY_EYE)


def mathieu_pattern(evidence: Evidence, reported: Reported) -> list[Condition]:
    """Slopes while the cosine is positive and while it is negative; k_m cos averages to 2/pi over a half period."""
    m, k, k_m, f_m = (reported.table_1("mathieu", n) for n in ("m", "k", "k_m", "f_m"))

    def slope(record: Record, sign: float) -> float:
        keep = sign * np.cos(2.0 * math.pi * f_m * record.time) > 0.0
        u, rest = record["displacement"][keep], restoring_force(record, m)[keep]
        return float(np.sum(u * rest) / np.sum(u**2))

    halves = (("stiff", 1.0), ("soft", -1.0))
    slopes = {half: evidence.each(Drive("mathieu"), lambda r, s=sign: slope(r, s)) for half, sign in halves}
    return [
        within_share(f"slope in the {half} half period", slopes[half], k + sign * 2.0 / math.pi * k_m, BY_EYE)
        for half, sign in halves
    ]


def dead_band_pattern(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """The gap read off the pattern."""
    m, gap = reported.table_1("dead_band", "m"), reported.value("dead_band_pattern")
    read = evidence.each(Drive("dead_band"), lambda r: read_dead_band(r, m))
    yield within_share("gap read off the pattern", read, gap, BY_EYE)


CLAIMS = claims(
    oval_width, patterns_alike, van_der_pol_pattern, mathieu_pattern, dead_band_pattern,
    oval_slope=lambda e, r: [_slope(e, r, "linear", 0.01, "slope")],
    duffing_pattern=lambda e, r: [_hardening(e, r, "duffing")],
    combined_pattern=lambda e, r: [_hardening(e, r, COMBINED), _bulbous(e, r, COMBINED)],
)  # fmt: skip
