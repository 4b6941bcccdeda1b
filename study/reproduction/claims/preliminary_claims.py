"""Section 3.2: restoring force over displacement."""

import math

import numpy as np
from numpy.typing import NDArray

from study.equations.model import Model
from study.records.record import Record
from study.reproduction.claims.evidence import Drive, Evidence
from study.reproduction.claims.judgement import Claim, Condition, at_least, close, conclude, near
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, average
from study.reproduction.ensemble import threaded
from study.reproduction.preliminary import harmonic_beside, harmonic_pattern, model_restoring_force, restoring_force

Floats = NDArray[np.float64]
PATTERNS = ("linear", "duffing", "van_der_pol", "duffing_van_der_pol", "mathieu", "dead_band")
READ_OFF = 0.05  # what a hand reads off a pattern
BY_EYE = 0.10  # what an eye reads off a cloud of points
OVALS = (("as in Table 1", 1, 1, 1), ("twice c", 2, 1, 1), ("twice U", 1, 2, 1), ("twice f_0", 1, 1, 2))  # c, U, f_0
GAPS = 120  # half widths tried between none and the largest displacement


def slopes(record: Record, mass: float, *shapes: Floats) -> list[float]:
    """Least-squares coefficients of the restoring force on some shapes, each of shape (n,)."""
    scale = [float(np.sqrt(np.mean(s**2))) for s in shapes]
    scaled = np.array([s / size for s, size in zip(shapes, scale, strict=True)], dtype=np.float64).T
    found = np.asarray(np.linalg.solve(scaled.T @ scaled, scaled.T @ restoring_force(record, mass)), dtype=np.float64)
    return [float(x) / size for x, size in zip(found, scale, strict=True)]


def local_damping_ratio(record: Record, mass: float) -> float:
    """Damping beyond 1.5 standard deviations of displacement over that within half of one."""
    u, v = record["displacement"], record["velocity"]
    size = np.abs(u) / np.std(u)
    rest = restoring_force(record, mass) - _mean_curve(record, mass)
    outer, inner = size > 1.5, size < 0.5
    c_outer = float(np.sum(rest[outer] * v[outer]) / np.sum(v[outer] ** 2))
    return c_outer / float(np.sum(rest[inner] * v[inner]) / np.sum(v[inner] ** 2))


def _mean_curve(record: Record, mass: float) -> Floats:
    """The odd cubic that follows the mean of the restoring force at given displacement."""
    u = record["displacement"]
    a, b = slopes(record, mass, u, u**3)
    return a * u + b * u**3


def read_dead_band(record: Record, mass: float) -> float:
    """The gap that a pattern shows: force of a slope beyond +-u_g, none within, that fits it best."""
    u, v = record["displacement"], record["velocity"]
    rest = restoring_force(record, mass)
    tried = np.linspace(0.0, float(np.max(np.abs(u))), GAPS + 1)[:-1]
    left: list[float] = []
    for gap in tried:
        design = np.column_stack([u - np.clip(u, -gap, gap), v])
        normal = design.T @ design
        coefficients = np.linalg.solve(normal, design.T @ rest)
        left.append(float(np.sum((rest - design @ coefficients) ** 2)))
    return float(tried[int(np.argmin(left))])


def oval_width(evidence: Evidence, reported: Reported) -> Claim:
    """The width gives the value: the branches stand at +-(2 pi f_0) c U, (3.2), whatever c, U and f_0 are."""
    model, size = evidence.model(Drive("linear")), 1e-3
    c, f_0 = reported.table_1("linear", "c"), reported.table_1("linear", "f_n")
    conditions: list[Condition] = []
    for label, *times in OVALS:
        damped = model.with_values({"c": times[0] * model.numbers()["c"]})
        half = 0.5 * _width(damped, times[1] * size, times[2] * f_0)
        stated = math.prod(times) * 2.0 * math.pi * f_0 * c * size
        conditions.append(
            Condition(
                f"{label}: half the width at u = 0 within 0.1 % of (2 pi f_0) c U",
                f"{label}: half the width {half:.5g} N, (2 pi f_0) c U {stated:.5g} N",
                math.isclose(half, stated, rel_tol=1e-3),
            )
        )
    return conclude(reported, "oval_width", *conditions)


def _width(model: Model, amplitude: float, frequency: float) -> float:
    """From branch to branch at u = 0."""
    pattern = harmonic_pattern(model, amplitude, frequency)
    return float(np.ptp(pattern.force[np.abs(pattern.displacement) < 1e-9 * amplitude]))


def oval_slope(evidence: Evidence, reported: Reported) -> Claim:
    """Regression of F_r on u under random excitation."""
    m, k = reported.table_1("linear", "m"), reported.table_1("linear", "k")
    found = evidence.each(Drive("linear"), lambda r: slopes(r, m, r["displacement"])[0])
    return conclude(reported, "oval_slope", close("slope", found, k, 0.01))


def patterns_alike(evidence: Evidence, reported: Reported) -> Claim:
    """Random patterns fill the harmonic envelope of their largest displacement and stay within it."""
    conditions: list[Condition] = []
    for system in PATTERNS:
        inside, filled = _envelopes(evidence, system, reported.table_1(system, "m"))
        why = (
            f"the random pattern of {system} is {filled.mean:.3g} times as wide as the harmonic one: the width is the "
            f"damping force at u = 0, which grows with the speed, and the random motion swings at "
            f"{_pace(evidence, system):.2f} Hz on average, the harmonic one of Figures 2 to 7 at f_n"
        )
        conditions += [
            at_least(f"{system}: share of points within the envelope", inside, 0.95),
            near(f"{system}: widest random over harmonic width at u = 0", filled, 1.0, 0.3, why),
        ]
    return conclude(reported, "patterns_alike", *conditions)


def _envelopes(evidence: Evidence, system: str, mass: float) -> tuple[Sample, Sample]:
    """Both numbers of :func:`envelope` for each record."""
    model = evidence.model(Drive(system))
    found = threaded(lambda r: envelope(model, r, mass), evidence.records(Drive(system)))
    inside, filled = (Sample(tuple(f[i] for f in found[1:]), found[0][i]) for i in (0, 1))
    return inside, filled


def _pace(evidence: Evidence, system: str) -> float:
    """Mean frequency of the response: root mean square velocity over that of the displacement, in hertz."""
    found = evidence.each(Drive(system), lambda r: float(np.std(r["velocity"]) / np.std(r["displacement"])))
    return found.mean / (2.0 * math.pi)


def envelope(model: Model, record: Record, mass: float) -> tuple[float, float]:
    """Share of the points within the harmonic envelope, and the random over the harmonic width at u = 0.

    The harmonic motion is that of Figures 2 to 7.
    """
    u, t = record["displacement"], record.time
    largest, frequency = harmonic_beside(model, record)
    speed = 2.0 * math.pi * frequency * np.sqrt(np.clip(largest**2 - u**2, 0.0, None))
    found = restoring_force(record, mass)
    upper, middle, lower = (model_restoring_force(model, u, s * speed, t) for s in (1.0, 0.0, -1.0))
    slack = 1e-9 * float(np.max(np.abs(found)))
    inside = (found <= upper + slack) & (found >= lower - slack)
    centre = np.abs(u) < 0.05 * largest
    width = float(np.max(np.abs(found - middle)[centre]) / np.max((upper - middle)[centre]))
    return average(inside), width


def duffing_pattern(evidence: Evidence, reported: Reported) -> Claim:
    """Mean of F_r at given u: k u + k3 u^3."""
    m = reported.table_1("duffing", "m")
    found = evidence.each(
        Drive("duffing"), lambda r: slopes(r, m, r["displacement"], r["displacement"] ** 3)[1]
    )  # fmt: skip
    k3 = reported.table_1("duffing", "k3")
    return conclude(reported, "duffing_pattern", close("cubic part of the mean", found, k3, READ_OFF))


def _bulbous(evidence: Evidence, system: str, mass: float) -> Condition:
    ratio = evidence.each(Drive(system), lambda r: local_damping_ratio(r, mass))
    return at_least(f"{system}: damping at large over that at small displacement", ratio, 1.5)


def _hardening(evidence: Evidence, system: str, mass: float) -> Sample:
    """Cubic part of the mean force at two standard deviations over the linear part."""

    def one(record: Record) -> float:
        u = record["displacement"]
        a, b = slopes(record, mass, u, u**3)
        return b * (2.0 * float(np.std(u))) ** 2 / a

    return evidence.each(Drive(system), one)


def van_der_pol_pattern(evidence: Evidence, reported: Reported) -> Claim:
    """Constant mean slope, damping that grows outwards; the linear pattern's does not."""
    m, k = reported.table_1("van_der_pol", "m"), reported.table_1("van_der_pol", "k")
    slope = evidence.each(Drive("van_der_pol"), lambda r: slopes(r, m, r["displacement"])[0])
    straight = evidence.each(Drive("linear"), lambda r: local_damping_ratio(r, m))
    return conclude(
        reported, "van_der_pol_pattern",
        close("mean slope", slope, k, READ_OFF),
        near("cubic over linear part of the mean at two standard deviations",
             _hardening(evidence, "van_der_pol", m), 0.0, READ_OFF),
        _bulbous(evidence, "van_der_pol", m),
        near("linear: damping at large over that at small displacement", straight, 1.0, BY_EYE),
    )  # fmt: skip


def combined_pattern(evidence: Evidence, reported: Reported) -> Claim:
    """Both behaviours at once."""
    system = "duffing_van_der_pol"
    m, k3 = reported.table_1(system, "m"), reported.table_1(system, "k3")
    cubic = evidence.each(Drive(system), lambda r: slopes(r, m, r["displacement"], r["displacement"] ** 3)[1])
    return conclude(
        reported, "combined_pattern",
        close("cubic part of the mean", cubic, k3, READ_OFF),
        _bulbous(evidence, system, m),
    )  # fmt: skip


def mathieu_pattern(evidence: Evidence, reported: Reported) -> Claim:
    """Slopes while the cosine is positive and while it is negative; k_m cos averages to 2/pi over a half period."""
    m, k, k_m, f_m = (reported.table_1("mathieu", n) for n in ("m", "k", "k_m", "f_m"))

    def slope(record: Record, sign: float) -> float:
        keep = sign * np.cos(2.0 * math.pi * f_m * record.time) > 0.0
        u, rest = record["displacement"][keep], restoring_force(record, m)[keep]
        return float(np.sum(u * rest) / np.sum(u**2))

    high = evidence.each(Drive("mathieu"), lambda r: slope(r, 1.0))
    low = evidence.each(Drive("mathieu"), lambda r: slope(r, -1.0))
    swing = 2.0 / math.pi * k_m
    return conclude(
        reported, "mathieu_pattern",
        close("slope in the stiff half period", high, k + swing, BY_EYE),
        close("slope in the soft half period", low, k - swing, BY_EYE),
    )  # fmt: skip


def dead_band_pattern(evidence: Evidence, reported: Reported) -> Claim:
    """The gap read off the pattern."""
    m = reported.table_1("dead_band", "m")
    found = evidence.each(Drive("dead_band"), lambda r: read_dead_band(r, m))
    return conclude(
        reported, "dead_band_pattern",
        close("gap read off the pattern", found, reported.value("dead_band_pattern"), BY_EYE),
    )  # fmt: skip


CLAIMS = (
    oval_width, oval_slope, patterns_alike, duffing_pattern, van_der_pol_pattern, combined_pattern,
    mathieu_pattern, dead_band_pattern,
)  # fmt: skip
