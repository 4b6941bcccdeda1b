"""What the desk asks of a session, whether of one coordinate or of a structure."""

from collections.abc import Sequence
from typing import Any, Protocol

from study.equations.model import Model


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
    def diagnosis(self) -> object | None:
        """None as long as nobody has asked."""
        ...


class AnySession(Protocol):
    """A session of one coordinate, or of a structure."""

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
