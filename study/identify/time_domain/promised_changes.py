"""Which coefficients of a fitted model may change along its record: what the sensitivities of its free run promise.

A change along the record is seen by neither of two halves of it, so every other block is fitted. Four functions of
time, or of a further channel, are tried for each coefficient at once, at the cost of one free run.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import fdtrc

from study.equations.laid_variations import laid_entry
from study.equations.model import Model, ModelTerm, free
from study.equations.terms import external
from study.equations.variation import ALONG_TIME, Variation, varying
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, rough_steps, run_of
from study.identify.time_domain.shape_search import Baseline, baseline
from study.identify.time_domain.weighted_fit import noise_left
from study.records.prepared import FORCE, Prepared
from study.records.record import Record
from study.records.record_layout import in_turns
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares, length_or_one
from study.support.thresholds import ALPHA, NEARLY, PROMISING, TOLERANCE


@dataclass(frozen=True, eq=False)
class PromisedChanges:
    """What changes of coefficients could explain of what a fitted model leaves, no more than its sensitivities tell."""

    fit: FreeRunFit  # of the model as it is, where every other block is judged
    prepared: Prepared  # the record laid out so
    shares: dict[ModelTerm, float]  # of each curve that no chance explains as much with

    @property
    def most(self) -> float:
        return max(self.shares.values())

    @property
    def together(self) -> float:
        """The largest share of one coefficient, its two sides added: they act at other times."""
        sides: dict[tuple[str, str], dict[str, float]] = {}
        for entry, share in self.shares.items():
            if (variation := entry.term.variation) is not None:
                own = sides.setdefault((variation.of.name, entry.place.label), {})
                own[variation.side] = max(share, own.get(variation.side, 0.0))
        return max(max(own.get("", 0.0), sum(s for side, s in own.items() if side)) for own in sides.values())

    @property
    def alone(self) -> bool:
        """Whether a change explains so much that others are asked for beside it from the start."""
        return self.most > PROMISING


def promised_changes(fit: FreeRunFit, prepared: Prepared, of: Sequence[ModelTerm]) -> PromisedChanges | None:
    """What changes of the coefficients of some terms promise beside a fit; None where nothing says that any may change.

    ``fit`` is that of a model with these terms to the record, which is laid out anew where it is a single stretch.
    """
    entries = _curves(of, fit.model, prepared)
    if not entries or fit.restarts or fit.model.modal:
        return None
    try:
        turns = prepared if prepared.record.stretches else in_turns(prepared)
        rough = fit_part(fit.model, turns, fit.held, steps=rough_steps(fit.model, turns, {}))
        shares = _promised(entries, baseline(rough, turns), rough)
    except StudyError:
        return None
    size = float(np.std(turns.outputs.stacked(turns.outputs.measured(turns.record, rough.span))))
    seen = np.sqrt(max(shares.values(), default=0.0)) * rough.rms > TOLERANCE * size
    return PromisedChanges(rough, turns, shares) if seen else None


def _curves(of: Sequence[ModelTerm], model: Model, prepared: Prepared) -> list[ModelTerm]:
    """Curves of their coefficients along time and with every channel that changes; of one side too with channels."""
    channels = [c for c in prepared.record.extra if np.ptp(prepared.record[c]) > 0.0 and c.isidentifier()]
    with_time = () if prepared.free and _one_run(prepared.record) else (ALONG_TIME,)
    found = list[ModelTerm]()
    for entry in of:
        term = entry.term
        if term.variation or term.name == "inertia" or len(term.symbols) > 1 or term.effort or external(term):
            continue
        for along in (*with_time, *channels):
            for side in _sides(entry, along, prepared):
                try:
                    changing = varying(Variation(term, along, side=side))
                    found.append(laid_entry(free(changing, entry.place), prepared, 5, 5))
                except StudyError:  # a channel that formulas cannot name
                    continue
    return [e for e in found if e.name not in model and e.symbols]


def _one_run(record: Record) -> bool:
    """Whether a record is one measured without a gap: of a decay, amplitude falls with time, and each looks as both."""
    parts = sorted(record.stretches, key=lambda stretch: stretch.first)
    return all(a.source is b.source and a.last == b.first for a, b in pairwise(parts))


def _sides(entry: ModelTerm, along: str, prepared: Prepared) -> tuple[str, ...]:
    """The sides of the motion whose coefficients may change apart: with a channel, in a component test."""
    if along == ALONG_TIME or prepared.response != FORCE:
        return ("",)
    return ("", "u > 0", "u < 0") if "stiffness" in entry.term.name else ("", "v > 0", "v < 0")


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
