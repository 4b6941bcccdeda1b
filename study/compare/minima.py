"""What is said where several minima of the sum of squares fit a record alike."""

from collections.abc import Sequence

from study.compare.fitted_coefficients import Coefficient, coefficients, found_by
from study.compare.prediction import Prediction, predict
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.rivals import larger
from study.support.numbers import percent

COUNTS = ("two", "three", "four", "five", "six")


def rivals_note(fit: FreeRunFit, rivals: Sequence[FreeRunFit], prediction: Prediction) -> str | None:
    """A sentence that names the values in which the minima differ, with the error of each; None where there is one.

    A rival that is significantly worse on the judging part fits the record less well, and is not named.
    """
    prepared = prediction.prepared
    foretold = [(rival, predict(rival, prepared)) for rival in rivals]
    alike = [(rival, p) for rival, p in foretold if not p.diverged and not larger(p.residual, prediction.residual)]
    if not alike:
        return None
    fits = (fit, *(rival for rival, _ in alike))
    own, *others = (coefficients(one.model, found_by(one, prepared), prepared.record) for one in fits)
    keys = {key for other in others for key in _differing(own, other)}
    errors = [prediction.error, *(p.error for _, p in alike)]
    told = [f"{_values(values, keys)} (error {percent(e)})" for values, e in zip((own, *others), errors, strict=True)]
    count = COUNTS[len(alike) - 1] if len(alike) <= len(COUNTS) else str(len(told))
    return (
        f"{count} minima fit this record alike: {'; '.join(told[:-1])}; and {told[-1]}. The first, which leaves least "
        "on the fitting part, is shown here; a longer record, or a value that is known and held, would decide"
    )


def _differing(one: Sequence[Coefficient], other: Sequence[Coefficient]) -> list[str]:
    """Coefficients of which neither interval holds the other's value; the one that moves most if there is none."""
    pairs = [(a, b) for a, b in zip(one, other, strict=True) if not a.held]
    apart = [a.key for a, b in pairs if not (_holds(a, b.value) or _holds(b, a.value))]
    return apart or [max(pairs, key=lambda p: abs(p[1].value - p[0].value) / ((p[0].error or 0.0) or 1.0))[0].key]


def _holds(coefficient: Coefficient, value: float) -> bool:
    low, high = coefficient.interval or (value, value)
    return low <= value <= high


def _values(row: Sequence[Coefficient], keys: set[str]) -> str:
    named = [f"{c.key} = {c.value:.4g} {c.unit}".rstrip() for c in row if c.key in keys]
    return named[0] if len(named) == 1 else f"{', '.join(named[:-1])} and {named[-1]}"
