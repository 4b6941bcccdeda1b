"""Which effect is missing between sensors where the linear part is as measured, and where it sits.

Effects between sensors are screened by their lines (``measured_screening``), the most promising are fitted in free run
with modes of their own, and ranked, tied and believed as with masses and springs (``placed_ranking``).
"""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from study.compare.prediction import Prediction
from study.diagnose import ranked
from study.diagnose.credibility import credible
from study.diagnose.held_out import HeldOut, HeldOutTest
from study.diagnose.ranked import Ranked
from study.diagnose.ranking import in_order
from study.diagnose.verdict import MISSING, NOTHING, UNKNOWN
from study.equations.model import Model
from study.equations.term import Term
from study.identify.time_domain.weighted_fit import noise_left
from study.records import noise_floor
from study.structure.measured_comparison import MeasuredComparison
from study.structure.measured_fit import MeasuredFit, fit_with_term, modal_run
from study.structure.measured_prediction import predict_measured
from study.structure.measured_screening import Screened, measured_entries, screened_by_lines
from study.structure.measured_spectra import CoefficientSpectrum, coefficient_spectra
from study.support import statistics
from study.support.arrays import Floats
from study.support.cores import cores
from study.support.errors import StudyError
from study.support.least_squares import length_or_one
from study.support.thresholds import ALPHA, ENOUGH, GOOD, TOLERANCE, UNSTEADY, K

FITTED = 8  # candidates that promise most: fitted in free run, with the best at each place


@dataclass(frozen=True, eq=False)
class MeasuredRanked(Ranked):
    """One candidate with its coefficients line by line."""

    fit: MeasuredFit
    spectra: tuple[CoefficientSpectrum, ...] = ()  # none where they cannot be read

    def wanders(self, asked: int) -> bool:
        """Whether its coefficient, line by line, has an imaginary part or a trend as that of a true term has not."""
        for spectrum in self.spectra:
            mean = abs(spectrum.mean[0])
            for value, error in (spectrum.imaginary, spectrum.trend):
                chance = math.erfc(abs(value) / error / math.sqrt(2.0)) if error > 0.0 else 1.0
                if asked * chance < ALPHA and abs(value) > UNSTEADY * mean:
                    return True
        return False


@dataclass(frozen=True, eq=False)
class MeasuredDiagnosis:
    """What is missing between the sensors."""

    verdict: str  # ``missing_effect``, ``nothing_missing`` or ``unknown_effect``
    comparison: MeasuredComparison
    candidates: tuple[MeasuredRanked, ...]  # best first
    asked: int  # effects times places
    left: float  # rms over that of the motion that stands above white noise beside the best explanation


def diagnose_measured(
    comparison: MeasuredComparison, extra: Sequence[Term] = (), without: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
) -> MeasuredDiagnosis:  # fmt: skip
    """Find the effect that a structure with a measured linear part lacks, and its place between sensors.

    ``extra`` are the user's own candidates, ``without`` terms of the library to leave out; ``progress`` is called with
    each candidate that was fitted.
    """
    model, prepared, fit = comparison.fit.model, comparison.prepared, comparison.fit
    entries = measured_entries(model, prepared, extra, without)
    ordered = screened_by_lines(model, prepared, entries, fit.residual, fit.modal.modes)

    def tried(item: Screened) -> MeasuredRanked | None:
        row = _tried(item, comparison)
        if progress is not None:
            progress("")
        return row

    with ThreadPoolExecutor(cores()) as pool:
        rows = [r for r in pool.map(tried, _promising(ordered)) if r is not None]
    return _decide(_ranked(rows, comparison, len(entries)), comparison, len(entries))


def _promising(ordered: Sequence[Screened]) -> list[Screened]:
    """Those worth a fit in free run: the first of all, and of each place the first."""
    seen: set[frozenset[str]] = set()
    chosen: list[Screened] = []
    for rank, item in enumerate(ordered):
        path = item.entry.place.path if item.entry.place else frozenset[str]()
        if rank < FITTED or path not in seen:
            chosen.append(item)
        seen.add(path)
    return chosen


def _shaped(comparison: MeasuredComparison) -> Model:
    """The model as it was given, shape parameters as they were fitted."""
    given = comparison.model
    shapes = {k for t in given.terms for k in t.keys[len(t.symbols) :]}
    return given.with_values({k: comparison.fit.values[k] for k in shapes})


def _tried(item: Screened, comparison: MeasuredComparison) -> MeasuredRanked | None:
    prepared, before = comparison.prepared, comparison.prediction
    try:
        fit = fit_with_term(_shaped(comparison), item.entry, prepared)
        prediction = predict_measured(fit, prepared)
    except StudyError:
        return None
    estimates = np.array([fit.values[key] for key in fit.keys])
    coefficient, error, parameters, errors = ranked.amount(item.entry, fit.keys, estimates, fit.covariance)
    gain = statistics.gain(before.residual, prediction.residual)
    return MeasuredRanked(
        item.entry, fit, prediction, gain, 1.0, coefficient, error, parameters, errors, None, None,
        HeldOut(prediction.residual, np.zeros(0)), spectra=_spectra(fit, item, comparison),
    )  # fmt: skip


def _spectra(fit: MeasuredFit, item: Screened, comparison: MeasuredComparison) -> tuple[CoefficientSpectrum, ...]:
    """The candidate's coefficients line by line."""
    try:
        found = coefficient_spectra(fit, comparison.prepared)
    except StudyError:
        return ()
    return tuple(s for s in found if set(s.key.split(" + ")) & set(item.entry.symbols))


def _ranked(rows: list[MeasuredRanked], comparison: MeasuredComparison, asked: int) -> list[MeasuredRanked]:
    if not rows:
        return []
    best = min(rows, key=lambda r: float(r.residual @ r.residual))
    outputs = comparison.prepared.outputs
    noise = noise_left(outputs.stacked(best.fit.residual), len(outputs))

    white = {r.name: outputs.whitened(r.residual, noise) for r in rows}
    own = HeldOut(comparison.prediction.residual, np.zeros(0))
    columns = outputs.whitened(outputs.stacked(_derivatives(comparison)), noise)
    bases = (np.linalg.qr(columns / length_or_one(columns))[0], np.zeros((0, 0)))
    test = HeldOutTest(outputs, noise, own, own.white(outputs, noise), bases, False)
    rows = [replace(r, p_value=min(1.0, asked * test.p_value(r.held_out, tuned=True))) for r in rows]
    return in_order(rows, white, asked)


def _derivatives(comparison: MeasuredComparison) -> Floats:
    """Of the motions on the judging part by the keys of the fit and its initial state."""
    fit, prepared = comparison.fit, comparison.prepared
    begin = prepared.plan.fit[0] if prepared.plan.judge[0] == prepared.plan.fit[1] else prepared.plan.judge[0]
    span = (begin, prepared.plan.judge[1])
    run = modal_run(fit.model, fit.modal, prepared, prepared.sensors, fit.steps, span, fit.values, fit.keys)
    return run.respond(fit.values, fit.initial, run.states)[1][prepared.plan.judge[0] - begin :]


def _decide(rows: list[MeasuredRanked], comparison: MeasuredComparison, asked: int) -> MeasuredDiagnosis:
    believed = [r for r in rows if credible(comparison.prediction, r.prediction, r.interval, r.p_value)]
    if not believed:
        left = rms_above_noise(comparison.prediction)
        verdict = UNKNOWN if left > TOLERANCE else NOTHING
        return MeasuredDiagnosis(verdict, comparison, tuple(rows), asked, left)
    first = believed[0]
    left = rms_above_noise(first.prediction)
    enough = (first.gain.explained >= ENOUGH or left <= GOOD) and not first.wanders(asked)
    ordered = (first, *(r for r in rows if r is not first))
    return MeasuredDiagnosis(MISSING if enough else UNKNOWN, comparison, ordered, asked, left)


def rms_above_noise(prediction: Prediction) -> float:
    """Rms over that of the motion of what stands above white noise at any sensor, beyond chance; zero if nothing does.

    What no model could explain is white here; a mode that the fit has not is above it as well.
    """
    floors = [noise_floor.floor(x, prediction.prepared.dt) for x in prediction.misfit.T]
    excess = [max(f.excess, 0.0) / s**2 if f.significance > K else 0.0
              for f, s in zip(floors, prediction.size, strict=True)]  # fmt: skip
    return float(np.sqrt(np.mean(excess)))
