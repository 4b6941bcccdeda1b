"""Sections 5.2.3 and 5.2.4: the Van der Pol and the combined system."""

import numpy as np

from study.reproduction.claims.common import (
    differs_from_gaussian,
    less_distorted,
    linear_share,
    looks_gaussian,
    near_unity,
    recovered,
)
from study.reproduction.claims.duffing import LINEAR_PARTS, levels, rising
from study.reproduction.claims.evidence import Assumed, Drive, Evidence
from study.reproduction.claims.judgement import Claim, Condition, at_least, close, conclude, near, significant
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import GAUSSIAN_OUTER_SHARE, outer_share

COMBINED = "duffing_van_der_pol"


def van_der_pol_linear(evidence: Evidence, reported: Reported) -> Claim:
    """A_1 by MI/SO; c by SI/SO at every level."""
    ensemble = evidence.unit("van_der_pol")
    c = reported.table_1("van_der_pol", "c")
    off = ensemble.siso("c")
    found = {level: evidence.at("van_der_pol", level).siso("c") for level in levels(reported)}
    return conclude(
        reported, "van_der_pol_linear",
        *recovered(evidence, reported, "van_der_pol", ensemble, LINEAR_PARTS),
        Condition("mean SI/SO c more than 10 % off", f"SI/SO c {off}", abs(off.mean - c) > 0.1 * c),
        *rising("SI/SO c", found),
    )  # fmt: skip


def van_der_pol_damping(evidence: Evidence, reported: Reported) -> Claim:
    """A_2 with its real part left free: a cubic stiffness is assumed beside the damping."""
    c3 = reported.value("van_der_pol_damping")
    ensemble = evidence.ensemble(Drive("van_der_pol"), Assumed(plus=("cubic_stiffness",)))
    at_resonance = 2.0 * np.pi * reported.table_1("van_der_pol", "f_n") * c3 / 3.0
    real = ensemble.sample(lambda o: o.miso.values["k3"] / at_resonance)
    return conclude(
        reported, "van_der_pol_damping",
        close("c3", ensemble.miso("c3"), c3, evidence.tolerance("van_der_pol", "c3")),
        near("real part of A_2 over its imaginary part at f_n", real, 0.0, 0.05),
    )  # fmt: skip


def van_der_pol_share(evidence: Evidence, reported: Reported) -> Claim:
    """Linear coherence below and above 2 Hz."""
    edge, (low, high) = reported.value("van_der_pol_share"), evidence.settings["fit_band"]
    ensemble = evidence.unit("van_der_pol")
    below, above = linear_share(ensemble, low, edge), linear_share(ensemble, edge, high)
    where, lowest = ensemble.lowest(lambda o: o.miso.cumulative[0])
    return conclude(
        reported, "van_der_pol_share",
        at_least(
            f"linear coherence below {edge:g} Hz", below, 0.95,
            f"below {edge:g} Hz {below.mean:.3f} of the force passes through L_1; the lowest line, {lowest:.2f}, "
            f"stands at {where:.2f} Hz",
        ),
        significant(f"nonlinear share above less that below {edge:g} Hz", below.minus(above),
                    f"linear coherence is {below.mean:.3f} below and {above.mean:.3f} above {edge:g} Hz: the mass "
                    "takes most of the force at high frequency"),
    )  # fmt: skip


def van_der_pol_coherence(evidence: Evidence, reported: Reported) -> Claim:
    """Figure 27."""
    return conclude(reported, "van_der_pol_coherence", *near_unity(evidence.unit("van_der_pol")))


def van_der_pol_histogram(evidence: Evidence, reported: Reported) -> Claim:
    """Figure 28."""
    return conclude(
        reported, "van_der_pol_histogram",
        *differs_from_gaussian(evidence, "van_der_pol", 0.95,
                               "the kurtosis lies below 3 on average, but a single record does not always show it"),
    )  # fmt: skip


def combined_linear(evidence: Evidence, reported: Reported) -> Claim:
    """Figure 29."""
    ensemble = evidence.unit(COMBINED)
    conditions: list[Condition] = []
    for name in ("k", "c"):
        true, found = reported.table_1(COMBINED, name), ensemble.siso(name)
        off = abs(found.mean - true) > 0.1 * true
        conditions.append(Condition(f"mean SI/SO {name} more than 10 % off", f"SI/SO {name} {found}", off))
    return conclude(
        reported, "combined_linear", *conditions, *recovered(evidence, reported, COMBINED, ensemble, LINEAR_PARTS)
    )


def combined_cubic(evidence: Evidence, reported: Reported) -> Claim:
    """Figures 30 and 31."""
    ensemble = evidence.unit(COMBINED)
    alone = {"k3": evidence.unit("duffing").miso("k3"), "c3": evidence.unit("van_der_pol").miso("c3")}
    same = [
        close(f"{n} of the combined system", ensemble.miso(n), a.mean, 2.0 * evidence.tolerance(COMBINED, n))
        for n, a in alone.items()
    ]
    return conclude(
        reported, "combined_cubic",
        *recovered(evidence, reported, COMBINED, ensemble, ("k3", "c3")), *same, *near_unity(ensemble),
    )  # fmt: skip


def combined_histogram(evidence: Evidence, reported: Reported) -> Claim:
    """Figure 32: nearer to the Gaussian than Figure 28."""
    far = evidence.each(Drive(COMBINED), lambda r: outer_share(r["displacement"]))
    why = (
        f"the cubic spring and damper hold large displacements back, so that {100 * far.mean:.2g} % lie beyond two "
        f"standard deviations where a Gaussian has {100 * GAUSSIAN_OUTER_SHARE:.2g} %"
    )
    return conclude(
        reported, "combined_histogram",
        *looks_gaussian(evidence, COMBINED, 0.5, why),
        less_distorted(evidence, COMBINED, "van_der_pol"),
    )  # fmt: skip


def combined_nearly_linear(evidence: Evidence, reported: Reported) -> Claim:
    """High linear coherence, yet nonlinear terms identified."""
    ensemble = evidence.unit(COMBINED)
    linear = ensemble.linear_coherence()
    where, lowest = ensemble.lowest(lambda o: o.miso.cumulative[0])
    why = (
        f"on average {100 * (1 - linear.mean):.0f} % of the force needs the nonlinear terms, and "
        f"{100 * (1 - lowest):.0f} % at {where:.1f} Hz: a coherence that would make an analyst suspicious"
    )
    return conclude(
        reported, "combined_nearly_linear",
        at_least("linear coherence over the fit band", linear, 0.9, why),
        *recovered(evidence, reported, COMBINED, ensemble, ("k3", "c3")),
    )  # fmt: skip


CLAIMS = (
    van_der_pol_linear, van_der_pol_damping, van_der_pol_share, van_der_pol_coherence, van_der_pol_histogram,
    combined_linear, combined_cubic, combined_histogram, combined_nearly_linear,
)  # fmt: skip
