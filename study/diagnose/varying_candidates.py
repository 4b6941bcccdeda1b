"""Coefficients of the model that may vary, as candidates: which of them are worth a fit, and beside which others.

A change along the record is seen by neither of two halves of it: fitted to the first, a curve says nothing of the
second. So where the sensitivities of the fitted model promise that a coefficient changes, the record is laid out anew,
every other block judged, and all candidates are asked there, nonlinear ones as rivals.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from study.compare.comparison import Comparison, compare
from study.diagnose.candidates import PROMISING, FittedCandidate
from study.equations.laid_variations import laid_entry
from study.equations.model import Model, ModelTerm, free
from study.equations.terms import external
from study.equations.variation import ALONG_TIME, Shape, Variation, varying
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, rough_steps, run_of
from study.identify.time_domain.shape_search import Baseline, baseline
from study.identify.time_domain.weighted_fit import finished, noise_left
from study.records.prepared import FORCE, Prepared
from study.records.record_layout import in_turns
from study.support import statistics
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares, length_or_one
from study.support.thresholds import ALPHA, NEARLY, TOLERANCE, K


@dataclass(frozen=True, eq=False)
class Suspect:
    """Changes of coefficients that are worth a fit, and the comparison beside which they are asked for."""

    comparison: Comparison  # the same model, judged in every other block
    entries: list[ModelTerm]  # in each shape that is asked for


@dataclass(frozen=True, eq=False)
class Promise:
    """What changes of coefficients could explain of what a fitted model leaves, no more than its sensitivities tell."""

    comparison: Comparison
    fit: FreeRunFit  # of the model as it is, where every other block is judged
    prepared: Prepared  # the record laid out so
    shares: dict[ModelTerm, float]  # of each curve that no chance explains as much with

    @property
    def most(self) -> float:
        return max(self.shares.values(), default=0.0)

    @property
    def alone(self) -> bool:
        """Whether a change explains so much that others are asked for beside it from the start."""
        return self.most > PROMISING

    def beside(self, tried: Sequence[FittedCandidate]) -> bool:
        """Whether it explains as much as half of what the best of other effects does, as fitted to both parts."""
        left = np.concatenate([self.comparison.fit.residual, self.comparison.prediction.residual])
        power = float(np.mean(left**2))
        least = min((c.power for c in tried if not c.unphysical), default=power)
        return self.most > 0.0 and power > 0.0 and self.most >= 0.5 * (1.0 - least / power)

    def suspect(self) -> Suspect | None:
        """The changes that are worth a fit; None where the model does not follow the record laid out so."""
        comparison = self.comparison
        chosen = [entry for entry, share in self.shares.items() if share >= PROMISING * self.most]
        try:
            if self.prepared is not comparison.prepared:
                comparison = compare(comparison.model, self.prepared, fit=finished(self.fit, self.prepared))
            return Suspect(comparison, [shaped for entry in chosen for shaped in _shapes(entry, self.prepared)])
        except StudyError:
            return None


def promise(comparison: Comparison) -> Promise | None:
    """What changes of the model's coefficients promise; None where nothing says that any of them may change."""
    prepared, fit = comparison.prepared, comparison.fit
    entries = _curves(comparison.fit.model, prepared)
    if not entries or fit.restarts or fit.model.modal:
        return None
    try:
        turns = prepared if prepared.record.stretches else in_turns(prepared)
        rough = fit_part(fit.model, turns, fit.held, steps=rough_steps(fit.model, turns, {}))
        shares = _promised(entries, baseline(rough, turns), rough)
    except StudyError:
        return None
    most = max(shares.values(), default=0.0)
    seen = most > 0.0 and np.sqrt(most) * comparison.prediction.error > TOLERANCE
    return Promise(comparison, rough, turns, shares) if seen else None


def _curves(model: Model, prepared: Prepared) -> list[ModelTerm]:
    """Curves of every coefficient along time and with every channel that changes; of one side too with channels."""
    channels = [c for c in prepared.record.extra if np.ptp(prepared.record[c]) > 0.0 and c.isidentifier()]
    found = list[ModelTerm]()
    for entry in model.terms:
        term = entry.term
        if term.variation or term.name == "inertia" or len(term.symbols) > 1 or term.effort or external(term):
            continue
        for along in (ALONG_TIME, *channels):
            for side in _sides(entry, along, prepared):
                try:
                    changing = varying(Variation(term, along, side=side))
                    found.append(laid_entry(free(changing, entry.place), prepared, 5, 5))
                except StudyError:  # a channel that formulas cannot name
                    continue
    return [e for e in found if e.name not in model and e.symbols]


def _sides(entry: ModelTerm, along: str, prepared: Prepared) -> tuple[str, ...]:
    """The sides of the motion whose coefficients may change apart: with a channel, in a component test."""
    if along == ALONG_TIME or prepared.response != FORCE:
        return ("",)
    return ("", "u > 0", "u < 0") if "stiffness" in entry.term.name else ("", "v > 0", "v < 0")


def _shapes(entry: ModelTerm, prepared: Prepared) -> list[ModelTerm]:
    """A curve, and the simpler shapes that the same coefficient may change in."""
    variation = entry.term.variation
    if variation is None:
        return [entry]
    simpler: tuple[Shape, ...] = ("line", "step") if variation.along == ALONG_TIME else ("line",)
    others = [varying(replace(variation, shape=shape, knots=(), lasts=None)) for shape in simpler]
    return [entry, *(laid_entry(free(term, entry.place), prepared) for term in others)]


def _promised(entries: Sequence[ModelTerm], base: Baseline, fit: FreeRunFit) -> dict[ModelTerm, float]:
    """Share of what a model leaves that each change could explain, of those that no chance does."""
    model = fit.model
    for entry in entries:
        model = model.with_term(replace(entry, coefficients=(0.0,) * len(entry.symbols)))
    symbols = [symbol for entry in entries for symbol in entry.symbols]
    run = run_of(replace(fit, model=model), base.prepared, symbols)
    added = run.respond(dict.fromkeys(symbols, 0.0), fit.initial)[1]
    added = base.prepared.known(base.prepared.outputs.stacked(added), fit.span)
    added = added - base.basis @ (base.basis.T @ added)
    noise = noise_left(fit.residual, len(fit.outputs))
    white, left = fit.outputs.whitened(added, noise), fit.outputs.whitened(fit.residual, noise)
    columns, place = dict[ModelTerm, Floats](), 0
    for entry in entries:
        own = slice(place, place + len(entry.symbols))
        place += len(entry.symbols)
        seen = np.all(np.isfinite(added[:, own])) and np.any(added[:, own])
        if seen and _chance(white[:, own], left, len(fit.keys)) * len(entries) < ALPHA:
            columns[entry] = added[:, own]
    return {entry: _explained(columns[entry], fit.residual) for entry in _apart_or_alike(columns, fit.residual)}


def _apart_or_alike(columns: Mapping[ModelTerm, Floats], residual: Floats) -> list[ModelTerm]:
    """Changes without those of both sides where these are alike, and without those of all the motion where not."""
    kept = list[ModelTerm]()
    for entry in columns:
        variation = entry.term.variation
        group = [
            other for other in columns
            if other.place == entry.place and variation is not None and other.term.variation is not None
            and (other.term.variation.of, other.term.variation.along) == (variation.of, variation.along)
        ]  # fmt: skip
        whole = [other for other in group if other.term.variation is not None and not other.term.variation.side]
        sides = [other for other in group if other not in whole]
        if whole and sides:
            together = _explained(np.hstack([columns[other] for other in sides]), residual)
            alike = _explained(columns[whole[0]], residual) >= NEARLY * together
            group = whole if alike else sides
        kept += [entry] if entry in group else []
    return kept


def _explained(columns: Floats, residual: Floats) -> float:
    """Share of a residual that columns explain."""
    after = residual - columns @ least_squares(columns, residual, 1e-8)
    return 1.0 - float(after @ after) / max(float(residual @ residual), np.finfo(float).tiny)


def _chance(columns: Floats, residual: Floats, keys: int) -> float:
    """How probable it is that as many columns of noise explain as much of a white residual (F test)."""
    count = columns.shape[1]
    scaled = columns / length_or_one(columns)
    share = _explained(scaled, residual)
    freedom = max(len(residual) - count - keys, 1)
    ratio = share / count * freedom / max(1.0 - share, 1e-300)
    return float(np.asarray(fdtrc(count, freedom, ratio), dtype=np.float64))


def simplest(tried: Sequence[FittedCandidate]) -> list[FittedCandidate]:
    """Of the shapes in which one coefficient may change, the simplest that leaves no more than the best does."""
    groups: dict[tuple[object, ...], list[FittedCandidate]] = {}
    for candidate in tried:
        variation = candidate.term.variation
        if variation is not None:
            key = (variation.of.name, variation.along, variation.side, candidate.entry.place)
            groups.setdefault(key, []).append(candidate)
    found = list[FittedCandidate]()
    for group in groups.values():
        best = min(group, key=lambda c: c.prediction.error)
        level = [c for c in group if _level(c, best) and not any(_beaten(c, other) for other in group)]
        found.append(min(level, key=lambda c: c.unknowns))
    return found


def _beaten(one: FittedCandidate, other: FittedCandidate) -> bool:
    """Whether another with no more unknowns leaves less."""
    return other.unknowns <= one.unknowns and other.prediction.error < one.prediction.error


def _level(one: FittedCandidate, best: FittedCandidate) -> bool:
    """Whether a candidate leaves no more than the best, but for chance and the numbers' own error."""
    left, least = one.prediction.residual, best.prediction.residual
    apart = float(np.sqrt(np.mean((left - least) ** 2)))
    return apart <= np.hypot(one.numerical, best.numerical) or statistics.worse(left, least) < K
