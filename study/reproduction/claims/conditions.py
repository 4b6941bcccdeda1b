"""Conditions that several sections share, and those that a row of ``config/reported.tsv`` states in words."""

import math
from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise

import numpy as np

from study.records.record import Record
from study.reproduction import preliminary
from study.reproduction.claims.evidence import Drive, Ensemble, Evidence
from study.reproduction.claims.judgement import (
    Condition,
    at_least,
    at_most,
    far,
    one_record,
    together,
    within_share,
)
from study.reproduction.claims.reported import INPUT_VARIANCES, Reported, Stated, Statement
from study.reproduction.claims.sample import Sample, gaussian_score, is_gaussian, kurtosis
from study.support.arrays import Floats
from study.support.numbers import percent

Reader = Callable[[Ensemble, str], Sample]
ESTIMATES: Mapping[str, Reader] = {
    "SI/SO": Ensemble.siso, "MI/SO": Ensemble.miso, "fitted": Ensemble.siso, "hand-read": Ensemble.hand_read,
}  # fmt: skip
COHERENCES: Mapping[str, Callable[[Ensemble], Sample]] = {
    "linear coherence": Ensemble.linear_coherence, "multiple coherence": Ensemble.multiple_coherence,
}  # fmt: skip
PATTERNS: Mapping[str, tuple[str, Callable[[Record, float], float]]] = {  # with the parameter that they show, by mass
    "slope": ("k", lambda record, mass: preliminary.mean_curve(record, mass, 1)[0]),
    "mean slope": ("k", lambda record, mass: preliminary.mean_curve(record, mass, 1)[0]),
    "cubic part of the mean": ("k3", lambda record, mass: preliminary.mean_curve(record, mass, 1, 3)[1]),
    "gap read off the pattern": ("u_g", preliminary.read_dead_band),
}


# ---- what a row states


def stated(evidence: Evidence, reported: Reported, statement: Statement, why: str = "") -> list[Condition]:
    """The conditions of a row; those on a system at a level are one condition together where there are several such.

    ``why`` is the reason in case one is not met, that of the row if left out.
    """
    why = why or statement.why
    levels = [reported.levels[INPUT_VARIANCES.index(name)] for name in statement.levels] or [1.0]
    found: dict[str, list[Condition]] = {}
    for system in statement.systems:
        for level in levels:
            by_level = f"variance {level:g}" if len(statement.systems) == 1 else f"{system} at {level:g}"
            found[by_level if len(levels) > 1 else system] = [
                condition
                for words in statement.holds_if
                for condition in _judged(evidence, reported, Drive(system, level), statement, words, why)
            ]
    (first, *others) = found.values()
    return [together(label, conditions) for label, conditions in found.items()] if others else first


def _judged(
    evidence: Evidence, reported: Reported, drive: Drive, statement: Statement, words: Stated, why: str
) -> Iterable[Condition]:  # fmt: skip
    """One condition in words, on one system at one level."""
    subject, verb, argument = words
    reader, _, names = subject.partition(" ")
    match verb:
        case "recovered":
            ensemble = evidence.ensemble(drive)
            own = [name for name in subject.split() if name in ensemble.own.miso.values]
            return recovered(evidence, reported, ensemble, own)
        case "near unity":
            return near_unity(reported, evidence.ensemble(drive))
        case "rises":
            read = ESTIMATES[reader]
            return rising(subject, {v: read(evidence.at(drive.system, v), names) for v in reported.levels})
        case "refused at most":
            return [looks_gaussian(evidence, drive.system, reported.limit(argument), why)]
        case "refused at least":
            return [differs_from_gaussian(evidence, drive.system, reported.limit(argument), why)]
        case "less distorted than":
            return [less_distorted(evidence, drive.system, argument)]
        case "at least":
            measure = next(read for name, read in COHERENCES.items() if subject.startswith(name))
            return [at_least(subject, measure(evidence.ensemble(drive)), reported.limit(argument), why)]
        case _:
            pass
    if subject in PATTERNS:
        parameter, of_record = PATTERNS[subject]
        mass = reported.table_1(drive.system, "m")
        found = {subject: (parameter, evidence.each(drive, lambda record: of_record(record, mass)))}
    else:
        read, ensemble = ESTIMATES[reader], evidence.ensemble(drive)
        found = {f"{reader} {name}": (name, read(ensemble, name)) for name in names.split()}
    conditions: list[Condition] = []
    for label, (parameter, sample) in found.items():
        target = reported.table_1(drive.system, parameter) if statement.value is None else statement.value
        if verb == "of one record":
            conditions.append(one_record(label, sample, target, why))
        else:
            compared = within_share if verb == "within" else far
            conditions.append(compared(label, sample, target, reported.limit(argument), why))
    return conditions


# ---- what several sections ask


def recovered(evidence: Evidence, reported: Reported, ensemble: Ensemble, names: Iterable[str]) -> list[Condition]:
    """Each parameter's mean lies within the study's own tolerance of Table 1 (config.yaml, set before looking)."""
    conditions: list[Condition] = []
    for name in names:
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
        conditions.append(Condition(criterion, measured, abs(off) <= allowed, f"{measured} off"))
    return conditions


def near_unity(reported: Reported, ensemble: Ensemble) -> list[Condition]:
    """Multiple coherence near unity: on average over the fit band, and on its lowest line."""
    where, lowest = ensemble.lowest(lambda o: o.miso.cumulative[-1])
    least, measured = reported.limit("near_unity_lowest"), f"lowest line {lowest:.4f} at {where:.2f} Hz"
    return [
        at_least("multiple coherence over the fit band", ensemble.multiple_coherence(), reported.limit("near_unity")),
        Condition(
            f"mean multiple coherence of every line at least {least:g}", measured, lowest >= least,
            f"the {measured} is below {least:g}",
        ),
    ]  # fmt: skip


def rising(label: str, by_level: Mapping[float, Sample]) -> list[Condition]:
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


def differs_from_gaussian(evidence: Evidence, system: str, least: float, why: str) -> Condition:
    """A Gaussian is refused for at least a share of the records."""
    share, score = refused(evidence, system), evidence.of_channel(system, gaussian_score)
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


def has_line(reported: Reported, label: str, frequencies: Floats, target: float) -> Condition:
    """One of the frequencies lies within two lines of a target."""
    best, line = nearest(frequencies, target), reported.limit("line")
    return Condition(
        f"{label} within {line:g} Hz of {target:g} Hz", f"{label} nearest to {target:g} Hz at {best:.2f} Hz",
        abs(best - target) <= line, f"the {label} nearest to {target:g} Hz stands at {best:.2f} Hz",
    )  # fmt: skip
