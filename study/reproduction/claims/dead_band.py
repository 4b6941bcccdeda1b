"""Sections 5.2.6 and 5.2.7: the Dead-Band and the Extreme system; and what the report's "unit variance" refers to."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pandas as pd

from study.records.excitation import READINGS
from study.reproduction.claims.conditions import recovered
from study.reproduction.claims.evidence import Assumed, Drive, Ensemble, Evidence, Outcome
from study.reproduction.claims.identification import longer_segments_help
from study.reproduction.claims.judgement import (
    Condition,
    at_least,
    at_most,
    claims,
    far,
    near,
    one_record,
    surely_above_zero,
    within_share,
)
from study.reproduction.claims.reported import LINEAR_PARTS, SYSTEMS, Reported
from study.reproduction.claims.sample import Sample, relative_distance
from study.support.arrays import Floats
from study.support.numbers import percent

SYSTEM = "dead_band"
AS_DUFFING = Assumed(plus=("cubic_stiffness",), minus=("dead_band",))
NEARER = 2.0  # standard errors by which one reading must be the nearer one; otherwise there is a tie


def line_errors(outcome: Outcome, true: float) -> Floats:
    """Relative error of the Dead-Band's Re A_2, line by line."""
    return np.abs(outcome.miso.response[1].real / true - 1.0)


def largest_error(ensemble: Ensemble, reported: Reported) -> Sample:
    """Largest relative error of the Dead-Band's Re A_2 in the report's 2- to 3-Hz band."""
    keep, true = ensemble.between(*reported.band("dead_band_error")), -reported.table_1("dead_band", "k")
    return ensemble.sample(lambda o: float(np.max(line_errors(o, true)[keep])))


def dead_band_as_duffing(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """A cubic stiffness in place of the dead band."""
    ensemble = evidence.ensemble(Drive(SYSTEM), AS_DUFFING)
    linear, whole = ensemble.linear_coherence(), ensemble.multiple_coherence()
    gain = Sample(tuple((w - x) / (1.0 - x) for w, x in zip(whole.values, linear.values, strict=True)))
    where, lowest = ensemble.lowest(lambda o: -o.miso.cumulative[-1])
    gap, factor = reported.table_1(SYSTEM, "u_g"), reported.limit("same_order")
    size = evidence.of_channel(SYSTEM, lambda displacement: float(np.std(displacement)) / gap)
    yield Condition(
        f"dead band and response of the same order (within a factor of {factor:g})",
        f"root mean square response {size} of u_g", 1.0 / factor <= size.mean <= factor,
    )  # fmt: skip
    yield surely_above_zero("k3", ensemble.miso("k3"))
    why = f"the cubic term takes the coherence from {linear.mean:.3f} to {whole.mean:.3f} only"
    yield at_least("share of the linear fit's failure that the cubic term removes", gain, 0.5, why)
    why = f"it reaches {whole.mean:.3f} on average: a cubic imitates the gap well"
    yield at_most("multiple coherence over the fit band", whole, reported.limit("near_unity_lowest"), why)
    yield Condition(
        "no line's mean multiple coherence above 0.99", f"highest line {-lowest:.4f} at {where:.2f} Hz",
        -lowest <= 0.99,
        f"at {where:.1f} Hz it reaches {-lowest:.4f}: there the mass takes nearly all of the force",
    )  # fmt: skip


def dead_band_not_invariant(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """k and k3 of the Duffing system put in its place, at the lowest and the highest level of Section 5.3."""
    lowest, *_, highest = reported.levels
    low, high = (evidence.ensemble(Drive(SYSTEM, level), AS_DUFFING) for level in (lowest, highest))
    for name in ("k", "k3"):
        before, after = low.miso(name), high.miso(name)
        least = max(0.1 * abs(before.mean), 5.0 * math.hypot(before.error, after.error))
        yield Condition(
            f"{name} changes by more than 10 % and 5 standard errors from variance {lowest:g} to {highest:g}",
            f"{name} {before} and {after}", abs(after.mean - before.mean) > least,
        )  # fmt: skip


def dead_band_linear(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """SI/SO's natural frequency, MI/SO's A_1."""
    ensemble, f_n = evidence.at(SYSTEM), reported.table_1(SYSTEM, "f_n")
    yield at_most("SI/SO f_n, hand-read", ensemble.hand_read("f_n"), 0.9 * f_n)
    yield at_most("SI/SO f_n, fitted", ensemble.sample(lambda o: o.siso.values.get("f_n", 0.0)), 0.9 * f_n)
    yield from recovered(evidence, reported, ensemble, LINEAR_PARTS)


def dead_band_stiffness(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """-A_2 fitted, and its largest error outside the 2- to 3-Hz band."""
    ensemble, stated = evidence.at(SYSTEM), reported.value("dead_band_stiffness")
    low, high = reported.band("dead_band_error")
    outside = ~ensemble.between(low, high)
    worst = ensemble.sample(lambda o: float(np.max(line_errors(o, stated)[outside])))
    limit, allowed = reported.value("dead_band_error"), evidence.tolerance(SYSTEM, "k_dead_band")
    why = f"outside the band the worst line of a record errs by {percent(worst.mean, '.0f')}"
    yield within_share("fitted A_2", ensemble.miso("k_dead_band").scaled(-1.0), stated, allowed)
    yield at_most(f"largest error of a line outside {low:g} to {high:g} Hz", worst, limit, why)


def dead_band_error(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """The 7 percent, and where the largest error is."""
    ensemble, stated = evidence.at(SYSTEM), reported.value("dead_band_error")
    low, high = reported.band("dead_band_error")
    inside, true = ensemble.between(low, high), -reported.table_1(SYSTEM, "k")
    error = largest_error(ensemble, reported)
    there = Sample(tuple(float(inside[np.argmax(line_errors(o, true))]) for o in ensemble.seeds))
    longer = Assumed(segments=(("length", 2 * evidence.segments.length),))
    finer = largest_error(evidence.ensemble(Drive(SYSTEM), longer), reported)
    why = (
        f"the worst line of a record errs by {percent(error.mean, '.0f')} (scatter {percent(error.scatter, '.0f')}), "
        f"which is leakage: segments twice as long leave {percent(finer.mean, '.0f')}"
    )
    yield within_share(f"largest error from {low:g} to {high:g} Hz", error, stated, 0.5, why)
    yield one_record(f"largest error from {low:g} to {high:g} Hz", error, stated, why)
    why = f"the largest error lies in that band in {percent(there.mean, '.0f')} of the records only"
    yield at_least("share of records whose largest error lies in that band", there, 0.5, why)


def dead_band_share(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """About 65 percent, under both readings of unit variance."""
    stated, chosen = reported.value("dead_band_share"), evidence.settings.excitation.reading
    by_level = {level: evidence.at(SYSTEM, level).linear_coherence() for level in (0.05, 0.1, *reported.levels)}
    lowest = min(by_level, key=lambda level: by_level[level].mean)
    where, bottom = evidence.at(SYSTEM, lowest).lowest(lambda o: o.miso.cumulative[0])
    text = ", ".join(f"{level:g}: {sample.mean:.3f}" for level, sample in by_level.items())
    why = (
        f"no level gives it over the fit band (by variance of the {chosen} force the mean is {text}); at {lowest:g} "
        f"single lines fall to {bottom:.2f} at {where:.1f} Hz"
    )
    for reading in READINGS:
        share = evidence.ensemble(Drive(SYSTEM, excitation=(("reading", reading),))).linear_coherence()
        yield near(f"linear coherence, unit variance {reading}", share, stated, 0.05, why)


def dead_band_coherence(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """Approaches unity; the dip is leakage."""
    ensemble, f_n = evidence.at(SYSTEM), reported.table_1(SYSTEM, "f_n")
    where, lowest = ensemble.lowest(lambda o: o.miso.cumulative[-1])
    apparent = ensemble.hand_read("f_n").mean
    yield at_least(
        "multiple coherence over the fit band", ensemble.multiple_coherence(), reported.limit("near_unity_lowest")
    )
    yield Condition(
        f"lowest coherence between the apparent resonance {apparent:.2f} Hz and {f_n:g} Hz, or 0.5 Hz about it",
        f"lowest line {lowest:.3f} at {where:.2f} Hz", apparent - 0.5 <= where <= f_n + 0.5,
    )  # fmt: skip
    yield longer_segments_help(evidence, reported, SYSTEM, where, "there")


def linear_dominates(evidence: Evidence, _: Reported) -> list[Condition]:
    """Linear coherence of every nonlinear system before the Extreme one above one half."""
    return [at_least(f"{s}: linear coherence", evidence.at(s).linear_coherence(), 0.5) for s in SYSTEMS[1:-1]]


def extreme_siso(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """A false natural frequency, wrong mass and stiffness."""
    ensemble, m = evidence.at("extreme"), reported.table_1("extreme", "m")
    lowest, _ = ensemble.lowest(lambda o: np.abs(o.siso.response[0]))
    mass = ensemble.siso("m")
    yield at_least("SI/SO f_n (exact 0)", ensemble.sample(lambda o: o.siso.values.get("f_n", 0.0)), 0.5)
    yield Condition(
        "the averaged SI/SO |A_1| has its minimum inside the band", f"minimum at {lowest:.2f} Hz",
        ensemble.frequency[0] < lowest < ensemble.frequency[-1],
    )  # fmt: skip
    yield surely_above_zero("SI/SO k (exact 0)", ensemble.siso("k"))
    why = f"SI/SO's m is {percent(mass.mean / m - 1.0, '+.1f')} off, hardly a serious error"
    yield far("SI/SO m", mass, m, 0.05, why)


def extreme_linear(evidence: Evidence, reported: Reported) -> Iterator[Condition]:
    """A_1 = -(2 pi f)^2 m."""
    ensemble, m = evidence.at("extreme"), reported.table_1("extreme", "m")
    exact = -((2.0 * math.pi * ensemble.frequency) ** 2) * m
    off = ensemble.sample(lambda o: relative_distance(o.miso.response[0], exact))
    yield at_most("departure of A_1 (root mean square over the band, relative)", off, 0.02)
    yield from recovered(evidence, reported, ensemble, ("m", "c", "k"))


DEAD_BAND_CLAIMS = claims(
    dead_band_as_duffing, dead_band_not_invariant, dead_band_linear, dead_band_stiffness, dead_band_error,
    dead_band_share, dead_band_coherence, linear_dominates, extreme_siso, extreme_linear,
)  # fmt: skip


# ---- what "unit variance" refers to: both readings against the numbers that the report quotes

QUOTED: tuple[tuple[str, str, str, Callable[[Ensemble, Reported], Sample]], ...] = (  # name, row, system, reading
    ("SI/SO k of the Duffing system, hand-read", "siso_stiffness", "duffing", lambda e, _: e.hand_read("k")),
    ("SI/SO k of the Duffing system, fitted", "siso_stiffness", "duffing", lambda e, _: e.siso("k")),
    ("SI/SO f_n of the Duffing system, hand-read", "siso_frequency", "duffing", lambda e, _: e.hand_read("f_n")),
    ("SI/SO f_n of the Duffing system, fitted", "siso_frequency", "duffing", lambda e, _: e.siso("f_n")),
    ("linear coherence of the Duffing system", "duffing_share", "duffing", lambda e, _: e.linear_coherence()),
    ("linear coherence of the Dead-Band system", "dead_band_share", SYSTEM, lambda e, _: e.linear_coherence()),
    ("largest error of the Dead-Band's A_2 from 2 to 3 Hz", "dead_band_error", SYSTEM, largest_error),
)


def both_readings(evidence: Evidence, reported: Reported) -> pd.DataFrame:
    """Each quantity under both readings, one row each; ``results/excitation_reading.csv``.

    ``distance`` is the mean less the reported number; ``in_scatter`` is the distance over the standard
    deviation of one record, for the report shows one.
    """
    rows: list[dict[str, Any]] = []
    for name, source, system, read in QUOTED:
        statement, target = reported[source], reported.value(source)
        row: dict[str, Any] = {
            "quantity": name, "where": statement.where, "unit": statement.unit, "reported": target,
        }  # fmt: skip
        samples = {
            reading: read(evidence.ensemble(Drive(system, excitation=(("reading", reading),))), reported)
            for reading in READINGS
        }
        for reading, sample in samples.items():
            row |= {
                f"{reading}_mean": sample.mean, f"{reading}_standard_error": sample.error,
                f"{reading}_distance": sample.mean - target,
                f"{reading}_in_scatter": (sample.mean - target) / sample.scatter,
            }  # fmt: skip
        distances = {reading: abs(sample.mean - target) for reading, sample in samples.items()}
        first, second = samples.values()
        apart = abs(distances[READINGS[0]] - distances[READINGS[1]])
        sure = apart >= NEARER * first.minus(second).error  # seed by seed: both readings have the same seeds
        rows.append({**row, "nearer": min(distances, key=lambda reading: distances[reading]) if sure else "tie"})
    return pd.DataFrame(rows)
