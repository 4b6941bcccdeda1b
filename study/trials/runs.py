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

from study.diagnose.verdict import MISSING, Diagnosis, diagnose
from study.equations.model import Model, free
from study.equations.terms import Term
from study.identify.time_domain import held_out
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.records.plan import Plan, make_plan
from study.reproduction.settings import TrialSettings
from study.support.errors import DivergenceError, StudyError
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
    """A trial to be run.

    Attributes
    ----------
    kind : str
        ``single``, ``none``, ``pair`` or ``removed``.
    seed : int
        Of the trial.
    hidden : tuple of str
        Effects to hide.
    noise : float
        Mean square of the noise over that of the response.
    response : str
        What is measured.
    """

    kind: str
    seed: int
    hidden: tuple[str, ...]
    noise: float
    response: str


def orders(settings: TrialSettings) -> list[Order]:
    """Every trial of the published run: all effects at all noises and responses, each with a seed of its own.

    Parameters
    ----------
    settings : TrialSettings
        ``trials`` of the configuration: ``first_seed``, ``noises``, how many ``rounds`` of single effects and
        of ``none`` at each noise and response, and how many ``pairs`` and ``removed`` trials of each effect.
    """
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
    how = make_plan(trial.record)
    without = order.hidden if order.kind == REMOVED else ()
    found = diagnose(trial.believed, trial.record, how, without=without)
    first = found.candidates[0]
    missing = found.verdict == MISSING
    after, finer = _after_adding(trial, how, first.term) if missing else (found.response_error, how)
    row: Row = {
        "verdict": found.verdict,
        "first": first.name,
        "named": first.name if missing else "",
        "tied_with": "+".join(first.tied_with),
        "pair": "+".join(found.pair),
        "error_before": found.response_error,
        "error_after": after,
        "error_true": error_of_truth(trial, finer),
        "noise_floor": found.noise,
        "left": found.left,
    }
    if missing and order.kind == PAIR:
        row |= _second(trial, how, first.term)
    if missing and order.kind == REMOVED and not first.tied_with:
        whole = diagnose(trial.believed, trial.record, how)
        row["tie_with_hidden"] = str(_tied(whole, order.hidden[0], first.name))
    return row


def _added(trial: Trial, *terms: Term) -> Model:
    """The model after ``study add``: everything is fitted anew, shape parameters are searched for."""
    model = trial.believed
    for term in terms:
        model = model.with_term(free(term))
    return model


def _after_adding(trial: Trial, how: Plan, *terms: Term) -> tuple[float, Plan]:
    """Held-out response error after adding, and the plan with the steps that the fit was refined to."""
    found, finer = fit_model(_added(trial, *terms), trial.record, how)
    return _held_out(found, trial, finer), finer


def _second(trial: Trial, how: Plan, first: Term) -> Row:
    """Diagnose again after adding what came first."""
    found = diagnose(_added(trial, first), trial.record, how)
    best = found.candidates[0]
    missing = found.verdict == MISSING
    return {
        "second_verdict": found.verdict,
        "second_named": best.name if missing else "",
        "second_tied_with": "+".join(best.tied_with),
        "error_after_two": _after_adding(trial, how, first, best.term)[0] if missing else found.response_error,
    }


def _tied(whole: Diagnosis, hidden: str, named: str) -> bool:
    """Whether the diagnosis with the whole library says that the record cannot tell the two apart."""
    ties = {row.name: row.tied_with for row in whole.candidates}
    return named in ties.get(hidden, ()) or hidden in ties.get(named, ())


def error_of_truth(trial: Trial, how: Plan) -> float:
    """Held-out response error of the true model, fitted as any other, from the true values; NaN if it cannot be."""
    try:
        found = held_out.fit(trial.truth, trial.record, how, (), trial.truth.numbers())
        return _held_out(found, trial, how)
    except StudyError:
        return math.nan


def _held_out(found: FreeRunFit, trial: Trial, how: Plan) -> float:
    """Rms of what is left of the judging part over that of the response; all of it where the free run runs away."""
    try:
        residual = held_out.held_out_residual(found, trial.record, how)
    except DivergenceError:
        return 1.0
    return float(np.sqrt(np.mean(residual**2)) / np.std(trial.record[how.response][slice(*how.judge)]))


def chunk(every: Sequence[Order], number: int, count: int) -> list[Order]:
    """The part of the trials that job ``number`` of ``count`` runs: every count-th, so that all take equally long."""
    return list(every[number::count])
