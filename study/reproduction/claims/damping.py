"""Sections 5.2.3 and 5.2.4: the Van der Pol and the combined system."""

from collections.abc import Iterator

import numpy as np

from study.reproduction.claims import common
from study.reproduction.claims.evidence import Assumed, Drive, Evidence
from study.reproduction.claims.judgement import Condition, at_least, claims, far, near, surely_above_zero, within_share
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import GAUSSIAN_OUTER_SHARE, outer_share
from study.support.numbers import percent


def van_der_pol_linear(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """A_1 by MI/SO; c by SI/SO at every level."""
    ensemble = evidence.at("van_der_pol")
    by_level = {level: evidence.at("van_der_pol", level).siso("c") for level in common.input_variances(reported)}
    yield from common.recovered(evidence, reported, ensemble, common.LINEAR_PARTS)
    yield far("SI/SO c", ensemble.siso("c"), reported.table_1("van_der_pol", "c"), 0.1)
    yield from common.rising("SI/SO c", by_level)


def van_der_pol_damping(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """A_2 with its real part left free: a cubic stiffness is assumed beside the damping."""
    c3 = reported.value("van_der_pol_damping")
    ensemble = evidence.ensemble(Drive("van_der_pol"), Assumed(plus=("cubic_stiffness",)))
    at_resonance = 2.0 * np.pi * reported.table_1("van_der_pol", "f_n") * c3 / 3.0
    real = ensemble.sample(lambda o: o.miso.values["k3"] / at_resonance)
    yield within_share("c3", ensemble.miso("c3"), c3, evidence.tolerance("van_der_pol", "c3"))
    yield near("real part of A_2 over its imaginary part at f_n", real, 0.0, 0.05)


def van_der_pol_share(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Linear coherence below and above 2 Hz."""
    edge, ensemble = reported.value("van_der_pol_share"), evidence.at("van_der_pol")
    below, above = ensemble.linear_coherence(high=edge), ensemble.linear_coherence(low=edge)
    where, lowest = ensemble.lowest(lambda o: o.miso.cumulative[0])
    yield at_least(
        f"linear coherence below {edge:g} Hz", below, 0.95,
        f"below {edge:g} Hz {below.mean:.3f} of the force passes through L_1; the lowest line, {lowest:.2f}, "
        f"stands at {where:.2f} Hz",
    )  # fmt: skip
    yield surely_above_zero(
        f"nonlinear share above less that below {edge:g} Hz", below.minus(above),
        f"linear coherence is {below.mean:.3f} below and {above.mean:.3f} above {edge:g} Hz: the mass takes most "
        "of the force at high frequency",
    )  # fmt: skip


def combined_linear(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Figure 29."""
    ensemble = evidence.at(common.COMBINED)
    yield from (far(f"SI/SO {n}", ensemble.siso(n), reported.table_1(common.COMBINED, n), 0.1) for n in ("k", "c"))
    yield from common.recovered(evidence, reported, ensemble, common.LINEAR_PARTS)


def combined_cubic(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Figures 30 and 31."""
    ensemble = evidence.at(common.COMBINED)
    alone = {"k3": evidence.at("duffing").miso("k3"), "c3": evidence.at("van_der_pol").miso("c3")}
    yield from common.recovered(evidence, reported, ensemble, alone)
    for name, sample in alone.items():
        allowed = 2.0 * evidence.tolerance(common.COMBINED, name)
        yield within_share(f"{name} of the combined system", ensemble.miso(name), sample.mean, allowed)
    yield from common.near_unity(ensemble)


def combined_histogram(evidence: Evidence, _: Reported) -> Iterator[Condition]:
    """Figure 32: nearer to the Gaussian than Figure 28."""
    outside = evidence.of_channel(common.COMBINED, outer_share)
    why = (
        f"the cubic spring and damper hold large displacements back, so that {percent(outside.mean, '.2g')} lie beyond "
        f"two standard deviations where a Gaussian has {percent(GAUSSIAN_OUTER_SHARE, '.2g')}"
    )
    yield common.looks_gaussian(evidence, common.COMBINED, 0.5, why)
    yield common.less_distorted(evidence, common.COMBINED, "van_der_pol")


def combined_nearly_linear(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """High linear coherence, yet nonlinear terms identified."""
    ensemble = evidence.at(common.COMBINED)
    linear = ensemble.linear_coherence()
    where, lowest = ensemble.lowest(lambda o: o.miso.cumulative[0])
    why = (
        f"on average {percent(1.0 - linear.mean, '.0f')} of the force needs the nonlinear terms, and "
        f"{percent(1.0 - lowest, '.0f')} at {where:.1f} Hz: a coherence that would make an analyst suspicious"
    )
    yield at_least("linear coherence over the fit band", linear, 0.9, why)
    yield from common.recovered(evidence, reported, ensemble, ("k3", "c3"))


CLAIMS = claims(
    van_der_pol_linear, van_der_pol_damping, van_der_pol_share, combined_linear, combined_cubic, combined_histogram,
    combined_nearly_linear,
    van_der_pol_coherence=lambda e, _: common.near_unity(e.at("van_der_pol")),
    van_der_pol_histogram=lambda e, _: [
        common.differs_from_gaussian(
            e, "van_der_pol", "the kurtosis lies below 3 on average, but a single record does not always show it"
        )
    ],
)  # fmt: skip
