"""Section 5.2.5: the Mathieu system."""

from collections.abc import Iterator

import numpy as np

from study.reproduction.claims import common
from study.reproduction.claims.evidence import Evidence
from study.reproduction.claims.judgement import Condition, at_most, claims, near, within_share
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import GAUSSIAN_CENTRAL_SHARE, average, central_share, kurtosis
from study.support.numbers import percent

LOW_COHERENCE = 0.5  # "quite low", "rather low": less than half passes
NEGLIGIBLE = 0.02
EXCELLENT = 0.05


def mathieu_third(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """A_3 against A_2, and what passes through it."""
    ensemble, k_m = evidence.at("mathieu"), reported.table_1("mathieu", "k_m")
    size = ensemble.sample(lambda o: average(o.miso.response[2].real) / k_m)
    passed = ensemble.sample(lambda o: average(o.miso.cumulative[2] - o.miso.cumulative[1]))
    yield near("A_3 / k_m averaged over the band", size, 0.0, NEGLIGIBLE)
    yield at_most("share of the force through A_3", passed, NEGLIGIBLE)


def mathieu_side_resonances(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Local minima of the averaged SI/SO |A_1|: what a resonance is to an impedance."""
    ensemble = evidence.at("mathieu")
    low, high = common.band(reported, "mathieu_side_resonances")
    averaged = common.local_maxima(ensemble.frequency, -ensemble.lines(lambda o: np.abs(o.siso.response[0])))
    own = common.local_maxima(ensemble.frequency, -np.abs(ensemble.own.siso.response[0]))
    shown = ", ".join(f"{f:.2f}" for f in own if low - 1.0 <= f <= high + 1.0)
    yield common.has_line("minimum of the averaged SI/SO |A_1|", averaged, low)
    yield common.has_line("minimum of the averaged SI/SO |A_1|", averaged, high)
    yield Condition(
        "the own record's curve has minima there as well", f"own record has minima at {shown} Hz",
        all(np.any(np.abs(own - f) <= common.LINE) for f in (low, high)),
    )  # fmt: skip


def mathieu_siso_coherence(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Between and about the side resonances, where the response is."""
    low, high = common.band(reported, "mathieu_side_resonances")
    share = evidence.at("mathieu").linear_coherence(low, high)
    why = f"from {low:g} to {high:g} Hz {share.mean:.2f} passes through the linear path, more than half"
    yield at_most(f"SI/SO coherence from {low:g} to {high:g} Hz", share, LOW_COHERENCE, why)


def mathieu_stiffness(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """A_2: the fitted amplitude, and line by line where the response is strong."""
    ensemble, stated = evidence.at("mathieu"), reported.value("mathieu_stiffness")
    low, high = common.band(reported, "mathieu_side_resonances")
    keep = ensemble.between(low, high)
    error = ensemble.sample(lambda o: average(np.abs(o.miso.response[1][keep] / stated - 1.0)))
    imaginary = ensemble.sample(lambda o: average(o.miso.response[1][keep].imag) / stated)
    yield within_share("k_m", ensemble.miso("k_m"), stated, evidence.tolerance("mathieu", "k_m"))
    yield at_most(f"error of a line of A_2 from {low:g} to {high:g} Hz", error, EXCELLENT)
    yield near(f"Im A_2 / k_m from {low:g} to {high:g} Hz", imaginary, 0.0, NEGLIGIBLE)


def mathieu_share(evidence: Evidence, _: Reported) -> Iterator[Condition]:
    """Figure 35, lower curve."""
    ensemble = evidence.at("mathieu")
    share = ensemble.linear_coherence()
    where, lowest = ensemble.lowest(lambda o: o.miso.cumulative[0])
    why = (
        f"it falls to {lowest:.2f} at {where:.1f} Hz, but above the resonance the mass takes most of the force, so "
        f"that {share.mean:.2f} passes on average"
    )
    yield at_most("linear coherence over the fit band", share, LOW_COHERENCE, why)


def mathieu_histogram(evidence: Evidence, _: Reported) -> Iterator[Condition]:
    """Figure 36: fewer values near zero than a Gaussian has."""
    central, shape = evidence.of_channel("mathieu", central_share), evidence.of_channel("mathieu", kurtosis)
    flat_records = average([v < GAUSSIAN_CENTRAL_SHARE for v in central.values])
    yield Condition(
        f"share of values within half a standard deviation below the Gaussian's {GAUSSIAN_CENTRAL_SHARE:.3f} "
        "by three standard errors",
        f"share {central}; kurtosis {shape}", central.mean < GAUSSIAN_CENTRAL_SHARE - 3.0 * central.error,
        f"the varying stiffness gives heavy tails (kurtosis {shape.mean:.2f}) and a peaked top; single records "
        f"look flat by chance ({percent(flat_records, '.0f')} of them)",
    )  # fmt: skip


CLAIMS = claims(
    mathieu_third, mathieu_side_resonances, mathieu_siso_coherence, mathieu_stiffness, mathieu_share, mathieu_histogram,
    mathieu_linear=lambda e, r: common.recovered(e, r, e.at("mathieu"), common.LINEAR_PARTS),
    mathieu_coherence=lambda e, _: common.near_unity(e.at("mathieu")),
)  # fmt: skip
