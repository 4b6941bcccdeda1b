"""What a model holds at a value that its record contradicts, before an effect is called missing.

A spring constant of a data sheet, or the damping of another day, that is wrong by a tenth leaves an error that effects
of the library imitate: friction and a damping that grows with displacement stand for too little damping.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from study.compare.comparison import Comparison, compare
from study.compare.prediction import predict
from study.diagnose.candidates import Progress
from study.diagnose.ranked import Ranked
from study.diagnose.verdict import NOTHING, Diagnosis, Otherwise, diagnose
from study.equations.terms import Term
from study.identify.time_domain.part_fit import fit_part, run_and_slopes, uncertainty
from study.identify.time_domain.rivals import larger
from study.support import statistics
from study.support.errors import StudyError
from study.support.numbers import enumerated, percent
from study.support.thresholds import K

CONTRADICTED = "this record contradicts what the model holds"  # by which the note is known


def diagnose_with_values_let_go(
    comparison: Comparison,
    *,
    extra: Sequence[Term] = (),
    without: Sequence[str] = (),
    progress: Progress | None = None,
    otherwise: Otherwise | None = None,
) -> Diagnosis:
    """The diagnosis of :func:`study.diagnose.verdict.diagnose`, with values let go that stand for an effect it names.

    Values that the model holds are fitted where with these, in place of one of the effects of the best set, the model
    leaves no more. Those stay held that the fit then does not contradict. The diagnosis is that of the model with the
    others fitted, and its notes say so.
    """
    diagnosed = partial(diagnose, extra=extra, without=without, progress=progress, otherwise=otherwise)
    found = diagnosed(comparison)
    keys = held_coefficients(comparison)
    best = next(iter([*found.sets, *found.candidates]), None)
    if found.verdict == NOTHING or best is None or not keys or not _stand_in(keys, best, comparison):
        return found
    try:
        freed = diagnosed(_let_go(comparison, keys))
        wrong = contradicted(keys, freed, comparison)
        if not wrong:
            return found
        told = freed if len(wrong) == len(keys) else diagnosed(_let_go(comparison, tuple(wrong)))
    except StudyError:
        return found
    return saying_so(told, wrong, comparison)


def _let_go(comparison: Comparison, keys: Sequence[str]) -> Comparison:
    """The comparison with these values fitted."""
    return compare(comparison.model.with_values(dict.fromkeys(keys)), comparison.prepared)


def held_coefficients(comparison: Comparison) -> tuple[str, ...]:
    """Coefficients that the model holds and that the record tells of; of free decays ratios to the mass alone."""
    model = comparison.model
    if model.modal:
        return ()
    free = comparison.prepared.free
    told = {s for t in model.terms for s in t.symbols if not (free and t.term.name == "inertia")}
    return tuple(key for key in comparison.fit.held if key in told)


def _stand_in(keys: Sequence[str], best: Ranked, comparison: Comparison) -> bool:
    """Whether with these fitted, without one of the best effects, the model leaves no more than with all of them."""
    prepared, held = comparison.prepared, [key for key in comparison.fit.held if key not in keys]
    for name in best.names:
        fewer = best.fit.model.without_term(name)
        try:
            fit = fit_part(fewer, prepared, held, steps=best.fit.steps_per_sample)
            left = predict(fit, prepared).residual
        except StudyError:
            continue
        if statistics.worse(left, best.prediction.residual) < K and larger(comparison.prediction.residual, left):
            return True
    return False


def contradicted(
    keys: Sequence[str], freed: Diagnosis, comparison: Comparison
) -> dict[str, tuple[float, float]]:  # fmt: skip
    """Values, with standard errors, of those that are others than the model holds, beside what is missing."""
    fit, prepared = (freed.answer or freed.comparison).fit, freed.comparison.prepared
    errors = np.sqrt(np.diag(uncertainty(fit, prepared, *run_and_slopes(fit, prepared))))
    found = zip(fit.keys, fit.values.tolist(), errors.tolist(), strict=False)  # behind them those of initial states
    given = comparison.fit.model.numbers()  # what is held is as given
    return {key: (value, e) for key, value, e in found if key in keys and abs(value - given[key]) > K * e}


def saying_so(told: Diagnosis, wrong: Mapping[str, tuple[float, float]], comparison: Comparison) -> Diagnosis:
    """A diagnosis whose notes say which values were let go, and what was left with them."""
    held = {c.key: c for c in comparison.coefficients}
    each = [
        f"{key} is {value:.4g} +- {1.96 * error:.2g}{held[key].unit and f' {held[key].unit}'}, "
        f"not {held[key].value:.4g}"
        for key, (value, error) in wrong.items()
    ]
    left = percent(comparison.prediction.error)
    note = (
        f"{CONTRADICTED}: {enumerated(each)}; with that held {left} of the response is left (no value, or held: false, "
        "in the model file fits it)"
    )
    return replace(told, comparison=replace(told.comparison, notes=(*told.comparison.notes, note)))
