"""Sections 3.1 and 3.3: distribution and autospectrum of the response."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from study.reproduction.claims import common
from study.reproduction.claims.evidence import Drive, Evidence
from study.reproduction.claims.judgement import Condition, at_least, claims, explained, surely_above_zero
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, kurtosis
from study.reproduction.preliminary import mathieu_lines

Floats = NDArray[np.float64]
MAXIMUM = "maximum of the averaged autospectrum"


def nonlinear_is_not(evidence: Evidence, _: Reported) -> Iterator[Condition]:
    """Mean kurtosis of each nonlinear system against that of the linear one under the same forces."""
    straight = evidence.of_channel("linear", kurtosis)
    for system in common.SYSTEMS[1:]:
        off = evidence.of_channel(system, kurtosis).minus(straight)
        criterion = f"{system}: mean kurtosis differs from the linear system's by 3 standard errors"
        yield Condition(criterion, f"{system} {off}", abs(off.mean) > 3.0 * off.error)


def narrow_band(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Share of the power within a fifth of the natural frequency about it."""
    f_n = reported.table_1("linear", "f_n")
    frequency, density = evidence.spectra(Drive("linear"))
    share = share_of_power(density, np.abs(frequency - f_n) <= 0.2 * f_n)
    yield at_least("share of the power within 20 % of f_n", share, 0.5)


def share_of_power(density: Floats, keep: NDArray[np.bool_]) -> Sample:
    """Share of the power of each record's autospectrum, shape (records, lines), that lies in the kept lines."""
    return Sample.own_first(float(np.sum(d[keep]) / np.sum(d)) for d in density)


def harmonics(evidence: Evidence, _: Reported) -> Iterator[Condition]:
    """Duffing over linear response three times above the resonance, where both are governed by the mass."""
    frequency, linear = evidence.spectra(Drive("linear"))
    duffing = evidence.spectra(Drive("duffing"))[1]
    peak = float(frequency[np.argmax(np.mean(duffing[1:], axis=0))])
    excess = _excess(duffing, linear, np.abs(frequency - 3.0 * peak) <= 0.2 * 3.0 * peak)
    yield surely_above_zero(f"excess over the linear response about three times the peak at {peak:.2f} Hz", excess)


def _excess(density: Floats, linear: Floats, keep: NDArray[np.bool_]) -> Sample:
    """Power of each record in the kept lines, over that of another system's record, less one."""
    return Sample.own_first(
        float(np.sum(d[keep]) / np.sum(b[keep]) - 1.0) for d, b in zip(density, linear, strict=True)
    )  # fmt: skip


def mathieu_spectrum(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Local maxima of the response autospectrum, Figure 8."""
    f_n, f_m = reported.value("mathieu_lines.f_n"), reported.value("mathieu_lines.f_m")
    frequency, density = evidence.spectra(Drive("mathieu"))
    maxima = common.local_maxima(frequency, np.mean(density[1:], axis=0))
    lower, middle, upper = mathieu_lines(f_n, f_m).values()
    spacing = 0.5 * (common.nearest(maxima, upper) - common.nearest(maxima, lower))
    yield common.has_line(MAXIMUM, maxima, middle)
    yield Condition(
        f"half the distance of the outer maxima within 0.1 Hz of f_m = {f_m:g} Hz",
        f"half the distance of the outer maxima {spacing:.2f} Hz", math.isclose(spacing, f_m, abs_tol=0.1),
    )  # fmt: skip
    yield from (common.has_line(MAXIMUM, maxima, outer) for outer in (lower, upper))


def mathieu_fast(evidence: Evidence, reported: Reported) -> list[Condition]:
    """The same with a stiffness faster than the resonance."""
    f_m = reported.value("mathieu_fast.f_m")
    frequency, density = evidence.spectra(Drive("mathieu", values=(("periodic_stiffness.f_m", f_m),)))
    constant = evidence.spectra(Drive("mathieu", values=(("km_cos", 0.0), ("km_sin", 0.0))))[1]
    mean: Floats = np.mean(density[1:], axis=0)
    maxima = common.local_maxima(frequency, mean)
    low, middle, high = (reported.value(f"mathieu_fast.{n}") for n in ("low", "middle", "high"))
    excess = {
        line: _excess(density, constant, np.abs(frequency - line) <= 2.0 * common.LINE) for line in (low, high)
    }  # fmt: skip
    return explained(
        _pulled(float(frequency[np.argmax(mean)]), f_m, reported),
        [
            *(common.has_line(MAXIMUM, maxima, line) for line in (low, middle, high)),
            *(
                surely_above_zero(f"excess over the response with constant stiffness about {line:g} Hz", sample)
                for line, sample in excess.items()
            ),
        ],
    )


def _pulled(peak: float, f_m: float, reported: Reported) -> str:
    """Where the lines go when the periodic stiffness moves the resonance itself."""
    f_n, width = reported.table_1("mathieu", "f_n"), 2.0 * reported.table_1("mathieu", "zeta") * peak
    return (
        f"a stiffness that varies so much draws the resonance from {f_n:g} Hz towards f_m/2, to {peak:.2f} Hz, and its "
        f"sum with f_m to {f_m + peak:.2f} Hz; their difference, {f_m - peak:.2f} Hz, stands "
        f"{abs(f_m - 2.0 * peak):.2f} Hz from the resonance, which is {width:.2f} Hz wide, and makes no maximum"
    )


CLAIMS = claims(
    nonlinear_is_not, narrow_band, harmonics, mathieu_fast,
    linear_is_gaussian=lambda e, _: [common.looks_gaussian(e, "linear", common.TESTS_WRONG)],
    mathieu_lines=mathieu_spectrum,
)  # fmt: skip
