"""What "unit variance" refers to: both readings against the numbers that the report quotes."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import pandas as pd

from study.records.excitation import READINGS
from study.reproduction.claims.evidence import Assumed, Drive, Ensemble, Evidence
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample

SURE = 2.0  # standard errors by which one reading must come nearer than the other ...
TIE = "tie"  # ... or this is said


@dataclass(frozen=True)
class Quantity:
    """A number the report quotes and how it is read off an ensemble.

    Attributes
    ----------
    name, reported : str
        What it is; its id in ``config/reported.tsv``.
    system : str
        Whose it is.
    read : callable
        ``Ensemble -> Sample``.
    """

    name: str
    reported: str
    system: str
    read: Callable[[Ensemble], Sample]


@dataclass(frozen=True)
class Row:
    """A quantity under both readings; a row of ``results/excitation_reading.csv``.

    ``distance`` is the mean less the reported number; ``in_scatter`` is the distance over the standard
    deviation of one record, for the report shows one.
    """

    quantity: str
    where: str
    unit: str
    reported: float
    raw_mean: float
    raw_standard_error: float
    raw_distance: float
    raw_in_scatter: float
    filtered_mean: float
    filtered_standard_error: float
    filtered_distance: float
    filtered_in_scatter: float
    nearer: str


def largest_error(ensemble: Ensemble, reported: Reported) -> Sample:
    """Largest relative error of the Dead-Band's Re A_2 in the report's 2- to 3-Hz band."""
    true = -reported.table_1("dead_band", "k")
    low, high = reported.value("dead_band_error.low"), reported.value("dead_band_error.high")
    keep = (ensemble.frequency >= low) & (ensemble.frequency <= high)
    return ensemble.sample(lambda o: float(np.max(np.abs(o.miso.response[1].real[keep] / true - 1.0))))


def quantities(reported: Reported) -> tuple[Quantity, ...]:
    """The numbers of Section 5.2 that depend on the level."""

    def read(name: str) -> Callable[[Ensemble], Sample]:
        return lambda e: e.sample(lambda o: o.siso.read.get(name, math.nan))

    return (
        Quantity("SI/SO k of the Duffing system, hand-read", "siso_stiffness", "duffing", read("k")),
        Quantity("SI/SO k of the Duffing system, fitted", "siso_stiffness", "duffing", lambda e: e.siso("k")),
        Quantity("SI/SO f_n of the Duffing system, hand-read", "siso_frequency", "duffing", read("f_n")),
        Quantity("SI/SO f_n of the Duffing system, fitted", "siso_frequency", "duffing", lambda e: e.siso("f_n")),
        Quantity("linear coherence of the Duffing system", "duffing_share", "duffing", Ensemble.linear_coherence),
        Quantity("linear coherence of the Dead-Band system", "dead_band_share", "dead_band", Ensemble.linear_coherence),
        Quantity(
            "largest error of the Dead-Band's A_2 from 2 to 3 Hz", "dead_band_error", "dead_band",
            lambda e: largest_error(e, reported),
        ),
    )  # fmt: skip


def study(evidence: Evidence, reported: Reported) -> pd.DataFrame:
    """One row a quantity, ``Row``."""
    return pd.DataFrame([asdict(_row(q, evidence, reported)) for q in quantities(reported)])


def _row(quantity: Quantity, evidence: Evidence, reported: Reported) -> Row:
    statement, target = reported[quantity.reported], reported.value(quantity.reported)
    found: dict[str, Sample] = {}
    numbers: dict[str, float] = {}
    for reading in READINGS:
        drive = Drive(quantity.system, excitation=(("reading", reading),))
        sample = found[reading] = quantity.read(evidence.ensemble(drive, Assumed()))
        numbers |= {
            f"{reading}_mean": sample.mean,
            f"{reading}_standard_error": sample.error,
            f"{reading}_distance": sample.mean - target,
            f"{reading}_in_scatter": (sample.mean - target) / sample.scatter,
        }
    nearer = min(READINGS, key=lambda r: abs(found[r].mean - target))
    distances = [abs(found[r].mean - target) for r in READINGS]
    between = found[READINGS[0]].minus(found[READINGS[1]])  # seed by seed: both readings have the same seeds
    if abs(distances[0] - distances[1]) < SURE * between.error:
        nearer = TIE
    return Row(quantity.name, statement.where, statement.unit, target, **numbers, nearer=nearer)


def preferred(nearer: Sequence[str]) -> str:
    """The reading that comes nearer to more of the numbers."""
    counts: Mapping[str, int] = {reading: list(nearer).count(reading) for reading in READINGS}
    return max(READINGS, key=lambda r: counts[r])
