"""Compare a model with measured records: how good it is, and where it fails."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from study.compare.along_time import AlongTime, along_time
from study.compare.bands import Band, bands
from study.compare.by_estimator import FREE_RUN, fit_by
from study.compare.dependence import FamilyGain, families, left_by
from study.compare.fitted_coefficients import Coefficient, Level, across_levels, coefficients, found_by, rivals_note
from study.compare.force_error import ForceError, Judge, force_error, force_errors, mean_share
from study.compare.growth import Growths, growths
from study.compare.local_force_error import local_force_error
from study.compare.missing_force import MissingForce, Unbalanced, unbalanced
from study.compare.prediction import Prediction, SensorPrediction, predict
from study.compare.unlike_records import unlike_in_words, unlike_records
from study.compare.varying_coefficients import VaryingCoefficient, varying_coefficients
from study.equations.equations_of_motion import loose_motions
from study.equations.linear_part import Modes, modes_of
from study.equations.model import Model
from study.equations.place import Place
from study.equations.terms import LINEAR
from study.identify.frequency_domain.coefficient_spectra import CoefficientSpectrum, coefficient_spectra
from study.identify.frequency_domain.coefficients import Estimate
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.multiple_shooting import is_chaotic
from study.identify.time_domain.rivals import best_first, rivals
from study.identify.time_domain.smoothness import smoothed
from study.identify.time_domain.step_moments import dated
from study.identify.time_domain.weighted_fit import weighted
from study.records.plan import Plan
from study.records.prepared import Prepared
from study.records.record import MOTIONS, Record, Sensor
from study.records.record_layout import records_judged
from study.support.errors import StudyError, expect

REPORTS = 5  # of progress on a record
Progress = Callable[[str], None]
Value = tuple[float, float, str]  # value, standard error (not a number where it was held), unit
CHAOTIC = (
    "the fitted system amplifies disturbances like a chaotic one: a single free run would lose the measured motion "
    "even with the true model, so it is fitted and judged in segments, each from its own state"
)

ASTRAY = (
    "no single free run of this model follows the motion, so it is fitted and judged in segments, each from a state of "
    "its own: a term is missing, or the channels are not what they seem"
)


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model held against one record."""

    model: Model  # as it was given
    prepared: Prepared  # the record with all motions in consistent units; what was fitted and what is judged
    fit: FreeRunFit
    found: Estimate  # what was fitted, with its covariance
    prediction: Prediction  # measured and predicted motions on the judging part, error and noise floor
    forces: tuple[ForceError, ...]  # the error in reverse, of each equation of motion that the sensors show
    bands: tuple[Band, ...]  # where in frequency most of the unexplained power of responses and force lies
    missing: Unbalanced  # what each equation of motion leaves
    missing_force: MissingForce  # the force that the model lacks where most is missing
    place: Place  # where that is
    growths: Growths | None  # what it grows with; None where nothing stands above the noise
    time: AlongTime  # whether the error of the sensor that is missed most changes along the record
    notes: tuple[str, ...]  # what was converted, integrated or left out
    estimator: str = FREE_RUN  # what found the coefficients

    @property
    def record(self) -> Record:
        """The record with all motions in consistent units."""
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
    def views(self) -> tuple[SensorPrediction, ...]:
        """What each sensor shows of the prediction; a single mass has one."""
        return self.prediction.views

    @property
    def worst(self) -> SensorPrediction:
        """What the sensor shows that is missed most."""
        return self.prediction.worst

    @cached_property
    def coefficients(self) -> tuple[Coefficient, ...]:
        """Every value with its interval and unit."""
        return coefficients(self.fit.model, self.found, self.record)

    @cached_property
    def varying(self) -> tuple[VaryingCoefficient, ...]:
        """Coefficients that vary along time or with a channel, with their bands."""
        count = len(self.fit.keys)
        return varying_coefficients(self.fit, self.found.covariance[:count, :count], self.prepared)

    @cached_property
    def modes(self) -> Modes:
        """Those of the linear part; none of a component."""
        return modes_of(self.fit.model, self.found.symbols, self.found.covariance)

    @cached_property
    def by_line(self) -> tuple[CoefficientSpectrum, ...]:
        """Coefficients beside a modal linear part line by line; none of another, nor where no line can be read."""
        try:
            return coefficient_spectra(self.fit, self.prepared) if self.model.modal else ()
        except StudyError:
            return ()

    @property
    def natural(self) -> tuple[Value | None, Value | None]:
        """Natural frequency and damping ratio of a single mass, (4.4) and (4.5); None without what they follow from."""
        modes, known = self.modes, "linear_damping" in self.model
        if not np.any(modes.frequency > 0.0):
            return None, None
        frequency, ratio = (
            (float(value[0]), float(error[0]) or math.nan, unit)
            for value, error, unit in (
                (modes.frequency, modes.frequency_error, "Hz"), (modes.damping, modes.damping_error, "")
            )
        )  # fmt: skip
        return frequency, ratio if known else None

    @property
    def force_error(self) -> float:
        """Share of the force's power that is unexplained, the mean of all equations; nan beside modes."""
        return mean_share([force.total for force in self.forces])

    @property
    def level(self) -> float:
        """Rms force of the fitting part."""
        return math.hypot(*(float(np.std(self.record[f][slice(*self.plan.fit)])) for f in self.record.forces))

    @cached_property
    def leftovers(self) -> tuple[FamilyGain, ...]:
        """What general shapes of the motion at each place explain of what is left, held out; asked for when shown."""
        return tuple(families(left_by(self.fit, self.prepared)))


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
    of the force is free of leakage too. ``progress`` is called with what is being done, ``REPORTS`` times. A model that
    cannot be fitted raises a ``StudyError``.
    """
    report: Progress = progress or (lambda _: None)
    expect(
        estimator == FREE_RUN or len(model.coordinates) == 1,
        f"--estimator {estimator} is for a single mass; expected {FREE_RUN} of a structure",
    )
    report("fit")
    known: Estimate | None = None
    if estimator != FREE_RUN:
        fit, known = fit_by(estimator, model, prepared)
    if fit is None:
        fit, alike = compared_fit(search or fit_model(model, prepared, start), prepared)
    else:
        alike = rivals(fit, prepared)
    report("free run")
    prediction = predict(fit, prepared)
    found = known or found_by(fit, prepared)
    keys = (*fit.keys, *(known.symbols if known else ()))
    judged = _judged(
        fit, keys, prediction, local_force_error if estimator == "local_polynomial" else force_error, report
    )
    unlike = unlike_in_words(unlike_records(fit, prepared), fit.model, prepared.record)
    said = [_why_in_segments(fit, prepared), rivals_note(fit, alike, prediction) or "", *_of_a_structure(fit), unlike,
            _ended_at(fit, prepared)]  # fmt: skip
    return Comparison(
        model=model, prepared=prepared, fit=fit, found=found, notes=(*prepared.notes, *filter(None, said)),
        estimator=estimator, **judged,
    )  # fmt: skip


def _ended_at(fit: FreeRunFit, prepared: Prepared) -> str:
    """Where the fit ended that began at a mode named by the user: a stronger one beside it may have drawn it away."""
    m, k = (fit.model.numbers().get(key, 0.0) for key in ("m", "k"))
    if not prepared.near or min(m, k) <= 0.0:
        return ""
    ended = math.sqrt(k / m) / (2.0 * math.pi)
    return f"the fit began at the mode near {prepared.near:g} Hz (--near) and ended at {ended:.4g} Hz"


def compared_fit(search: FreeRunFit, prepared: Prepared) -> tuple[FreeRunFit, list[FreeRunFit]]:
    """The finished fit from what ``fit_model`` gave, and its rivals."""
    fit, *alike = best_first(search, prepared)
    return smoothed(weighted(dated(fit, prepared), prepared), prepared), alike


def _why_in_segments(fit: FreeRunFit, prepared: Prepared) -> str:
    """Why a fit is one of segments; empty if it is none. A linear system is never chaotic."""
    if not fit.restarts:
        return ""
    linear = all(entry.term.name in LINEAR for entry in fit.model.terms)
    return CHAOTIC if not linear and is_chaotic(fit, prepared) else ASTRAY


def _of_a_structure(fit: FreeRunFit) -> list[str]:
    """What to say of several coordinates: motions that nothing ties down, values that the record does not show."""
    if not fit.model.named:
        return []
    loose = loose_motions(fit.model) if not (fit.model.prescribed or fit.model.modal) else 0
    drifts = f"nothing ties the structure down in {loose} of its motions: it may drift away as a whole"
    unclear = f"this record does not show, or cannot tell apart, {', '.join(fit.undecided)}"
    return [drifts if loose else "", unclear if fit.undecided else ""]


def _judged(
    fit: FreeRunFit, keys: Sequence[str], prediction: Prediction,
    in_reverse: Judge = force_error, report: Progress = lambda _: None,
) -> dict[str, Any]:  # fmt: skip
    """The fields of a comparison that say how good a fit is on the judging part, and where it fails."""
    views = prediction.views
    report("force")
    forces = force_errors(fit.model, prediction, in_reverse)
    report("where it fails")
    missing = unbalanced(fit.model, keys, prediction)
    place = next(iter(missing.shown), missing.aligned[0][0])
    lacking = missing.at(place)
    report("what it grows with")
    return {
        "prediction": prediction, "forces": forces, "bands": bands(views, forces), "missing": missing,
        "missing_force": lacking, "place": place,
        "growths": None if all(v.noise.alone for v in views) else growths(lacking),
        "time": along_time(prediction.worst),
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
        for channel in (*first.forces, *(str(Sensor(c, MOTIONS[0])) for c in first.coordinates)):
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
