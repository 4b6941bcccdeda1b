"""A user's own term whose force is zero, or a combination of those of other terms in the model."""

from dataclasses import replace

import numpy as np

from study.equations import formulas
from study.equations.equations_of_motion import unit_force
from study.equations.graph import Graph
from study.equations.model import Model
from study.equations.terms import LIBRARY
from study.support.arrays import Floats

POINTS, FEWEST = 512, 32  # random motions at which formulas are compared, and how many of them must be finite
NOTHING = 1e-150  # a force below counts as zero
SAME = 1e-10  # share of a formula that others do not account for, at most: rounding
TAKES_PART = 1e-6  # share of a formula that another accounts for, at least


def repeated_force(model: Model) -> str | None:
    """A sentence on the first own term that no record could tell from others, or that is zero; None if all are new.

    It is compared with terms whose coefficient is to be estimated. Terms with a shape parameter or a memory are left
    out, as their forces depend on values that are not known yet.
    """
    model = replace(model, terms=tuple(t for t in model.terms if t.term.variation is None))  # along time it is another
    if all(t.name in LIBRARY for t in model.terms):
        return None
    names, values = _forces(model)
    size = np.max(np.abs(values), axis=0)
    held = {t.name for t in model.terms if None not in t.coefficients}
    unknown = np.array([name not in held for name in names])
    for i in (i for i, name in enumerate(names) if name not in LIBRARY):
        if size[i] < NOTHING:
            return f"the force of {names[i]!r} is zero at every motion; expected a formula that changes with u, v or t"
        others = np.flatnonzero(unknown & (size >= NOTHING) & (np.arange(len(names)) != i))
        shares = _shares(values[:, i], values[:, others]) if unknown[i] else None
        if shares is not None:
            parts = dict.fromkeys(names[j] for j, share in zip(others, shares, strict=True) if share > TAKES_PART)
            return (
                f"the force of {names[i]!r} is no other than that of {' and '.join(parts)}, which the model has "
                "already; no record can tell them apart, so leave one of them out"
            )
    return None


def _forces(model: Model) -> tuple[tuple[str, ...], Floats]:
    """Names of the terms, and their forces with unit coefficients at random motions, shape (points, components).

    Inertia, and terms with a shape parameter or a state of their own, are left out.
    """
    from study.equations import kernels  # compiled code is loaded only where a formula needs it

    graph, variables = Graph(), (*formulas.VARIABLES, *model.channels)
    inputs = {name: graph.input(name) for name in variables}
    terms = [t.term for t in model.terms if not t.term.parameters and t.term.state is None]
    pairs = [(term.name, c) for term in terms for c in term.components if c.order < 2]
    program = graph.program([unit_force(graph, c, inputs, None) for _, c in pairs])
    rng = np.random.default_rng(1990)
    shape = (POINTS, len(variables))
    data = rng.standard_normal(shape) * 10.0 ** rng.uniform(-6.0, 6.0, shape)  # a record's unit of length is unknown
    values = kernels.evaluate(program, dict(zip(variables, data.T, strict=True)), POINTS)
    names, finite = tuple(name for name, _ in pairs), np.all(np.isfinite(values), axis=1)
    return names, values[finite] if np.count_nonzero(finite) >= FEWEST else np.eye(len(names))


def _shares(wanted: Floats, others: Floats) -> Floats | None:
    """Largest share of each other formula in a wanted one; None if they do not make it up.

    Every motion counts alike, whatever its size: u + 1e-9 u^3 is not u.
    """
    row = np.maximum(np.maximum(np.abs(wanted), np.max(np.abs(others), axis=1, initial=0.0)), NOTHING)
    rows, target = others / row[:, None], wanted / row
    size: Floats = np.max(np.abs(rows), axis=0)
    amounts = np.asarray(np.linalg.lstsq(rows / size, target, rcond=1e-12)[0], dtype=np.float64)
    parts = amounts * rows / size
    left = float(np.linalg.norm(target - np.sum(parts, axis=1)))
    return np.max(np.abs(parts), axis=0) if left < SAME * float(np.linalg.norm(target)) else None
