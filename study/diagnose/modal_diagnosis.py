"""Which effect is missing between sensors where the linear part is a sum of modes, and where it sits.

Effects between sensors are screened by their lines (``modal_screening``), the most promising are fitted in free run
with modes of their own, and ranked, tied and believed as with masses and springs (``placed_ranking``).
"""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from study.compare.modal_comparison import ModalComparison
from study.compare.prediction import predict
from study.diagnose import ranked
from study.diagnose.credibility import credible
from study.diagnose.held_out import HeldOut, HeldOutTest
from study.diagnose.ranked import Ranked
from study.diagnose.ranking import in_order
from study.diagnose.verdict import MISSING, NOTHING, UNKNOWN
from study.equations import formulas
from study.equations.layout import LINEAR, check
from study.equations.model import Model, ModelTerm, free
from study.equations.place import GROUND, Place
from study.equations.term import Term
from study.equations.terms import LIBRARY, external, one_sided
from study.identify.frequency_domain.coefficient_spectra import CoefficientSpectrum, coefficient_spectra
from study.identify.frequency_domain.inputs import input_history, reverse_inputs
from study.identify.frequency_domain.modal_screening import screened_by_lines
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.modal_fit import with_modal_term
from study.identify.time_domain.part_fit import linearise, uncertainty
from study.identify.time_domain.shape_search import Screened
from study.identify.time_domain.weighted_fit import noise_left
from study.records.prepared import Prepared
from study.records.record import Record
from study.support import statistics
from study.support.arrays import Floats
from study.support.cores import cores
from study.support.errors import StudyError
from study.support.least_squares import length_or_one
from study.support.thresholds import ALPHA, ENOUGH, GOOD, TOLERANCE, UNSTEADY

FITTED = 8  # candidates that promise most: fitted in free run, with the best at each place


def between_sensors(model: Model, prepared: Prepared) -> tuple[Place, ...]:
    """Every place that the sensors show: each to the ground, and each two of them."""
    seen = [s.coordinate for s in prepared.sensors]
    pairs = [*((GROUND, c) for c in seen), *combinations(seen, 2)]
    known = {t.place.path: t.place for t in model.terms if t.place.kind == "between"}
    return tuple(known.get(frozenset(ends), Place("between", ends)) for ends in pairs)


def modal_entries(
    model: Model, prepared: Prepared, extra: Sequence[Term] = (), without: Sequence[str] = ()
) -> list[ModelTerm]:
    """Every nonlinear effect at every place that the sensors show and where the model does not have it.

    A force from outside is none: it is no property of a place.
    """
    known = {(t.term.name, t.place.path) for t in model.terms}
    effects = [t for t in (*LIBRARY.values(), *extra) if t.name not in (*LINEAR, *without)]
    found: list[ModelTerm] = []
    for term in (t for t in effects if not external(t) and not _linear(t)):
        for place in between_sensors(model, prepared):
            if term.angle and not prepared.record.rotations.issuperset(place.moving):
                continue
            if (term.name, place.path) not in known:
                found.append(free(term, place))
                if one_sided(term):
                    found.append(free(term, Place("between", place.ends[::-1])))
    return [entry for entry in found if _fits_in(model, entry)]


def _linear(term: Term) -> bool:
    """Whether twice the motion has twice the force, at any time: modes hold it already."""
    if any("t" in formulas.names(c.shape) for c in term.components) or term.channels:
        return False
    u, v = (np.random.default_rng(1).standard_normal(200).cumsum() for _ in range(2))
    model = Model("alone", (replace(free(term), parameters=(0.3,) * len(term.parameters)),))

    def forces(times: float) -> list[Floats]:
        motion = {"force": 0.0 * u, "displacement": times * u, "velocity": times * v}
        return [input_history(item, Record(0.1, motion)) for item in reverse_inputs(model)]

    return all(np.allclose(b, 2.0 * a) for a, b in zip(forces(1.0), forces(2.0), strict=True))


def _fits_in(model: Model, entry: ModelTerm) -> bool:
    try:
        check(model.with_term(entry))
    except StudyError:
        return False
    return True


@dataclass(frozen=True, eq=False)
class ModalRanked(Ranked):
    """One candidate with its coefficients line by line."""

    spectra: tuple[CoefficientSpectrum, ...] = ()  # none where they cannot be read

    @property
    def modes(self) -> int:
        """How many its fit has."""
        return self.fit.model.modal.count if self.fit.model.modal else 0

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
class ModalDiagnosis:
    """What is missing between the sensors."""

    verdict: str  # ``missing_effect``, ``nothing_missing`` or ``unknown_effect``
    comparison: ModalComparison
    candidates: tuple[ModalRanked, ...]  # best first
    asked: int  # effects times places
    left: float  # rms over that of the motion that stands above white noise beside the best explanation


def diagnose_modal(
    comparison: ModalComparison, extra: Sequence[Term] = (), without: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
) -> ModalDiagnosis:  # fmt: skip
    """Find the effect that a structure with a modal linear part lacks, and its place between sensors.

    ``extra`` are the user's own candidates, ``without`` terms of the library to leave out; ``progress`` is called with
    each candidate that was fitted.
    """
    model, prepared, fit = comparison.fit.model, comparison.prepared, comparison.fit
    entries = modal_entries(model, prepared, extra, without)
    ordered = screened_by_lines(model, prepared, entries, fit)

    def tried(item: Screened) -> ModalRanked | None:
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


def _shaped(comparison: ModalComparison) -> Model:
    """The model as it was given, shape parameters as they were fitted."""
    given = comparison.model
    shapes = {k for t in given.terms for k in t.keys[len(t.symbols) :]}
    return given.with_values({k: comparison.values[k] for k in shapes})


def _tried(item: Screened, comparison: ModalComparison) -> ModalRanked | None:
    prepared, before = comparison.prepared, comparison.prediction
    try:
        fit = with_modal_term(_shaped(comparison), item.entry, prepared)
    except StudyError:
        return None
    prediction = predict(fit, prepared)
    if prediction.diverged:
        return None
    covariance = uncertainty(fit, prepared, linearise(fit, prepared))
    coefficient, error, parameters, errors = ranked.amount(item.entry, fit.keys, fit.values, covariance)
    gain = statistics.gain(before.residual, prediction.residual)
    return ModalRanked(
        item.entry, fit, prediction, gain, 1.0, coefficient, error, parameters, errors, None, None,
        HeldOut(prediction.residual, np.zeros(0)), spectra=_spectra(fit, item, comparison),
    )  # fmt: skip


def _spectra(fit: FreeRunFit, item: Screened, comparison: ModalComparison) -> tuple[CoefficientSpectrum, ...]:
    """The candidate's coefficients line by line."""
    try:
        found = coefficient_spectra(fit, comparison.prepared)
    except StudyError:
        return ()
    return tuple(s for s in found if set(s.key.split(" + ")) & set(item.entry.symbols))


def _ranked(rows: list[ModalRanked], comparison: ModalComparison, asked: int) -> list[ModalRanked]:
    if not rows:
        return []
    best = min(rows, key=lambda r: float(r.residual @ r.residual))
    outputs = comparison.prepared.outputs
    noise = noise_left(best.fit.residual, len(outputs))
    white = {r.name: outputs.whitened(r.residual, noise) for r in rows}
    own, run = HeldOut(comparison.prediction.residual, np.zeros(0)), comparison.prediction.run
    columns = np.zeros((len(own.judged), 0)) if run is None else run.derivatives(comparison.fit)
    columns = outputs.whitened(columns, noise)
    bases = (np.linalg.qr(columns / length_or_one(columns))[0], np.zeros((0, 0)))
    test = HeldOutTest(outputs, noise, own, own.white(outputs, noise), bases, False)
    rows = [replace(r, p_value=min(1.0, asked * test.p_value(r.held_out, tuned=True))) for r in rows]
    return in_order(rows, white, asked)


def _decide(rows: list[ModalRanked], comparison: ModalComparison, asked: int) -> ModalDiagnosis:
    believed = [r for r in rows if credible(comparison.prediction, r.prediction, r.interval, r.p_value)]
    if not believed:
        left = comparison.prediction.above_noise
        verdict = UNKNOWN if left > TOLERANCE else NOTHING
        return ModalDiagnosis(verdict, comparison, tuple(rows), asked, left)
    first = believed[0]
    left = first.prediction.above_noise
    enough = (first.gain.explained >= ENOUGH or left <= GOOD) and not first.wanders(asked)
    ordered = (first, *(r for r in rows if r is not first))
    return ModalDiagnosis(MISSING if enough else UNKNOWN, comparison, ordered, asked, left)
