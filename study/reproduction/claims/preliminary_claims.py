"""Section 3: distribution and autospectrum of the response, and restoring force over displacement."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from study.equations.model import Model
from study.records.record import Record
from study.reproduction.claims.conditions import has_line, local_maxima, nearest, stated
from study.reproduction.claims.evidence import Drive, Evidence
from study.reproduction.claims.judgement import (
    Condition,
    at_least,
    claims,
    explained,
    near,
    surely_above_zero,
    within_share,
)
from study.reproduction.claims.reported import COMBINED, SYSTEMS, Reported
from study.reproduction.claims.sample import Sample, average, kurtosis, share_of_power
from study.reproduction.preliminary import (
    harmonic_beside,
    harmonic_pattern,
    local_damping_ratio,
    mathieu_frequencies,
    mean_curve,
    model_restoring_force,
    restoring_force,
)
from study.support.arrays import Floats
from study.support.cores import side_by_side

MAXIMUM = "maximum of the averaged autospectrum"
OVALS = (("as in Table 1", 1, 1, 1), ("twice c", 2, 1, 1), ("twice U", 1, 2, 1), ("twice f_0", 1, 1, 2))  # c, U, f_0


# ---- distribution and autospectrum, Sections 3.1 and 3.3


def nonlinear_is_not(evidence: Evidence, _: Reported) -> Iterator[Condition]:
    """Mean kurtosis of each nonlinear system against that of the linear one under the same forces."""
    straight = evidence.of_channel("linear", kurtosis)
    for system in SYSTEMS[1:]:
        off = evidence.of_channel(system, kurtosis).minus(straight)
        criterion = f"{system}: mean kurtosis differs from the linear system's by 3 standard errors"
        yield Condition(criterion, f"{system} {off}", abs(off.mean) > 3.0 * off.error)


def narrow_band(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Share of the power within a fifth of the natural frequency about it."""
    f_n = reported.table_1("linear", "f_n")
    frequency, density = evidence.spectra(Drive("linear"))
    share = share_of_power(density, np.abs(frequency - f_n) <= 0.2 * f_n)
    yield at_least("share of the power within 20 % of f_n", share, 0.5)


def harmonics(evidence: Evidence, _: Reported) -> Iterator[Condition]:
    """Duffing over linear response three times above the resonance, where both are governed by the mass."""
    frequency, linear = evidence.spectra(Drive("linear"))
    duffing = evidence.spectra(Drive("duffing"))[1]
    peak = float(frequency[np.argmax(np.mean(duffing[1:], axis=0))])
    excess = _excess(duffing, linear, np.abs(frequency - 3.0 * peak) <= 0.2 * 3.0 * peak)
    yield surely_above_zero(f"excess over the linear response about three times the peak at {peak:.2f} Hz", excess)


def _excess(density: Floats, linear: Floats, keep: NDArray[np.bool_]) -> Sample:
    """Power of each record in the kept lines, over that of another system's record, less one."""
    pairs = zip(density, linear, strict=True)
    return Sample.own_first(float(np.sum(d[keep]) / np.sum(b[keep]) - 1.0) for d, b in pairs)


def mathieu_lines(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Local maxima of the response autospectrum, Figure 8."""
    f_n, f_m = reported.value("mathieu_lines.f_n"), reported.value("mathieu_lines.f_m")
    frequency, density = evidence.spectra(Drive("mathieu"))
    maxima = local_maxima(frequency, np.mean(density[1:], axis=0))
    lower, middle, upper = mathieu_frequencies(f_n, f_m).values()
    spacing = 0.5 * (nearest(maxima, upper) - nearest(maxima, lower))
    yield has_line(reported, MAXIMUM, maxima, middle)
    yield Condition(
        f"half the distance of the outer maxima within 0.1 Hz of f_m = {f_m:g} Hz",
        f"half the distance of the outer maxima {spacing:.2f} Hz", math.isclose(spacing, f_m, abs_tol=0.1),
    )  # fmt: skip
    yield from (has_line(reported, MAXIMUM, maxima, outer) for outer in (lower, upper))


def mathieu_fast(evidence: Evidence, reported: Reported) -> list[Condition]:
    """The same with a stiffness faster than the resonance."""
    f_m, f_n = reported.value("mathieu_fast.f_m"), reported.table_1("mathieu", "f_n")
    frequency, density = evidence.spectra(Drive("mathieu", values=(("periodic_stiffness.f_m", f_m),)))
    constant = evidence.spectra(Drive("mathieu", values=(("km_cos", 0.0), ("km_sin", 0.0))))[1]
    mean: Floats = np.mean(density[1:], axis=0)
    maxima, peak = local_maxima(frequency, mean), float(frequency[np.argmax(mean)])
    low, middle, high = (reported.value(f"mathieu_fast.{n}") for n in ("low", "middle", "high"))
    about, width = 2.0 * reported.limit("line"), 2.0 * reported.table_1("mathieu", "zeta") * peak
    excess = {line: _excess(density, constant, np.abs(frequency - line) <= about) for line in (low, high)}
    return explained(
        f"a stiffness that varies so much draws the resonance from {f_n:g} Hz towards f_m/2, to {peak:.2f} Hz, and its "
        f"sum with f_m to {f_m + peak:.2f} Hz; their difference, {f_m - peak:.2f} Hz, stands "
        f"{abs(f_m - 2.0 * peak):.2f} Hz from the resonance, which is {width:.2f} Hz wide, and makes no maximum",
        [
            *(has_line(reported, MAXIMUM, maxima, line) for line in (low, middle, high)),
            *(
                surely_above_zero(f"excess over the response with constant stiffness about {line:g} Hz", sample)
                for line, sample in excess.items()
            ),
        ],
    )


# ---- patterns, Section 3.2


def oval_width(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """The width gives the value: the branches stand at +-(2 pi f_0) c U, (3.2), whatever c, U and f_0 are."""
    model, size = evidence.model(Drive("linear")), 1e-3
    c, f_0 = reported.table_1("linear", "c"), reported.table_1("linear", "f_n")
    for label, *times in OVALS:
        damped = model.with_values({"c": times[0] * model.numbers()["c"]})
        pattern = harmonic_pattern(damped, times[1] * size, times[2] * f_0)
        at_zero = np.abs(pattern.displacement) < 1e-9 * times[1] * size
        half = 0.5 * float(np.ptp(pattern.force[at_zero]))  # from branch to branch
        expected = math.prod(times) * 2.0 * math.pi * f_0 * c * size
        yield Condition(
            f"{label}: half the width at u = 0 within 0.1 % of (2 pi f_0) c U",
            f"{label}: half the width {half:.5g} N, (2 pi f_0) c U {expected:.5g} N",
            math.isclose(half, expected, rel_tol=1e-3),
        )


def patterns_alike(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Random patterns fill the harmonic envelope of their largest displacement and stay within it."""
    for system in SYSTEMS[:-1]:  # the Extreme system has no natural frequency to swing at
        model, mass, drive = evidence.model(Drive(system)), reported.table_1(system, "m"), Drive(system)
        pairs = list(side_by_side(lambda r, m=model, mass=mass: envelope(m, r, mass), evidence.records(drive)))
        inside, filled = (Sample.own_first(numbers) for numbers in zip(*pairs, strict=True))
        speed = evidence.each(drive, lambda r: float(np.std(r["velocity"]) / np.std(r["displacement"])))
        why = (
            f"the random pattern of {system} is {filled.mean:.3g} times as wide as the harmonic one: the width is the "
            f"damping force at u = 0, which grows with the speed, and the random motion swings at "
            f"{speed.mean / (2.0 * math.pi):.2f} Hz on average, the harmonic one of Figures 2 to 7 at f_n"
        )
        yield at_least(f"{system}: share of points within the envelope", inside, 0.95)
        yield near(f"{system}: widest random over harmonic width at u = 0", filled, 1.0, 0.3, why)


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


def _damping_growth(evidence: Evidence, reported: Reported, system: str) -> tuple[str, Sample]:
    """Damping at large over that at small displacement, with words for it."""
    m = reported.table_1(system, "m")
    ratio = evidence.each(Drive(system), lambda r: local_damping_ratio(r, m))
    return f"{system}: damping at large over that at small displacement", ratio


def van_der_pol_pattern(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Constant mean slope, damping that grows outwards; the linear pattern's does not."""
    m = reported.table_1("van_der_pol", "m")

    def cubic_over_linear(record: Record) -> float:
        a, b = mean_curve(record, m, 1, 3)
        return b * (2.0 * float(np.std(record["displacement"]))) ** 2 / a

    bend = evidence.each(Drive("van_der_pol"), cubic_over_linear)
    straight = "cubic over linear part of the mean at two standard deviations"
    yield from stated(evidence, reported, reported["van_der_pol_pattern"])
    yield near(straight, bend, 0.0, reported.limit("read_off"))
    yield at_least(*_damping_growth(evidence, reported, "van_der_pol"), 1.5)
    yield near(*_damping_growth(evidence, reported, "linear"), 1.0, reported.limit("by_eye"))


def combined_pattern(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Each as in its own system: the spring hardens, the damping grows outwards."""
    yield from stated(evidence, reported, reported["combined_pattern"])
    yield at_least(*_damping_growth(evidence, reported, COMBINED), 1.5)


def mathieu_pattern(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Slopes while the cosine is positive and while it is negative; k_m cos averages to 2/pi over a half period."""
    m, k, k_m, f_m = (reported.table_1("mathieu", n) for n in ("m", "k", "k_m", "f_m"))

    def slope(record: Record, sign: float) -> float:
        keep = sign * np.cos(2.0 * math.pi * f_m * record.time) > 0.0
        u, rest = record["displacement"][keep], restoring_force(record, m)[keep]
        return float(np.sum(u * rest) / np.sum(u**2))

    for half, sign in (("stiff", 1.0), ("soft", -1.0)):
        found, expected = evidence.each(Drive("mathieu"), lambda r, s=sign: slope(r, s)), k + sign * 2.0 / math.pi * k_m
        yield within_share(f"slope in the {half} half period", found, expected, reported.limit("by_eye"))


PRELIMINARY_CLAIMS = claims(
    nonlinear_is_not, narrow_band, harmonics, mathieu_lines, mathieu_fast, oval_width, patterns_alike,
    van_der_pol_pattern, combined_pattern, mathieu_pattern,
)  # fmt: skip
