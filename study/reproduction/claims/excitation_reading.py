"""What "unit variance" refers to: both readings against the numbers that the report quotes."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from study.records.excitation import READINGS
from study.reproduction.claims.common import band
from study.reproduction.claims.evidence import Drive, Ensemble, Evidence, Outcome
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample

SURE = 2.0  # standard errors by which one reading must be the nearer one; otherwise there is a tie
TIE = "tie"


@dataclass(frozen=True)
class Quantity:
    """A number the report quotes: its name, its id in ``config/reported.tsv``, its system, and how to read it off."""

    name: str
    reported: str
    system: str
    read: Callable[[Ensemble], Sample]


def line_errors(outcome: Outcome, true: float) -> NDArray[np.float64]:
    """Relative error of the Dead-Band's Re A_2, line by line."""
    return np.abs(outcome.miso.response[1].real / true - 1.0)


def largest_error(ensemble: Ensemble, reported: Reported) -> Sample:
    """Largest relative error of the Dead-Band's Re A_2 in the report's 2- to 3-Hz band."""
    keep, true = ensemble.between(*band(reported, "dead_band_error")), -reported.table_1("dead_band", "k")
    return ensemble.sample(lambda o: float(np.max(line_errors(o, true)[keep])))


def quantities(reported: Reported) -> tuple[Quantity, ...]:
    """The numbers of Section 5.2 that depend on the level."""
    return (
        Quantity("SI/SO k of the Duffing system, hand-read", "siso_stiffness", "duffing", lambda e: e.hand_read("k")),
        Quantity("SI/SO k of the Duffing system, fitted", "siso_stiffness", "duffing", lambda e: e.siso("k")),
        Quantity(
            "SI/SO f_n of the Duffing system, hand-read", "siso_frequency", "duffing", lambda e: e.hand_read("f_n")
        ),
        Quantity("SI/SO f_n of the Duffing system, fitted", "siso_frequency", "duffing", lambda e: e.siso("f_n")),
        Quantity("linear coherence of the Duffing system", "duffing_share", "duffing", Ensemble.linear_coherence),
        Quantity("linear coherence of the Dead-Band system", "dead_band_share", "dead_band", Ensemble.linear_coherence),
        Quantity(
            "largest error of the Dead-Band's A_2 from 2 to 3 Hz", "dead_band_error", "dead_band",
            lambda e: largest_error(e, reported),
        ),
    )  # fmt: skip


def both_readings(evidence: Evidence, reported: Reported) -> pd.DataFrame:
    """Each quantity under both readings, one row each; ``results/excitation_reading.csv``.

    ``distance`` is the mean less the reported number; ``in_scatter`` is the distance over the standard
    deviation of one record, for the report shows one.
    """
    return pd.DataFrame([_row(quantity, evidence, reported) for quantity in quantities(reported)])


def _row(quantity: Quantity, evidence: Evidence, reported: Reported) -> dict[str, Any]:
    statement, target = reported[quantity.reported], reported.value(quantity.reported)
    row = {"quantity": quantity.name, "where": statement.where, "unit": statement.unit, "reported": target}
    samples: dict[str, Sample] = {}
    for reading in READINGS:
        drive = Drive(quantity.system, excitation=(("reading", reading),))
        sample = samples[reading] = quantity.read(evidence.ensemble(drive))
        row |= {
            f"{reading}_mean": sample.mean, f"{reading}_standard_error": sample.error,
            f"{reading}_distance": sample.mean - target,
            f"{reading}_in_scatter": (sample.mean - target) / sample.scatter,
        }  # fmt: skip
    distances = {reading: abs(sample.mean - target) for reading, sample in samples.items()}
    first, second = (samples[reading] for reading in READINGS)
    apart = abs(distances[READINGS[0]] - distances[READINGS[1]])
    sure = apart >= SURE * first.minus(second).error  # seed by seed: both readings have the same seeds
    return {**row, "nearer": min(distances, key=lambda reading: distances[reading]) if sure else TIE}
