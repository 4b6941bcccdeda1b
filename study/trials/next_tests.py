"""Trials of the test that is proposed after a tie: it is made of the true model, and both records are diagnosed."""

import math
from dataclasses import replace

import numpy as np

from study.diagnose.confirmed_faults import diagnose_accounted
from study.diagnose.designs import Design, Limits
from study.diagnose.next_test import Choice, driving, next_test, tied_rows
from study.diagnose.separation import Rivals, allowed, own_limits, rivals_of
from study.equations.free_run import prepare
from study.records.record import Record, Sensor
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.trials.draw import Trial
from study.trials.findings import compared, tie_set
from study.trials.kept import Row
from study.way_in.compare_records import compare_records

LOUDER = 2.0  # times what the record reached of force and motion: the limits of the test


def judged_next_test(trial: Trial) -> Row:
    """Whether the proposed test, and a random one that is allowed and as long, end the tie in the right effect."""
    diagnosis = diagnose_accounted(compared(trial, trial.believed)).diagnosis
    named = tie_set(diagnosis)
    row: Row = {"verdict": diagnosis.verdict, "first": named[0] if named else "", "tie_set": "+".join(named)}
    if len(named) < 2 or not set(trial.hidden) <= set(named) or len(diagnosis.sets) > len(named):
        return row
    rivals = rivals_of(tied_rows(diagnosis), diagnosis.comparison.prepared)
    limits = own_limits(rivals.fits, rivals.present, LOUDER)
    found = next_test(rivals, limits)
    choice, again = found.choice, found.again
    row |= {
        "asked": found.asked, "design": choice.design.kind, "band": choice.design.place, "level": choice.design.level,
        "length": choice.design.length / limits.length, "sensor": "" if choice.sensor is None else str(choice.sensor),
        "promise": choice.promise, "promise_as_was": math.nan if again is None else again.promise,
        "likely": sum(p for row, p in zip(rivals.rows, rivals.likely, strict=True) if row.names == trial.hidden),
    }  # fmt: skip
    row["decided"], row["ends_in"] = _decided(trial, rivals, choice, 1)
    drawn = _random_test(rivals, limits, choice, trial.record)
    row |= {"random_design": drawn.kind, "random_band": drawn.place}
    row["random_decided"], _ = _decided(trial, rivals, replace(choice, design=drawn, sensor=None), 2)
    return row


def _random_test(rivals: Rivals, limits: Limits, choice: Choice, record: Record) -> Design:
    """One of the tests that are allowed, as long as the one that is proposed."""
    every = allowed(rivals.fits, rivals.present, limits, choice.design.length)
    return every[int(np.random.default_rng([7, len(record)]).integers(len(every)))]


def _decided(trial: Trial, rivals: Rivals, choice: Choice, seed: int) -> tuple[float, str]:
    """Whether the diagnosis of this record and the test names the hidden effect, and no former rival beside it."""
    record = measured_in(trial, rivals, choice, np.random.default_rng([len(trial.record), seed]))
    records = [record] if choice.sensor is not None else [trial.record, record]
    try:
        named = tie_set(diagnose_accounted(compare_records(records, trial.believed)).diagnosis)
    except StudyError as error:
        return 0.0, str(error)
    rivals_left = {row.name for row in rivals.rows} & set(named)
    return float(rivals_left == set(trial.hidden) and named[0] in trial.hidden), "+".join(named)


def measured_in(trial: Trial, rivals: Rivals, choice: Choice, rng: np.random.Generator) -> Record:
    """The record of a test of the true model, with the noise that the trial has."""
    design, given = choice.design, trial.record
    every = rivals.prepared.every
    driven = driving(rivals.present, design, rivals.prepared, trial.truth.values.get("m"), given)
    samples = every * (len(design.record) - 1) + 1
    own = {name: np.zeros(samples) for name in given.forces} | driven
    if "base_acceleration" in driven:
        own["force"] = -driven["base_acceleration"]
    fine = Record(given.dt, own, given.units, "next test", coordinates=given.coordinates, forces=given.forces)
    outputs, _ = rivals.seen(choice.sensor)
    sensors = (*outputs.sensors,)
    run = prepare(trial.truth, _with_motion(fine, design, every), sensors=sensors, steps_per_sample=8)
    shown = run.respond({}, design.begin[: run.moving])[0]
    sizes = _noise_sizes(trial, rivals, sensors)
    noisy = {str(s): shown[:, i] + sizes[i] * rng.standard_normal(samples) for i, s in enumerate(sensors)}
    channels = {name: own[name] for name in own if name != "force" or "base_acceleration" not in own}
    if "force" in noisy:  # of a component
        channels = dict(driven)
    if "base_acceleration" in own:
        channels["force"] = np.zeros(samples)
    return Record(given.dt, {**channels, **noisy}, given.units, "next test", coordinates=given.coordinates,
                  forces=given.forces)  # fmt: skip


def _with_motion(record: Record, design: Design, every: int) -> Record:
    """A record with the prescribed motion of a component, all of it; others as they are."""
    from study.records.interpolation import between_samples

    moved = {m: between_samples(design.record[m], every) for m in ("displacement", "velocity", "acceleration")
             if m in design.record and "displacement" in record}  # fmt: skip
    return record.with_channels(moved) if moved else record


def _noise_sizes(trial: Trial, rivals: Rivals, sensors: tuple[Sensor, ...]) -> Floats:
    """Standard deviation of the noise of each sensor: that of the record, or in the same proportion to the motion."""
    share = math.sqrt(trial.noise / (1.0 + trial.noise))
    known = [s for s in sensors if s in trial.record]
    sizes = {s: share * float(np.std(trial.record[s])) for s in known}
    others = [s for s in sensors if s not in trial.record]
    if others:
        moved = np.std(rivals.rows[0].prediction.motions(others), axis=0)
        sizes |= {s: math.sqrt(trial.noise) * float(size) for s, size in zip(others, moved, strict=True)}
    return np.array([sizes[s] for s in sensors])
