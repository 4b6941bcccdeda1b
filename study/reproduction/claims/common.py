"""Conditions that several sections share."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from study.reproduction.claims.evidence import Drive, Ensemble, Evidence
from study.reproduction.claims.judgement import Condition, at_least, at_most
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample, average, gaussian_score, is_gaussian, kurtosis, share
from study.reproduction.ensemble import threaded

Floats = NDArray[np.float64]
NEAR_UNITY_MEAN, NEAR_UNITY_LOWEST = 0.99, 0.95
TESTS_WRONG = 0.10  # a 5 % test may refuse up to twice as many Gaussian records


def recovered(
    evidence: Evidence, reported: Reported, system: str, ensemble: Ensemble, names: Sequence[str]
) -> list[Condition]:
    """Each parameter's mean lies within the study's own tolerance of Table 1 (config.yaml, set before looking)."""
    return [_recovered(evidence, reported.table_1(system, n), system, ensemble.miso(n), n) for n in names]


def _recovered(evidence: Evidence, true: float, system: str, found: Sample, name: str) -> Condition:
    if true == 0.0:
        tolerance: float = evidence.settings["tolerances"]["absolute"][name]
        criterion, scale, unit = f"mean {name} within +-{tolerance:g}", 1.0, ""
    else:
        tolerance = evidence.tolerance(system, name)
        criterion, scale, unit = f"mean {name} within {100.0 * tolerance:g} % of {true:.6g}", 100.0 / abs(true), " %"
    off = found.mean - true
    text = f"{name} {scale * off:+.2g} +- {scale * found.error:.1g}{unit}"
    met = abs(off) <= tolerance * (abs(true) or 1.0)
    return Condition(criterion, text, met, f"{text} off")


def near_unity(ensemble: Ensemble, why: str = "") -> list[Condition]:
    """Multiple coherence near unity: on average over the fit band, and on its lowest line."""
    mean = ensemble.multiple_coherence()
    where, lowest = ensemble.lowest(lambda o: o.miso.cumulative[-1])
    found = f"lowest line {lowest:.4f} at {where:.2f} Hz"
    return [
        at_least("multiple coherence over the fit band", mean, NEAR_UNITY_MEAN, why),
        Condition(
            f"mean multiple coherence of every line at least {NEAR_UNITY_LOWEST:g}",
            found,
            lowest >= NEAR_UNITY_LOWEST,
            why or f"the {found} is below {NEAR_UNITY_LOWEST:g}",
        ),
    ]


def in_band(ensemble: Ensemble, low: float, high: float) -> NDArray[np.bool_]:
    """Lines from ``low`` to ``high`` hertz."""
    return (ensemble.frequency >= low) & (ensemble.frequency <= high)


def linear_share(ensemble: Ensemble, low: float, high: float) -> Sample:
    """Mean linear coherence of the lines from ``low`` to ``high`` hertz."""
    keep = in_band(ensemble, low, high)
    return ensemble.sample(lambda o: average(o.miso.cumulative[0][keep]))


def refusals(evidence: Evidence, drive: Drive) -> Sample:
    """Share of the records whose kurtosis refuses a Gaussian at 5 %."""
    own, *others = threaded(lambda r: is_gaussian(r["displacement"]), evidence.records(drive))
    return Sample(share([not g for g in others]).values, float(not own))


def looks_gaussian(evidence: Evidence, system: str, most: float, why: str = "") -> list[Condition]:
    """A Gaussian is refused for no more than a share of the records."""
    shape = evidence.each(Drive(system), lambda r: kurtosis(r["displacement"]))
    refused = refusals(evidence, Drive(system))
    condition = at_most("share of records whose kurtosis refuses a Gaussian at 5 %", refused, most, why)
    return [Condition(condition.criterion, f"kurtosis {shape}; refused {refused.mean:.2g}", condition.met, why)]


def less_distorted(evidence: Evidence, system: str, other: str) -> Condition:
    """The kurtosis lies nearer to 3 than that of another system under the same forces."""
    found, more = (evidence.each(Drive(s), lambda r: kurtosis(r["displacement"])) for s in (system, other))
    difference = found.minus(more)
    return Condition(
        f"mean kurtosis nearer to 3 than that of {other} by three standard errors",
        f"{other} {more}",
        abs(more.mean - 3.0) - abs(found.mean - 3.0) > 3.0 * difference.error,
        f"its kurtosis of {found.mean:.3f} is no nearer to 3 than the {more.mean:.3f} of {other}",
    )


def differs_from_gaussian(evidence: Evidence, system: str, least: float, why: str = "") -> list[Condition]:
    """A Gaussian is refused for at least a share of the records."""
    shape = evidence.each(Drive(system), lambda r: kurtosis(r["displacement"]))
    score = evidence.each(Drive(system), lambda r: gaussian_score(r["displacement"]))
    refused = refusals(evidence, Drive(system))
    return [
        Condition(
            f"share of records whose kurtosis refuses a Gaussian at 5 % at least {least:g}",
            f"kurtosis {shape}, {score.mean:+.2g} standard errors from 3; refused {refused.mean:.2g}",
            refused.mean >= least,
            why,
        )
    ]


def local_maxima(frequency: Floats, values: Floats) -> Floats:
    """Frequencies of the lines that stand above both neighbours."""
    inside = values[1:-1]
    return frequency[1:-1][(inside > values[:-2]) & (inside > values[2:])]


def nearest(found: Floats, target: float) -> float:
    """The one of some frequencies that lies nearest to a target; nan where there is none."""
    return float(found[np.argmin(np.abs(found - target))]) if len(found) else math.nan


def has_line(label: str, found: Floats, target: float, within: float, why: str = "") -> Condition:
    """One of some frequencies lies near a target."""
    best = nearest(found, target)
    return Condition(
        f"{label} within {within:g} Hz of {target:g} Hz",
        f"{label} nearest to {target:g} Hz at {best:.2f} Hz",
        abs(best - target) <= within,
        why or f"the {label} nearest to {target:g} Hz stands at {best:.2f} Hz",
    )
