"""Where the boxes and lines of a structure's sketch stand; ``sketch_drawing`` draws it, ``structure_page`` as SVG.

Coordinates are boxes in a row. Connections of neighbours are straight, others arcs above the row, those with the ground
lines down to it. Lengths are in widths of a box.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from study.equations.model import Model, ModelTerm
from study.equations.place import GROUND, Place
from study.structure.places import connections

BOX, HIGH, STEP, GROUND_AT = 1.0, 0.6, 1.9, -1.35
SIDE, ABOVE, HATCH = 1.1, 0.9, 0.16  # room beside the outer boxes and above all; height of the ground
ARC, ARCS = 0.55, 0.34  # height of the lowest arc above the boxes, and of each further coordinate that it passes


@dataclass(frozen=True)
class Box:
    """A coordinate; x and y are its middle."""

    name: str
    x: float
    y: float
    forces: tuple[str, ...]  # measured forces that act on it
    measured: bool


@dataclass(frozen=True)
class Link:
    """A connection as a curve with two ends and the point in the middle that bends it (quadratic Bezier)."""

    place: Place
    begin: tuple[float, float]
    bend: tuple[float, float]
    end: tuple[float, float]
    tied: bool  # whether a term of the model acts there
    share: float  # of what is left of the motions that a force there could make, or that an effect there explains

    @property
    def middle(self) -> tuple[float, float]:
        """Where its label stands."""
        (x0, y0), (x1, y1), (x2, y2) = self.begin, self.bend, self.end
        return 0.25 * x0 + 0.5 * x1 + 0.25 * x2, 0.25 * y0 + 0.5 * y1 + 0.25 * y2


@dataclass(frozen=True)
class Sketch:
    """A structure as it is drawn."""

    boxes: tuple[Box, ...]
    links: tuple[Link, ...]
    bottom: float
    top: float

    @property
    def width(self) -> float:
        """Of all that is drawn."""
        return self.boxes[-1].x + 2.0 * SIDE

    @property
    def height(self) -> float:
        """Of all that is drawn."""
        return self.top - self.bottom


def sketch(model: Model, measured: Sequence[str], shares: Mapping[frozenset[str], float]) -> Sketch:
    """The sketch of a structure; ``shares`` by what a place lies between, nothing where there is none."""
    at = {name: STEP * i for i, name in enumerate(model.coordinates)}
    boxes = tuple(
        Box(name, x, 0.0, tuple(f for f, where in model.forces if where == name), name in measured)
        for name, x in at.items()
    )
    tied = {e.place.path for e in model.terms if (e.place.kind != "at" or not _mass(e))}
    links = [_link(place, at, place.path in tied, shares.get(place.path, 0.0)) for place in _drawn(model)]
    top = max(0.5 * HIGH, *(link.middle[1] for link in links)) + ABOVE
    return Sketch(boxes, tuple(links), GROUND_AT - 2.0 * HATCH, top)


def _mass(entry: ModelTerm) -> bool:
    return entry.term.name == "inertia"


def _drawn(model: Model) -> list[Place]:
    """All connections, and the bodies that inertia couples, each once."""
    found = {place.path: place for place in connections(model)}
    for entry in model.terms:
        if entry.place.kind == "couples":
            found.setdefault(entry.place.path, entry.place)
    return list(found.values())


def _link(place: Place, at: Mapping[str, float], tied: bool, share: float) -> Link:
    if GROUND in place.path:
        (name,) = place.moving
        begin, end = (at[name], -0.5 * HIGH), (at[name], GROUND_AT)
        return Link(place, begin, (at[name], 0.5 * (begin[1] + end[1])), end, tied, share)
    left, right = sorted(at[name] for name in place.moving)
    apart = round((right - left) / STEP)
    if apart == 1:
        begin, end = (left + 0.5 * BOX, 0.0), (right - 0.5 * BOX, 0.0)
        return Link(place, begin, (0.5 * (left + right), 0.0), end, tied, share)
    begin, end = (left + 0.2, 0.5 * HIGH), (right - 0.2, 0.5 * HIGH)
    rise = 0.5 * HIGH + 2.0 * (ARC + ARCS * (apart - 2))
    return Link(place, begin, (0.5 * (left + right), rise), end, tied, share)
