"""A comparison with the faults of the measurement accounted for: compare, find, correct, compare again."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from study.compare.by_estimator import FREE_RUN
from study.compare.comparison import Comparison, compare
from study.equations.model import Model
from study.faults.correction import corrected
from study.faults.fault import Fault
from study.faults.imposed import FAULTS
from study.faults.search import first_faults, search
from study.identify.time_domain.fit_model import fit_model
from study.records.prepared import Prepared

__all__ = ["Accounted", "accounted", "corrected", "find_faults"]


@dataclass(frozen=True, eq=False)
class Accounted:
    """A comparison with the corrected record, and the faults that it is corrected for."""

    comparison: Comparison
    faults: tuple[Fault, ...]


def accounted(
    model: Model,
    prepared: Prepared,
    *,
    held: Mapping[str, float] | None = None,
    switched_off: Sequence[str] = (),
    estimator: str = FREE_RUN,
    progress: Callable[[str], None] | None = None,
) -> Accounted:
    """Compare a model with a record, the faults of the measurement accounted for.

    Parameters
    ----------
    model, prepared, estimator, progress
        As for :func:`study.compare.comparison.compare`.
    held : mapping of float
        Values of faults (of ``HOLDABLE``) that are known; they are corrected and not searched for.
    switched_off : sequence of str
        Faults that are not looked for.

    Returns
    -------
    Accounted
        A record without faults is compared as it is.

    Raises
    ------
    StudyError
        If the model cannot be fitted.
    """
    known = dict(held or {})
    asked = tuple(name for name in FAULTS if name not in switched_off and name not in known)
    faults = first_faults(prepared, known, asked)
    first = corrected(prepared, faults)
    fit = fit_model(model, first)
    found = search(prepared, fit, faults, asked) if asked else faults
    final = first if found == faults else corrected(prepared, found)
    same = final is first and estimator == FREE_RUN
    return Accounted(compare(model, final, fit=fit if same else None, estimator=estimator, progress=progress), found)


def find_faults(comparison: Comparison, switched_off: Sequence[str] = ()) -> tuple[Fault, ...]:
    """The faults of the measurement in a record that a model has been compared with."""
    asked = tuple(name for name in FAULTS if name not in switched_off)
    faults = first_faults(comparison.prepared, {}, asked)
    fit = comparison.fit if not any(f.corrected for f in faults) else fit_model(
        comparison.model, corrected(comparison.prepared, faults)
    )
    return search(comparison.prepared, fit, faults, asked)
