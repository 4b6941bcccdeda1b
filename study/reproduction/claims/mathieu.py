"""Section 5.2.5: the Mathieu system."""

import numpy as np
from numpy.typing import NDArray

from study.reproduction.claims.common import has_line, in_band, linear_share, local_maxima, near_unity, recovered
from study.reproduction.claims.duffing import LINEAR_PARTS
from study.reproduction.claims.evidence import Analysis, Drive, Evidence
from study.reproduction.claims.judgement import Claim, Condition, at_most, close, conclude, near
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import GAUSSIAN_CENTRAL_SHARE, average, central_share, kurtosis

LINE = 0.2  # hertz: two lines of the report's spectra
LOW_COHERENCE = 0.5  # "quite low", "rather low": less than half passes
NEGLIGIBLE = 0.02
EXCELLENT = 0.05


def _size(found: Analysis) -> NDArray[np.float64]:
    return np.abs(found.response[0])


def third(evidence: Evidence, reported: Reported) -> Claim:
    """A_3 against A_2, and what passes through it."""
    ensemble, k_m = evidence.unit("mathieu"), reported.table_1("mathieu", "k_m")
    size = ensemble.sample(lambda o: average(o.miso.response[2].real) / k_m)
    passed = ensemble.sample(lambda o: average(o.miso.cumulative[2] - o.miso.cumulative[1]))
    return conclude(
        reported, "mathieu_third",
        near("A_3 / k_m averaged over the band", size, 0.0, NEGLIGIBLE),
        at_most("share of the force through A_3", passed, NEGLIGIBLE),
    )  # fmt: skip


def side_resonances(evidence: Evidence, reported: Reported) -> Claim:
    """Local minima of the averaged SI/SO |A_1|: what a resonance is to an impedance."""
    ensemble = evidence.unit("mathieu")
    low, high = reported.value("mathieu_side_resonances.low"), reported.value("mathieu_side_resonances.high")
    found = local_maxima(ensemble.frequency, -ensemble.lines(lambda o: _size(o.siso)))
    own = local_maxima(ensemble.frequency, -_size(ensemble.own.siso))
    seen = ", ".join(f"{f:.2f}" for f in own if low - 1.0 <= f <= high + 1.0)
    return conclude(
        reported, "mathieu_side_resonances",
        has_line("minimum of the averaged SI/SO |A_1|", found, low, LINE),
        has_line("minimum of the averaged SI/SO |A_1|", found, high, LINE),
        Condition(
            "the own record's curve has minima there as well", f"own record has minima at {seen} Hz",
            all(np.any(np.abs(own - f) <= LINE) for f in (low, high)),
        ),
    )  # fmt: skip


def siso_coherence(evidence: Evidence, reported: Reported) -> Claim:
    """Between and about the side resonances, where the response is."""
    ensemble = evidence.unit("mathieu")
    low, high = reported.value("mathieu_side_resonances.low"), reported.value("mathieu_side_resonances.high")
    found = linear_share(ensemble, low, high)
    return conclude(
        reported, "mathieu_siso_coherence",
        at_most(f"SI/SO coherence from {low:g} to {high:g} Hz", found, LOW_COHERENCE,
                f"from {low:g} to {high:g} Hz {found.mean:.2f} passes through the linear path, more than half"),
    )  # fmt: skip


def linear(evidence: Evidence, reported: Reported) -> Claim:
    """A_1 by MI/SO."""
    ensemble = evidence.unit("mathieu")
    return conclude(
        reported, "mathieu_linear", *recovered(evidence, reported, "mathieu", ensemble, LINEAR_PARTS)
    )  # fmt: skip


def stiffness(evidence: Evidence, reported: Reported) -> Claim:
    """A_2: the fitted amplitude, and line by line where the response is strong."""
    ensemble, stated = evidence.unit("mathieu"), reported.value("mathieu_stiffness")
    low, high = reported.value("mathieu_side_resonances.low"), reported.value("mathieu_side_resonances.high")
    keep = in_band(ensemble, low, high)
    error = ensemble.sample(lambda o: average(np.abs(o.miso.response[1][keep] / stated - 1.0)))
    imaginary = ensemble.sample(lambda o: average(o.miso.response[1][keep].imag) / stated)
    return conclude(
        reported, "mathieu_stiffness",
        close("k_m", ensemble.miso("k_m"), stated, evidence.tolerance("mathieu", "k_m")),
        at_most(f"error of a line of A_2 from {low:g} to {high:g} Hz", error, EXCELLENT),
        near(f"Im A_2 / k_m from {low:g} to {high:g} Hz", imaginary, 0.0, NEGLIGIBLE),
    )  # fmt: skip


def coherence(evidence: Evidence, reported: Reported) -> Claim:
    """Figure 35, upper curve."""
    return conclude(reported, "mathieu_coherence", *near_unity(evidence.unit("mathieu")))


def share(evidence: Evidence, reported: Reported) -> Claim:
    """Figure 35, lower curve."""
    ensemble = evidence.unit("mathieu")
    found = ensemble.linear_coherence()
    where, lowest = ensemble.lowest(lambda o: o.miso.cumulative[0])
    return conclude(
        reported, "mathieu_share",
        at_most("linear coherence over the fit band", found, LOW_COHERENCE,
                f"it falls to {lowest:.2f} at {where:.1f} Hz, but above the resonance the mass takes most of the "
                f"force, so that {found.mean:.2f} passes on average"),
    )  # fmt: skip


def histogram(evidence: Evidence, reported: Reported) -> Claim:
    """Figure 36: fewer values near zero than a Gaussian has."""
    drive = Drive("mathieu")
    found = evidence.each(drive, lambda r: central_share(r["displacement"]))
    shape = evidence.each(drive, lambda r: kurtosis(r["displacement"]))
    flat = found.mean < GAUSSIAN_CENTRAL_SHARE - 3.0 * found.error
    flat_records = average([v < GAUSSIAN_CENTRAL_SHARE for v in found.values])
    return conclude(
        reported, "mathieu_histogram",
        Condition(
            f"share of values within half a standard deviation below the Gaussian's {GAUSSIAN_CENTRAL_SHARE:.3f} "
            "by three standard errors",
            f"share {found}; kurtosis {shape}", flat,
            f"the varying stiffness gives heavy tails (kurtosis {shape.mean:.2f}) and a peaked top; single records "
            f"look flat by chance ({100 * flat_records:.0f} % of them)",
        ),
    )  # fmt: skip


CLAIMS = (third, side_resonances, siso_coherence, linear, stiffness, coherence, share, histogram)
