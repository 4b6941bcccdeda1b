"""Sections 4.5 and 5.2.2: the Duffing system."""

import math
from itertools import pairwise

import numpy as np

from study.reproduction.claims.common import less_distorted, looks_gaussian, near_unity, recovered
from study.reproduction.claims.evidence import Assumed, Drive, Ensemble, Evidence
from study.reproduction.claims.judgement import Claim, Condition, at_most, close, conclude, near, one_record
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, average

LEVELS = ("lowest", "second", "third", "highest")
READ_OFF = 0.05  # what a hand reads off a curve
LINEAR_PARTS = ("m", "c", "k", "f_n", "zeta")


def levels(reported: Reported) -> list[float]:
    """The input variances of Section 5.3."""
    return [reported.value(f"levels_invariant.{name}") for name in LEVELS]


def added_terms(evidence: Evidence, reported: Reported) -> Claim:
    """A quintic stiffness in the Duffing analysis, without noise and with the lowest noise of Section 5.4."""
    noise = reported.value("noise_random_only.low")
    conditions: list[Condition] = []
    for level, text in ((0.0, "no noise"), (noise, f"{100 * noise:g} % noise")):
        drive = Drive("duffing", noise=level)
        plain = evidence.ensemble(drive, Assumed())
        more = evidence.ensemble(drive, Assumed(plus=("quintic_stiffness",)))
        conditions += _added(plain, more, text)
    return conclude(
        reported, "added_terms", *conditions,
        because="noise on u biases its powers, and the added power takes up part of what the others lose",
    )  # fmt: skip


def _added(plain: Ensemble, more: Ensemble, text: str) -> list[Condition]:
    extra = more.sample(lambda o: o.miso.values["k5"])
    found = [
        Condition(
            f"{text}: mean k5 within 2 standard deviations of a record of zero",
            f"{text}: k5 {extra}, scatter {extra.scatter:.2g}",
            abs(extra.mean) <= 2.0 * extra.scatter,
            f"with {text} k5 lies {abs(extra.mean) / extra.scatter:.1f} scatters of a record from zero",
        )
    ]  # fmt: skip
    for name in ("m", "c", "k", "k3"):
        before, after = plain.miso(name), more.miso(name)
        change, limit = after.minus(before), 2.0 * before.scatter
        found.append(
            Condition(
                f"{text}: mean change of {name} within 2 standard deviations of a record",
                f"{text}: {name} changes by {change} (scatter {before.scatter:.2g})",
                abs(change.mean) <= limit,
                f"with {text} it moves {name} from {before.mean:.4g} to {after.mean:.4g}",
            )
        )
    return found


def duffing_linear(evidence: Evidence, reported: Reported) -> Claim:
    """A_1 of the Duffing system by MI/SO."""
    return conclude(
        reported, "duffing_linear", *recovered(evidence, reported, "duffing", evidence.unit("duffing"), LINEAR_PARTS)
    )


def siso_stiffness(evidence: Evidence, reported: Reported) -> Claim:
    """k = 500."""
    stated, ensemble = reported.value("siso_stiffness"), evidence.unit("duffing")
    read = ensemble.sample(lambda o: o.siso.read["k"])
    return conclude(
        reported, "siso_stiffness",
        close("hand-read k", read, stated, READ_OFF),
        one_record("hand-read k", read, stated),
        close("fitted k", ensemble.siso("k"), stated, READ_OFF),
    )  # fmt: skip


def siso_frequency(evidence: Evidence, reported: Reported) -> Claim:
    """f_n = 3.6 Hz."""
    stated, ensemble = reported.value("siso_frequency"), evidence.unit("duffing")
    read, fitted = ensemble.sample(lambda o: o.siso.read.get("f_n", math.nan)), ensemble.siso("f_n")
    lower = evidence.at("duffing", levels(reported)[1]).sample(lambda o: o.siso.read.get("f_n", math.nan))
    why = (
        f"the best linear fit lies at {fitted.mean:.2f} Hz; at half the variance it is read at {lower.mean:.2f} Hz, so "
        "that the report's force seems to have been weaker"
    )
    return conclude(
        reported, "siso_frequency",
        close("hand-read f_n", read, stated, READ_OFF, why),
        one_record("hand-read f_n", read, stated, why),
        close("fitted f_n", fitted, stated, READ_OFF, why),
    )  # fmt: skip


def siso_wrong(evidence: Evidence, reported: Reported) -> Claim:
    """SI/SO k and m at every level, fitted and (k) hand-read, against the study's tolerances."""
    conditions: list[Condition] = []
    for level in levels(reported):
        ensemble = evidence.at("duffing", level)
        for name in ("k", "m"):
            true, found = reported.table_1("duffing", name), ensemble.siso(name)
            allowed = evidence.tolerance("duffing", name)
            conditions.append(
                Condition(
                    f"variance {level:g}: mean SI/SO {name} more than {100 * allowed:g} % off",
                    f"variance {level:g}: {name} {found}",
                    abs(found.mean - true) > allowed * true,
                )
            )
    return conclude(reported, "siso_wrong", *conditions)


def siso_varies(evidence: Evidence, reported: Reported) -> Claim:
    """SI/SO k rises from level to level, by more than it scatters."""
    found = {level: evidence.at("duffing", level).siso("k") for level in levels(reported)}
    return conclude(reported, "siso_varies", *rising("SI/SO k", found))


def rising(label: str, found: dict[float, Sample]) -> list[Condition]:
    """From each level to the next the mean rises by more than two standard deviations of a record."""
    pairs = list(found.items())
    return [
        Condition(
            f"{label} at {high:g} above that at {low:g} by two standard deviations of a record",
            f"{low:g}: {a}, {high:g}: {b}",
            b.mean - a.mean > 2.0 * max(a.scatter, b.scatter),
        )
        for (low, a), (high, b) in pairwise(pairs)
    ]


def duffing_cubic(evidence: Evidence, reported: Reported) -> Claim:
    """Re A_2 = k3, Im A_2 = 0."""
    ensemble, k3 = evidence.unit("duffing"), reported.value("duffing_cubic")
    imaginary = ensemble.sample(lambda o: average(o.miso.response[1].imag) / k3)
    lines = ensemble.sample(lambda o: float(np.median(np.abs(o.miso.response[1].imag))) / k3)
    return conclude(
        reported, "duffing_cubic",
        close("k3", ensemble.miso("k3"), k3, evidence.tolerance("duffing", "k3")),
        near("Im A_2 / k3 averaged over the band", imaginary, 0.0, 0.01),
        at_most("median |Im A_2| / k3 of a line", lines, READ_OFF),
    )  # fmt: skip


def duffing_coherence(evidence: Evidence, reported: Reported) -> Claim:
    """Figure 23, upper curve."""
    return conclude(reported, "duffing_coherence", *near_unity(evidence.unit("duffing")))


def duffing_share(evidence: Evidence, reported: Reported) -> Claim:
    """Figure 23, lower curve: approximately 90 percent."""
    stated, found = reported.value("duffing_share"), evidence.unit("duffing").linear_coherence()
    lower = evidence.at("duffing", levels(reported)[1]).linear_coherence()
    return conclude(
        reported, "duffing_share",
        near("linear coherence over the fit band", found, stated, 0.05,
             f"on average {found.mean:.3f} passes through L_1; {stated:g} would be met by a weaker force "
             f"({lower.mean:.3f} at half the variance)"),
    )  # fmt: skip


def duffing_histogram(evidence: Evidence, reported: Reported) -> Claim:
    """Figure 24: a histogram would not tell, and tells less than Van der Pol's."""
    why = "a flat top and short tails: a record of this length is long enough to refuse the Gaussian"
    return conclude(
        reported, "duffing_histogram",
        *looks_gaussian(evidence, "duffing", 0.5, why),
        less_distorted(evidence, "duffing", "van_der_pol"),
    )  # fmt: skip


CLAIMS = (
    added_terms, duffing_linear, siso_stiffness, siso_frequency, siso_wrong, siso_varies, duffing_cubic,
    duffing_coherence, duffing_share, duffing_histogram,
)  # fmt: skip
