"""A user's own term whose force is zero, or a combination of those of other terms in the model."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from study.equations import formulas
from study.equations.equations_of_motion import unit_force
from study.equations.graph import Graph
from study.equations.model import Model
from study.equations.terms import LIBRARY
from study.support.arrays import Floats

POINTS, FEWEST_FINITE = 512, 32  # random motions at which formulas are compared, and how many of them must be finite
NO_FORCE = 1e-150  # what is below counts as zero
UNACCOUNTED = 1e-10  # share of a formula that others leave, at most: rounding
TAKES_PART = 1e-6  # share of a formula that another accounts for, at least


def repeated_force(model: Model) -> str | None:
    """A sentence on the first own term that no record could tell from others, or that is zero; None if all are new.

    It is compared with terms whose coefficient is to be estimated. Terms with a shape parameter or a memory are left
    out, as their forces depend on values that are not known yet.
    """
    model = replace(model, terms=tuple(t for t in model.terms if t.term.variation is None))  # along time it is another
    if all(t.name in LIBRARY for t in model.terms):
        return None
    rng = np.random.default_rng(1990)
    variables = (*formulas.VARIABLES, *model.channels)
    shape = (POINTS, len(variables))
    data = rng.standard_normal(shape) * 10.0 ** rng.uniform(-6.0, 6.0, shape)  # a record's unit of length is unknown
    names, values = _forces(model, dict(zip(variables, data.T, strict=True)))
    size = np.max(np.abs(values), axis=0)
    for i in (i for i, name in enumerate(names) if name not in LIBRARY):
        if size[i] < NO_FORCE:
            return f"the force of {names[i]!r} is zero at every motion; expected a formula that changes with u, v or t"
        if parts := _made_of(model, names, values, i, evenly=True):
            return (
                f"the force of {names[i]!r} is no other than that of {_some(parts)}, which the model has "
                "already; no record can tell them apart, so leave one of them out"
            )
    return None


def repeated_along(model: Model, motion: Mapping[str, Floats], record: str) -> str | None:
    """The same of a record by its name: along the ``motion`` of it, by u, v, t and channels, shape (n,) each.

    Thirty sines are all other forces; along a small motion each is the sum of a few powers.
    """
    names, values = _forces(model, motion)
    for i in (i for i, name in enumerate(names) if name not in LIBRARY):
        if parts := _made_of(model, names, values, i, evenly=False):
            return (
                f"the formula of {names[i]!r} is along {record!r} a sum of {_some(parts)}, to the tenth digit; this "
                "record cannot tell them apart, so leave some of them out"
            )
    return None


def _some(names: Sequence[str]) -> str:
    """Names that fit into a sentence."""
    first, others = names[:3], len(names) - 3
    return " and ".join(names) if others <= 1 else f"{', '.join(first)} and {others} others"


def _forces(model: Model, motion: Mapping[str, Floats]) -> tuple[tuple[str, ...], Floats]:
    """Names of the terms, and their forces with unit coefficients along a motion, shape (points, components).

    Inertia, and terms with a shape parameter or a state of their own, are left out, and points at which one is not
    finite.
    """
    from study.equations import kernels  # compiled code is loaded only where a formula needs it

    graph = Graph()
    inputs = {name: graph.input(name) for name in (*formulas.VARIABLES, *model.channels)}
    terms = [t.term for t in model.terms if not t.term.parameters and t.term.state is None]
    pairs = [(term.name, c) for term in terms for c in term.components if c.order < 2]
    program = graph.program([unit_force(graph, c, inputs, None) for _, c in pairs])
    values = kernels.evaluate(program, {name: motion[name] for name in inputs}, len(motion["u"]))
    names, finite = tuple(name for name, _ in pairs), np.all(np.isfinite(values), axis=1)
    return names, values[finite] if np.count_nonzero(finite) >= FEWEST_FINITE else np.eye(len(names))


def _made_of(model: Model, names: Sequence[str], values: Floats, i: int, *, evenly: bool) -> list[str]:
    """Names of the terms whose forces make up that of term i, where its coefficient is to be estimated; none if new.

    ``evenly`` counts every motion alike, whatever its size: u + 1e-9 u^3 is not u.
    """
    held = {t.name for t in model.terms if None not in t.coefficients}
    size = np.max(np.abs(values), axis=0)
    if names[i] in held or size[i] < NO_FORCE:
        return []
    others = [j for j, name in enumerate(names) if name not in held and size[j] >= NO_FORCE and j != i]
    own = values[:, [i, *others]]
    if evenly:
        own = own / np.maximum(np.max(np.abs(own), axis=1), NO_FORCE)[:, None]
    shares = _shares(own[:, 0], own[:, 1:])
    found = [] if shares is None else [names[j] for j, share in zip(others, shares, strict=True) if share > TAKES_PART]
    return list(dict.fromkeys(found))


def _shares(wanted: Floats, others: Floats) -> Floats | None:
    """Largest share of each other formula in a wanted one; None if they do not make it up."""
    size: Floats = np.max(np.abs(others), axis=0)
    amounts = np.asarray(np.linalg.lstsq(others / size, wanted, rcond=1e-12)[0], dtype=np.float64)
    parts = amounts * others / size
    left = float(np.linalg.norm(wanted - np.sum(parts, axis=1)))
    largest = float(np.max(np.abs(wanted)))
    return np.max(np.abs(parts), axis=0) / largest if left < UNACCOUNTED * float(np.linalg.norm(wanted)) else None
