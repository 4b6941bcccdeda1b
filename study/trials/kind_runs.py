"""Trials of each kind of test, diagnosed as the command line would, and what came of them as rows of a table."""

import time
from collections.abc import Sequence
from typing import Any

from study.diagnose.held_out import held_out_of
from study.diagnose.verdict import MISSING, NOTHING, believed, diagnose
from study.faults.kinds_of_tests import accounted_test
from study.support.errors import StudyError
from study.trials.draw import Trial
from study.trials.findings import intervals, tie_set
from study.trials.kinds import make_test

Row = dict[str, Any]
COLUMNS: tuple[str, ...] = (
    "test", "seed", "noise", "hidden", "verdict", "first", "tied", "right", "error_before", "error_after", "held",
    "asked", "seconds", "trouble",
)  # fmt: skip


def run_test(test: str, seed: int, hidden: Sequence[str] | None = None, noise: float | None = None) -> Row:
    """One trial of a kind of test. ``right``: the true effect first or tied with the first, or nothing where none is.

    A trial that cannot be drawn or diagnosed says so under ``trouble``.
    """
    row: Row = dict.fromkeys(COLUMNS, "") | {"test": test, "seed": seed}
    begun = time.perf_counter()
    try:
        trial = make_test(test, seed, hidden, noise)
        row |= {"noise": trial.noise, "hidden": "+".join(trial.hidden) or "none"} | _diagnosed(trial)
    except StudyError as error:
        row["trouble"] = str(error)
    return row | {"seconds": round(time.perf_counter() - begun, 1)}


def _diagnosed(trial: Trial) -> Row:
    found = accounted_test([trial.record], trial.believed)
    diagnosis = diagnose(found.comparison)
    named = tie_set(diagnosis)
    first = diagnosis.candidates[0] if diagnosis.candidates else None
    # Without noise an interval is as wide as rounding: nothing is asked of those.
    right = diagnosis.verdict == NOTHING if not trial.hidden else set(named) >= set(trial.hidden)
    seen = first is not None and believed(first, found.comparison.prediction, held_out_of(found.comparison))
    row: Row = {
        "verdict": diagnosis.verdict, "first": named[0] if named else "", "tied": "+".join(named[1:]),
        "right": int(right), "error_before": round(found.comparison.prediction.error, 6),
        "error_after": round(first.response_error, 6) if first is not None and seen else "",
    }  # fmt: skip
    if trial.noise > 0.0 and diagnosis.verdict == MISSING and named[0] in trial.hidden:
        again = accounted_test([trial.record], trial.completed.with_values(dict.fromkeys(trial.completed.values)))
        row |= intervals(again.comparison, trial.truth)
    return row
