"""Conditions that several sections share."""

import math
from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from study.reproduction.claims.evidence import Ensemble, Evidence
from study.reproduction.claims.judgement import Condition, at_least, at_most
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, gaussian_score, is_gaussian, kurtosis
from study.support.numbers import percent

Floats = NDArray[np.float64]
SYSTEMS = ("linear", "duffing", "van_der_pol", "duffing_van_der_pol", "mathieu", "dead_band", "extreme")
COMBINED = "duffing_van_der_pol"
LINEAR_PARTS = ("m", "c", "k", "f_n", "zeta")
READ_OFF = 0.05  # share that a hand may be off when it reads a curve
LINE = 0.2  # hertz: two lines of the report's spectra
NEAR_UNITY_MEAN, NEAR_UNITY_LOWEST = 0.99, 0.95
TESTS_WRONG = 0.10  # a 5 % test may refuse up to twice as many Gaussian records


def input_variances(reported: Reported) -> list[float]:
    """The input variances of Section 5.3."""
    return [reported.value(f"levels_invariant.{name}") for name in ("lowest", "second", "third", "highest")]


def noises(reported: Reported) -> list[float]:
    """The noise levels of Section 5.4."""
    return [reported.value(f"noise_random_only.{name}") for name in ("low", "middle", "high")]


def band(reported: Reported, name: str) -> tuple[float, float]:
    """A band of frequencies that the report names, in hertz."""
    return reported.value(f"{name}.low"), reported.value(f"{name}.high")


def recovered(evidence: Evidence, reported: Reported, ensemble: Ensemble, names: Iterable[str]) -> list[Condition]:
    """Each parameter's mean lies within the study's own tolerance of Table 1 (config.yaml, set before looking)."""
    return [_recovered(evidence, reported, ensemble, name) for name in names]


def _recovered(evidence: Evidence, reported: Reported, ensemble: Ensemble, name: str) -> Condition:
    true, sample = reported.table_1(ensemble.system, name), ensemble.miso(name)
    off = sample.mean - true
    if true == 0.0:
        allowed: float = evidence.settings.tolerances.absolute[name]
        criterion, measured = f"mean {name} within +-{allowed:g}", f"{name} {off:+.2g} +- {sample.error:.1g}"
    else:
        tolerance = evidence.tolerance(ensemble.system, name)
        criterion = f"mean {name} within {percent(tolerance)} of {true:.6g}"
        measured = f"{name} {percent(off / abs(true), '+.2g', sample.error / abs(true))}"
        allowed = tolerance * abs(true)
    return Condition(criterion, measured, abs(off) <= allowed, f"{measured} off")


def near_unity(ensemble: Ensemble) -> list[Condition]:
    """Multiple coherence near unity: on average over the fit band, and on its lowest line."""
    where, lowest = ensemble.lowest(lambda o: o.miso.cumulative[-1])
    measured = f"lowest line {lowest:.4f} at {where:.2f} Hz"
    return [
        at_least("multiple coherence over the fit band", ensemble.multiple_coherence(), NEAR_UNITY_MEAN),
        Condition(
            f"mean multiple coherence of every line at least {NEAR_UNITY_LOWEST:g}", measured,
            lowest >= NEAR_UNITY_LOWEST, f"the {measured} is below {NEAR_UNITY_LOWEST:g}",
        ),
    ]  # fmt: skip


def rising(label: str, by_level: dict[float, Sample]) -> list[Condition]:
    """From each level to the next the mean rises by more than two standard deviations of a record."""
    conditions: list[Condition] = []
    for (low, before), (high, after) in pairwise(by_level.items()):
        met = after.mean - before.mean > 2.0 * max(before.scatter, after.scatter)
        criterion = f"{label} at {high:g} above that at {low:g} by two standard deviations of a record"
        conditions.append(Condition(criterion, f"{low:g}: {before}, {high:g}: {after}", met))
    return conditions


def refused(evidence: Evidence, system: str, channel: str = "displacement") -> Sample:
    """Share of the records whose kurtosis refuses a Gaussian at 5 %."""
    return evidence.of_channel(system, lambda values: float(not is_gaussian(values)), channel)


def looks_gaussian(evidence: Evidence, system: str, most: float, why: str = "") -> Condition:
    """A Gaussian is refused for no more than a share of the records."""
    share = refused(evidence, system)
    condition = at_most("share of records whose kurtosis refuses a Gaussian at 5 %", share, most)
    measured = f"kurtosis {evidence.of_channel(system, kurtosis)}; refused {share.mean:.2g}"
    return Condition(condition.criterion, measured, condition.met, why)


def differs_from_gaussian(evidence: Evidence, system: str, why: str) -> Condition:
    """A Gaussian is refused for nearly every record."""
    share, least = refused(evidence, system), 0.95
    score = evidence.of_channel(system, gaussian_score)
    return Condition(
        f"share of records whose kurtosis refuses a Gaussian at 5 % at least {least:g}",
        f"kurtosis {evidence.of_channel(system, kurtosis)}, {score.mean:+.2g} standard errors from 3; "
        f"refused {share.mean:.2g}",
        share.mean >= least,
        why,
    )


def less_distorted(evidence: Evidence, system: str, other: str) -> Condition:
    """The kurtosis lies nearer to 3 than that of another system under the same forces."""
    own, others = (evidence.of_channel(name, kurtosis) for name in (system, other))
    nearer = abs(others.mean - 3.0) - abs(own.mean - 3.0)
    return Condition(
        f"mean kurtosis nearer to 3 than that of {other} by three standard errors",
        f"{other} {others}",
        nearer > 3.0 * own.minus(others).error,
        f"its kurtosis of {own.mean:.3f} is no nearer to 3 than the {others.mean:.3f} of {other}",
    )


def local_maxima(frequency: Floats, values: Floats) -> Floats:
    """Frequencies of the lines that stand above both neighbours."""
    inside = values[1:-1]
    return frequency[1:-1][(inside > values[:-2]) & (inside > values[2:])]


def nearest(frequencies: Floats, target: float) -> float:
    """The frequency that lies nearest to a target; nan where there is none."""
    return float(frequencies[np.argmin(np.abs(frequencies - target))]) if len(frequencies) else math.nan


def has_line(label: str, frequencies: Floats, target: float) -> Condition:
    """One of the frequencies lies within two lines of a target."""
    best = nearest(frequencies, target)
    return Condition(
        f"{label} within {LINE:g} Hz of {target:g} Hz", f"{label} nearest to {target:g} Hz at {best:.2f} Hz",
        abs(best - target) <= LINE, f"the {label} nearest to {target:g} Hz stands at {best:.2f} Hz",
    )  # fmt: skip
