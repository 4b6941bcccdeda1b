"""What a trial is scored by: the tie set, what the measurement suffered from, evidence, and intervals that hold.

The fields of a diagnosis are read here and nowhere else in the trials.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from study.compare.comparison import Comparison
from study.diagnose.credibility import credible
from study.diagnose.verdict import MISSING, Diagnosis
from study.equations.model import Model
from study.faults import accounting
from study.faults.fault import Fault
from study.records.prepared import Prepared

Row = dict[str, Any]
Found = Mapping[str, Any]  # a fault of the measurement as diagnosis.json has it
WHATEVER_ITS_P_VALUE = 0  # effects asked for: a p value times none is below any alpha
FAR = 20.0  # standard errors: rivals that are farther behind stand in no tie set


def accounted_comparison(model: Model, prepared: Prepared) -> tuple[Comparison, tuple[Fault, ...]]:
    """The comparison that a diagnosis begins with, and the faults of the measurement that it accounts for."""
    found = accounting.accounted(model, prepared)
    return found.comparison, found.faults


def tie_set(diagnosis: Diagnosis) -> tuple[str, ...]:
    """The effects that the record cannot tell apart, the one put first among them; empty where none is named."""
    if diagnosis.verdict != MISSING:
        return ()
    first = diagnosis.candidates[0]
    return (first.name, *first.tied_with)


def evidence_row(diagnosis: Diagnosis, hidden: Sequence[str]) -> Row:
    """From which false alarms at any alpha, and tie sets at any K, follow.

    ``smallest_p`` is the smallest p value (of so many candidates) of those that would be believed if it were small
    enough, ``true_p`` that of the hidden effect, ``distance`` how far that is behind the first in standard errors, and
    ``rivals`` how far each is that is less than ``FAR`` behind, the first included.
    """
    rows = diagnosis.candidates
    behind = {row.name: max(row.distance, 0.0) for row in rows}
    true = next((row for row in rows if row.name in hidden), None)
    before = diagnosis.comparison.prediction
    believable = [r.p_value for r in rows if credible(before, r.prediction, r.interval, WHATEVER_ITS_P_VALUE)]
    return {
        "smallest_p": min(believable, default=1.0),
        "true_p": math.nan if true is None else true.p_value,
        "distance": math.nan if true is None else behind[true.name],
        "rivals": "+".join(f"{d:.2f}" for d in behind.values() if d < FAR),
    }


def intervals(comparison: Comparison, truth: Model) -> Row:
    """How many of the coefficients of a model with the true terms lie in their 95 % intervals: ``held`` of ``asked``.

    Nothing is asked of a model with other terms.
    """
    if {t.name for t in comparison.model.terms} != {t.name for t in truth.terms}:
        return {"held": 0, "asked": 0}
    true = truth.numbers()
    spans = [(true[c.key], c.interval) for c in comparison.coefficients]
    inside = [span[0] <= value <= span[1] for value, span in spans if span is not None]
    return {"held": sum(inside), "asked": len(inside)}


def measurement(found: Sequence[Found], imposed: Found) -> Row:
    """The faults found, and of the one that was imposed (the first, if it was not found) value and interval."""
    row: Row = {
        "faults_found": "+".join(str(f["fault"]) for f in found),
        "fault_rivals": "+".join(str(name) for f in found for name in f["rivals"]),
    }
    match = (f for f in found if (f["fault"], f["channel"]) == (imposed.get("fault"), imposed.get("channel")))
    shown = next(match, found[0] if found else None)
    if shown is None:
        return row
    low, high = shown["interval"] or (math.nan, math.nan)
    return row | {
        "found": shown["fault"], "found_channel": shown["channel"], "found_value": shown["value"],
        "found_low": low, "found_high": high,
    }  # fmt: skip
