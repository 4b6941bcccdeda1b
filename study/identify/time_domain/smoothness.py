"""How smooth a coefficient's curve is: chosen from the record, by restricted maximum likelihood.

Second differences of what a coefficient changes by at its knots are rows beside the residual, weighted with a root of
``mu = lambda s^2``; the closed-form step of Fellner and Schall (Wood and Fasiolo, 2017) leads to the lambda at which
the record is most likely with the curve integrated out. Straight lines cost nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.equations.laid_variations import laid_entry
from study.equations.model import Model, ModelTerm, free
from study.equations.variation import MOST_KNOTS, Variation, roughness, varying
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part, linearise
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares, length_or_one


@dataclass(frozen=True)
class Smoothness:
    """What a smooth curve of a fit is made of."""

    entry: ModelTerm
    unknowns: float  # how many it takes effectively: 1 of a line, one less than knots without any penalty
    weight: float  # of its second differences beside the residual


def smoothed(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit with curves as smooth as the record asks for; itself where none has three knots or more."""
    curves = _curves(fit)
    if not curves or fit.restarts:
        return fit
    weights = np.zeros(len(curves))
    for _ in range(3):
        before, weights = weights, _weights(fit, linearise(fit, prepared), curves, weights)
        try:
            again = fit_part(
                fit.model, prepared, fit.held, steps=fit.steps_per_sample, initial=np.atleast_2d(fit.initial),
                noise=fit.noise, penalty=_rows(fit, curves, weights),
            )  # fmt: skip
        except StudyError:
            return fit
        fit = replace(again, elsewhere=fit.elsewhere)
        if np.all(np.abs(weights - before) <= 0.05 * weights):
            break
    return fit


def with_all_knots(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit with curves of as many knots as a model that leaves these open has, where a search took fewer."""
    model = fit.model
    for entry in _curves(fit):
        variation = entry.term.variation
        new = (
            None
            if variation is None
            else laid_entry(free(varying(replace(variation, knots=())), entry.place), prepared)
        )
        if variation is None or new is None or new.term.variation is None:
            continue
        if len(new.term.variation.knots) > len(variation.knots):
            model = with_curve(model, entry, new.term.variation)
    if model is fit.model:
        return fit
    held = [key for key in fit.held if key in model.values]
    begun = np.atleast_2d(fit.initial) if fit.span == prepared.plan.fit else None
    try:
        again = fit_part(model, prepared, held, steps=fit.steps_per_sample, initial=begun)
    except StudyError:
        return fit
    return replace(again, elsewhere=fit.elsewhere)


def with_curve(model: Model, entry: ModelTerm, other: Variation) -> Model:
    """A model in which a curve or a line goes through the same values on the knots of another."""
    variation, values = entry.term.variation, model.numbers()
    if variation is None:
        return model
    finer = free(varying(other), entry.place)
    through, each = variation.basis(np.array(other.knots[1:])), len(variation.knots) - 1
    amounts = np.array([values[symbol] for symbol in entry.symbols]).reshape(-1, each) @ through.T
    finer = finer.with_values(dict(zip(finer.symbols, amounts.ravel().tolist(), strict=True)))
    return replace(model, terms=tuple(finer if e is entry else e for e in model.terms))


def moved_by_finer_knots(fit: FreeRunFit, prepared: Prepared) -> tuple[Model, dict[str, float]]:
    """A model with twice as many knots to each curve, and by how much a step towards its minimum moves each estimate.

    What that moves is what the knots of the fit leave out: splines of so many knots come no nearer to the truth,
    however little noise there is. As smooth as the fit's own curves, by the integral of their squared second
    derivatives.
    """
    model, weights, before = fit.model, list[float](), smoothness(fit, prepared)
    for one in before:
        variation = one.entry.term.variation
        if variation is not None:
            count = min(2 * len(variation.knots) - 1, MOST_KNOTS)
            knots = np.linspace(variation.knots[0], variation.knots[-1], count).tolist()
            model = with_curve(model, one.entry, replace(variation, knots=tuple(knots)))
            weights.append(one.weight * ((count - 1) / (len(variation.knots) - 1)) ** 3)
    keys = tuple(key for key in model.values if key not in fit.held)
    numbers = model.numbers()
    finer = replace(fit, model=model, keys=keys, values=np.array([numbers[key] for key in keys]))
    rows = _rows(finer, _curves(finer), np.array(weights))
    try:
        columns = finer.whitened(linearise(finer, prepared))
    except StudyError:
        return fit.model, {}
    beside = np.zeros((len(rows), columns.shape[1]))
    beside[:, : len(keys)] = rows
    target = np.concatenate([finer.whitened(fit.residual), -rows @ finer.values])
    step = least_squares(np.vstack([columns, beside]), target, 1e-9)
    return model, dict(zip(keys, step.tolist(), strict=False))


def smoothness(fit: FreeRunFit, prepared: Prepared) -> tuple[Smoothness, ...]:
    """The curves of a fit, with how many unknowns each effectively takes."""
    curves = _curves(fit)
    if not curves:
        return ()
    jacobian = fit.whitened(linearise(fit, prepared))
    gram = jacobian.T @ jacobian
    penalty = np.zeros_like(gram)
    count = len(fit.keys)
    penalty[:count, :count] = fit.penalty.T @ fit.penalty
    scale = length_or_one(jacobian)
    whole, own = (m / np.outer(scale, scale) for m in (gram + penalty, gram))
    shares = np.diag(np.linalg.pinv(whole, hermitian=True) @ own)
    found = list[Smoothness]()
    for entry in curves:
        at = [fit.keys.index(symbol) for symbol in entry.symbols]
        rows, bend = fit.penalty[:, at], roughness(entry.term)
        weight = float(np.sum(rows**2) / np.sum(bend**2))
        found.append(Smoothness(entry, float(np.sum(shares[at])), weight))
    return tuple(found)


def _curves(fit: FreeRunFit) -> list[ModelTerm]:
    """Terms whose curves are fitted and can bend."""
    return [e for e in fit.model.terms if len(roughness(e.term)) and set(e.symbols) <= set(fit.keys)]


def _rows(fit: FreeRunFit, curves: Sequence[ModelTerm], weights: Floats) -> Floats:
    """Weighted second differences of all curves, shape (rows, keys)."""
    found = list[Floats]()
    for entry, weight in zip(curves, weights, strict=True):
        bend = roughness(entry.term)
        rows = np.zeros((len(bend), len(fit.keys)))
        rows[:, [fit.keys.index(symbol) for symbol in entry.symbols]] = np.sqrt(weight) * bend
        found.append(rows)
    return np.vstack(found)


def _weights(fit: FreeRunFit, jacobian: Floats, curves: Sequence[ModelTerm], weights: Floats) -> Floats:
    """Weights of the curves' second differences at which the record is most likely, the fit linearised."""
    columns, keys = fit.whitened(jacobian), len(fit.keys)
    residual = fit.whitened(fit.residual)
    target = residual + columns[:, :keys] @ fit.values
    others = columns[:, keys:]
    if others.shape[1]:
        basis = np.linalg.qr(others / length_or_one(others))[0]
        columns, target = (x - basis @ (basis.T @ x) for x in (columns[:, :keys], target))
    scale = length_or_one(columns)
    design = columns / scale
    gram, product, power = design.T @ design, design.T @ target, float(target @ target)
    freedom = max(len(target) - jacobian.shape[1], 1)
    each = [_rows(fit, [entry], np.ones(1)) / scale for entry in curves]
    bends = [rows.T @ rows for rows in each]
    ranks = [len(rows) for rows in each]
    # where they are not known yet they begin at what the record says of the curve itself
    size = [np.trace(gram @ bend) / max(float(np.trace(bend @ bend)), 1e-300) for bend in bends]
    weights = np.where(weights > 0.0, weights, 1e-3 * np.array(size))
    for _ in range(30):
        inverse = np.linalg.pinv(gram + sum(w * b for w, b in zip(weights, bends, strict=True)), hermitian=True)
        amounts = inverse @ product
        variance = max(power - 2.0 * float(amounts @ product) + float(amounts @ gram @ amounts), 0.0) / freedom
        taken = [rank - w * np.trace(inverse @ b) for rank, w, b in zip(ranks, weights, bends, strict=True)]
        rough = [float(amounts @ b @ amounts) for b in bends]
        moved = [variance * max(t, 0.0) / max(r, 1e-300) for t, r in zip(taken, rough, strict=True)]
        before, weights = weights, np.clip(moved, 1e-12 * np.array(size), 1e8 * np.array(size))
        if np.all(np.abs(weights - before) <= 0.05 * weights):
            break
    return weights
