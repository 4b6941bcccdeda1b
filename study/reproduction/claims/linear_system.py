"""Sections 4.4, 5.2 and 5.2.1: spectra and the linear system."""

import math

import numpy as np
from numpy.typing import NDArray

from study.identify.estimators.base import Identified
from study.identify.frequency_domain.conditioned import MisoResult
from study.records.spectra import Segments
from study.reproduction.claims.common import TESTS_WRONG, looks_gaussian, near_unity
from study.reproduction.claims.evidence import Assumed, Drive, Evidence
from study.reproduction.claims.judgement import Claim, Condition, at_most, close, conclude, significant
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, average

Floats = NDArray[np.float64]
READ_OFF = 0.05  # what a hand reads off a curve


def averages(evidence: Evidence, reported: Reported) -> Claim:
    """Segments end to end, and what the overlapped ones are worth."""
    cut, samples = Segments(**evidence.settings["segments"]), evidence.settings["sampling"]["samples"]
    stated, apart, worth = reported.value("averages"), samples // cut.length, cut.effective_averages(samples)
    count = cut.count(samples)
    return conclude(
        reported, "averages",
        Condition(f"{stated:g} segments end to end", f"{apart} segments end to end", apart == stated),
        Condition(
            f"effective averages under the stated overlap within 10 % of {stated:g}",
            f"{worth:.1f} effective of {count} overlapped", abs(worth - stated) <= 0.1 * stated,
            f"the stated overlap makes {count} segments, which the Hann window leaves worth {worth:.1f} averages; "
            f"{stated:g} counts them end to end",
        ),
    )  # fmt: skip


def resolution(evidence: Evidence, reported: Reported) -> Claim:
    """Line spacing and lengths in seconds."""
    sampling, length = evidence.settings["sampling"], evidence.settings["segments"]["length"]
    seconds = length * sampling["dt"]
    found = {
        "": (1.0 / seconds, 1e-3), ".seconds": (seconds, 1e-9), ".length": (length, 0.0),
        ".samples": (sampling["samples"], 0.0), ".total": (sampling["samples"] * sampling["dt"], 1e-9),
    }  # fmt: skip
    conditions: list[Condition] = []
    for suffix, (value, rounding) in found.items():
        row = reported[f"resolution{suffix}"]
        stated = reported.value(row.id)
        same = math.isclose(value, stated, rel_tol=rounding)
        conditions.append(Condition(f"{row.what} equals {row}", f"{value:.5g} {row.unit}", same))
    return conclude(reported, "resolution", *conditions)


def deficit(evidence: Evidence, system: str, assumed: Assumed, centre: float, reach: float) -> Sample:
    """1 - multiple coherence near a frequency, freed of the bias that few averages bring."""
    ensemble = evidence.ensemble(Drive(system), assumed)
    keep = np.abs(ensemble.frequency - centre) <= reach
    inputs = len(ensemble.own.miso.cumulative)
    worth = ensemble.own.miso.averages
    return ensemble.sample(lambda o: average(1.0 - o.miso.cumulative[-1][keep])).scaled(worth / (worth - inputs))


def hanning(evidence: Evidence, reported: Reported) -> Claim:
    """Leakage at the linear system's resonance with and without the window."""
    f_n = reported.table_1("linear", "f_n")
    hann = deficit(evidence, "linear", Assumed(), f_n, 0.5)
    bare = deficit(evidence, "linear", Assumed(segments=(("window", "boxcar"),)), f_n, 0.5)
    return conclude(
        reported, "hanning",
        significant("1 - coherence near resonance without window less that with it", bare.minus(hann)),
    )  # fmt: skip


def overlap(evidence: Evidence, reported: Reported) -> Claim:
    """Scatter of the lines of A_1 under noise with and without the overlap."""
    drive = Drive("duffing_van_der_pol", noise=reported.value("noise_random_only.low"))
    own = evidence.ensemble(drive, Assumed())
    scatter = [
        np.asarray(np.std([o.miso.response[0] for o in e.seeds], axis=0, ddof=1), dtype=np.float64)
        for e in (own, evidence.ensemble(drive, Assumed(segments=(("overlap", 0.0),))))
    ]
    logs: Floats = np.log(scatter[0] / scatter[1])
    cut = Segments(**evidence.settings["segments"])
    ratio = float(np.exp(np.mean(logs)))
    spread = ratio * float(np.std(logs, ddof=1)) * math.sqrt(cut.line_inflation() / len(logs))
    return conclude(
        reported, "overlap",
        Condition(
            "scatter of a line of A_1 with overlap over that without below 1 by two standard errors",
            f"{ratio:.3g} +- {spread:.1g} (geometric mean over the band)", ratio + 2.0 * spread < 1.0,
            f"the ratio {ratio:.3g} +- {spread:.1g} is not clearly below one",
        ),
    )  # fmt: skip


def coherence_forms(evidence: Evidence, reported: Reported) -> Claim:
    """(4.38) and (4.39) on the Duffing system's own record."""
    from study.identify.estimators import miso
    from study.identify.estimators.base import Settings

    drive = Drive("duffing")
    low, high = evidence.settings["fit_band"]
    told = Settings(Segments(**evidence.settings["segments"]), (low, high))
    found: Identified = miso.identify(evidence.model(drive), evidence.records(drive)[0], told)
    assert isinstance(found.responses, MisoResult)
    product = 1.0 - np.prod(1.0 - found.responses.partial, axis=0)
    worst = float(np.max(np.abs(product - np.sum(found.responses.contribution, axis=0))))
    return conclude(
        reported, "coherence_forms",
        Condition("both forms equal to 1e-9 on every line", f"largest difference {worst:.1g}", worst < 1e-9),
    )  # fmt: skip


def linear_same(evidence: Evidence, reported: Reported) -> Claim:
    """Both curves of the linear system, the MI/SO one assuming a Duffing system."""
    ensemble = evidence.ensemble(Drive("linear"), Assumed(plus=("cubic_stiffness",)))
    apart = ensemble.sample(
        lambda o: float(
            np.linalg.norm(o.miso.response[0] - o.siso.response[0]) / np.linalg.norm(o.siso.response[0])
        )
    )  # fmt: skip
    return conclude(
        reported, "linear_same",
        at_most("difference of the curves (root mean square over the band, relative)", apart, 0.02),
        *(close(f"MI/SO {n}", ensemble.miso(n), ensemble.siso(n).mean, 0.01) for n in ("m", "c", "k")),
    )  # fmt: skip


def linear_coherence(evidence: Evidence, reported: Reported) -> Claim:
    """Coherence of the linear system."""
    return conclude(reported, "linear_coherence", *near_unity(evidence.unit("linear")))


def linear_leakage(evidence: Evidence, reported: Reported) -> Claim:
    """The dip stands at resonance and falls with longer segments."""
    f_n, ensemble = reported.table_1("linear", "f_n"), evidence.unit("linear")
    lowest, _ = ensemble.lowest(lambda o: o.miso.cumulative[-1])
    length = evidence.settings["segments"]["length"]
    dips = {n: deficit(evidence, "linear", Assumed(segments=(("length", n),)), f_n, 0.5) for n in (length, 4 * length)}
    text = ", ".join(f"{n} samples {d}" for n, d in dips.items())
    ratio = dips[4 * length].mean / dips[length].mean
    return conclude(
        reported, "linear_leakage",
        Condition(
            f"lowest coherence within 0.5 Hz of {f_n:g} Hz", f"lowest at {lowest:.2f} Hz", abs(lowest - f_n) <= 0.5
        ),
        Condition(
            "four times longer segments at least halve 1 - coherence near resonance",
            f"1 - coherence near resonance: {text}", ratio <= 0.5,
        ),
    )  # fmt: skip


def linear_histogram(evidence: Evidence, reported: Reported) -> Claim:
    """Figure 20."""
    return conclude(reported, "linear_histogram", *looks_gaussian(evidence, "linear", TESTS_WRONG))


def hand_read(evidence: Evidence, reported: Reported) -> Claim:
    """The recipes of Section 5.2.1 on the linear system."""
    ensemble = evidence.unit("linear")
    return conclude(
        reported, "hand_read",
        *(
            close(f"hand-read {n}", ensemble.sample(lambda o, n=n: o.siso.read.get(n, math.nan)),
                  reported.table_1("linear", n), READ_OFF,
                  "the recipe reads single lines of a curve whose minimum the window fills up with leakage")
            for n in ("k", "f_n", "m", "c")
        ),
    )  # fmt: skip


CLAIMS = (
    coherence_forms, averages, resolution, hanning, overlap, linear_same, linear_coherence, linear_leakage,
    linear_histogram, hand_read,
)  # fmt: skip
