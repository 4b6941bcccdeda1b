"""What a trial is scored by: its diagnosis, the tie set, what the measurement suffered from, intervals that hold.

Models are compared, and the fields of a diagnosis read, here and nowhere else in the trials.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from study.compare.comparison import Comparison, compare
from study.compare.prediction import predict
from study.diagnose.credibility import credible
from study.diagnose.verdict import MISSING, Diagnosis, diagnose
from study.equations.model import Model
from study.faults.accounting import Accounted
from study.identify.time_domain.part_fit import fit_part, rough_steps
from study.identify.time_domain.weighted_fit import finished
from study.records.prepared import Prepared, prepare_record
from study.support.errors import StudyError
from study.trials.draw import Trial
from study.trials.kept import Row
from study.way_in.compare_records import compare_records

Found = Mapping[str, Any]  # a fault of the measurement as diagnosis.json has it
FAR_BEHIND = 20.0  # standard errors: rivals that are farther behind stand in no tie set


def compared(trial: Trial, model: Model) -> Accounted:
    """The comparison that a diagnosis begins with, and the faults of the measurement that it accounts for."""
    return compare_records([trial.record], model)


def diagnosed_structure(trial: Trial) -> Diagnosis:
    """What is said of a structure."""
    return diagnose(compare(trial.believed, prepare_record(trial.record)))


def tie_set(diagnosis: Diagnosis) -> tuple[str, ...]:
    """The effects that the record cannot tell apart, the one put first among them; empty where none is named."""
    if diagnosis.verdict != MISSING:
        return ()
    return tuple(row.name for row in diagnosis.sets if len(row.entries) == 1)


def evidence_row(diagnosis: Diagnosis, hidden: Sequence[str]) -> Row:
    """From which false alarms at any alpha, and tie sets at any K, follow.

    ``smallest_p`` is the smallest p value (of so many candidates) of those that would be believed if it were small
    enough, ``true_p`` that of the hidden effect, ``distance`` how far that is behind the first in standard errors, and
    ``rivals`` how far each is that is less than ``FAR_BEHIND`` behind, the first included.
    """
    rows = diagnosis.candidates
    behind = {row.name: max(row.distance, 0.0) for row in rows}
    true = next((row for row in rows if row.name in hidden), None)
    before = diagnosis.comparison.prediction
    # Those that would be believed whatever their p value: one of zero is below any alpha.
    believable = [r.p_value for r in rows if credible(before, r.prediction, r.effect.interval, 0.0)]
    return {
        "smallest_p": min(believable, default=1.0),
        "true_p": math.nan if true is None else true.p_value,
        "distance": math.nan if true is None else behind[true.name],
        "rivals": "+".join(f"{d:.2f}" for d in behind.values() if d < FAR_BEHIND),
    }


def intervals(comparison: Comparison | Comparison, truth: Model) -> Row:
    """How many of the coefficients of a model with the true terms lie in their 95 % intervals: ``held`` of ``asked``.

    Nothing is asked of a model with other terms.
    """
    if {t.name for t in comparison.model.terms} != {t.name for t in truth.terms}:
        return {"held": 0, "asked": 0}
    true = truth.numbers()
    spans = [(true[c.key], c.interval) for c in comparison.coefficients]
    inside = [span[0] <= value <= span[1] for value, span in spans if span is not None]
    return {"held": sum(inside), "asked": len(inside)}


def true_comparison(trial: Trial, diagnosis: Diagnosis) -> Comparison:
    """The true model of a structure, fitted from its true values."""
    prepared = diagnosis.comparison.prepared
    model, start = trial.completed, trial.truth.numbers()
    fit = fit_part(model, prepared, (), start, steps=rough_steps(model, prepared, start))
    return compare(model, prepared, fit=finished(fit, prepared))


def error_of_truth(trial: Trial, prepared: Prepared, steps: int) -> float:
    """Held-out response error of the true model, fitted as any other, from the true values; NaN if it cannot be."""
    try:
        return predict(fit_part(trial.truth, prepared, (), steps=steps), prepared).error
    except StudyError:
        return math.nan


def fault_shown(trial: Trial, found: Sequence[str]) -> str:
    """Whether the record shows its fault, ``yes`` or ``no``: it was found, or is beside the true equation.

    Empty without a fault. What no search finds beside the very equation that made the record is too small for it.
    """
    imposed = trial.fault.get("fault", "")
    if not imposed or imposed in found:
        return "yes" if imposed else ""
    try:
        beside = compared(trial, trial.completed)
        seen = [fault.fault for fault in (beside.with_all_faults() if beside.put_off else beside).faults]
    except StudyError:
        seen = []
    return "yes" if imposed in seen else "no"


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
