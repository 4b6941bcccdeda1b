"""Sections 5.3 and 5.4: the combined system at other levels and under noise."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from study.records.excitation import displacement_noise
from study.reproduction.claims.common import near_unity, recovered
from study.reproduction.claims.damping import COMBINED
from study.reproduction.claims.duffing import levels, rising
from study.reproduction.claims.evidence import Assumed, Drive, Ensemble, Evidence
from study.reproduction.claims.judgement import Claim, Condition, at_least, close, conclude, together
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, average
from study.reproduction.ensemble import NOISE_OFFSET, threaded

Floats = NDArray[np.float64]
PARTS = ("m", "c", "k", "k3", "c3")
SIGNIFICANT_BIAS = 0.05  # "not significant": below 5 % of the exact value
STRONG_BELOW = 5.0  # hertz: half of the band, which holds the response's resonance
SLIGHT = 0.10  # "decreasing slightly": the coherence loses no more than this


def noises(reported: Reported) -> list[float]:
    """The noise levels of Section 5.4."""
    return [reported.value(f"noise_random_only.{n}") for n in ("low", "middle", "high")]


def invariant(evidence: Evidence, reported: Reported) -> Claim:
    """Every parameter at every level within its tolerance."""
    conditions: list[Condition] = []
    for level in levels(reported):
        found = recovered(evidence, reported, COMBINED, evidence.at(COMBINED, level), PARTS)
        conditions.append(together(f"variance {level:g}", found))
    return conclude(reported, "levels_invariant", *conditions)


def siso_climbs(evidence: Evidence, reported: Reported) -> Claim:
    """SI/SO's natural frequency from level to level."""
    found = {level: evidence.at(COMBINED, level).siso("f_n") for level in levels(reported)}
    return conclude(reported, "levels_siso", *rising("SI/SO f_n", found))


def similar(evidence: Evidence, reported: Reported) -> Claim:
    """SI/SO and MI/SO at the lowest level."""
    level = levels(reported)[0]
    ensemble = evidence.at(COMBINED, level)
    spring, damper = cubic_shares(evidence, reported, level)
    return conclude(
        reported, "levels_similar",
        *(
            close(f"SI/SO {n}", ensemble.siso(n), ensemble.miso(n).mean, 0.10,
                  f"SI/SO's {n} is {ensemble.siso(n).mean:.4g} where MI/SO's is {ensemble.miso(n).mean:.4g}")
            for n in ("f_n", "k", "m", "c")
        ),
        because=f"even at {level:g} N^2 the cubic spring adds {100 * spring:.0f} % to the force that follows u and the "
        f"cubic damper {100 * damper:.0f} % to that which follows the velocity: SI/SO takes them for k and c",
    )  # fmt: skip


def cubic_shares(evidence: Evidence, reported: Reported, level: float) -> tuple[float, float]:
    """What the cubic spring adds to k, and the cubic damper to c, by least squares along the records: as shares."""
    k, c, k3, c3 = (reported.table_1(COMBINED, n) for n in ("k", "c", "k3", "c3"))
    drive = Drive(COMBINED, level)
    spring = evidence.each(drive, lambda r: k3 / k * _on(r["displacement"] ** 3, r["displacement"]))
    damper = evidence.each(drive, lambda r: c3 / c * _on(r["displacement"] ** 2 * r["velocity"], r["velocity"]))
    return spring.mean, damper.mean


def _on(values: Floats, motion: Floats) -> float:
    """Coefficient of a motion in some values, by least squares."""
    return float(values @ motion / (motion @ motion))


def coherences(evidence: Evidence, reported: Reported) -> Claim:
    """Figures 46, 49, 31, 52."""
    found = [together(f"variance {v:g}", near_unity(evidence.at(COMBINED, v))) for v in levels(reported)]
    return conclude(reported, "levels_coherence", *found)


def _biases(ensemble: Ensemble, reported: Reported, names: tuple[str, ...]) -> dict[str, Sample]:
    """Relative error of each fitted parameter."""
    truth = {n: reported.table_1(COMBINED, n) for n in names}
    return {n: ensemble.sample(lambda o, n=n: o.miso.values[n] / truth[n] - 1.0) for n in names}


def random_only(evidence: Evidence, reported: Reported) -> Claim:
    """Bias of every parameter at every noise level against the scatter of its mean."""
    conditions: list[Condition] = []
    clean = _biases(evidence.unit(COMBINED), reported, PARTS)
    for noise in noises(reported):
        found = _biases(evidence.at(COMBINED, 1.0, noise), reported, PARTS)
        shifts = [shift(name, sample.minus(clean[name])) for name, sample in found.items()]
        conditions.append(together(f"{100 * noise:g} % noise", shifts))
    return conclude(
        reported, "noise_random_only", *conditions,
        because="u is the input of the reverse system, and noise on an input (and on its cube) biases, where noise on "
        "the output only scatters",
    )  # fmt: skip


def shift(name: str, off: Sample) -> Condition:
    """A mean that scatter alone explains."""
    text = f"{name} {100 * off.mean:+.3g} +- {100 * off.error:.1g} %"
    criterion = f"mean shift of {name} within 3 standard errors of zero"
    return Condition(criterion, text, abs(off.mean) <= 3.0 * off.error, text)


def output_noise(evidence: Evidence, reported: Reported) -> Claim:
    """Noise on the force, the reverse system's output."""
    noise, drive = noises(reported)[1], Drive(COMBINED)
    model = evidence.model(drive)

    def one(pair: tuple[int, int]) -> dict[str, tuple[float, float]]:
        record = evidence.records(drive)[pair[0]]
        extra = displacement_noise(record["force"], noise, pair[1])
        found = evidence.analyse(model, record.with_channels({"force": record["force"] + extra})).miso
        return {n: (found.values[n], found.errors[n]) for n in PARTS}

    pairs = [(i + 1, NOISE_OFFSET + seed) for i, seed in enumerate(evidence.seeds)]
    found = threaded(one, pairs)
    conditions: list[Condition] = []
    for name in PARTS:
        true = reported.table_1(COMBINED, name)
        sample = Sample(tuple(f[name][0] / true - 1.0 for f in found))
        ratio = average([f[name][1] for f in found]) / (sample.scatter * true)
        spread = ratio / math.sqrt(2.0 * (len(found) - 1))
        allowed = evidence.tolerance(COMBINED, name)
        conditions += [
            Condition(
                f"mean {name} within its tolerance of {100 * allowed:g} % or 3 standard errors",
                f"{name} {100 * sample.mean:+.2g} +- {100 * sample.error:.1g} %",
                abs(sample.mean) <= max(allowed, 3.0 * sample.error),
            ),
            Condition(
                f"predicted standard error of {name} within 25 % of its scatter",
                f"{name} predicted over observed {ratio:.2f} +- {spread:.2f}", abs(ratio - 1.0) <= 0.25,
            ),
        ]  # fmt: skip
    return conclude(reported, "noise_output", *conditions)


def random_errors(evidence: Evidence, reported: Reported) -> Claim:
    """Scatter of the fitted coefficients of A_1 and A_2."""
    steps = [0.0, *noises(reported)]
    conditions: list[Condition] = []
    for name in PARTS:
        scatter = [evidence.at(COMBINED, 1.0, n).miso(name).scatter for n in steps]
        text = ", ".join(f"{100 * n:g} %: {s:.3g}" for n, s in zip(steps, scatter, strict=True))
        conditions.append(
            Condition(
                f"scatter of {name} rises with every noise level", f"{name} {text}",
                all(a < b for a, b in pairwise(scatter)),
                f"the scatter of {name} goes {text}: a strong bias shrinks the estimate and its scatter with it",
            )
        )  # fmt: skip
    return conclude(reported, "noise_random", *conditions)


def linear_bias(evidence: Evidence, reported: Reported) -> Claim:
    """Bias of A_1 as fitted by weighted least squares and as a hand reads it."""
    names = ("k", "f_n", "m", "c")
    truth = {n: reported.table_1(COMBINED, n) for n in names}
    conditions: list[Condition] = []
    for noise in noises(reported):
        ensemble = evidence.at(COMBINED, 1.0, noise)
        fitted = {n: ensemble.miso(n).mean for n in names}
        read = {n: ensemble.sample(lambda o, n=n: o.miso.read.get(n, math.nan)).median for n in names}
        for how, found in (("fitted (mean)", fitted), ("hand-read (median)", read)):
            biases = {n: bias(n, value / truth[n] - 1.0) for n, value in found.items()}
            label = f"{100 * noise:g} % noise, {how}"
            conditions += [together(label, [biases[n] for n in ("k", "m", "f_n")]), together(label, [biases["c"]])]
    low, worst = evidence.settings["fit_band"][0], noises(reported)[-1]
    strong = evidence.ensemble(Drive(COMBINED, noise=worst), Assumed(band=(low, STRONG_BELOW)))
    near = ", ".join(f"{n} {100 * (strong.miso(n).mean / truth[n] - 1.0):+.2g} %" for n in names)
    return conclude(
        reported, "noise_linear", *conditions,
        because="the fit over the whole band meets lines where white noise exceeds the response; fitted below "
        f"{STRONG_BELOW:g} Hz alone, {100 * worst:g} % noise leaves {near}, so that the damping is biased everywhere",
    )  # fmt: skip


def bias(name: str, off: float) -> Condition:
    """A bias that is not significant."""
    text = f"{name} {100 * off:+.3g} %"
    return Condition(f"bias of {name} within {100 * SIGNIFICANT_BIAS:g} %", text, abs(off) <= SIGNIFICANT_BIAS, text)


def cubic_bias(evidence: Evidence, reported: Reported) -> Claim:
    """Random and bias errors of k3 and c3, and which is hurt more."""
    steps = [0.0, *noises(reported)]
    found = {n: _biases(evidence.at(COMBINED, 1.0, n), reported, ("k3", "c3")) for n in steps}
    conditions: list[Condition] = []
    for name, part in (("k3", "real"), ("c3", "imaginary")):
        bias = [abs(found[n][name].mean) for n in steps]
        spread = [_line_scatter(evidence.at(COMBINED, 1.0, n), part == "imaginary", reported) for n in steps]
        for label, values in ((f"bias of {name}", bias), (f"scatter of a line of the {part} part", spread)):
            text = ", ".join(f"{100 * n:g} %: {v:.3g}" for n, v in zip(steps, values, strict=True))
            rises = all(a < b for a, b in pairwise(values))
            why = f"the {label} goes {text}: a strong bias shrinks the estimate and its scatter with it"
            conditions.append(
                Condition(f"{label} (relative) rises with every noise level", f"{label} {text}", rises, why)
            )
    worst = noises(reported)[-1]
    k3, c3 = found[worst]["k3"].mean, found[worst]["c3"].mean
    conditions.append(
        Condition(
            f"at {100 * worst:g} % noise the bias of c3 is the larger", f"k3 {100 * k3:+.3g} %, c3 {100 * c3:+.3g} %",
            abs(c3) > abs(k3),
        )
    )  # fmt: skip
    return conclude(reported, "noise_cubic", *conditions)


def _line_scatter(ensemble: Ensemble, imaginary: bool, reported: Reported) -> float:
    """Standard deviation over the seeds of a line of A_2, relative to its exact value; median over the band."""
    stacked = np.stack([o.miso.response[1].imag if imaginary else o.miso.response[1].real for o in ensemble.seeds])
    slope = 2.0 * np.pi * ensemble.frequency * reported.table_1(COMBINED, "c3") / 3.0
    exact = slope if imaginary else np.full_like(slope, reported.table_1(COMBINED, "k3"))
    return float(np.median(np.std(stacked, axis=0, ddof=1) / exact))


def noise_coherence(evidence: Evidence, reported: Reported) -> Claim:
    """Multiple coherence over the fit band."""
    steps = [0.0, *noises(reported)]
    found = {n: evidence.at(COMBINED, 1.0, n).multiple_coherence() for n in steps}
    pairs = list(found.items())
    text = ", ".join(f"{100 * n:g} %: {s}" for n, s in pairs)
    last = evidence.at(COMBINED, 1.0, steps[-1])
    top = last.lines(lambda o: o.miso.cumulative[-1])[-1]
    why = (
        f"at {100 * steps[-1]:g} % noise it falls to {pairs[-1][1].mean:.2f} on average and {top:.2f} at the band's "
        "end, where white noise exceeds the response"
    )
    return conclude(
        reported, "noise_coherence",
        Condition(
            "mean multiple coherence falls with every noise level", text,
            all(a.mean > b.mean for (_, a), (_, b) in pairwise(pairs)),
        ),
        *(
            Condition(f"loss at {100 * n:g} % noise at most {SLIGHT:g}", text,
                      found[0.0].mean - s.mean <= SLIGHT, why)
            for n, s in pairs[1:]
        ),
        at_least(f"multiple coherence at {100 * steps[-1]:g} % noise", pairs[-1][1], 0.9, why),
    )  # fmt: skip


CLAIMS = (
    invariant, siso_climbs, similar, coherences, random_only, output_noise, random_errors, linear_bias, cubic_bias,
    noise_coherence,
)  # fmt: skip
