"""Sections 4.4, 4.5 and 5.2 to 5.2.5: spectra; linear, Duffing, Van der Pol, combined and Mathieu system."""

import math
from collections.abc import Iterator

import numpy as np

from study.identify.estimators.in_reverse import miso
from study.identify.frequency_domain.conditioned import MisoResult
from study.reproduction.claims.conditions import has_line, local_maxima, near_unity, recovered, stated
from study.reproduction.claims.evidence import Assumed, Drive, Evidence
from study.reproduction.claims.judgement import (
    Condition,
    at_least,
    at_most,
    claims,
    explained,
    near,
    surely_above_zero,
    within_share,
)
from study.reproduction.claims.reported import COMBINED, Reported
from study.reproduction.claims.sample import (
    GAUSSIAN_CENTRAL_SHARE,
    GAUSSIAN_OUTER_SHARE,
    Sample,
    average,
    central_share,
    kurtosis,
    outer_share,
    relative_distance,
)
from study.support.arrays import Floats
from study.support.numbers import percent

# ---- spectra, Sections 4.4 and 5.2


def coherence_forms(evidence: Evidence, _: Reported) -> Iterator[Condition]:
    """(4.38) and (4.39) on the Duffing system's own record."""
    drive = Drive("duffing")
    result = miso(evidence.model(drive), evidence.records(drive)[0], evidence.estimator_settings()).responses
    assert isinstance(result, MisoResult)
    product = 1.0 - np.prod(1.0 - result.partial, axis=0)
    worst = float(np.max(np.abs(product - np.sum(result.contribution, axis=0))))
    yield Condition("both forms equal to 1e-9 on every line", f"largest difference {worst:.1g}", worst < 1e-9)


def averages(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Segments end to end, and what the overlapped ones are worth."""
    segments, samples = evidence.segments, evidence.settings.sampling.samples
    number, apart, worth = reported.value("averages"), samples // segments.length, segments.effective_averages(samples)
    count = segments.count(samples)
    yield Condition(f"{number:g} segments end to end", f"{apart} segments end to end", apart == number)
    yield Condition(
        f"effective averages under the stated overlap within 10 % of {number:g}",
        f"{worth:.1f} effective of {count} overlapped", abs(worth - number) <= 0.1 * number,
        f"the stated overlap makes {count} segments, which the Hann window leaves worth {worth:.1f} averages; "
        f"{number:g} counts them end to end",
    )  # fmt: skip


def resolution(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Line spacing and lengths in seconds."""
    samples, dt = evidence.settings.sampling.samples, evidence.settings.sampling.dt
    length = evidence.segments.length
    values = {
        "resolution": (1.0 / (length * dt), 1e-3), "resolution.seconds": (length * dt, 1e-9),
        "resolution.length": (length, 0.0), "resolution.samples": (samples, 0.0),
        "resolution.total": (samples * dt, 1e-9),
    }  # fmt: skip
    for name, (value, rounding) in values.items():
        row, same = reported[name], math.isclose(value, reported.value(name), rel_tol=rounding)
        yield Condition(f"{row.what} equals {row}", f"{value:.5g} {row.unit}", same)


def deficit(evidence: Evidence, reported: Reported, system: str, centre: float, **segments: object) -> Sample:
    """1 - multiple coherence near a frequency, freed of the bias that few averages bring.

    ``segments`` are settings of the segments that replace the configured ones.
    """
    ensemble = evidence.ensemble(Drive(system), Assumed(segments=tuple(segments.items())))
    keep = np.abs(ensemble.frequency - centre) <= reported.limit("nearby")
    inputs, worth = len(ensemble.own.miso.cumulative), ensemble.own.miso.averages
    return ensemble.sample(lambda o: average(1.0 - o.miso.cumulative[-1][keep])).scaled(worth / (worth - inputs))


def longer_segments_help(evidence: Evidence, reported: Reported, system: str, centre: float, where: str) -> Condition:
    """Leakage falls with the length of the segments: four times as long, they at least halve 1 - coherence."""
    length = evidence.segments.length
    short, long = (deficit(evidence, reported, system, centre, **of) for of in ({}, {"length": 4 * length}))
    left = long.mean / short.mean
    return Condition(
        f"four times longer segments at least halve 1 - coherence {where}",
        f"1 - coherence {where}: {length} samples {short}, {4 * length} samples {long}",
        left <= 0.5,
        f"four times longer segments leave {percent(left, '.0f')} of the dip",
    )


def hanning(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Leakage at the linear system's resonance with and without the window."""
    f_n = reported.table_1("linear", "f_n")
    without, with_it = (deficit(evidence, reported, "linear", f_n, **of) for of in ({"window": "boxcar"}, {}))
    yield surely_above_zero("1 - coherence near resonance without window less that with it", without.minus(with_it))


def overlap(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Scatter of the lines of A_1 under noise with and without the overlap."""
    drive = Drive(COMBINED, noise=reported.noises[0])
    ensembles = [evidence.ensemble(drive), evidence.ensemble(drive, Assumed(segments=(("overlap", 0.0),)))]
    overlapped, apart = (np.std([o.miso.response[0] for o in e.seeds], axis=0, ddof=1) for e in ensembles)
    logarithms: Floats = np.log(overlapped / apart)
    ratio = float(np.exp(np.mean(logarithms)))
    inflation = evidence.segments.line_inflation()
    spread = ratio * float(np.std(logarithms, ddof=1)) * math.sqrt(inflation / len(logarithms))
    yield Condition(
        "scatter of a line of A_1 with overlap over that without below 1 by two standard errors",
        f"{ratio:.3g} +- {spread:.1g} (geometric mean over the band)", ratio + 2.0 * spread < 1.0,
        f"the ratio {ratio:.3g} +- {spread:.1g} is not clearly below one",
    )  # fmt: skip


# ---- the linear system, Section 5.2.1


def linear_same(evidence: Evidence, _: Reported) -> Iterator[Condition]:
    """Both curves of the linear system, the MI/SO one assuming a Duffing system."""
    ensemble = evidence.ensemble(Drive("linear"), Assumed(plus=("cubic_stiffness",)))
    apart = ensemble.sample(lambda o: relative_distance(o.miso.response[0], o.siso.response[0]))
    yield at_most("difference of the curves (root mean square over the band, relative)", apart, 0.02)
    yield from (within_share(f"MI/SO {n}", ensemble.miso(n), ensemble.siso(n).mean, 0.01) for n in ("m", "c", "k"))


def linear_leakage(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """The dip stands at resonance and falls with longer segments."""
    f_n, nearby = reported.table_1("linear", "f_n"), reported.limit("nearby")
    lowest, _ = evidence.at("linear").lowest(lambda o: o.miso.cumulative[-1])
    at_resonance = abs(lowest - f_n) <= nearby
    yield Condition(f"lowest coherence within {nearby:g} Hz of {f_n:g} Hz", f"lowest at {lowest:.2f} Hz", at_resonance)
    yield longer_segments_help(evidence, reported, "linear", f_n, "near resonance")


# ---- the Duffing system, Sections 4.5 and 5.2.2


def added_terms(evidence: Evidence, reported: Reported) -> list[Condition]:
    """A quintic stiffness in the Duffing analysis, without noise and with the lowest noise of Section 5.4."""
    conditions: list[Condition] = []
    for noise in (0.0, reported.noises[0]):
        label, drive = f"{percent(noise)} noise" if noise else "no noise", Drive("duffing", noise=noise)
        plain, extended = evidence.ensemble(drive), evidence.ensemble(drive, Assumed(plus=("quintic_stiffness",)))
        k5 = extended.miso("k5")
        conditions.append(
            Condition(
                f"{label}: mean k5 within 2 standard deviations of a record of zero",
                f"{label}: k5 {k5}, scatter {k5.scatter:.2g}", abs(k5.mean) <= 2.0 * k5.scatter,
                f"with {label} k5 lies {abs(k5.mean) / k5.scatter:.1f} scatters of a record from zero",
            )
        )  # fmt: skip
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
    return explained(
        "noise on u biases its powers, and the added power takes up part of what the others lose", conditions
    )  # fmt: skip


def siso_frequency(evidence: Evidence, reported: Reported) -> list[Condition]:
    """f_n = 3.6 Hz."""
    fitted, lower = evidence.at("duffing").siso("f_n"), evidence.at("duffing", reported.levels[1]).hand_read("f_n")
    why = (
        f"the best linear fit lies at {fitted.mean:.2f} Hz; at half the variance it is read at {lower.mean:.2f} Hz, so "
        "that the report's force seems to have been weaker"
    )
    return stated(evidence, reported, reported["siso_frequency"], why)


def siso_wrong(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """SI/SO k and m at every level, against the study's tolerances."""
    for level in reported.levels:
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
    yield at_most("median |Im A_2| / k3 of a line", lines, reported.limit("read_off"))


def duffing_share(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Figure 23, lower curve: approximately 90 percent."""
    number, share = reported.value("duffing_share"), evidence.at("duffing").linear_coherence()
    lower = evidence.at("duffing", reported.levels[1]).linear_coherence()
    why = (
        f"on average {share.mean:.3f} passes through L_1; {number:g} would be met by a weaker force ({lower.mean:.3f} "
        "at half the variance)"
    )
    yield near("linear coherence over the fit band", share, number, 0.05, why)


# ---- the Van der Pol and the combined system, Sections 5.2.3 and 5.2.4


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


def combined_cubic(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Figures 30 and 31."""
    ensemble = evidence.at(COMBINED)
    alone = {"k3": evidence.at("duffing").miso("k3"), "c3": evidence.at("van_der_pol").miso("c3")}
    yield from recovered(evidence, reported, ensemble, alone)
    for name, sample in alone.items():
        allowed = 2.0 * evidence.tolerance(COMBINED, name)
        yield within_share(f"{name} of the combined system", ensemble.miso(name), sample.mean, allowed)
    yield from near_unity(reported, ensemble)


def combined_histogram(evidence: Evidence, reported: Reported) -> list[Condition]:
    """Figure 32: nearer to the Gaussian than Figure 28."""
    outside = evidence.of_channel(COMBINED, outer_share)
    why = (
        f"the cubic spring and damper hold large displacements back, so that {percent(outside.mean, '.2g')} lie beyond "
        f"two standard deviations where a Gaussian has {percent(GAUSSIAN_OUTER_SHARE, '.2g')}"
    )
    return stated(evidence, reported, reported["combined_histogram"], why)


def combined_nearly_linear(evidence: Evidence, reported: Reported) -> list[Condition]:
    """High linear coherence, yet nonlinear terms identified."""
    ensemble = evidence.at(COMBINED)
    where, lowest = ensemble.lowest(lambda o: o.miso.cumulative[0])
    why = (
        f"on average {percent(1.0 - ensemble.linear_coherence().mean, '.0f')} of the force needs the nonlinear terms, "
        f"and {percent(1.0 - lowest, '.0f')} at {where:.1f} Hz: a coherence that would make an analyst suspicious"
    )
    return stated(evidence, reported, reported["combined_nearly_linear"], why)


# ---- the Mathieu system, Section 5.2.5


def mathieu_third(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """A_3 against A_2, and what passes through it."""
    ensemble, k_m, negligible = evidence.at("mathieu"), reported.table_1("mathieu", "k_m"), reported.limit("negligible")
    size = ensemble.sample(lambda o: average(o.miso.response[2].real) / k_m)
    passed = ensemble.sample(lambda o: average(o.miso.cumulative[2] - o.miso.cumulative[1]))
    yield near("A_3 / k_m averaged over the band", size, 0.0, negligible)
    yield at_most("share of the force through A_3", passed, negligible)


def mathieu_side_resonances(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Local minima of the averaged SI/SO |A_1|: what a resonance is to an impedance."""
    ensemble = evidence.at("mathieu")
    low, high = reported.band("mathieu_side_resonances")
    averaged = local_maxima(ensemble.frequency, -ensemble.lines(lambda o: np.abs(o.siso.response[0])))
    own = local_maxima(ensemble.frequency, -np.abs(ensemble.own.siso.response[0]))
    shown = ", ".join(f"{f:.2f}" for f in own if low - 1.0 <= f <= high + 1.0)
    yield from (has_line(reported, "minimum of the averaged SI/SO |A_1|", averaged, f) for f in (low, high))
    yield Condition(
        "the own record's curve has minima there as well", f"own record has minima at {shown} Hz",
        all(np.any(np.abs(own - f) <= reported.limit("line")) for f in (low, high)),
    )  # fmt: skip


def mathieu_siso_coherence(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Between and about the side resonances, where the response is."""
    low, high = reported.band("mathieu_side_resonances")
    share = evidence.at("mathieu").linear_coherence(low, high)
    why = f"from {low:g} to {high:g} Hz {share.mean:.2f} passes through the linear path, more than half"
    yield at_most(f"SI/SO coherence from {low:g} to {high:g} Hz", share, reported.limit("low_coherence"), why)


def mathieu_stiffness(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """A_2: the fitted amplitude, and line by line where the response is strong."""
    ensemble, number = evidence.at("mathieu"), reported.value("mathieu_stiffness")
    low, high = reported.band("mathieu_side_resonances")
    keep = ensemble.between(low, high)
    error = ensemble.sample(lambda o: average(np.abs(o.miso.response[1][keep] / number - 1.0)))
    imaginary = ensemble.sample(lambda o: average(o.miso.response[1][keep].imag) / number)
    yield within_share("k_m", ensemble.miso("k_m"), number, evidence.tolerance("mathieu", "k_m"))
    yield at_most(f"error of a line of A_2 from {low:g} to {high:g} Hz", error, reported.limit("excellent"))
    yield near(f"Im A_2 / k_m from {low:g} to {high:g} Hz", imaginary, 0.0, reported.limit("negligible"))


def mathieu_share(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Figure 35, lower curve."""
    ensemble = evidence.at("mathieu")
    share = ensemble.linear_coherence()
    where, lowest = ensemble.lowest(lambda o: o.miso.cumulative[0])
    why = (
        f"it falls to {lowest:.2f} at {where:.1f} Hz, but above the resonance the mass takes most of the force, so "
        f"that {share.mean:.2f} passes on average"
    )
    yield at_most("linear coherence over the fit band", share, reported.limit("low_coherence"), why)


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


IDENTIFICATION_CLAIMS = claims(
    coherence_forms, averages, resolution, hanning, overlap, linear_same, linear_leakage, added_terms, siso_frequency,
    siso_wrong, duffing_cubic, duffing_share, van_der_pol_damping, van_der_pol_share, combined_cubic,
    combined_histogram, combined_nearly_linear, mathieu_third, mathieu_side_resonances, mathieu_siso_coherence,
    mathieu_stiffness, mathieu_share, mathieu_histogram,
)  # fmt: skip
