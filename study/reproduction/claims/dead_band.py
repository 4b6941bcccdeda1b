"""Sections 5.2.6 and 5.2.7: the Dead-Band and the Extreme system."""

import math

import numpy as np

from study.records.excitation import READINGS
from study.reproduction.claims.common import NEAR_UNITY_LOWEST, differs_from_gaussian, in_band, near_unity, recovered
from study.reproduction.claims.duffing import LINEAR_PARTS, levels
from study.reproduction.claims.evidence import Assumed, Drive, Evidence
from study.reproduction.claims.excitation_reading import largest_error
from study.reproduction.claims.judgement import (
    Claim,
    Condition,
    at_least,
    at_most,
    close,
    conclude,
    near,
    one_record,
    significant,
)
from study.reproduction.claims.linear_system import deficit
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, share

SYSTEM = "dead_band"
AS_DUFFING = Assumed(plus=("cubic_stiffness",), minus=("dead_band",))
SAME_ORDER = 3.0  # dead band and root mean square response within a factor of this


def as_duffing(evidence: Evidence, reported: Reported) -> Claim:
    """A cubic stiffness in place of the dead band."""
    ensemble = evidence.ensemble(Drive(SYSTEM), AS_DUFFING)
    cubic, linear, whole = ensemble.miso("k3"), ensemble.linear_coherence(), ensemble.multiple_coherence()
    failures = zip(whole.values, linear.values, strict=True)
    gain = Sample(tuple((w - x) / (1.0 - x) for w, x in failures))
    where, negative = ensemble.lowest(lambda o: -o.miso.cumulative[-1])
    highest = -negative
    gap = reported.table_1(SYSTEM, "u_g")
    size = evidence.each(Drive(SYSTEM), lambda r: float(np.std(r["displacement"])) / gap)
    return conclude(
        reported, "dead_band_as_duffing",
        Condition(
            f"dead band and response of the same order (within a factor of {SAME_ORDER:g})",
            f"root mean square response {size} of u_g", 1.0 / SAME_ORDER <= size.mean <= SAME_ORDER,
        ),
        significant("k3", cubic),
        at_least("share of the linear fit's failure that the cubic term removes", gain, 0.5,
                 f"the cubic term takes the coherence from {linear.mean:.3f} to {whole.mean:.3f} only"),
        at_most("multiple coherence over the fit band", whole, NEAR_UNITY_LOWEST,
                f"it reaches {whole.mean:.3f} on average: a cubic imitates the gap well"),
        Condition(
            "no line's mean multiple coherence above 0.99",
            f"highest line {highest:.4f} at {where:.2f} Hz", highest <= 0.99,
            f"at {where:.1f} Hz it reaches {highest:.4f}: there the mass takes nearly all of the force",
        ),
    )  # fmt: skip


def not_invariant(evidence: Evidence, reported: Reported) -> Claim:
    """k and k3 of the Duffing system put in its place, at the lowest and the highest level of Section 5.3."""
    chosen = (levels(reported)[0], levels(reported)[-1])
    ensembles = [evidence.ensemble(Drive(SYSTEM, level), AS_DUFFING) for level in chosen]
    conditions: list[Condition] = []
    for name in ("k", "k3"):
        low, high = (e.miso(name) for e in ensembles)
        conditions.append(
            Condition(
                f"{name} changes by more than 10 % and 5 standard errors from variance {chosen[0]:g} to {chosen[1]:g}",
                f"{name} {low} and {high}",
                abs(high.mean - low.mean) > max(0.1 * abs(low.mean), 5.0 * math.hypot(low.error, high.error)),
            )
        )
    return conclude(reported, "dead_band_not_invariant", *conditions)


def linear(evidence: Evidence, reported: Reported) -> Claim:
    """SI/SO's natural frequency, MI/SO's A_1."""
    ensemble, f_n = evidence.unit(SYSTEM), reported.table_1(SYSTEM, "f_n")
    return conclude(
        reported, "dead_band_linear",
        at_most("SI/SO f_n, hand-read", ensemble.sample(lambda o: o.siso.read.get("f_n", math.nan)), 0.9 * f_n),
        at_most("SI/SO f_n, fitted", ensemble.sample(lambda o: o.siso.values.get("f_n", 0.0)), 0.9 * f_n),
        *recovered(evidence, reported, SYSTEM, ensemble, LINEAR_PARTS),
    )  # fmt: skip


def stiffness(evidence: Evidence, reported: Reported) -> Claim:
    """-A_2 fitted, and its largest error outside the 2- to 3-Hz band."""
    ensemble, stated = evidence.unit(SYSTEM), reported.value("dead_band_stiffness")
    low, high = reported.value("dead_band_error.low"), reported.value("dead_band_error.high")
    outside = ~in_band(ensemble, low, high)
    worst = ensemble.sample(lambda o: float(np.max(np.abs(o.miso.response[1].real[outside] / stated - 1.0))))
    limit, allowed = reported.value("dead_band_error"), evidence.tolerance(SYSTEM, "k_dead_band")
    return conclude(
        reported, "dead_band_stiffness",
        close("fitted A_2", ensemble.miso("k_dead_band").scaled(-1.0), stated, allowed),
        at_most(f"largest error of a line outside {low:g} to {high:g} Hz", worst, limit,
                f"outside the band the worst line of a record errs by {100 * worst.mean:.0f} %"),
    )  # fmt: skip


def largest(evidence: Evidence, reported: Reported) -> Claim:
    """The 7 percent, and where the largest error is."""
    ensemble, stated = evidence.unit(SYSTEM), reported.value("dead_band_error")
    low, high = reported.value("dead_band_error.low"), reported.value("dead_band_error.high")
    inside, true = in_band(ensemble, low, high), -reported.table_1(SYSTEM, "k")
    found = largest_error(ensemble, reported)
    largest_inside = share(
        [bool(inside[int(np.argmax(np.abs(o.miso.response[1].real / true - 1.0)))]) for o in ensemble.seeds]
    )
    finer = evidence.ensemble(
        Drive(SYSTEM), Assumed(segments=(("length", 2 * evidence.settings["segments"]["length"]),))
    )
    why = (
        f"the worst line of a record errs by {100 * found.mean:.0f} % (scatter {100 * found.scatter:.0f} %), which is "
        f"leakage: segments twice as long leave {100 * largest_error(finer, reported).mean:.0f} %"
    )
    return conclude(
        reported, "dead_band_error",
        close(f"largest error from {low:g} to {high:g} Hz", found, stated, 0.5, why),
        one_record(f"largest error from {low:g} to {high:g} Hz", found, stated, why),
        at_least("share of records whose largest error lies in that band", largest_inside, 0.5,
                 f"the largest error lies in that band in {100 * largest_inside.mean:.0f} % of the records only"),
    )  # fmt: skip


def linear_share(evidence: Evidence, reported: Reported) -> Claim:
    """About 65 percent, under both readings of unit variance."""
    stated = reported.value("dead_band_share")
    chosen = evidence.settings["excitations"]["report"]["reading"]
    found: dict[str, Sample] = {
        r: evidence.ensemble(Drive(SYSTEM, excitation=(("reading", r),)), Assumed()).linear_coherence()
        for r in READINGS
    }
    weaker = {v: evidence.at(SYSTEM, v).linear_coherence() for v in (0.05, 0.1, *levels(reported))}
    lowest = min(weaker, key=lambda v: weaker[v].mean)
    where, bottom = evidence.at(SYSTEM, lowest).lowest(lambda o: o.miso.cumulative[0])
    seen = ", ".join(f"{v:g}: {s.mean:.3f}" for v, s in weaker.items())
    why = (
        f"no level gives it over the fit band (by variance of the {chosen} force the mean is {seen}); at {lowest:g} "
        f"single lines fall to {bottom:.2f} at {where:.1f} Hz"
    )
    return conclude(
        reported, "dead_band_share",
        *(near(f"linear coherence, unit variance {r}", found[r], stated, 0.05, why) for r in READINGS),
    )  # fmt: skip


def coherence(evidence: Evidence, reported: Reported) -> Claim:
    """Approaches unity; the dip is leakage."""
    ensemble = evidence.unit(SYSTEM)
    whole = ensemble.multiple_coherence()
    f_n = reported.table_1(SYSTEM, "f_n")
    lowest, dip = ensemble.lowest(lambda o: o.miso.cumulative[-1])
    apparent = ensemble.sample(lambda o: o.siso.read.get("f_n", math.nan)).mean
    length = evidence.settings["segments"]["length"]
    dips = {n: deficit(evidence, SYSTEM, Assumed(segments=(("length", n),)), lowest, 0.5) for n in (length, 4 * length)}
    ratio = dips[4 * length].mean / dips[length].mean
    return conclude(
        reported, "dead_band_coherence",
        at_least("multiple coherence over the fit band", whole, NEAR_UNITY_LOWEST),
        Condition(
            f"lowest coherence between the apparent resonance {apparent:.2f} Hz and {f_n:g} Hz, or 0.5 Hz about it",
            f"lowest line {dip:.3f} at {lowest:.2f} Hz",
            apparent - 0.5 <= lowest <= f_n + 0.5,
        ),
        Condition(
            "four times longer segments at least halve 1 - coherence there",
            "1 - coherence there: " + ", ".join(f"{n} samples {d}" for n, d in dips.items()), ratio <= 0.5,
            f"four times longer segments leave {100 * ratio:.0f} % of the dip",
        ),
    )  # fmt: skip


def histogram(evidence: Evidence, reported: Reported) -> Claim:
    """Figure 40."""
    return conclude(
        reported, "dead_band_histogram",
        *differs_from_gaussian(evidence, SYSTEM, 0.95,
                               "a single record of this length rarely shows how its kurtosis departs from 3"),
    )  # fmt: skip


def linear_dominates(evidence: Evidence, reported: Reported) -> Claim:
    """Linear coherence of every earlier system above one half."""
    earlier = ("duffing", "van_der_pol", "duffing_van_der_pol", "mathieu", SYSTEM)
    return conclude(
        reported, "linear_dominates",
        *(at_least(f"{s}: linear coherence", evidence.unit(s).linear_coherence(), 0.5) for s in earlier),
    )  # fmt: skip


def extreme_siso(evidence: Evidence, reported: Reported) -> Claim:
    """A false natural frequency, wrong mass and stiffness."""
    ensemble, m = evidence.unit("extreme"), reported.table_1("extreme", "m")
    false = ensemble.sample(lambda o: o.siso.values.get("f_n", 0.0))
    lowest, _ = ensemble.lowest(lambda o: np.abs(o.siso.response[0]))
    mass, stiffness = ensemble.siso("m"), ensemble.siso("k")
    return conclude(
        reported, "extreme_siso",
        at_least("SI/SO f_n (exact 0)", false, 0.5),
        Condition(
            "the averaged SI/SO |A_1| has its minimum inside the band", f"minimum at {lowest:.2f} Hz",
            ensemble.frequency[0] < lowest < ensemble.frequency[-1],
        ),
        significant("SI/SO k (exact 0)", stiffness),
        Condition("mean SI/SO m more than 5 % off", f"SI/SO m {mass}", abs(mass.mean - m) > 0.05 * m,
                  f"SI/SO's m is {100 * (mass.mean / m - 1):+.1f} % off, hardly a serious error"),
    )  # fmt: skip


def extreme_linear(evidence: Evidence, reported: Reported) -> Claim:
    """A_1 = -(2 pi f)^2 m."""
    ensemble, m = evidence.unit("extreme"), reported.table_1("extreme", "m")
    exact = -((2.0 * math.pi * ensemble.frequency) ** 2) * m
    off = ensemble.sample(
        lambda o: float(np.linalg.norm(o.miso.response[0] - exact) / np.linalg.norm(exact))
    )  # fmt: skip
    return conclude(
        reported, "extreme_linear",
        at_most("departure of A_1 (root mean square over the band, relative)", off, 0.02),
        *recovered(evidence, reported, "extreme", ensemble, ("m", "c", "k")),
    )  # fmt: skip


def extreme_cubic(evidence: Evidence, reported: Reported) -> Claim:
    """k3 and c3, confirmed by the coherence."""
    ensemble = evidence.unit("extreme")
    return conclude(
        reported, "extreme_cubic",
        *recovered(evidence, reported, "extreme", ensemble, ("k3", "c3")), *near_unity(ensemble),
    )  # fmt: skip


CLAIMS = (
    as_duffing, not_invariant, linear, stiffness, largest, linear_share, coherence, histogram,
    linear_dominates, extreme_siso, extreme_linear, extreme_cubic,
)  # fmt: skip
