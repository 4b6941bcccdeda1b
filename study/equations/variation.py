"""Coefficients that vary: along time, or with a further channel of the record, beside what they are at its start.

What a coefficient changes by is a term of its own beside the one whose coefficient it is: the same shape, multiplied by
functions B_j of time or of the channel, ``force = (a + sum over j of b_j B_j(s)) g(u, v, t)``. It is linear in all of
its unknowns, so that simulation, sensitivities, fits, intervals and candidates are those of any other term.

- a ``curve`` is a natural cubic spline in B-splines over knots equally far apart (Eilers and Marx, 1996), constant
  beyond them; at the first knot the coefficient is that of the term beside it,
- a ``line`` is the curve of two knots,
- a ``step`` is a ramp that ``lasts`` a short while about ``step_at``, which a fit finds as any shape parameter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from study.equations import formulas
from study.equations.graph import Graph
from study.equations.term import OF_VARIATION, Component, Search, ShapeParameter, Term
from study.records.record import Record
from study.support.arrays import Floats
from study.support.errors import StudyError, expect

ALONG_TIME = "time"
Shape = Literal["curve", "line", "step"]
HOW: tuple[Shape, ...] = ("curve", "line", "step")
SIDES = {  # what part of the motion has the change, and what that is called in names
    "": "", "v > 0": "forward", "v < 0": "backward", "u > 0": "above", "u < 0": "below",
}  # fmt: skip
RATE_OF = {"u": "v", "u**3": "3*u**2*v", "u*abs(u)": "2*abs(u)*v"}  # of the shapes that a library term differentiates
STEP_AT = "step_at"
MOST_KNOTS = 40
ABOUT = tuple(np.linspace(0.04, 0.96, 24).tolist())  # quantiles where a step is looked for


@dataclass(frozen=True)
class Variation:
    """What a coefficient varies with, and how."""

    of: Term  # whose coefficients change
    along: str  # ``time``, or the name of a further channel
    shape: Shape = "curve"
    knots: tuple[float, ...] = ()  # of a curve or a line; none where they are yet to be laid along a record
    lasts: float | None = None  # of a step: how long it takes, in seconds or the channel's unit
    side: str = ""  # the part of the motion that has the change, a key of SIDES; empty for all of it

    @property
    def open(self) -> bool:
        """Whether what it varies over is yet to be seen from a record."""
        return self.lasts is None if self.shape == "step" else not self.knots

    @property
    def variable(self) -> str:
        """What formulas call it."""
        return "t" if self.along == ALONG_TIME else self.along

    def values(self, record: Record) -> Floats:
        """Time in seconds, or the channel, along a record, shape (n,).

        Raises
        ------
        StudyError
            If the record has no such channel.
        """
        known = f"it has {', '.join(record.extra) or 'none beside forces and motions'}, and 'time'"
        lacking = f"{record.name} has no channel {self.along!r}, with which {self.of.name} varies; {known}"
        expect(self.along == ALONG_TIME or self.along in record.extra, lacking)
        return record.time if self.along == ALONG_TIME else record[self.along]

    def basis(self, along: Floats, step_at: float = 0.0) -> Floats:
        """The functions B_j at values of what it varies with, shape (n, functions)."""
        from study.equations import kernels

        graph = Graph()
        known = {self.variable: graph.input(self.variable), STEP_AT: graph.input(STEP_AT)}
        nodes = [formulas.add_formula(graph, text, known) for text in self.functions]
        return kernels.evaluate(
            graph.program(nodes).with_inputs({STEP_AT: step_at}), {self.variable: along}, len(along)
        )

    @property
    def functions(self) -> tuple[str, ...]:
        """Formulas of the functions B_j: of all knots but the first."""
        if self.open:
            return ()
        if self.shape == "step":
            return (f"max(min(({self.variable} - {STEP_AT})/{float(self.lasts or 1.0)!r} + 0.5, 1), 0)",)
        first, last, count = float(self.knots[0]), float(self.knots[-1]), len(self.knots)
        return tuple(f"spline({self.variable}, {first!r}, {last!r}, {count}, {j})" for j in range(1, count))


def varying(variation: Variation) -> Term:
    """The term of what coefficients change by.

    Raises
    ------
    StudyError
        If it cannot vary so.
    """
    of, along = variation.of, variation.along
    owner = f"{of.name} that varies with {along}"
    expect(of.variation is None, f"{of.name} is a change itself; expected the effect whose coefficient changes")
    expect(of.name != "inertia", "inertia that varies is a mass that comes or goes; expected another effect to vary")
    taken = {*formulas.VARIABLES, "z", "pi", STEP_AT, *(p.name for p in of.parameters)}
    usable = along == ALONG_TIME or (along.isidentifier() and along.isascii() and along not in taken)
    expect(usable, f"{owner}: no formula can name {along!r}; expected 'time' or a channel of letters, digits and _")
    expect(variation.side in SIDES, f"{owner}: only {variation.side!r}; expected {', '.join(filter(None, SIDES))}")
    _check_knots(variation, owner)
    word = f"_{SIDES[variation.side]}" if variation.side else ""
    if variation.shape == "step":
        word += "_step"
    several = len(variation.functions) > 1
    components = [
        Component(
            f"{c.symbol}{word}_{along}{f'_{j}' if several else ''}",
            f"{function}*({_on_one_side(_force(c), variation.side)})", 0, c.factor,
        )
        for c in of.components
        for j, function in enumerate(variation.functions, start=2)
    ]  # fmt: skip
    with_what = "along time" if along == ALONG_TIME else f"with {along}"
    told = f" where {variation.side}" if variation.side else ""
    how = {"curve": "changes", "line": "changes evenly", "step": "changes at once"}[variation.shape]
    name = of.name.replace("_", " ")
    return Term(
        f"{of.name}{word}_over_{along}", tuple(components), f"({of.formula}) that {how} {with_what}{told}",
        f"{name} that {how} {with_what}{told}",
        "something settles, wears, warms up or loosens" if along == ALONG_TIME else f"whatever {along} stands for",
        (*of.parameters, *((_step_at(),) if variation.shape == "step" else ())), of.state,
        either_sign=True, placeless=of.placeless, angle=of.angle, variation=variation,
    )  # fmt: skip


def _check_knots(variation: Variation, owner: str) -> None:
    knots = np.array(variation.knots)
    if variation.shape == "step":
        expect(not len(knots), f"{owner} in a step has no knots; expected {STEP_AT!r}")
        lasts = variation.lasts
        expect(lasts is None or lasts > 0.0, f"{owner}: its step lasts {lasts}; expected a while above zero")
        return
    most = 2 if variation.shape == "line" else MOST_KNOTS
    wanted = f"expected 2{f' to {most}' if most > 2 else ''}"
    fits = len(knots) != 1 and len(knots) <= most
    expect(fits, f"{owner} has {len(knots)} knots; {wanted}, or none to have them laid along the record")
    apart = np.diff(knots)  # which a person may have rounded
    even = bool(np.all(apart > 0.0)) and float(np.ptp(apart)) <= 1e-3 * float(np.mean(apart)) if len(knots) else True
    listed = ", ".join(f"{k:g}" for k in variation.knots)
    expect(even, f"{owner}: its knots are {listed}; expected rising ones, equally far apart")


def _step_at() -> ShapeParameter:
    return ShapeParameter(
        STEP_AT, OF_VARIATION, "value at which it steps",
        Search("quantiles of what it varies with", ABOUT, blunt=True), (0.2, 0.8), signed=True,
    )  # fmt: skip


def _force(component: Component) -> str:
    """Formula of the force with a unit coefficient: what varies is multiplied with that, not with an integral of it."""
    if component.order == 0:
        return component.shape
    if component.shape not in RATE_OF:  # every entry of the library is there, and a user's own has no order
        raise StudyError(f"no formula is known of the rate of {component.shape}; expected one of {', '.join(RATE_OF)}")
    return RATE_OF[component.shape]


def _on_one_side(force: str, side: str) -> str:
    """The force where the motion is on one side, zero on the other.

    A force that jumps with the velocity stays linear in its sign, as what holds at rest lies between both.
    """
    if not side:
        return force
    of, sign = side[0], "+" if side[2] == ">" else "-"
    if f"sgn({of})" in force:
        return force.replace(f"sgn({of})", f"(0.5*(sgn({of}) {sign} 1))")
    if force == of:
        return f"{'max' if sign == '+' else 'min'}({of}, 0)"
    return f"0.5*(1 {sign} sgn({of}))*({force})"


def laid(term: Term, values: Floats, knots: int, lasts: float) -> Term:
    """A term of change over the values that what it varies with takes along a record.

    Parameters
    ----------
    term : Term
        Its variation is open.
    values : array, shape (n,)
        Of the time or the channel.
    knots : int
        Of a curve.
    lasts : float
        How long a step takes.

    Raises
    ------
    StudyError
        If the values are all the same.
    """
    variation = term.variation
    if variation is None or not variation.open:
        return term
    first, last = float(np.min(values)), float(np.max(values))
    along = variation.along
    expect(last > first, f"{along} is {first:g} all along the record; expected one that changes, for {term.name}")
    if variation.shape == "step":
        return varying(replace(variation, lasts=lasts))
    count = 2 if variation.shape == "line" else knots
    return varying(replace(variation, knots=tuple(np.linspace(first, last, count).tolist())))


def roughness(term: Term) -> Floats:
    """Second differences of what each coefficient changes by, as rows; shape (rows, components)."""
    variation = term.variation
    count = len(variation.knots) if variation is not None else 0
    if count < 3:
        return np.zeros((0, len(term.components)))
    one = np.diff(np.eye(count), 2, axis=0)[:, 1:]  # the change at the first knot is zero
    return np.asarray(np.kron(np.eye(len(term.components) // (count - 1)), one), dtype=np.float64)


def covered(variation: Variation, values: Floats) -> bool:
    """Whether knots reach over all of some values, but for a fiftieth of their range, as the ends of a record take."""
    if not variation.knots:
        return True
    slack = 0.02 * (variation.knots[-1] - variation.knots[0])
    within = variation.knots[0] - slack <= np.min(values) and np.max(values) <= variation.knots[-1] + slack
    return bool(within)


def changes_at(variation: Variation, amounts: Sequence[float]) -> tuple[float, ...]:
    """What one coefficient changes by at each knot, the first of which is zero; of a step, by how much."""
    return tuple(amounts) if variation.shape == "step" else (0.0, *amounts)
