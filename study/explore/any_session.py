"""What the desk asks of a session, whether of one coordinate or of a structure."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Protocol, TypeVar

from study.equations.model import Model
from study.support.errors import StudyError, expect


class AnyStage(Protocol):
    """A model of a session, of one coordinate or of a structure."""

    @property
    def model(self) -> Model:
        """Values that it gives are held."""
        ...

    @property
    def label(self) -> str:
        """What was done to arrive at it."""
        ...

    @property
    def values(self) -> dict[str, float]:
        """Every value as fitted or held."""
        ...

    @property
    def diagnosis(self) -> object | None:
        """None as long as nobody has asked."""
        ...


class AnyPrepared(Protocol):
    """A record that was made ready."""

    @property
    def record(self) -> Any:
        """It has a name."""
        ...


class AnySession(Protocol):
    """A session of one coordinate, or of a structure."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def prepared(self) -> AnyPrepared:
        """What all models are tried on."""
        ...

    @property
    def now(self) -> AnyStage:
        """The present model."""
        ...

    @property
    def stages(self) -> Sequence[AnyStage]:
        """From the model as given to the present one."""
        ...

    @property
    def own(self) -> object:
        """The user's own candidates."""
        ...

    @property
    def steps(self) -> list[dict[str, Any]]:
        """The history."""
        ...


class Named(Protocol):
    """A candidate."""

    @property
    def name(self) -> str:
        """Of its effect, and of the place if it has one."""
        ...


S = TypeVar("S", bound=AnySession)
N = TypeVar("N", bound=Named)


def undone(session: S) -> S:
    """The session before its last change; the model as given stays."""
    return replace(session, stages=session.stages[:-1]) if len(session.stages) > 1 else session


def chosen(candidates: Iterable[N], name: str) -> N:
    """The candidate of this name; a ``StudyError`` if the present diagnosis has none."""
    for row in candidates:
        if row.name == name:
            return row
    raise StudyError(f"{name!r} is no candidate of the present model; expected one of the list")


def holding(session: AnySession, key: str, hold: bool) -> Model:
    """The present model with a value held where it stands, or freed; it must not be so already."""
    values = session.now.model.values
    expect(key in values, f"{key!r} is no value of this model; it has {', '.join(values)}")
    expect((values[key] is None) == hold, f"{key} is {'held' if hold else 'free'} already")
    return session.now.model.with_values({**values, key: session.now.values[key] if hold else None})


def held(key: str, hold: bool) -> str:
    """What was done, as the history has it."""
    return f"{key} {'held' if hold else 'free'}"
