"""Coefficients by an estimator of the user's choice, judged in free run like any others.

The free run fit of ``study compare`` is unbiased under noise on the response and sees the motion as a whole.
What the reverse estimators find on the same part of the record can stand in its place: the report's own, one
without leakage, or one that allows for noise on the force.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from study.compare.noise import segments_of
from study.equations.model import Model
from study.identify import estimators
from study.identify.estimators.base import Settings
from study.identify.frequency_domain.coefficients import Estimate
from study.identify.frequency_domain.linear_start import FAINT
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part
from study.identify.time_domain.told_alone import is_alone, model_alone, prepared_alone, told_back
from study.records.prepared import Prepared
from study.records.record import Record
from study.records.spectra import Segments, cross_spectra
from study.support.errors import StudyError

FREE_RUN = "output_error"
RUN_STEPS = 8  # per sample: no coefficient is fitted in free run, so that many cost little
FOLLOWED, SMOOTHED = 0.5, 5  # coherence, over so many lines, up to the last of which the displacement is no noise


def fit_by(name: str, model: Model, prepared: Prepared) -> tuple[FreeRunFit, Estimate]:
    """What an estimator finds on the fitting part, as a fit whose initial state alone was found in free run.

    ``model`` leaves coefficients open, and shape parameters for estimators that find them. The fit has converged if the
    estimator's own search has; with it comes what the estimator found.

    Raises
    ------
    StudyError
        If the model holds what the estimator finds, or the estimator does not find all that is open.
    """
    if is_alone(model):
        alone = model_alone(model)
        fit, found = fit_by(name, alone, prepared_alone(prepared))
        named = dict(zip(alone.values, model.values, strict=True))
        return told_back(fit, model, prepared.outputs), replace(found, symbols=tuple(named[s] for s in found.symbols))
    held = [key for key in model.held_keys if "." not in key]
    if held:
        raise StudyError(
            f"model {model.name!r} holds {', '.join(held)}; the estimator {name} finds every coefficient: leave them "
            f"open, or take {FREE_RUN}"
        )
    part = prepared.record.part(*prepared.inner(prepared.plan.fit))
    cut = segments_of(len(part))
    band = followed_band(part, prepared.band, cut)
    identified = estimators.identify(name, model, part, Settings(cut, band))
    estimate = _together(identified.estimate, identified.shapes)
    missing = [key for key, value in model.values.items() if value is None and key not in estimate]
    if missing:
        raise StudyError(
            f"the estimator {name} finds no {', '.join(missing)} in {part.name} from {band[0]:.3g} to "
            f"{band[1]:.3g} Hz; take {FREE_RUN} or another"
        )
    given = [key for key in estimate.symbols if model.values[key] is not None]
    if given:
        raise StudyError(
            f"model {model.name!r} gives {', '.join(given)}; the estimator {name} finds that from the record: leave it "
            f"open, or take {FREE_RUN}"
        )
    known = model.with_values({key: estimate[key] for key in estimate.symbols})
    run = fit_part(known, prepared, tuple(known.values), steps=RUN_STEPS)
    return replace(run, converged=not identified.note, message=identified.note or run.message), estimate


def followed_band(part: Record, within: tuple[float, float], cut: Segments) -> tuple[float, float]:
    """The band in which the force is heard, up to where noise takes over from the displacement."""
    matrix = cross_spectra([part["force"], part["displacement"]], part.dt, cut)
    g, frequency = matrix.density, matrix.frequency
    force, motion = g[:, 0, 0].real, g[:, 1, 1].real
    loud = (force > FAINT * np.max(force)) & (frequency <= within[1])
    together = np.convolve(np.abs(g[:, 0, 1]) ** 2, np.ones(SMOOTHED), "same")
    coherence = together / np.maximum(np.convolve(force * motion, np.ones(SMOOTHED), "same"), np.finfo(float).tiny)
    followed = loud & (coherence > FOLLOWED)
    return max(within[0], float(frequency[1])), float(frequency[followed if np.any(followed) else loud][-1])


def _together(estimate: Estimate | None, shapes: Estimate | None) -> Estimate:
    """Coefficients and shape parameters, found apart from each other, as one estimate."""
    parts = [part for part in (estimate, shapes) if part is not None]
    if len(parts) == 1:
        return parts[0]
    return Estimate(
        tuple(symbol for part in parts for symbol in part.symbols),
        np.concatenate([part.values for part in parts]) if parts else np.zeros(0),
        np.asarray(block_diag(*(part.covariance for part in parts)), dtype=np.float64),
        min((part.freedom for part in parts), default=np.inf),
    )
