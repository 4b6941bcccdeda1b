"""Trials of each kind of test, diagnosed as the command line would, and what came of them as rows of a table."""

import time
from collections.abc import Sequence
from typing import Any

from study.compare.comparison import Comparison
from study.diagnose.held_out import held_out_of
from study.diagnose.verdict import MISSING, NOTHING, believed, diagnose
from study.faults.kinds_of_tests import accounted_test
from study.support.errors import StudyError
from study.trials.draw import Trial
from study.trials.findings import intervals, tie_set
from study.trials.kinds import make_test

Row = dict[str, Any]
COLUMNS: tuple[str, ...] = (
    "test", "seed", "noise", "hidden", "verdict", "first", "tied", "right", "shown", "error_before", "error_after",
    "held", "asked", "seconds", "trouble",
)  # fmt: skip
FIRST_SEED = 630_001


def run_test(test: str, seed: int, hidden: Sequence[str] | None = None, noise: float | None = None) -> Row:
    """One trial of a kind of test.

    ``right`` is whether the true effect came first or is tied with the first, or nothing was found where none is.
    ``shown`` is the coefficient of the hidden effect over its standard error, in the fit of the true model: what is
    there but less than ``VISIBLE`` of these no test of that many candidates finds for certain; without noise it is
    left out. A trial that cannot be drawn or diagnosed says so under ``trouble``.
    """
    row: Row = dict.fromkeys(COLUMNS, "") | {"test": test, "seed": seed}
    begun = time.perf_counter()
    try:
        trial = make_test(test, seed, hidden, noise)
        row |= {"noise": trial.noise, "hidden": "+".join(trial.hidden) or "none"}
        row |= _diagnosed(trial)
        row |= _true_model(trial)
    except StudyError as error:
        row["trouble"] = str(error)
    return row | {"seconds": round(time.perf_counter() - begun, 1)}


def _diagnosed(trial: Trial) -> Row:
    found = accounted_test([trial.record], trial.believed)
    diagnosis = diagnose(found.comparison)
    named = tie_set(diagnosis)
    first = diagnosis.candidates[0] if diagnosis.candidates else None
    right = diagnosis.verdict == NOTHING
    if trial.hidden:
        right = diagnosis.verdict == MISSING and set(named) >= set(trial.hidden)
    seen = first is not None and believed(first, found.comparison.prediction, held_out_of(found.comparison))
    return {
        "verdict": diagnosis.verdict, "first": named[0] if named else "", "tied": "+".join(named[1:]),
        "right": int(right), "error_before": round(found.comparison.prediction.error, 6),
        "error_after": round(first.response_error, 6) if first is not None and seen else "",
    }  # fmt: skip


def _true_model(trial: Trial) -> Row:
    """Whether its intervals hold, and how far the hidden effect stands out; nothing of a record without noise.

    There an interval is as wide as rounding.
    """
    if trial.noise == 0.0:
        return {}
    true = trial.completed.with_values(dict.fromkeys(trial.completed.values))
    comparison = accounted_test([trial.record], true).comparison
    shown = {"shown": round(_standing(comparison, trial.hidden[0]), 1)} if trial.hidden else {}
    return shown | intervals(comparison, trial.truth)


def _standing(comparison: Comparison, name: str) -> float:
    """The coefficient of a term over its standard error."""
    one = next(c for c in comparison.coefficients if c.term == name)
    return abs(one.value) / one.error if one.error else 0.0
