"""Trials of the test that is proposed after a tie: it is made of the true model, and both records are diagnosed."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from study.diagnose.confirmed_faults import diagnose_accounted
from study.diagnose.next_test import WORTH, Choice, driving, next_test, tied_rows
from study.diagnose.separation import Rivals, allowed, own_limits, rivals_of
from study.equations.free_run import prepare
from study.records.interpolation import between_samples
from study.records.record import MOTIONS, Record, Sensor
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.trials.draw import Trial
from study.trials.findings import compared, tie_set
from study.trials.kept import Row
from study.way_in.compare_records import compare_records

LOUDER = 2.0  # times what the record reached of force and motion: the limits of the test


def judged_next_test(trial: Trial, seed: int) -> Row:
    """Whether the proposed test, and a random one that is allowed and as long, end the tie in the right effect."""
    diagnosis = diagnose_accounted(compared(trial, trial.believed)).diagnosis
    named = tie_set(diagnosis)
    row: Row = {"verdict": diagnosis.verdict, "tie_set": "+".join(named)}
    if len(named) < 2 or not set(trial.hidden) <= set(named):
        return row
    rivals = rivals_of(tied_rows(diagnosis), diagnosis.comparison.prepared)
    limits = own_limits(rivals.fits, rivals.present, LOUDER)
    found = next_test(rivals, limits)
    choice, again = found.choice, found.again
    row |= {
        "asked": found.asked, "design": choice.design.kind, "band": choice.design.place,
        "level": choice.design.level, "length": choice.design.length / limits.length,
        "sensor": "" if choice.sensor is None else str(choice.sensor), "promise": choice.promise,
        "promise_as_was": math.nan if again is None else again.promise,
    }  # fmt: skip
    if choice.promise < WORTH:  # it is said that no test is likely to decide
        return row
    row["decided"], row["ends_in"] = _decided(trial, rivals, choice, np.random.default_rng([seed, 1]))
    every, rng = allowed(rivals.fits, rivals.present, limits, choice.design.length), np.random.default_rng([seed, 2])
    drawn = every[int(rng.integers(len(every)))]
    row |= {"random_design": drawn.kind, "random_band": drawn.place}
    row["random_decided"], _ = _decided(trial, rivals, replace(choice, design=drawn, sensor=None), rng)
    return row


def _decided(trial: Trial, rivals: Rivals, choice: Choice, rng: np.random.Generator) -> tuple[float, str]:
    """Whether the diagnosis of this record and the test names the hidden effect, and no former rival beside it.

    And the effects that it names.
    """
    record = measured_in(trial, rivals, choice, rng)
    records = [record] if choice.sensor is not None else [trial.record, record]
    try:
        named = tie_set(diagnose_accounted(compare_records(records, trial.believed)).diagnosis)
    except StudyError as error:
        return 0.0, str(error)
    left = {row.name for row in rivals.rows} & set(named)
    return float(left == set(trial.hidden) and named[0] in trial.hidden), "+".join(named)


def measured_in(trial: Trial, rivals: Rivals, choice: Choice, rng: np.random.Generator) -> Record:
    """The record of a test of the true model, with the noise that the trial has."""
    design, prepared, given = choice.design, rivals.prepared, trial.record
    driven = driving(rivals.present, design, prepared.every)
    samples = prepared.every * (len(design.record) - 1) + 1
    moves = [m for m in MOTIONS if m in design.record] if rivals.present.prescribed else []
    acting = {name: np.zeros(samples) for name in given.forces}
    acting |= {name: between_samples(design.record[name], prepared.every) for name in (*rivals.present.drivers, *moves)}
    sensors = rivals.seen(choice.sensor)[0].sensors
    source = Record(given.dt, acting, given.units, coordinates=given.coordinates, forces=given.forces)
    run = prepare(trial.truth, source, sensors=sensors, steps_per_sample=8)
    shown = run.respond({}, design.begin[: run.moving])[0]
    measured = {
        str(sensor): own + noise * rng.standard_normal(samples)
        for sensor, own, noise in zip(sensors, shown.T, _noise(trial, rivals, sensors), strict=True)
    }
    silent = {name: np.zeros(samples) for name in given.forces}
    channels = {**silent, **driven, **measured}
    return Record(
        given.dt, channels, given.units, "next test", coordinates=given.coordinates, forces=given.forces
    )  # fmt: skip


def _noise(trial: Trial, rivals: Rivals, sensors: Sequence[Sensor]) -> Floats:
    """Standard deviation of the noise of each sensor: that of the record, or in the same proportion to the motion."""
    share, sizes = math.sqrt(trial.noise / (1.0 + trial.noise)), list[float]()
    for sensor in sensors:
        seen = trial.record[sensor] if sensor in trial.record else rivals.rows[0].prediction.motions([sensor])
        sizes.append(share * float(np.std(seen)))
    return np.array(sizes)
