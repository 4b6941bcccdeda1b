"""Which sets of effects are worth a free run? Two answers, as each is blind where the other sees.

The sensitivities of a fitted model's free run know no noise, but that model lacks effects: they are asked anew beside
the best smaller set. The reverse system, where all terms are linear inputs, knows no side valleys, but noise on the
response biases it. In both a set is one small system of normal equations, and thousands cost no more than one free run.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.fft import rfft, rfftfreq

from study.diagnose.candidates import FittedCandidate, unknowns_of
from study.equations.model import Model, ModelTerm
from study.identify.frequency_domain.inputs import input_history, reverse_inputs, without_inertia
from study.identify.frequency_domain.linear_start import FAINT
from study.identify.time_domain.part_fit import with_states
from study.identify.time_domain.shape_search import CUTOFF, Baseline, sensitivities
from study.identify.time_domain.told_alone import is_alone, model_alone, prepared_alone
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares, length_or_one

BEAM = 200  # sets of a size from which those of the next are made
COLLINEAR = 1e-10  # of the squared length of a column: what others leave of it is rounding


@dataclass(frozen=True)
class SetStart:
    """A set of effects and where its fit begins."""

    names: frozenset[str]
    model: Model  # with all of them, every value given
    beside: FittedCandidate | None = None  # the smaller set whose states it begins with; None for the model's own


def best_subsets(
    columns: Mapping[str, Floats], target: Floats, sizes: Sequence[int]
) -> dict[int, list[frozenset[str]]]:
    """By size the sets whose columns explain most of a target, best first.

    Each is grown from one of the best with one effect less (a beam search: for two dozen effects the same as all sets).

    Parameters
    ----------
    columns : mapping of array, shape (n, any)
        What each effect could add, by name.
    target : array, shape (n,)
        What is to be explained.
    sizes : sequence of int
        Numbers of effects.
    """
    names = list(columns)
    design = np.hstack([columns[name] for name in names])
    design = design / length_or_one(design)
    gram, product = design.T @ design + COLLINEAR * np.eye(design.shape[1]), design.T @ target
    edges = np.cumsum([0, *(columns[name].shape[1] for name in names)])
    own = [range(a, b) for a, b in pairwise(edges)]
    beam: list[tuple[int, ...]] = [()]
    found: dict[int, list[frozenset[str]]] = {}
    for size in range(1, max(sizes) + 1):
        grown = {tuple(sorted((*chosen, i))) for chosen in beam for i in range(len(names)) if i not in chosen}
        explained: dict[tuple[int, ...], float] = {}
        places = {chosen: [column for i in chosen for column in own[i]] for chosen in grown}
        for width in {len(at) for at in places.values()}:  # sets with as many columns are solved together
            alike = [chosen for chosen, at in places.items() if len(at) == width]
            at = np.array([places[chosen] for chosen in alike])
            solved = np.linalg.solve(gram[at[:, :, None], at[:, None, :]], product[at][:, :, None])[:, :, 0]
            explained |= dict(zip(alike, np.sum(product[at] * solved, axis=1).tolist(), strict=True))
        beam = sorted(grown, key=lambda chosen: (-explained[chosen], chosen))[:BEAM]
        if size in sizes:
            found[size] = [frozenset(names[i] for i in chosen) for chosen in beam]
    return found


def by_sensitivities(
    parent: FittedCandidate | None, offered: Mapping[str, ModelTerm], base: Baseline, sizes: Sequence[int], most: int,
    *, moved: bool = False,
) -> dict[int, list[SetStart]]:  # fmt: skip
    """By size the sets that promise most by the sensitivities at a fitted set, or at the model itself (None).

    What the set has may go and come back; what is new begins at zero. ``offered`` are the effects with shape parameters
    at which each begins. Where most of a large set go, what stays is ``moved`` to where the sensitivities put it.
    """
    fit = base.fit if parent is None else parent.fit
    members = {} if parent is None else {name: _entry(fit.model, name) for name in parent.names}
    jacobian = with_states(fit, base.prepared)
    owned = {name: [i for i, key in enumerate(fit.keys) if key in entry.keys] for name, entry in members.items()}
    rest = sorted(set(range(jacobian.shape[1])) - {i for at in owned.values() for i in at})
    others = jacobian[:, rest]
    basis = np.linalg.qr(others / length_or_one(others))[0]

    def beyond(columns: Floats) -> Floats:
        return columns - basis @ (basis.T @ columns)

    columns = {name: beyond(jacobian[:, at]) for name, at in owned.items()}
    target = fit.residual.copy()
    amounts = {n: [fit.keys.index(s) for s in entry.symbols if s in fit.keys] for n, entry in members.items()}
    for at in amounts.values():
        target += jacobian[:, at] @ fit.values[at]
    here = replace(base, fit=fit, basis=basis)
    more = {name: entry for name, entry in offered.items() if name not in columns}
    points = [(entry, tuple(float(p or 0.0) for p in entry.parameters)) for entry in more.values()]
    found = zip(more, sensitivities(points, here), strict=True)
    columns |= {name: added for name, added in found if added is not None}
    known = fit.model.numbers()

    def started(names: frozenset[str]) -> SetStart:
        model = replace(base.fit.model, modal=fit.model.modal).with_values(known)
        for name in (n for n in offered if n in names):
            entry = members.get(name) or replace(offered[name], coefficients=(0.0,) * len(offered[name].symbols))
            model = model.with_term(entry)
        if moved:
            kept = [i for name in sorted(names) for i in amounts.get(name, [])]
            change = least_squares(jacobian[:, rest + kept], target, CUTOFF).tolist()
            own = {i: float(fit.values[i]) if i in rest else 0.0 for i in rest + kept if i < len(fit.keys)}
            put = dict(zip(rest + kept, change, strict=True))
            model = model.with_values({fit.keys[i]: value + put[i] for i, value in own.items()})
        return SetStart(names, model, parent)

    return _chosen(columns, beyond(target), sizes, most, offered, started)


def by_the_reverse_system(
    offered: Mapping[str, ModelTerm], base: Baseline, sizes: Sequence[int], most: int
) -> dict[int, list[SetStart]]:
    """By size the sets with coefficients, all of them anew, from the reverse system of a single mass; best first."""
    if base.several:
        return {}
    known, everything = base.fit.model, base.fit.model
    for entry in offered.values():
        everything = everything.with_term(entry)
    try:
        spectra, target = _spectra(everything, base)
    except StudyError:
        return {}
    free = [key for key in known.values if key in spectra and key in base.fit.keys]
    fixed = [key for key in known.values if key in spectra and key not in base.fit.keys]
    target = target - sum((float(known.values[k] or 0.0) * spectra[k] for k in fixed), np.zeros(len(target)))
    own = np.stack([spectra[key] for key in free], axis=1) if free else np.zeros((len(target), 0))  # all are held
    basis = np.linalg.qr(own / length_or_one(own))[0]
    columns: dict[str, Floats] = {}
    for name, entry in offered.items():
        if set(entry.symbols) <= set(spectra):
            column = np.stack([spectra[symbol] for symbol in entry.symbols], axis=1)
            columns[name] = column - basis @ (basis.T @ column)

    def started(names: frozenset[str]) -> SetStart:
        model, keys = known, list(free)
        for name in (n for n in offered if n in names):
            model, keys = model.with_term(offered[name]), [*keys, *offered[name].symbols]
        amounts = least_squares(np.stack([spectra[key] for key in keys], axis=1), target)
        return SetStart(names, model.with_values(dict(zip(keys, amounts.tolist(), strict=True))))

    return _chosen(columns, target - basis @ (basis.T @ target), sizes, most, offered, started)


def _chosen(
    columns: Mapping[str, Floats], target: Floats, sizes: Sequence[int], most: int, offered: Mapping[str, ModelTerm],
    started: Callable[[frozenset[str]], SetStart],
) -> dict[int, list[SetStart]]:  # fmt: skip
    """By size the sets that explain most, and half as many more of simple effects, which flexible ones imitate."""
    best = best_subsets(columns, target, sizes)
    simple = {name: column for name, column in columns.items() if unknowns_of(offered[name]) == 1}
    plain = best_subsets(simple, target, sizes) if 0 < len(simple) < len(columns) else {}
    return {
        size: [started(n) for n in dict.fromkeys([*best[size][:most], *plain.get(size, [])[: most // 2]])]
        for size in sizes
    }


def _entry(model: Model, name: str) -> ModelTerm:
    return next(entry for entry in model.terms if entry.name == name)


def _spectra(model: Model, base: Baseline) -> tuple[dict[str, Floats], Floats]:
    """Spectra of each coefficient's unit force, and of the measured force, as the response would show them.

    Real and imaginary parts of the lines that the force drives, one array a key; of stretches one after the other, as a
    free run begins anew in each. Weighted with the linear receptance, so that noise on the response weighs as it does
    in a free run.
    """
    alone, prepared = model_alone(model), prepared_alone(base.prepared) if is_alone(model) else base.prepared
    named = dict(zip(alone.values, model.values, strict=True))
    part, inputs = prepared.record.part(*prepared.inner(prepared.plan.fit)), reverse_inputs(alone)
    if prepared.free:  # its inertia force is what the others have to balance
        mass, inputs = float(alone.values["m"] or 1.0), without_inertia(inputs)
        part = part.with_channels({"force": -mass * part["acceleration"]})
    histories = [(item, np.asarray(input_history(item, part))) for item in inputs]
    columns: dict[str, list[Floats]] = {}
    target: list[Floats] = []
    for first, last in part.runs((0, len(part))):
        taper = np.hanning(last - first + 1)[:-1]
        tapered = taper * part["force"][first:last]
        if not np.any(tapered):  # between blows, or where one has just ended: no line is driven
            continue
        frequency = np.asarray(rfftfreq(last - first, part.dt))
        force = np.asarray(rfft(tapered))
        loud = np.abs(force) ** 2 > FAINT * np.max(np.abs(force) ** 2)
        keep = (frequency >= prepared.band[0]) & (frequency <= frequency[loud][-1])
        weight = base.paths(last - first)[keep, 0, 0]
        target.append(_real(force[keep] * weight))
        for item, history in histories:
            spectrum = np.asarray(rfft(taper * history[first:last]))[keep] * weight
            for k, power in zip(item.parts, item.powers(frequency[keep]).T, strict=True):
                columns.setdefault(named[k.symbol], []).append(_real(spectrum * power))
    if not any(map(len, target)):
        raise StudyError(f"no frequency that the force of {part.name!r} drives is one at which all motions are valid")
    return {key: np.concatenate(lines) for key, lines in columns.items()}, np.concatenate(target)


def _real(lines: Complexes) -> Floats:
    return np.concatenate([lines.real, lines.imag])
