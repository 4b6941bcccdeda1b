"""The sketch of a model with several coordinates: where boxes and lines stand, and as SVG within a page.

Coordinates are boxes in a row. Connections of neighbours are straight, others arcs above the row, those with the ground
lines down to it. Lengths are in widths of a box.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from study.equations.linear_part import connections
from study.equations.model import Model
from study.equations.place import GROUND, Place
from study.support.numbers import percent

HIGH, SPACING, GROUND_AT = 0.6, 1.9, -1.35
SIDE, HATCH = 1.1, 0.16  # room beside the outer boxes; height of the ground
SEEN = 0.01  # share from which a connection's is written beside it
UNIT = 84.0  # pixels in the width of a box


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
        return self.boxes[-1].x + 2.0 * SIDE

    @property
    def height(self) -> float:
        return self.top - self.bottom


def sketch(model: Model, measured: Sequence[str], shares: Mapping[frozenset[str], float]) -> Sketch:
    """The sketch of a structure; ``shares`` by what a place lies between, nothing where there is none."""
    at = {name: SPACING * i for i, name in enumerate(model.coordinates)}
    boxes = tuple(
        Box(name, x, 0.0, tuple(f for f, where in model.forces if where == name), name in measured)
        for name, x in at.items()
    )
    tied = {e.place.path for e in model.terms if e.place.kind != "at" or e.term.name != "inertia"}
    found = {place.path: place for place in connections(model)}
    for entry in model.terms:  # the bodies that inertia couples, each once
        if entry.place.kind == "couples":
            found.setdefault(entry.place.path, entry.place)
    links = [_link(place, at, path in tied, shares.get(path, 0.0)) for path, place in found.items()]
    top = max(0.5 * HIGH, *(link.middle[1] for link in links)) + 0.9
    return Sketch(boxes, tuple(links), GROUND_AT - 2.0 * HATCH, top)


def _link(place: Place, at: Mapping[str, float], tied: bool, share: float) -> Link:
    if GROUND in place.path:
        (name,) = place.moving
        begin, end = (at[name], -0.5 * HIGH), (at[name], GROUND_AT)
        return Link(place, begin, (at[name], 0.5 * (begin[1] + end[1])), end, tied, share)
    left, right = sorted(at[name] for name in place.moving)
    apart = round((right - left) / SPACING)
    if apart == 1:
        begin, end = (left + 0.5, 0.0), (right - 0.5, 0.0)
        return Link(place, begin, (0.5 * (left + right), 0.0), end, tied, share)
    begin, end = (left + 0.2, 0.5 * HIGH), (right - 0.2, 0.5 * HIGH)
    rise = 0.5 * HIGH + 2.0 * (0.55 + 0.34 * (apart - 2))  # twice the arc's height: higher the more it passes
    return Link(place, begin, (0.5 * (left + right), rise), end, tied, share)


def svg(drawn: Sketch, selected: Place) -> str:
    """The sketch, one place selected."""
    left = drawn.boxes[0].x - 0.5 * (drawn.width - drawn.boxes[-1].x)
    view = f"{left * UNIT:.1f} {-drawn.top * UNIT:.1f} {drawn.width * UNIT:.1f} {drawn.height * UNIT:.1f}"
    ends = (drawn.boxes[0].x - 1.0) * UNIT, (drawn.boxes[-1].x + 1.0) * UNIT
    ground = (
        f'<rect class=ground x="{ends[0]:.1f}" y="{-GROUND_AT * UNIT:.1f}" width="{ends[1] - ends[0]:.1f}" '
        f'height="{HATCH * UNIT:.1f}"/>'
    )
    links = "".join(_link_as_svg(link, link.place.path == selected.path) for link in drawn.links)
    boxes = "".join(_box_as_svg(box) for box in drawn.boxes)
    return (
        f'<svg class=sketch viewBox="{view}" style="max-width:{drawn.width * UNIT:.0f}px" role=img '
        f'aria-label="sketch of the structure">{ground}{links}{boxes}</svg>'
    )


def _link_as_svg(link: Link, chosen: bool) -> str:
    (x0, y0), (x1, y1), (x2, y2) = ((x * UNIT, -y * UNIT) for x, y in (link.begin, link.bend, link.end))
    way = f'd="M{x0:.1f} {y0:.1f} Q{x1:.1f} {y1:.1f} {x2:.1f} {y2:.1f}"'
    kind = "couples" if link.place.kind == "couples" else "tied" if link.tied else "untied"
    x, y = link.middle
    upright = link.begin[0] == link.end[0]
    label = percent(link.share) if link.share >= SEEN else ""
    text = (
        f'<text x="{x * UNIT + (9 if upright else 0):.1f}" y="{-y * UNIT + (4 if upright else -10):.1f}" '
        f'text-anchor="{"start" if upright else "middle"}">{label}</text>'
    )
    return (
        f'<g class="link{" selected" if chosen else ""}" data-place="{escape(link.place.label)}" tabindex=0>'
        f"<title>{escape(link.place.label)}</title>"
        f'<path class=glow {way} style="opacity:{min(link.share, 1.0) ** 0.5:.3f}"/><path class="{kind}" {way}/>'
        f"<path class=hit {way}/>{text}</g>"
    )


def _box_as_svg(box: Box) -> str:
    x, y = (box.x - 0.5) * UNIT, -(box.y + 0.5 * HIGH) * UNIT
    size = min(15.0, 130.0 / len(box.name))
    drawn = (
        f'<rect class="box{"" if box.measured else " blind"}" x="{x:.1f}" y="{y:.1f}" rx=6 width="{UNIT:.1f}" '
        f'height="{HIGH * UNIT:.1f}"/><text class=name x="{box.x * UNIT:.1f}" y="{-box.y * UNIT + 5:.1f}" '
        f'font-size="{size:.1f}">{escape(box.name)}</text>'
    )
    for i, force in enumerate(box.forces):
        top = y - 34.0 - 16.0 * i
        drawn += (
            f'<path class=force d="M{box.x * UNIT:.1f} {y - 28:.1f} V{y - 4:.1f} m-4 -7 l4 7 l4 -7"/>'
            f'<text class=force x="{box.x * UNIT:.1f}" y="{top:.1f}">{escape(force)}</text>'
        )
    return drawn
