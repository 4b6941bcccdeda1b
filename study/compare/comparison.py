"""Compare a model with measured records: how good it is, and where it fails."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from study.compare.across_levels import Level, levels
from study.compare.along_time import AlongTime, along_time
from study.compare.bands import Band, bands
from study.compare.by_estimator import CHAOTIC, FREE_RUN, fit_by, has_lost
from study.compare.force_error import ForceError, force_error
from study.compare.growth import Growths, growths
from study.compare.local_force_error import local_force_error
from study.compare.missing_force import Restoring, restoring
from study.compare.noise import Noise, noise_of
from study.compare.prediction import Judged, judge
from study.equations.model import Model
from study.identify.frequency_domain.coefficients import Estimate
from study.identify.time_domain.fit_model import Coefficient, coefficients, fit_model
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.records.completion import complete
from study.records.plan import Plan, make_plan
from study.records.record import Record
from study.support.errors import StudyError

STEPS = 5  # reports of progress a record
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Comparison:
    """A model held against one record.

    Attributes
    ----------
    model : Model
        As it was given.
    record : Record
        With all three motions, in consistent units.
    how : Plan
        What was fitted and what is judged, in how many steps per sample.
    found : FreeRunFit
        The fit.
    coefficients : tuple of Coefficient
        Every value with its interval and unit.
    judged : Judged
        Measured and predicted response on the judging part.
    noise : Noise
        Noise floor of the response.
    force : ForceError
        The error in reverse.
    bands : tuple of Band
        Where in frequency most of the unexplained power of response and force lies.
    restoring : Restoring
        The force that the model lacks.
    growths : Growths or None
        What it grows with; None where nothing stands above the noise.
    time : AlongTime
        Whether the error changes along the record.
    notes : tuple of str
        What was converted, integrated or left out.
    estimator : str
        What found the coefficients.
    """

    model: Model
    record: Record
    how: Plan
    found: FreeRunFit
    coefficients: tuple[Coefficient, ...]
    judged: Judged
    noise: Noise
    force: ForceError
    bands: tuple[Band, ...]
    restoring: Restoring
    growths: Growths | None
    time: AlongTime
    notes: tuple[str, ...]
    estimator: str = FREE_RUN

    @property
    def response_error(self) -> float:
        """Rms of measured minus predicted response over the rms of the response."""
        return self.judged.error

    @property
    def noise_floor(self) -> float:
        """The part of that which no model could explain."""
        return self.noise.rms / self.judged.size

    @property
    def structure(self) -> float:
        """Rms of what stands above the noise over the rms of the response; zero if noise alone would leave as much."""
        return 0.0 if self.noise.alone else float(np.sqrt(self.noise.excess)) / self.judged.size

    @property
    def level(self) -> float:
        """Rms force of the fitting part."""
        return float(np.std(self.record["force"][slice(*self.how.fit)]))


def compare(
    model: Model,
    record: Record,
    how: Plan | None = None,
    *,
    cutoff: float | None = None,
    start: Mapping[str, float] | None = None,
    estimator: str = FREE_RUN,
    progress: Progress | None = None,
) -> Comparison:
    """Fit what a model leaves open to one part of a record and judge it on the other.

    Parameters
    ----------
    model : Model
        Values that it gives are held, the others fitted.
    record : Record
        Force and at least one motion.
    how : Plan, optional
        What is fitted and what is judged; :func:`plan.make_plan` if left out.
    cutoff : float, optional
        Frequency in hertz above which a measured velocity or acceleration is integrated; what lies below is
        not judged. Found from the record if left out.
    start : mapping of float, optional
        Values to begin the fit from, one for each that is fitted; searched for if left out.
    estimator : str
        What finds the coefficients: the fit in free run, or one of ``estimators``. With ``local_polynomial``
        the error of the force is free of leakage too.
    progress : callable, optional
        Called with what is being done, ``STEPS`` times.

    Raises
    ------
    StudyError
        If the model cannot be fitted to this record, or record and plan do not go together.
    """
    told: Progress = progress or (lambda _: None)
    how = how or make_plan(record)
    told("motions")
    completed = complete(record, cutoff)
    told("fit")
    known: Estimate | None = None
    notes = completed.says
    if estimator == FREE_RUN:
        found, how = fit_model(model, completed.record, how, start)
    else:
        found, how, known = fit_by(estimator, model, completed, how)
    if estimator == FREE_RUN and not model.held_keys and has_lost(found, completed, how):
        with suppress(StudyError):  # where pieces fail as well, the one free run is what there is
            found, how, known = fit_by(estimator, model, completed, how)
            notes = (*notes, CHAOTIC)
    told("free run")
    judged = judge(found, completed.record, how, completed.band[0])
    noise = noise_of(judged, completed.record, how.judge[1])
    told("force")
    in_reverse = local_force_error if estimator == "local_polynomial" else force_error
    force = in_reverse(found.model, completed, how, noise)
    told("where it fails")
    fitted = (*found.keys, *(known.symbols if known else ()))
    lacking = restoring(found.model, fitted, judged, noise, completed.record, how)
    return Comparison(
        model=model,
        record=completed.record,
        how=how,
        found=found,
        coefficients=coefficients(found, completed.record, how, known),
        judged=judged,
        noise=noise,
        force=force,
        bands=bands(noise, force, judged.low),
        restoring=lacking,
        growths=None if noise.alone else growths(lacking),
        time=along_time(judged),
        notes=notes,
        estimator=estimator,
    )


def lacking_with(found: Comparison, fit: FreeRunFit) -> Restoring:
    """The force that another model, fitted to the same part of the same record, lacks.

    Raises
    ------
    StudyError
        If the free run of that model leaves the range of finite numbers.
    """
    judged = judge(fit, found.record, found.how, found.judged.low)
    noise = noise_of(judged, found.record, found.how.judge[1])
    return restoring(fit.model, (), judged, noise, found.record, found.how)


def across(comparisons: Sequence[Comparison]) -> tuple[Level, ...]:
    """The coefficients of several records of one model by level of excitation; empty for one record.

    Raises
    ------
    StudyError
        If the records have different units.
    """
    if len(comparisons) < 2:
        return ()
    ordered = sorted(comparisons, key=lambda c: c.level)
    first = ordered[0].record
    for other in ordered[1:]:
        for channel in ("force", "displacement"):
            if other.record.units.get(channel) != first.units.get(channel):
                raise StudyError(
                    f"{channel} is in {first.units.get(channel)} in {first.name} and in "
                    f"{other.record.units.get(channel)} in {other.record.name}; the same unit in all records is right"
                )
    return levels([c.level for c in ordered], [c.coefficients for c in ordered])


def distinct(records: Sequence[Record]) -> tuple[Record, ...]:
    """Records whose names differ, so that tables and folders can be told apart."""
    names = [r.name for r in records]
    return tuple(
        r if names.count(r.name) == 1 else replace(r, name=f"{r.name}_{names[: i + 1].count(r.name)}")
        for i, r in enumerate(records)
    )
