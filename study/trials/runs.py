"""What diagnose makes of trials: one row each, the sealed answer beside what was found.

Four kinds: one effect hidden, none, a pair (diagnose, add what comes first, diagnose again), and one
effect hidden and taken out of the library (``removed``).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from study.compare.comparison import Comparison, compare
from study.compare.prediction import predict
from study.diagnose.adding import added
from study.diagnose.verdict import MISSING, Diagnosis, diagnose
from study.identify.time_domain.part_fit import fit_part
from study.records.prepared import Prepared, prepare_record
from study.reproduction.settings import TrialSettings
from study.support.errors import StudyError
from study.trials.draw import HIDDEN, Trial, make_trial

Row = dict[str, Any]
SINGLE, NONE, PAIR, REMOVED = "single", "none", "pair", "removed"
RESPONSES = ("displacement", "acceleration")
COLUMNS = (
    "kind", "seed", "hidden", "noise", "response", "known", "share",
    "verdict", "first", "named", "tied_with", "second_verdict", "second_named", "second_tied_with", "pair",
    "error_before", "error_after", "error_after_two", "error_true", "noise_floor", "left", "tie_with_hidden", "trouble",
)  # fmt: skip


@dataclass(frozen=True)
class Order:
    """A trial to be run."""

    kind: str  # ``single``, ``none``, ``pair`` or ``removed``
    seed: int  # of the trial
    hidden: tuple[str, ...]  # effects to hide
    noise: float  # mean square of the noise over that of the response
    response: str  # what is measured


def orders(settings: TrialSettings) -> list[Order]:
    """Every trial of the published run: all effects at all noises and responses, each with a seed of its own."""
    grid = [(noise, response) for noise in settings.noises for response in RESPONSES]
    wanted: list[tuple[str, tuple[str, ...], tuple[float, str]]] = []
    wanted += [(SINGLE, (name,), place) for _ in range(settings.rounds) for place in grid for name in HIDDEN]
    wanted += [(NONE, (), place) for _ in range(settings.none) for place in grid]
    couples = list(combinations(HIDDEN, 2))
    drawn = np.random.default_rng(settings.first_seed).permutation(len(couples))[: settings.pairs]
    wanted += [(PAIR, couples[j], grid[i % len(grid)]) for i, j in enumerate(drawn)]
    removed = [name for _ in range(settings.removed) for name in HIDDEN]
    wanted += [(REMOVED, (name,), grid[i % len(grid)]) for i, name in enumerate(removed)]
    first = settings.first_seed
    return [Order(kind, first + i, hidden, *place) for i, (kind, hidden, place) in enumerate(wanted)]


def run(order: Order) -> Row:
    """Make a trial, diagnose it and compare with the answer; a fault a user would be told of is kept in ``trouble``."""
    row: Row = dict.fromkeys(COLUMNS, "")
    row |= {"kind": order.kind, "seed": order.seed, "hidden": "+".join(order.hidden)}
    row |= {"noise": order.noise, "response": order.response}
    try:
        trial = make_trial(order.seed, order.hidden, order.noise, order.response)
        row |= {
            "known": "+".join(t.name for t in trial.believed.terms[3:]) or "linear",
            "share": "+".join(f"{share:.3f}" for share in trial.shares),
        }
        row |= _judged(order, trial)
    except StudyError as error:
        row["trouble"] = str(error)
    return row


def _judged(order: Order, trial: Trial) -> Row:
    prepared = prepare_record(trial.record)
    before = compare(trial.believed, prepared)
    diagnosis = diagnose(before, without=order.hidden if order.kind == REMOVED else ())
    first = diagnosis.candidates[0]
    missing = diagnosis.verdict == MISSING
    after = added(before, first.term) if missing else before
    row: Row = {
        "verdict": diagnosis.verdict, "first": first.name, "named": first.name if missing else "",
        "tied_with": "+".join(first.tied_with), "pair": "+".join(diagnosis.pair),
        "error_before": before.prediction.error, "error_after": after.prediction.error,
        "error_true": error_of_truth(trial, prepared, after.fit.steps_per_sample),
        "noise_floor": before.prediction.floor, "left": diagnosis.left,
    }  # fmt: skip
    if missing and order.kind == PAIR:
        row |= _second(after)
    if missing and order.kind == REMOVED and not first.tied_with:
        row["tie_with_hidden"] = str(_tied(diagnose(before), order.hidden[0], first.name))
    return row


def _second(after: Comparison) -> Row:
    """Diagnose again after adding what came first."""
    diagnosis = diagnose(after)
    best = diagnosis.candidates[0]
    missing = diagnosis.verdict == MISSING
    return {
        "second_verdict": diagnosis.verdict,
        "second_named": best.name if missing else "",
        "second_tied_with": "+".join(best.tied_with),
        "error_after_two": (added(after, best.term) if missing else after).prediction.error,
    }


def _tied(diagnosis: Diagnosis, hidden: str, named: str) -> bool:
    """Whether the diagnosis with the whole library says that the record cannot tell the two apart."""
    ties = {row.name: row.tied_with for row in diagnosis.candidates}
    return named in ties.get(hidden, ()) or hidden in ties.get(named, ())


def error_of_truth(trial: Trial, prepared: Prepared, steps: int) -> float:
    """Held-out response error of the true model, fitted as any other, from the true values; NaN if it cannot be."""
    try:
        return predict(fit_part(trial.truth, prepared, (), steps=steps), prepared).error
    except StudyError:
        return math.nan


def chunk(every: Sequence[Order], number: int, count: int) -> list[Order]:
    """The part of the trials that job ``number`` of ``count`` runs: every count-th, so that all take equally long."""
    return list(every[number::count])
