"""Sections 5.3 and 5.4: the combined system at other levels and under noise."""

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from study.records.excitation import displacement_noise
from study.reproduction.claims.common import COMBINED, input_variances, near_unity, noises, recovered, rising
from study.reproduction.claims.evidence import Analysis, Assumed, Drive, Ensemble, Evidence
from study.reproduction.claims.judgement import Condition, at_least, claims, explained, together, within_share
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, average
from study.reproduction.ensemble import NOISE_OFFSET, threaded
from study.support.numbers import percent

Floats = NDArray[np.float64]
PARTS = ("m", "c", "k", "k3", "c3")
SIGNIFICANT_BIAS = 0.05  # "not significant": below 5 % of the exact value
STRONG_BELOW = 5.0  # hertz: half of the band, which holds the response's resonance
SLIGHT = 0.10  # "decreasing slightly": the coherence loses no more than this


def levels_invariant(evidence: Evidence, reported: Reported) -> list[Condition]:
    """Every parameter at every level within its tolerance."""
    return [
        together(f"variance {level:g}", recovered(evidence, reported, evidence.at(COMBINED, level), PARTS))
        for level in input_variances(reported)
    ]


def levels_similar(evidence: Evidence, reported: Reported) -> list[Condition]:
    """SI/SO and MI/SO at the lowest level."""
    level = input_variances(reported)[0]
    ensemble = evidence.at(COMBINED, level)
    spring, damper = cubic_shares(evidence, reported, level)
    conditions: list[Condition] = []
    for name in ("f_n", "k", "m", "c"):
        single, multiple = ensemble.siso(name), ensemble.miso(name).mean
        why = f"SI/SO's {name} is {single.mean:.4g} where MI/SO's is {multiple:.4g}"
        conditions.append(within_share(f"SI/SO {name}", single, multiple, 0.10, why))
    return explained(
        f"even at {level:g} N^2 the cubic spring adds {percent(spring, '.0f')} to the force that follows u and the "
        f"cubic damper {percent(damper, '.0f')} to that which follows the velocity: SI/SO takes them for k and c",
        conditions,
    )


def cubic_shares(evidence: Evidence, reported: Reported, level: float) -> tuple[float, float]:
    """What the cubic spring adds to k, and the cubic damper to c, by least squares along the records: as shares."""
    k, c, k3, c3 = (reported.table_1(COMBINED, n) for n in ("k", "c", "k3", "c3"))
    drive = Drive(COMBINED, level)
    spring = evidence.each(drive, lambda r: k3 / k * _on(r["displacement"] ** 3, r["displacement"]))
    damper = evidence.each(drive, lambda r: c3 / c * _on(r["displacement"] ** 2 * r["velocity"], r["velocity"]))
    return spring.mean, damper.mean


def _on(values: Floats, motion: Floats) -> float:
    """Coefficient of a motion in the values, by least squares."""
    return float(values @ motion / (motion @ motion))


def _biases(ensemble: Ensemble, reported: Reported, names: tuple[str, ...]) -> dict[str, Sample]:
    """Relative error of each fitted parameter."""
    truth = {n: reported.table_1(COMBINED, n) for n in names}
    return {n: ensemble.sample(lambda o, n=n: o.miso.values[n] / truth[n] - 1.0) for n in names}


def noise_random_only(evidence: Evidence, reported: Reported) -> list[Condition]:
    """Bias of every parameter at every noise level against the scatter of its mean."""
    conditions: list[Condition] = []
    clean = _biases(evidence.at(COMBINED), reported, PARTS)
    for noise in noises(reported):
        biases = _biases(evidence.at(COMBINED, noise=noise), reported, PARTS)
        shifts = [_shift(name, bias.minus(clean[name])) for name, bias in biases.items()]
        conditions.append(together(f"{percent(noise)} noise", shifts))
    return explained(
        "u is the input of the reverse system, and noise on an input (and on its cube) biases, where noise on the "
        "output only scatters",
        conditions,
    )


def _shift(name: str, shift: Sample) -> Condition:
    """A shift of the mean that scatter alone explains."""
    measured = f"{name} {percent(shift.mean, '+.3g', shift.error)}"
    met = abs(shift.mean) <= 3.0 * shift.error
    return Condition(f"mean shift of {name} within 3 standard errors of zero", measured, met, measured)


def noise_output(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Noise on the force, the reverse system's output."""
    noise, drive = noises(reported)[1], Drive(COMBINED)
    model, (_, *records) = evidence.model(drive), evidence.records(drive)

    def analysis(index: int) -> Analysis:
        force = records[index]["force"]
        noisy = force + displacement_noise(force, noise, NOISE_OFFSET + evidence.seeds[index])
        return evidence.analyse(model, records[index].with_channels({"force": noisy})).miso

    analyses = threaded(analysis, range(len(records)))
    for name in PARTS:
        true, allowed = reported.table_1(COMBINED, name), evidence.tolerance(COMBINED, name)
        bias = Sample(tuple(a.values[name] / true - 1.0 for a in analyses))
        ratio = average([a.errors[name] for a in analyses]) / (bias.scatter * true)
        spread = ratio / math.sqrt(2.0 * (len(analyses) - 1))
        yield Condition(
            f"mean {name} within its tolerance of {percent(allowed)} or 3 standard errors",
            f"{name} {percent(bias.mean, '+.2g', bias.error)}", abs(bias.mean) <= max(allowed, 3.0 * bias.error),
        )  # fmt: skip
        yield Condition(
            f"predicted standard error of {name} within 25 % of its scatter",
            f"{name} predicted over observed {ratio:.2f} +- {spread:.2f}", abs(ratio - 1.0) <= 0.25,
        )  # fmt: skip


def _with_noise(evidence: Evidence, reported: Reported) -> dict[float, Ensemble]:
    """The combined system without noise and at every noise level."""
    return {noise: evidence.at(COMBINED, noise=noise) for noise in (0.0, *noises(reported))}


def _rises(label: str, by_noise: Mapping[float, float], measured: str, criterion: str) -> Condition:
    """A quantity that is larger at every higher noise."""
    text = ", ".join(f"{percent(noise)}: {value:.3g}" for noise, value in by_noise.items())
    return Condition(
        f"{criterion} rises with every noise level", f"{measured} {text}",
        all(a < b for a, b in pairwise(by_noise.values())),
        f"the {label} goes {text}: a strong bias shrinks the estimate and its scatter with it",
    )  # fmt: skip


def noise_random(evidence: Evidence, reported: Reported) -> list[Condition]:
    """Scatter of the fitted coefficients of A_1 and A_2."""
    ensembles = _with_noise(evidence, reported)
    return [
        _rises(f"scatter of {n}", {v: e.miso(n).scatter for v, e in ensembles.items()}, n, f"scatter of {n}")
        for n in PARTS
    ]


def noise_linear(evidence: Evidence, reported: Reported) -> list[Condition]:
    """Bias of A_1 as fitted by weighted least squares and as a hand reads it."""
    truth = {n: reported.table_1(COMBINED, n) for n in ("k", "f_n", "m", "c")}
    conditions: list[Condition] = []
    for noise in noises(reported):
        ensemble = evidence.at(COMBINED, noise=noise)
        fitted = {n: ensemble.miso(n).mean for n in truth}
        read = {n: ensemble.sample(lambda o, n=n: o.miso.read.get(n, math.nan)).median for n in truth}
        for way, values in (("fitted (mean)", fitted), ("hand-read (median)", read)):
            biases = {n: _bias(n, value / truth[n] - 1.0) for n, value in values.items()}
            label = f"{percent(noise)} noise, {way}"
            conditions += [together(label, [biases[n] for n in ("k", "m", "f_n")]), together(label, [biases["c"]])]
    low, worst = evidence.settings.fit_band[0], noises(reported)[-1]
    strong = evidence.ensemble(Drive(COMBINED, noise=worst), Assumed(band=(low, STRONG_BELOW)))
    left = ", ".join(f"{n} {percent(strong.miso(n).mean / true - 1.0, '+.2g')}" for n, true in truth.items())
    return explained(
        "the fit over the whole band meets lines where white noise exceeds the response; fitted below "
        f"{STRONG_BELOW:g} Hz alone, {percent(worst)} noise leaves {left}, so that the damping is biased everywhere",
        conditions,
    )


def _bias(name: str, off: float) -> Condition:
    """A bias that is not significant."""
    text = f"{name} {percent(off, '+.3g')}"
    return Condition(f"bias of {name} within {percent(SIGNIFICANT_BIAS)}", text, abs(off) <= SIGNIFICANT_BIAS, text)


def noise_cubic(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Random and bias errors of k3 and c3, and which is hurt more."""
    ensembles = _with_noise(evidence, reported)
    biases = {noise: _biases(e, reported, ("k3", "c3")) for noise, e in ensembles.items()}
    for name, part in (("k3", "real"), ("c3", "imaginary")):
        bias, scatter = f"bias of {name}", f"scatter of a line of the {part} part"
        sizes = {noise: abs(by_name[name].mean) for noise, by_name in biases.items()}
        spreads = {noise: _line_scatter(e, part == "imaginary", reported) for noise, e in ensembles.items()}
        yield from [
            _rises(label, values, label, f"{label} (relative)") for label, values in ((bias, sizes), (scatter, spreads))
        ]
    worst = noises(reported)[-1]
    k3, c3 = biases[worst]["k3"].mean, biases[worst]["c3"].mean
    measured = f"k3 {percent(k3, '+.3g')}, c3 {percent(c3, '+.3g')}"
    yield Condition(f"at {percent(worst)} noise the bias of c3 is the larger", measured, abs(c3) > abs(k3))


def _line_scatter(ensemble: Ensemble, imaginary: bool, reported: Reported) -> float:
    """Standard deviation over the seeds of a line of A_2, relative to its exact value; median over the band."""
    stacked = np.stack([o.miso.response[1].imag if imaginary else o.miso.response[1].real for o in ensemble.seeds])
    slope = 2.0 * np.pi * ensemble.frequency * reported.table_1(COMBINED, "c3") / 3.0
    exact = slope if imaginary else reported.table_1(COMBINED, "k3")
    return float(np.median(np.std(stacked, axis=0, ddof=1) / exact))


def noise_coherence(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Multiple coherence over the fit band."""
    ensembles = _with_noise(evidence, reported)
    coherences = {noise: ensemble.multiple_coherence() for noise, ensemble in ensembles.items()}
    (_, clean), *noisy = coherences.items()
    worst, lowest = noisy[-1]
    text = ", ".join(f"{percent(noise)}: {coherence}" for noise, coherence in coherences.items())
    last = ensembles[worst].lines(lambda o: o.miso.cumulative[-1])[-1]
    why = (
        f"at {percent(worst)} noise it falls to {lowest.mean:.2f} on average and {last:.2f} at the band's end, where "
        "white noise exceeds the response"
    )
    falls = all(a.mean > b.mean for a, b in pairwise(coherences.values()))
    yield Condition("mean multiple coherence falls with every noise level", text, falls)
    yield from (
        Condition(f"loss at {percent(n)} noise at most {SLIGHT:g}", text, clean.mean - c.mean <= SLIGHT, why)
        for n, c in noisy
    )
    yield at_least(f"multiple coherence at {percent(worst)} noise", lowest, 0.9, why)


CLAIMS = claims(
    levels_invariant, levels_similar, noise_random_only, noise_output, noise_random, noise_linear, noise_cubic,
    noise_coherence,
    levels_siso=lambda e, r: rising("SI/SO f_n", {v: e.at(COMBINED, v).siso("f_n") for v in input_variances(r)}),
    levels_coherence=lambda e, r: [
        together(f"variance {v:g}", near_unity(e.at(COMBINED, v))) for v in input_variances(r)
    ],
)  # fmt: skip
