"""Sections 3.1 and 3.3: distribution and autospectrum of the response."""

import math

import numpy as np
from numpy.typing import NDArray

from study.records.spectra import Segments, autospectrum
from study.reproduction.claims.common import TESTS_WRONG, has_line, local_maxima, looks_gaussian, nearest
from study.reproduction.claims.evidence import Drive, Evidence
from study.reproduction.claims.judgement import Claim, Condition, at_least, conclude, significant
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, kurtosis
from study.reproduction.preliminary import mathieu_lines

Floats = NDArray[np.float64]
NONLINEAR = ("duffing", "van_der_pol", "duffing_van_der_pol", "mathieu", "dead_band", "extreme")
LINE = 0.2  # hertz: two lines of the report's spectra


def displacement_spectra(evidence: Evidence, drive: Drive) -> tuple[Floats, Floats]:
    """Frequency, and the autospectrum of each record's displacement, shape (records, lines)."""
    cut = Segments(**evidence.settings["segments"])
    found = [autospectrum(r["displacement"], r.dt, cut) for r in evidence.records(drive)]
    return found[0][0], np.stack([density for _, density in found])


def linear_is_gaussian(evidence: Evidence, reported: Reported) -> Claim:
    """Kurtosis of the linear system's response."""
    return conclude(reported, "linear_is_gaussian", *looks_gaussian(evidence, "linear", TESTS_WRONG))


def nonlinear_is_not(evidence: Evidence, reported: Reported) -> Claim:
    """Mean kurtosis of each nonlinear system against that of the linear one under the same forces."""
    straight = evidence.each(Drive("linear"), lambda r: kurtosis(r["displacement"]))
    conditions: list[Condition] = []
    for system in NONLINEAR:
        off = evidence.each(Drive(system), lambda r: kurtosis(r["displacement"])).minus(straight)
        conditions.append(
            Condition(
                f"{system}: mean kurtosis differs from the linear system's by 3 standard errors",
                f"{system} {off}",
                abs(off.mean) > 3.0 * off.error,
            )
        )
    return conclude(reported, "nonlinear_is_not", *conditions)


def narrow_band(evidence: Evidence, reported: Reported) -> Claim:
    """Share of the power within a fifth of the natural frequency about it."""
    f_n = reported.table_1("linear", "f_n")
    frequency, density = displacement_spectra(evidence, Drive("linear"))
    keep = np.abs(frequency - f_n) <= 0.2 * f_n
    shares = [float(np.sum(d[keep]) / np.sum(d)) for d in density]
    found = Sample(tuple(shares[1:]), shares[0])
    return conclude(reported, "narrow_band", at_least("share of the power within 20 % of f_n", found, 0.5))


def harmonics(evidence: Evidence, reported: Reported) -> Claim:
    """Duffing over linear response three times above the resonance, where both are governed by the mass."""
    frequency, linear = displacement_spectra(evidence, Drive("linear"))
    _, duffing = displacement_spectra(evidence, Drive("duffing"))
    peak = float(frequency[np.argmax(np.mean(duffing[1:], axis=0))])
    keep = np.abs(frequency - 3.0 * peak) <= 0.2 * 3.0 * peak
    excess = [float(np.sum(d[keep]) / np.sum(b[keep]) - 1.0) for d, b in zip(duffing, linear, strict=True)]
    found = Sample(tuple(excess[1:]), excess[0])
    label = f"excess over the linear response about three times the peak at {peak:.2f} Hz"
    return conclude(reported, "harmonics", significant(label, found))


def mathieu_spectrum(evidence: Evidence, reported: Reported) -> Claim:
    """Local maxima of the response autospectrum, Figure 8."""
    f_n, f_m = reported.value("mathieu_lines.f_n"), reported.value("mathieu_lines.f_m")
    frequency, density = displacement_spectra(evidence, Drive("mathieu"))
    found = local_maxima(frequency, np.mean(density[1:], axis=0))
    outer = [line for name, line in mathieu_lines(f_n, f_m).items() if name != "f_n"]
    side = [nearest(found, line) for line in outer]
    spacing = 0.5 * (side[1] - side[0])
    return conclude(
        reported, "mathieu_lines",
        has_line("maximum of the averaged autospectrum", found, f_n, LINE),
        Condition(
            f"half the distance of the outer maxima within 0.1 Hz of f_m = {f_m:g} Hz",
            f"half the distance of the outer maxima {spacing:.2f} Hz", math.isclose(spacing, f_m, abs_tol=0.1),
        ),
        *(has_line("maximum of the averaged autospectrum", found, line, LINE) for line in outer),
    )  # fmt: skip


def mathieu_fast(evidence: Evidence, reported: Reported) -> Claim:
    """The same with a stiffness faster than the resonance."""
    f_m = reported.value("mathieu_fast.f_m")
    frequency, density = displacement_spectra(evidence, Drive("mathieu", values=(("periodic_stiffness.f_m", f_m),)))
    mean: Floats = np.mean(density[1:], axis=0)
    found = local_maxima(frequency, mean)
    targets = [reported.value(f"mathieu_fast.{n}") for n in ("low", "middle", "high")]
    plain = (("km_cos", 0.0), ("km_sin", 0.0))
    _, linear = displacement_spectra(evidence, Drive("mathieu", values=plain))
    return conclude(
        reported, "mathieu_fast",
        *(has_line("maximum of the averaged autospectrum", found, t, LINE) for t in targets),
        *(_excess(frequency, density, linear, t) for t in (targets[0], targets[-1])),
        because=_pulled(float(frequency[np.argmax(mean)]), f_m, reported),
    )  # fmt: skip


def _pulled(peak: float, f_m: float, reported: Reported) -> str:
    """Where the lines go when the periodic stiffness moves the resonance itself."""
    f_n, width = reported.table_1("mathieu", "f_n"), 2.0 * reported.table_1("mathieu", "zeta") * peak
    return (
        f"a stiffness that varies so much draws the resonance from {f_n:g} Hz towards f_m/2, to {peak:.2f} Hz, and its "
        f"sum with f_m to {f_m + peak:.2f} Hz; their difference, {f_m - peak:.2f} Hz, stands "
        f"{abs(f_m - 2.0 * peak):.2f} Hz from the resonance, which is {width:.2f} Hz wide, and makes no maximum"
    )


def _excess(frequency: Floats, density: Floats, linear: Floats, target: float) -> Condition:
    """Power about a frequency over that of the same system with a constant stiffness."""
    keep = np.abs(frequency - target) <= 2.0 * LINE
    ratio = np.sum(density[:, keep], axis=1) / np.sum(linear[:, keep], axis=1) - 1.0
    found = Sample(tuple(float(r) for r in ratio[1:]), float(ratio[0]))
    return significant(f"excess over the response with constant stiffness about {target:g} Hz", found)


CLAIMS = (linear_is_gaussian, nonlinear_is_not, narrow_band, harmonics, mathieu_spectrum, mathieu_fast)
