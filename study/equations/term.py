"""What a term is: the forces of a physical effect, its shape parameters, and when it is physical."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

from study.equations import dimensions, formulas

if TYPE_CHECKING:
    from study.equations.variation import Variation


@dataclass(frozen=True)
class Component:
    """One coefficient's shape."""

    symbol: str  # name of the coefficient, such as ``k3``
    shape: str  # formula of the unit-coefficient shape g(u, v, t) or of the term's state z
    order: int = 0  # how often it is differentiated with respect to time: 0, 1 or (inertia alone) 2
    factor: float = 1.0  # a fixed number before it: Van der Pol's damping is c3/3 d/dt u^3


Places = Literal[
    "quantiles of |u|", "quantiles of u", "times of the motion", "per amplitude", "shares of the one before",
    "shares of the velocity", "lines of the modulation", "lines of the residual", "pitches of the residual",
    "quantiles of what it varies with", "numbers",
]  # fmt: skip


@dataclass(frozen=True)
class Search:
    """Where a shape parameter is looked for along the motion of a model that lacks the term.

    ``kind`` says what the places are: quantiles of a displacement; multiples of the time in which the motion turns by
    one radian, of one over its rms displacement, of its rms velocity, or of the parameter before; or distances, in
    lines of a spectrum, from where a stiffness that varies with time would explain most, or from the peaks of the
    residual over time or over the displacement. Of a plain number they are its values.
    """

    kind: Places
    places: tuple[float, ...]  # the points to try
    blunt: bool = False  # whether a place predicts poorly where a fit from it ends: then fits start all over the range


@dataclass(frozen=True)
class ShapeParameter:
    """A shape parameter, given or estimated."""

    name: str  # in formulas
    quantity: (
        str  # its unit: ``length``, ``frequency``, ``time``, ``velocity``, ``1/length``, ``number``, or a channel's
    )
    meaning: str  # to people
    search: Search  # where a fit looks for it
    # Range from which a trial draws it, in the units that rms displacement and rms velocity make up; of the parameter
    # before where its search is in shares of that.
    drawn: tuple[float, float]
    signed: bool = False  # whether it may be zero or negative; all others are above zero

    @property
    def relative(self) -> bool:
        """Whether it is searched and drawn as a share of the parameter before it."""
        return self.search.kind == "shares of the one before"


@dataclass(frozen=True)
class PhysicalBound:
    """What makes a term physical: a coefficient or shape parameter above a bound."""

    name: str  # of the coefficient or shape parameter
    reason: str  # as a clause
    over: str | None = None  # another one whose size is the bound; zero is, if left out
    reached: bool = False  # whether the bound itself will do
    enforced: bool = False  # whether no fit goes beyond it
    seldom: bool = False  # whether effects beyond it break no law, and are few

    def broken(self, values: Mapping[str, float]) -> str:
        """A sentence on values by name that break it; empty if they do not, or are not all known."""
        names = (self.name,) if self.over is None else (self.name, self.over)
        if not set(names) <= set(values):
            return ""
        value, bound = values[self.name], 0.0 if self.over is None else abs(values[self.over])
        if value > bound or (self.reached and value == bound):
            return ""
        return f"{' and '.join(f'{name} is {values[name]:g}' for name in names)}; {self.reason}"


@dataclass(frozen=True)
class Term:
    """A physical effect."""

    name: str  # as models and tables name it
    components: tuple[Component, ...]  # one for each coefficient (a periodic stiffness of any phase has two)
    formula: str  # for people: the force with a unit coefficient
    meaning: str  # the physics in a sentence
    cause: str  # where it commonly comes from
    parameters: tuple[ShapeParameter, ...] = ()
    state: str | None = None  # dz/dt for a term with a memory z of its own
    conditions: tuple[PhysicalBound, ...] = ()  # when it is physical, beside positive parameters without a sign
    # What the report gives in place of the coefficients: amplitude and phase of a cosine and a sine, or the negative of
    # a single one.
    reported: tuple[str, ...] = ()
    either_sign: bool = False  # as hardening and softening do: a trial then draws its sign
    placeless: bool = False  # whether it is the same wherever the system rests, but for another linear stiffness
    repeats: bool = (
        False  # whether its force is the same again some distance further on, so that it brings nothing back
    )
    angle: bool = False  # whether its displacement is an angle, in radians: it is no effect of a coordinate in metres
    variation: "Variation | None" = None  # where it is what the coefficients of another term change by

    @cached_property
    def symbols(self) -> tuple[str, ...]:
        return tuple(c.symbol for c in self.components)

    @property
    def heading(self) -> str:
        """Name as a user gives it with a formula: ``friction(vs)`` where that has a parameter ``vs``."""
        return f"{self.name}({', '.join(p.name for p in self.parameters)})" if self.parameters else self.name

    @property
    def effort(self) -> int:
        """How much a fit of it has to search for: shape parameters, and a memory."""
        return len(self.parameters) + (self.state is not None)

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Names of the coefficients, then of the shape parameters as ``term.parameter``."""
        return self.symbols + tuple(f"{self.name}.{p.name}" for p in self.parameters)

    @property
    def bounds(self) -> tuple[PhysicalBound, ...]:
        """Its conditions, and that parameters without a sign are above zero."""
        own = (
            PhysicalBound(p.name, f"the {p.meaning} is above zero", enforced=True)
            for p in self.parameters
            if not p.signed
        )
        return (*self.conditions, *own)

    @property
    def positive(self) -> tuple[str, ...]:
        """Keys that have no meaning at or below zero, where no fit goes."""
        enforced = {c.name for c in self.bounds if c.enforced}
        return tuple(key for key in self.keys if key.rpartition(".")[2] in enforced)

    def physical(self, values: Mapping[str, float | None], *, seldom: bool = True) -> str:
        """Why this is no physical effect with these values by key, in a sentence; empty if it is, or may be one.

        What breaks no law and is ``seldom`` met counts, unless told otherwise.
        """
        own = {key.rpartition(".")[2]: values.get(key) for key in self.keys}
        known = {name: value for name, value in own.items() if value is not None}
        bounds = (bound for bound in self.bounds if seldom or not bound.seldom)
        return next((sentence for bound in bounds if (sentence := bound.broken(known))), "")

    def as_reported(self, coefficients: Sequence[float]) -> tuple[float, ...]:
        """What the report gives in place of these coefficients, in the order of ``reported``: (4.9) and (4.10)."""
        if len(coefficients) == 1:
            return (-coefficients[0],)
        cosine, sine = coefficients
        return math.hypot(cosine, sine), math.atan2(0.0 - sine, cosine)  # 0 - 0, not -0

    @property
    def tuned(self) -> bool:
        """Whether a frequency or pitch is picked from the peaks of what is left, as many as the record shows."""
        return any(p.search.kind.startswith(("lines of", "pitches of")) for p in self.parameters)

    @property
    def steady(self) -> bool:
        """Whether nothing changes its force: it moves the system to another place of rest."""
        return not any(formulas.names(c.shape) for c in self.components)

    @property
    def written(self) -> tuple[tuple[str, ...], str]:
        """Coefficients and force as an equation has them; a change is a function of what it varies with."""
        if self.variation is None:
            return self.symbols, self.formula
        of, side = self.variation.of, self.variation.side
        changes = tuple(f"Δ{symbol}({self.variation.variable})" for symbol in of.symbols)
        return changes, f"{of.formula} where {side}" if side else of.formula

    @cached_property  # cached: a diagnosis prepares hundreds of runs
    def channels(self) -> tuple[str, ...]:
        """Measured channels that its formulas name, in alphabetical order.

        A channel is whatever is not u, v, t or pi, a parameter, or z where the term has a state of its own.
        """
        own = {*formulas.VARIABLES, *(p.name for p in self.parameters), *(("z",) if self.state else ())}
        texts = (*(c.shape for c in self.components), *((self.state,) if self.state else ()))
        return tuple(sorted({name for text in texts for name in formulas.names(text)} - own))

    def unit(self, symbol: str, force: str, length: str) -> str:
        """Unit of one coefficient for a record with these units of force and length."""
        if self.variation is not None:  # a change is in the unit of what changes
            of, place = self.variation.of, self.symbols.index(symbol) * len(self.variation.of.symbols)
            return of.unit(of.symbols[place // len(self.symbols)], force, length)
        component = next(c for c in self.components if c.symbol == symbol)
        known = {p.name: QUANTITIES[p.quantity] for p in self.parameters}
        known |= {"z": STATE_DIMENSIONS} if self.state else {}
        powers = dimensions.dimensions(component.shape, known)
        if powers is not None:
            powers = (powers[0], powers[1] - component.order)
        return dimensions.compose(force, length, powers)


OF_VARIATION = "of what it varies with"  # time, or a channel of any unit
QUANTITIES = {
    "length": dimensions.VARIABLE_DIMENSIONS["u"],
    "time": dimensions.VARIABLE_DIMENSIONS["t"],
    "frequency": (dimensions.DIMENSIONLESS[0], dimensions.DIMENSIONLESS[1] - 1),
    "velocity": dimensions.VARIABLE_DIMENSIONS["v"],
    "1/length": (dimensions.DIMENSIONLESS[0] - 1, dimensions.DIMENSIONLESS[1]),
    OF_VARIATION: dimensions.DIMENSIONLESS,
    "number": dimensions.DIMENSIONLESS,
}
STATE_DIMENSIONS = dimensions.VARIABLE_DIMENSIONS["u"]  # the states of the library are internal displacements
