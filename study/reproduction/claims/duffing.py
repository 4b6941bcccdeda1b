"""Sections 4.5 and 5.2.2: the Duffing system."""

from collections.abc import Iterator

import numpy as np

from study.reproduction.claims import common
from study.reproduction.claims.evidence import Assumed, Drive, Evidence
from study.reproduction.claims.judgement import Condition, at_most, claims, explained, near, one_record, within_share
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import average
from study.support.numbers import percent


def added_terms(evidence: Evidence, reported: Reported) -> list[Condition]:
    """A quintic stiffness in the Duffing analysis, without noise and with the lowest noise of Section 5.4."""
    lowest = common.noises(reported)[0]
    return explained(
        "noise on u biases its powers, and the added power takes up part of what the others lose",
        [*_added(evidence, 0.0, "no noise"), *_added(evidence, lowest, f"{percent(lowest)} noise")],
    )


def _added(evidence: Evidence, noise: float, label: str) -> list[Condition]:
    drive = Drive("duffing", noise=noise)
    plain, extended = evidence.ensemble(drive), evidence.ensemble(drive, Assumed(plus=("quintic_stiffness",)))
    k5 = extended.miso("k5")
    conditions = [
        Condition(
            f"{label}: mean k5 within 2 standard deviations of a record of zero",
            f"{label}: k5 {k5}, scatter {k5.scatter:.2g}", abs(k5.mean) <= 2.0 * k5.scatter,
            f"with {label} k5 lies {abs(k5.mean) / k5.scatter:.1f} scatters of a record from zero",
        )
    ]  # fmt: skip
    for name in ("m", "c", "k", "k3"):
        before, after = plain.miso(name), extended.miso(name)
        change = after.minus(before)
        conditions.append(
            Condition(
                f"{label}: mean change of {name} within 2 standard deviations of a record",
                f"{label}: {name} changes by {change} (scatter {before.scatter:.2g})",
                abs(change.mean) <= 2.0 * before.scatter,
                f"with {label} it moves {name} from {before.mean:.4g} to {after.mean:.4g}",
            )
        )
    return conditions


def _siso_curve(evidence: Evidence, name: str, stated: float, why: str = "") -> list[Condition]:
    """The SI/SO curve gives a parameter that the report states, read by hand and fitted."""
    read, fitted = evidence.at("duffing").hand_read(name), evidence.at("duffing").siso(name)
    return [
        within_share(f"hand-read {name}", read, stated, common.READ_OFF, why),
        one_record(f"hand-read {name}", read, stated, why),
        within_share(f"fitted {name}", fitted, stated, common.READ_OFF, why),
    ]


def siso_frequency(evidence: Evidence, reported: Reported) -> list[Condition]:
    """f_n = 3.6 Hz."""
    fitted = evidence.at("duffing").siso("f_n")
    lower = evidence.at("duffing", common.input_variances(reported)[1]).hand_read("f_n")
    why = (
        f"the best linear fit lies at {fitted.mean:.2f} Hz; at half the variance it is read at {lower.mean:.2f} Hz, so "
        "that the report's force seems to have been weaker"
    )
    return _siso_curve(evidence, "f_n", reported.value("siso_frequency"), why)


def siso_wrong(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """SI/SO k and m at every level, against the study's tolerances."""
    for level in common.input_variances(reported):
        for name in ("k", "m"):
            true, sample = reported.table_1("duffing", name), evidence.at("duffing", level).siso(name)
            allowed = evidence.tolerance("duffing", name)
            yield Condition(
                f"variance {level:g}: mean SI/SO {name} more than {percent(allowed)} off",
                f"variance {level:g}: {name} {sample}", abs(sample.mean - true) > allowed * true,
            )  # fmt: skip


def duffing_cubic(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Re A_2 = k3, Im A_2 = 0."""
    ensemble, k3 = evidence.at("duffing"), reported.value("duffing_cubic")
    imaginary = ensemble.sample(lambda o: average(o.miso.response[1].imag) / k3)
    lines = ensemble.sample(lambda o: float(np.median(np.abs(o.miso.response[1].imag))) / k3)
    yield within_share("k3", ensemble.miso("k3"), k3, evidence.tolerance("duffing", "k3"))
    yield near("Im A_2 / k3 averaged over the band", imaginary, 0.0, 0.01)
    yield at_most("median |Im A_2| / k3 of a line", lines, common.READ_OFF)


def duffing_share(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Figure 23, lower curve: approximately 90 percent."""
    stated, share = reported.value("duffing_share"), evidence.at("duffing").linear_coherence()
    lower = evidence.at("duffing", common.input_variances(reported)[1]).linear_coherence()
    why = (
        f"on average {share.mean:.3f} passes through L_1; {stated:g} would be met by a weaker force ({lower.mean:.3f} "
        "at half the variance)"
    )
    yield near("linear coherence over the fit band", share, stated, 0.05, why)


def duffing_histogram(evidence: Evidence, _: Reported) -> Iterator[Condition]:
    """Figure 24: a histogram would not tell, and tells less than Van der Pol's."""
    why = "a flat top and short tails: a record of this length is long enough to refuse the Gaussian"
    yield common.looks_gaussian(evidence, "duffing", 0.5, why)
    yield common.less_distorted(evidence, "duffing", "van_der_pol")


CLAIMS = claims(
    added_terms, siso_frequency, siso_wrong, duffing_cubic, duffing_share, duffing_histogram,
    siso_stiffness=lambda e, r: _siso_curve(e, "k", r.value("siso_stiffness")),
    duffing_linear=lambda e, r: common.recovered(e, r, e.at("duffing"), common.LINEAR_PARTS),
    siso_varies=lambda e, r: common.rising(
        "SI/SO k", {v: e.at("duffing", v).siso("k") for v in common.input_variances(r)}
    ),
    duffing_coherence=lambda e, _: common.near_unity(e.at("duffing")),
)  # fmt: skip
