"""Where a term acts: at a coordinate, or between two."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from study.records.record import ALONE

GROUND = "ground"  # never moves
Kind = Literal["at", "between", "couples"]


@dataclass(frozen=True)
class Place:
    """Where a term acts.

    A term ``at`` a coordinate acts on its motion, one ``between`` two on the motion of the second minus that of the
    first, with equal and opposite forces on both; an inertia that ``couples`` two is an off-diagonal element of the
    symmetric mass matrix.
    """

    kind: Kind
    ends: tuple[str, ...]  # the coordinate, or both; ``ground`` may be one of two

    @property
    def label(self) -> str:
        """What coefficients are called by: ``floor2``, ``floor2-floor3``, ``heave,pitch`` of a coupling, or nothing."""
        return (",", "-")[self.kind != "couples"].join(self.ends)

    @property
    def suffix(self) -> str:
        """What it adds to the name of a term or a coefficient."""
        return f"[{self.label}]" if self.label else ""

    @property
    def moving(self) -> tuple[str, ...]:
        """Its coordinates, without the ground."""
        return tuple(end for end in self.ends if end != GROUND)

    @property
    def path(self) -> frozenset[str]:
        """What it lies between, whichever way it is written: ``at`` a coordinate is between the ground and it."""
        return frozenset((GROUND, *self.ends) if self.kind == "at" else self.ends)

    def direction(self, coordinates: Sequence[str]) -> tuple[float, ...]:
        """Weights of the coordinates in its relative motion, and of its force in their equations."""
        signs = {self.ends[-1]: 1.0} if self.kind == "at" else {self.ends[0]: -1.0, self.ends[1]: 1.0}
        return tuple(signs.get(c, 0.0) for c in coordinates)

    def plain(self) -> dict[str, str | list[str]]:
        """As models and ``diagnosis.json`` hold it: ``{"between": ["floor2", "floor3"]}``."""
        return {self.kind: self.ends[0] if self.kind == "at" else list(self.ends)}


HERE = Place("at", (ALONE,))  # where all terms of a single mass act


def place_in_words(place: Place) -> str:
    """``between floor2 and floor3``, ``at floor1``."""
    word = "coupling" if place.kind == "couples" else place.kind
    return f"{word} {' and '.join('the ground' if end == GROUND else end for end in place.ends)}"
