"""What diagnose makes of trials: one row each, the sealed answer beside what was found.

Five kinds: one effect hidden, none, a pair (diagnose, add what comes first, diagnose again), one effect hidden and
taken out of the library (``removed``), and one effect that the model has already (``completed``).
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from study.compare.comparison import Comparison
from study.compare.prediction import predict
from study.diagnose.adding import added
from study.diagnose.confirmed_faults import confirmed
from study.diagnose.verdict import diagnose
from study.faults.fault import fault_fields
from study.faults.imposed import FAULTS
from study.identify.time_domain.part_fit import fit_part
from study.records.prepared import Prepared, prepare_record
from study.records.record import MOTIONS
from study.reproduction.settings import TrialSettings
from study.support.errors import StudyError
from study.trials.draw import HIDDEN, NO_FAULT, Trial, make_trial
from study.trials.experiment import WIDE
from study.trials.findings import Row, accounted_comparison, evidence_row, intervals, measurement, tie_set

SINGLE, NONE, PAIR, REMOVED, COMPLETED = "single", "none", "pair", "removed", "completed"
WITHOUT, WITH = "without", "with"  # a fault of the measurement
COLUMNS = (
    "kind", "seed", "hidden", "noise", "faults", "response", "samples_a_period", "samples", "damping", "excitation",
    "known", "share", "fault", "fault_channel", "fault_value", "fault_unit",
    "faults_found", "fault_rivals", "fault_shown", "found", "found_channel", "found_value", "found_low", "found_high",
    "verdict", "first", "tie_set", "tie_size", "pair", "second_verdict", "second_tie_set", "whole_tie_set",
    "error_before", "error_after", "error_after_two", "error_true", "noise_floor", "left", "held", "asked",
    "smallest_p", "true_p", "distance", "rivals", "seconds", "trouble",
)  # fmt: skip


@dataclass(frozen=True)
class Order:
    """A trial to be run."""

    kind: str  # ``single``, ``none``, ``pair``, ``removed`` or ``completed``
    seed: int  # of the trial
    hidden: tuple[str, ...]  # effects to hide
    noise: float  # mean square of the noise over that of the response
    response: str  # what is measured
    faults: str = WITHOUT  # ``with`` or ``without`` one of the measurement


def orders(settings: TrialSettings) -> list[Order]:
    """Every trial of the published run, each with a seed of its own: those without a fault, then those with one.

    Each kind is laid out evenly over effects, noises and responses; then the order is shuffled, so that the first few
    are a fair sample of all.
    """
    rng = np.random.default_rng(settings.first_seed)
    every: list[Order] = []
    for faults in (WITHOUT, WITH):
        wanted = _wanted(settings, rng, faults)
        first = settings.first_seed + len(every)
        shuffled = [wanted[int(i)] for i in rng.permutation(len(wanted))]
        every += [Order(kind, first + i, *rest, faults=faults) for i, (kind, rest) in enumerate(shuffled)]
    return every


def _wanted(
    settings: TrialSettings, rng: np.random.Generator, faults: str
) -> list[tuple[str, tuple[tuple[str, ...], float, str]]]:
    """Kind, hidden effects, noise and response of each trial with, or without, a fault."""
    couples = list(combinations(HIDDEN, 2))
    drawn = [couples[int(i)] for i in rng.permutation(len(couples))[: settings.pairs]]
    kinds = {
        SINGLE: [(name,) for _ in range(settings.rounds * len(settings.noises)) for name in HIDDEN],
        NONE: [()] * (settings.none * len(settings.noises)),
        COMPLETED: [(name,) for _ in range(settings.completed) for name in HIDDEN],
        PAIR: drawn,
        REMOVED: [(name,) for _ in range(settings.removed) for name in HIDDEN if faults == WITHOUT],
    }
    return [
        (kind, (hidden, settings.noises[at % len(settings.noises)], MOTIONS[at % len(MOTIONS)]))
        for kind, all_hidden in kinds.items()
        for i, hidden in enumerate(all_hidden)
        for at in [i // len(HIDDEN) + i % len(HIDDEN)]  # so each effect meets each noise, round by round
    ]


def run_trial(order: Order) -> Row:
    """Make a trial, diagnose it and compare with the answer; a fault a user would be told of is kept in ``trouble``."""
    row: Row = dict.fromkeys(COLUMNS, "")
    row |= {"kind": order.kind, "seed": order.seed, "hidden": "+".join(order.hidden), "faults": order.faults}
    row |= {"noise": order.noise, "response": order.response}
    try:
        fault = FAULTS[order.seed % len(FAULTS)] if order.faults == WITH else NO_FAULT
        trial = make_trial(order.seed, order.hidden, order.noise, order.response, fault, WIDE)
        row |= _answer(trial)
        begun = time.perf_counter()
        row |= _judged(order, trial)
        row["seconds"] = round(time.perf_counter() - begun, 1)
    except StudyError as error:
        row["trouble"] = str(error)
    return row


def _answer(trial: Trial) -> Row:
    experiment = trial.experiment
    assert experiment is not None, "these trials are of a force on a mass and spring"
    return {
        "samples_a_period": experiment.samples_a_period, "samples": experiment.samples,
        "damping": experiment.damping, "excitation": experiment.kind,
        "known": "+".join(t.name for t in trial.believed.terms[3:]) or "linear",
        "share": "+".join(f"{share:.3f}" for share in trial.shares),
        "fault": trial.fault.get("fault", ""), "fault_channel": trial.fault.get("channel", ""),
        "fault_value": trial.fault.get("value", ""), "fault_unit": trial.fault.get("unit", ""),
    }  # fmt: skip


def _judged(order: Order, trial: Trial) -> Row:
    prepared = prepare_record(trial.record)
    before, faults = accounted_comparison(trial.completed if order.kind == COMPLETED else trial.believed, prepared)
    diagnosis = diagnose(before, without=order.hidden if order.kind == REMOVED else ())
    named = tie_set(diagnosis)
    after = added(before, diagnosis.candidates[0].term) if named else before
    first = next((c.name for c in diagnosis.candidates), "")
    row: Row = {
        "verdict": diagnosis.verdict, "first": first, "tie_set": "+".join(named),
        "tie_size": len(named), "pair": "+".join(diagnosis.pair), "left": diagnosis.left,
        "error_before": before.prediction.error, "error_after": after.prediction.error,
        "error_true": error_of_truth(trial, before.prepared, after.fit.steps_per_sample),
        "noise_floor": before.prediction.floor,
    }  # fmt: skip
    found = [fault_fields(fault) for fault in confirmed(faults, diagnosis)]
    row["fault_shown"] = fault_shown(trial, prepared, [str(field["fault"]) for field in found])
    row |= evidence_row(diagnosis, order.hidden) | measurement(found, trial.fault) | intervals(after, trial.truth)
    if named and order.kind == PAIR:
        row |= _second(after, trial)
    if named and order.kind == REMOVED:
        row["whole_tie_set"] = "+".join(tie_set(diagnose(before)))
    return row


def _second(after: Comparison, trial: Trial) -> Row:
    """Diagnose again after adding what came first."""
    diagnosis = diagnose(after)
    named = tie_set(diagnosis)
    last = added(after, diagnosis.candidates[0].term) if named else after
    return {
        "second_verdict": diagnosis.verdict, "second_tie_set": "+".join(named),
        "error_after_two": last.prediction.error, **intervals(last, trial.truth),
    }  # fmt: skip


def error_of_truth(trial: Trial, prepared: Prepared, steps: int) -> float:
    """Held-out response error of the true model, fitted as any other, from the true values; NaN if it cannot be."""
    try:
        return predict(fit_part(trial.truth, prepared, (), steps=steps), prepared).error
    except StudyError:
        return math.nan


def fault_shown(trial: Trial, prepared: Prepared, found: Sequence[str]) -> str:
    """Whether the record shows its fault, ``yes`` or ``no``: it was found, or is beside the true equation.

    Empty without a fault. What no search finds beside the very equation that made the record is too small for it.
    """
    imposed = trial.fault.get("fault", "")
    if not imposed or imposed in found:
        return "yes" if imposed else ""
    try:
        seen = [fault.fault for fault in accounted_comparison(trial.completed, prepared)[1]]
    except StudyError:
        seen = []
    return "yes" if imposed in seen else "no"


def chunk(every: Sequence[Order], number: int, count: int) -> list[Order]:
    """The part of the trials that job ``number`` of ``count`` runs: every count-th, so that all take equally long."""
    return list(every[number::count])
