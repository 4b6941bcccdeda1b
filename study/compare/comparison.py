"""Compare a model with measured records: how good it is, and where it fails."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from study.compare.across_levels import Level, across_levels
from study.compare.along_time import AlongTime, along_time
from study.compare.bands import Band, bands
from study.compare.by_estimator import FREE_RUN, fit_by
from study.compare.fitted_coefficients import Coefficient, coefficients
from study.compare.force_error import ForceError, force_error
from study.compare.growth import Growths, growths
from study.compare.local_force_error import local_force_error
from study.compare.minima import rivals_note
from study.compare.missing_force import MissingForce, missing_force
from study.compare.prediction import Prediction, predict
from study.equations.model import Model
from study.identify.frequency_domain.coefficients import Estimate
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.rivals import best_first, rivals
from study.identify.time_domain.weighted_fit import weighted
from study.records.plan import Plan
from study.records.prepared import Prepared
from study.records.record import Record
from study.records.record_layout import records_judged
from study.support.errors import StudyError

STEPS = 5  # reports of progress a record
Progress = Callable[[str], None]
CHAOTIC = (
    "the fitted system magnifies disturbances, as a chaotic one does: one free run would lose the measured motion "
    "however true the model, so it is fitted and judged in segments, each from a state of its own"
)


@dataclass(frozen=True)
class Comparison:
    """A model held against one record."""

    model: Model  # as it was given
    prepared: Prepared  # the record with all three motions in consistent units; what was fitted and what is judged
    fit: FreeRunFit
    coefficients: tuple[Coefficient, ...]  # every value with its interval and unit
    prediction: Prediction  # measured and predicted response on the judging part, error and noise floor
    force: ForceError  # the error in reverse
    bands: tuple[Band, ...]  # where in frequency most of the unexplained power of response and force lies
    missing_force: MissingForce  # the force that the model lacks
    growths: Growths | None  # what it grows with; None where nothing stands above the noise
    time: AlongTime  # whether the error changes along the record
    notes: tuple[str, ...]  # what was converted, integrated or left out
    estimator: str = FREE_RUN  # what found the coefficients

    @property
    def record(self) -> Record:
        """The record with all three motions in consistent units."""
        return self.prepared.record

    @property
    def plan(self) -> Plan:
        """What was fitted and what is judged."""
        return self.prepared.plan

    @property
    def spans(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """First sample of the parts to fit and to judge, and the one after the last, as the record was sampled."""
        plan = (self.prepared.as_sampled or self.prepared).plan
        return plan.fit, plan.judge

    @property
    def level(self) -> float:
        """Rms force of the fitting part."""
        return float(np.std(self.record["force"][slice(*self.plan.fit)]))


def compare(
    model: Model,
    prepared: Prepared,
    *,
    start: Mapping[str, float] | None = None,
    search: FreeRunFit | None = None,
    fit: FreeRunFit | None = None,
    estimator: str = FREE_RUN,
    progress: Progress | None = None,
) -> Comparison:
    """Fit what a model leaves open to one part of a record and judge it on the other.

    ``start`` holds values to begin the fit from, one for each that is fitted (searched for if left out), ``search``
    what ``fit_model`` gave where that was called already, ``fit`` the finished fit of a candidate. ``estimator`` finds
    the coefficients: the fit in free run, or one of ``study.identify.estimators``; with ``local_polynomial`` the error
    of the force is free of leakage too. ``progress`` is called with what is being done, ``STEPS`` times. A model that
    cannot be fitted raises a ``StudyError``.
    """
    if model.named:
        from study.structure.structure_comparison import compare_structure

        return compare_structure(model, prepared, fit, progress)
    report: Progress = progress or (lambda _: None)
    report("fit")
    known: Estimate | None = None
    if estimator != FREE_RUN:
        fit, known = fit_by(estimator, model, prepared)
    if fit is None:
        fit, *alike = best_first(search or fit_model(model, prepared, start), prepared)
        fit = weighted(fit, prepared)
    else:
        alike = rivals(fit, prepared)
    report("free run")
    prediction = predict(fit, prepared)
    keys = (*fit.keys, *(known.symbols if known else ()))
    judged = _judged(
        fit, keys, prediction, local_force_error if estimator == "local_polynomial" else force_error, report
    )
    said = [CHAOTIC if fit.restarts else None, rivals_note(fit, alike, prediction)]
    return Comparison(
        model=model, prepared=prepared, fit=fit, coefficients=coefficients(fit, prepared, known),
        notes=(*prepared.notes, *(note for note in said if note)), estimator=estimator, **judged,
    )  # fmt: skip


def _judged(
    fit: FreeRunFit, keys: Sequence[str], prediction: Prediction,
    in_reverse: Callable[[Model, Prediction], ForceError] = force_error, report: Progress = lambda _: None,
) -> dict[str, Any]:  # fmt: skip
    """The fields of a comparison that say how good a fit is on the judging part, and where it fails."""
    noise = prediction.of(0).noise
    report("force")
    force = in_reverse(fit.model, prediction)
    report("where it fails")
    lacking = missing_force(fit.model, keys, prediction)
    report("what it grows with")
    return {
        "prediction": prediction, "force": force, "bands": bands(noise, force, prediction.low),
        "missing_force": lacking, "growths": None if noise.alone else growths(lacking), "time": along_time(prediction),
    }  # fmt: skip


def on_each_record(comparison: Comparison) -> tuple[Comparison, ...]:
    """A comparison with several records that are fitted together, judged on each of them; none of one record.

    Fit and coefficients are those of all, the free run is the stretch of theirs along one record.
    """
    keys = [c.key for c in comparison.coefficients if not c.held]
    parts = records_judged(comparison.prepared)
    alone = [replace(comparison, prepared=p, **_judged(comparison.fit, keys, comparison.prediction.along(p)))
             for p in parts]  # fmt: skip
    return tuple(alone)


def across_records(comparisons: Sequence[Comparison]) -> tuple[Level, ...]:
    """The coefficients of several records by level, none of one record; a ``StudyError`` if the units differ."""
    if len(comparisons) < 2:
        return ()
    ordered = sorted(comparisons, key=lambda c: c.level)
    first = ordered[0].record
    for other in ordered[1:]:
        for channel in ("force", "displacement"):
            if other.record.units.get(channel) != first.units.get(channel):
                raise StudyError(
                    f"{channel} is in {first.units.get(channel)} in {first.name} and in "
                    f"{other.record.units.get(channel)} in {other.record.name}; expected the same unit in all records"
                )
    return across_levels([c.level for c in ordered], [c.coefficients for c in ordered])


def distinct(records: Sequence[Record]) -> tuple[Record, ...]:
    """Records whose names differ, so that tables and folders can be told apart."""
    names = [r.name for r in records]
    return tuple(
        r if names.count(r.name) == 1 else replace(r, name=f"{r.name}_{names[: i + 1].count(r.name)}")
        for i, r in enumerate(records)
    )
