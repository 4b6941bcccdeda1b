"""Sections 4.4, 5.2 and 5.2.1: spectra and the linear system."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from study.identify.estimators.in_reverse import miso
from study.identify.frequency_domain.conditioned import MisoResult
from study.reproduction.claims.common import READ_OFF, TESTS_WRONG, looks_gaussian, near_unity
from study.reproduction.claims.evidence import Assumed, Drive, Evidence
from study.reproduction.claims.judgement import Condition, at_most, claims, surely_above_zero, within_share
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, average, relative_distance
from study.support.numbers import percent

Floats = NDArray[np.float64]
NEARBY = 0.5  # hertz about a resonance


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
    stated, apart, worth = reported.value("averages"), samples // segments.length, segments.effective_averages(samples)
    count = segments.count(samples)
    yield Condition(f"{stated:g} segments end to end", f"{apart} segments end to end", apart == stated)
    yield Condition(
        f"effective averages under the stated overlap within 10 % of {stated:g}",
        f"{worth:.1f} effective of {count} overlapped", abs(worth - stated) <= 0.1 * stated,
        f"the stated overlap makes {count} segments, which the Hann window leaves worth {worth:.1f} averages; "
        f"{stated:g} counts them end to end",
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


def deficit(evidence: Evidence, system: str, centre: float, **segments: object) -> Sample:
    """1 - multiple coherence near a frequency, freed of the bias that few averages bring.

    ``segments`` are settings of the segments that replace the configured ones.
    """
    ensemble = evidence.ensemble(Drive(system), Assumed(segments=tuple(segments.items())))
    keep = np.abs(ensemble.frequency - centre) <= NEARBY
    inputs, worth = len(ensemble.own.miso.cumulative), ensemble.own.miso.averages
    return ensemble.sample(lambda o: average(1.0 - o.miso.cumulative[-1][keep])).scaled(worth / (worth - inputs))


def longer_segments_help(evidence: Evidence, system: str, centre: float, where: str) -> Condition:
    """Leakage falls with the length of the segments: four times as long, they at least halve 1 - coherence."""
    length = evidence.segments.length
    short, long = deficit(evidence, system, centre), deficit(evidence, system, centre, length=4 * length)
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
    more = deficit(evidence, "linear", f_n, window="boxcar").minus(deficit(evidence, "linear", f_n))
    yield surely_above_zero("1 - coherence near resonance without window less that with it", more)


def overlap(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Scatter of the lines of A_1 under noise with and without the overlap."""
    drive = Drive("duffing_van_der_pol", noise=reported.value("noise_random_only.low"))
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


def linear_same(evidence: Evidence, _: Reported) -> Iterator[Condition]:
    """Both curves of the linear system, the MI/SO one assuming a Duffing system."""
    ensemble = evidence.ensemble(Drive("linear"), Assumed(plus=("cubic_stiffness",)))
    apart = ensemble.sample(lambda o: relative_distance(o.miso.response[0], o.siso.response[0]))
    yield at_most("difference of the curves (root mean square over the band, relative)", apart, 0.02)
    yield from (within_share(f"MI/SO {n}", ensemble.miso(n), ensemble.siso(n).mean, 0.01) for n in ("m", "c", "k"))


def linear_leakage(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """The dip stands at resonance and falls with longer segments."""
    f_n = reported.table_1("linear", "f_n")
    lowest, _ = evidence.at("linear").lowest(lambda o: o.miso.cumulative[-1])
    at_resonance = abs(lowest - f_n) <= NEARBY
    yield Condition(f"lowest coherence within {NEARBY:g} Hz of {f_n:g} Hz", f"lowest at {lowest:.2f} Hz", at_resonance)
    yield longer_segments_help(evidence, "linear", f_n, "near resonance")


def hand_read(evidence: Evidence, reported: Reported) -> list[Condition]:
    """The recipes of Section 5.2.1 on the linear system."""
    why = "the recipe reads single lines of a curve whose minimum the window fills up with leakage"
    read = {name: evidence.at("linear").hand_read(name) for name in ("k", "f_n", "m", "c")}
    return [within_share(f"hand-read {n}", s, reported.table_1("linear", n), READ_OFF, why) for n, s in read.items()]


CLAIMS = claims(
    coherence_forms, averages, resolution, hanning, overlap, linear_same, linear_leakage, hand_read,
    linear_coherence=lambda e, _: near_unity(e.at("linear")),
    linear_histogram=lambda e, _: [looks_gaussian(e, "linear", TESTS_WRONG)],
)  # fmt: skip
