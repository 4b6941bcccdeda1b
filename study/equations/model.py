"""A model: terms with their coefficients and shape parameters.

The equation of motion is ``sum over terms = F(t)``. A coefficient or shape parameter is a number, or
None where it is to be estimated. Models are immutable; ``with_term`` and ``with_values`` give new ones.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from study.equations import formulas
from study.equations.modal_part import ModalPart
from study.equations.place import ALONE, HERE, Place
from study.equations.term import Term
from study.support.errors import StudyError

if TYPE_CHECKING:
    from study.records.readers.roles import Roles


@dataclass(frozen=True)
class ModelTerm:
    """A term in a model, at a place; None stands for what is to be estimated."""

    term: Term
    coefficients: tuple[float | None, ...]  # one for each component, in the order of ``term.symbols``
    parameters: tuple[float | None, ...]  # one for each shape parameter
    place: Place = HERE
    starts: tuple[tuple[str, float], ...] = ()  # where a fit of what is open begins, by key

    @cached_property  # cached, as the others: a diagnosis asks for them a million times
    def name(self) -> str:
        """Name of the term, with its place if it has one: ``cubic_stiffness[floor2-floor3]``."""
        return self.term.name + self.place.suffix

    @property
    def effect(self) -> tuple[str, frozenset[str]]:
        """Which effect, and between which ends: the same for either side of a place."""
        return self.term.name, self.place.path

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of its coefficients: ``k3``, or ``k3[floor2-floor3]``."""
        return self.keys[: len(self.coefficients)]

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Names of its coefficients, then of its shape parameters as ``term.parameter``."""
        own = tuple(symbol + self.place.suffix for symbol in self.term.symbols)
        return own + tuple(f"{self.name}.{p.name}" for p in self.term.parameters)

    @property
    def positive(self) -> tuple[str, ...]:
        """Keys that have no meaning at or below zero; an inertia that couples may have either sign."""
        if self.term.name == "inertia" and self.place.kind == "couples":
            return ()
        own = dict(zip(self.term.keys, self.keys, strict=True))
        return tuple(own[key] for key in self.term.positive)

    @property
    def values(self) -> dict[str, float | None]:
        return dict(zip(self.keys, self.coefficients + self.parameters, strict=True))

    def with_values(self, values: Mapping[str, float | None]) -> "ModelTerm":
        """The same term with those of the given values that are its own."""
        numbers = tuple(values.get(key, old) for key, old in self.values.items())
        split = len(self.coefficients)
        return replace(self, coefficients=numbers[:split], parameters=numbers[split:])

    def opened(self, held: Collection[str] = ()) -> "ModelTerm":
        """The same term with its values as starts of a fit, but those of ``held`` keys."""
        starts = {**dict(self.starts), **{k: v for k, v in self.values.items() if v is not None and k not in held}}
        return replace(self.with_values(dict.fromkeys(starts)), starts=tuple(starts.items()))


def free(term: Term, place: Place = HERE) -> ModelTerm:
    """A term of which nothing is known yet."""
    return ModelTerm(term, (None,) * len(term.components), (None,) * len(term.parameters), place)


@dataclass(frozen=True)
class Model:
    """An equation of motion.

    Where the linear part is ``modal``, a sum of modes, the coordinates are those with sensors, the terms what acts
    between them beside it.
    """

    name: str  # in tables and messages
    terms: tuple[ModelTerm, ...]  # each at most once at each place
    coordinates: tuple[str, ...] = (ALONE,)  # where sensors, forces and terms are; a single mass's has no name
    forces: tuple[tuple[str, str], ...] = (("force", ALONE),)  # each measured one, and the coordinate on which it acts
    modal: ModalPart | None = None

    def __post_init__(self) -> None:
        names = [t.name for t in self.terms]
        for name in names:
            if names.count(name) > 1:
                raise StudyError(f"model {self.name!r} lists the term {name!r} twice; expected once")

    def __contains__(self, name: str) -> bool:
        return any(t.name == name for t in self.terms)

    @property
    def named(self) -> bool:
        """Whether its coordinates have names."""
        return self.coordinates != (ALONE,)

    @property
    def inertial(self) -> tuple[str, ...]:
        """The coordinates with inertia, which are degrees of freedom; the motion of others is prescribed."""
        at = {e.place.ends[0] for e in self.terms if e.term.name == "inertia" and e.place.kind == "at"}
        return tuple(c for c in self.coordinates if c in at)

    @property
    def prescribed(self) -> bool:
        """Whether nothing of it has inertia: it is a component, whose motion is prescribed and force predicted."""
        return not (self.modal or self.inertial)

    @property
    def values(self) -> dict[str, float | None]:
        """Every coefficient and shape parameter by key, then every number of its modes."""
        own = {key: value for t in self.terms for key, value in t.values.items()}
        return own | (self.modal.values if self.modal else {})

    def opened(self, held: Collection[str] = ()) -> "Model":
        """The same model with its values as starts of a fit, but those of ``held`` keys; modes keep theirs."""
        return self if self.modal else replace(self, terms=tuple(t.opened(held) for t in self.terms))

    @property
    def starts(self) -> dict[str, float]:
        """Where a fit of what is open begins, by key, as far as the model says so."""
        return {key: value for t in self.terms for key, value in t.starts if self.values[key] is None}

    @property
    def roles(self) -> "Roles":
        """What the columns of a record may be for it: its forces, and motions of its coordinates."""
        from study.records.readers.roles import Roles

        return Roles(self.coordinates, tuple(name for name, _ in self.forces))

    @property
    def held_keys(self) -> tuple[str, ...]:
        """The keys whose values the model gives: a fit holds them and estimates the rest."""
        return tuple(key for key, value in self.values.items() if value is not None)

    @property
    def states(self) -> tuple[ModelTerm, ...]:
        """The terms that carry a state of their own."""
        return tuple(t for t in self.terms if t.term.state is not None)

    @property
    def channels(self) -> tuple[str, ...]:
        """The measured channels that its formulas name, in alphabetical order."""
        return tuple(sorted({name for t in self.terms for name in t.term.channels}))

    def with_term(self, term: Term | ModelTerm) -> "Model":
        return replace(self, terms=(*self.terms, term if isinstance(term, ModelTerm) else free(term)))

    def without_term(self, name: str) -> "Model":
        return replace(self, terms=tuple(t for t in self.terms if t.name != name))

    def with_values(self, values: Mapping[str, float | None]) -> "Model":
        modal = self.modal.with_values(values) if self.modal else None
        return replace(self, terms=tuple(t.with_values(values) for t in self.terms), modal=modal)

    def equation(self) -> str:
        written = ((t.term.written, t.place.suffix) for t in self.terms)
        return " + ".join(f"{' , '.join(s + at for s in own)} [{force}]" for (own, force), at in written) + " = F(t)"

    def numbers(self) -> dict[str, float]:
        """Every value; all must be known, and the mass of a single coordinate positive."""
        check_modes(self)
        known = {key: value for key, value in (self.values | self.starts).items() if value is not None}
        missing = [key for key in self.values if key not in known]
        if missing:
            raise StudyError(f"model {self.name!r} gives no value for {', '.join(missing)}; a simulation needs all")
        if not self.named and "m" in known and not known["m"] > 0.0:
            raise StudyError(f"model {self.name!r} has the mass {known.get('m', 0.0):g}; it must be above zero")
        return known


def check_modes(model: Model) -> None:
    """Refuse a model whose linear part is modes that no record has been asked for yet."""
    if model.modal and not model.modal.count:
        raise StudyError(f"model {model.name!r} has 'linear: modal' and no modes yet; expected it fitted to a record")


def named_channels(model: Model, available: Collection[str]) -> tuple[str, ...]:
    """The channels that the formulas of a model name; refuses those that are not available."""
    for entry in model.terms:
        for name in entry.term.channels:
            if name not in available:
                known = ", ".join(sorted({*formulas.VARIABLES, *available}))
                raise formulas.ExpressionError(
                    f"the formula of {entry.name!r} names {name!r}; it may name {known} and pi, and parameters behind "
                    f"its name, as in '{entry.term.name}({name})', which are fitted"
                )
    return model.channels
