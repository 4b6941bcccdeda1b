"""Physical effects that a record asks for beside a model: what a fault has to prove itself against."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from study.equations.model import ModelTerm, free
from study.equations.terms import LIBRARY, Term
from study.faults.leftover import FittedResidual, leaves_less, leftover, share
from study.identify.time_domain import shape_search
from study.identify.time_domain.fit_model import fit_model, with_term
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, run_of
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.cores import side_by_side
from study.support.errors import StudyError
from study.support.statistics import worse

PERIODS, SHORT, LONG = 100.0, 2048, 8192  # of the motion in a search, and in samples no fewer and no more than these
FITTED = 3  # effects of the largest linear share that are fitted
CHANCE = 2.0  # standard errors by which one effect may leave more than another and be as good
RUNS = 20  # free runs of such a fit


def asks_for_more(left: FittedResidual) -> bool:
    """Whether any effect of the library explains a part of what is left, as far as small amounts of it show.

    One free run with the sensitivities of all effects without shape parameters.
    """
    columns = _sensitivities(left)
    if columns is None:
        return True
    found = [share(left, (columns[0][:, [i]], columns[1][:, [i]])) for i in range(columns[0].shape[1])]
    return any(f is not None and f.significant(len(found)) for f in found)


def missing(left: FittedResidual) -> FittedResidual | None:
    """What is left beside the effect that explains most; None if none explains any of it.

    One outside of what makes it physical, which is another effect or a fault in disguise, only where no other does.
    """
    prepared, fit = left.prepared, left.fit
    look = prepared.shortened(int(np.clip(prepared.samples_in(PERIODS), SHORT, LONG)))
    terms = [t for t in LIBRARY.values() if t.name not in fit.model and t.name != "inertia"]
    try:
        near = fit if look is prepared else fit_part(fit.model, look, fit.held, steps=fit.steps_per_sample)
        base = shape_search.baseline(near, look)
    except StudyError:
        return None

    def begun(term: Term) -> list[shape_search.Start]:
        return shape_search.shape_starts(term, base, look)

    def fitted(start: tuple[Term, list[shape_search.Start]]) -> FittedResidual | None:
        return _fitted(start[0], base, look, prepared)

    begins = side_by_side(begun, terms, lambda term: term.effort)
    starts = [(term, found) for term, found in zip(terms, begins, strict=True) if found]
    promising = sorted(starts, key=lambda s: -s[1][0].share)[:FITTED]
    tried = [t for t in side_by_side(fitted, promising, lambda s: s[0].effort) if t is not None]
    names = [t.name for t in terms]
    for group in ([t for t in tried if not unphysical(t.fit, names)], tried):
        best = _simplest_of_the_best(group)
        if best is not None and leaves_less(left, best, len(terms)):
            return best
    return None


def unphysical(fit: FreeRunFit, names: Sequence[str]) -> bool:
    """Whether any of these effects is fitted outside of what makes it physical."""
    return any(e.term.physical(fit.model.values) for e in fit.model.terms if e.name in names)


def _simplest_of_the_best(tried: Sequence[FittedResidual]) -> FittedResidual | None:
    """Of those that are not worse than the best by what chance makes of it, the one with the fewest unknowns."""
    best = min(tried, key=lambda t: float(np.sum(t.residual[1] ** 2)), default=None)
    if best is None:
        return None
    level = [t for t in tried if t is best or worse(t.residual[1], best.residual[1]) < CHANCE]
    return min(level, key=lambda t: (len(t.fit.keys), t is not best))


def refitted(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit | None:
    """A fit again, on a record that was corrected, from where it stands; None where that is no single free run."""
    if fit.restarts:
        return None
    initial = np.atleast_2d(fit.initial) if fit.first == prepared.plan.fit[0] else None
    try:
        return fit_part(fit.model, prepared, fit.held, steps=fit.steps_per_sample, initial=initial)
    except StudyError:
        return None


def on_all(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """A fit to a record with other samples of the same motion, from the values where it stands."""
    values = fit.model.numbers()
    again = fit_model(fit.model.with_values(dict.fromkeys(fit.keys)), prepared, {key: values[key] for key in fit.keys})
    return replace(again, elsewhere=())


def without_effect(fit: FreeRunFit, name: str, prepared: Prepared) -> FreeRunFit | None:
    """The model without one of its effects, fitted again; None where that does not run."""
    model = fit.model.without_term(name)
    held = [key for key in fit.held if key in model.values]
    states = np.atleast_2d(fit.initial)
    own = next(entry for entry in fit.model.terms if entry.name == name).term.state is not None
    try:
        return fit_part(
            model, prepared, held, steps=fit.steps_per_sample, initial=None if own else states
        )  # fmt: skip
    except StudyError:
        return None


def _fitted(term: Term, base: shape_search.Baseline, look: Prepared, prepared: Prepared) -> FittedResidual | None:
    """What the model with an effect leaves, fitted as any candidate is; None where it does not run."""
    try:
        near = with_term(base.fit, free(term), base, look)
        initial = np.atleast_2d(near.initial)[:1] if near.first == prepared.plan.fit[0] else None
        fit = fit_part(
            near.model, prepared, base.fit.held, steps=near.steps_per_sample, max_iterations=RUNS, initial=initial
        )
    except StudyError:
        return None
    return leftover(fit, prepared)


def _sensitivities(left: FittedResidual) -> tuple[Floats, Floats] | None:
    """What small amounts of plain effects add to the response on both parts; None where that run fails."""
    fit, model, keys = left.fit, left.fit.model, list[str]()
    run = left.prediction.run
    for term in LIBRARY.values():
        if term.name not in model and not term.parameters and term.name != "inertia":
            model = model.with_term(ModelTerm(term, (0.0,) * len(term.components), ()))
            keys += term.symbols
    if run is None or not keys:
        return None
    extended = replace(fit, model=model, keys=tuple(keys), values=np.zeros(len(keys)))
    try:
        fitted = run_of(extended, left.prepared, keys).respond(dict.fromkeys(keys, 0.0), fit.initial, 0)[1][:, 0]
        judged = run.derivatives(extended)[:, : len(keys)]
    except StudyError:
        return None
    if not (np.all(np.isfinite(fitted)) and np.all(np.isfinite(judged))):
        return None
    return fitted, judged
