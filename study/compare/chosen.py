"""Coefficients by an estimator of the user's choice, judged in free run like any others.

The free run fit of ``study compare`` is unbiased under noise on the response and sees the motion as a whole.
What the reverse estimators find on the same part of the record can stand in its place: the report's own, one
without leakage, or one that allows for noise on the force.
"""

from collections.abc import Mapping

import numpy as np

from study import estimators, fitting
from study.compare.noise import segments_of
from study.errors import StudyError
from study.estimators.base import Settings
from study.fitting import Plan
from study.model import Model
from study.motion import CompletedRecord
from study.output_error import FreeRunFit, fit_free_run
from study.spectra import autospectrum

FREE_RUN = "output_error"
STEPS = 8  # per sample: no coefficient is fitted in free run, so that many cost little


def fit_by(
    name: str, model: Model, completed: CompletedRecord, how: Plan
) -> tuple[FreeRunFit, Plan, Mapping[str, float]]:
    """What an estimator finds on the fitting part, as a fit whose initial state alone was found in free run.

    Parameters
    ----------
    name : str
        Of the estimator.
    model : Model
        Shape parameters known, coefficients open.
    completed : CompletedRecord
        Record with all three motions.
    how : Plan
        What is fitted.

    Returns
    -------
    FreeRunFit, Plan, mapping of float
        The fit, the plan with its steps per sample, and the standard error of each coefficient.

    Raises
    ------
    StudyError
        If the model holds a coefficient, or the estimator does not find all of them.
    """
    held = [key for key in fitting.held_keys(model) if "." not in key]
    if held:
        raise StudyError(
            f"model {model.name!r} holds {', '.join(held)}; the estimator {name} finds every coefficient: leave them "
            f"open, or take {FREE_RUN}"
        )
    first, last = max(how.fit[0], completed.edge), min(how.fit[1], len(completed.record) - completed.edge)
    part = completed.record.part(first, last)
    cut = segments_of(len(part))
    frequency, density = autospectrum(part["force"], part.dt, cut)
    loud = frequency[(density > fitting.FAINT * np.max(density)) & (frequency <= completed.band[1])]
    band = max(completed.band[0], float(frequency[1])), float(loud[-1])
    estimate = estimators.identify(name, model, part, Settings(cut, band)).estimate
    missing = [key for key in model.values if "." not in key and (estimate is None or key not in estimate)]
    if estimate is None or missing:
        raise StudyError(
            f"the estimator {name} finds no {', '.join(missing)} in {part.name} from {band[0]:.3g} to "
            f"{band[1]:.3g} Hz; take {FREE_RUN} or another"
        )
    known = model.with_values({key: estimate[key] for key in estimate.symbols})
    how = fitting.with_steps(how, STEPS)
    run = fit_free_run(
        known, completed.record, held=tuple(known.values), response=how.response,
        steps_per_sample=STEPS, span=how.fit,
    )  # fmt: skip
    return run, how, {key: estimate.error(key) for key in estimate.symbols}
