"""The sketch of a structure as SVG within a page: each connection can be selected."""

from html import escape

from study.equations.place import Place
from study.structure.sketch import BOX, GROUND_AT, HATCH, HIGH, Box, Link, Sketch
from study.structure.sketch_drawing import SEEN
from study.support.numbers import percent

UNIT = 84.0  # pixels in the width of a box


def svg(drawn: Sketch, selected: Place) -> str:
    """The sketch, one place selected."""
    left = drawn.boxes[0].x - 0.5 * (drawn.width - drawn.boxes[-1].x)
    view = f"{left * UNIT:.1f} {-drawn.top * UNIT:.1f} {drawn.width * UNIT:.1f} {drawn.height * UNIT:.1f}"
    ends = (drawn.boxes[0].x - BOX) * UNIT, (drawn.boxes[-1].x + BOX) * UNIT
    ground = (
        f'<rect class=ground x="{ends[0]:.1f}" y="{-GROUND_AT * UNIT:.1f}" width="{ends[1] - ends[0]:.1f}" '
        f'height="{HATCH * UNIT:.1f}"/>'
    )
    links = "".join(_link(link, link.place.path == selected.path) for link in drawn.links)
    boxes = "".join(_box(box) for box in drawn.boxes)
    return (
        f'<svg class=sketch viewBox="{view}" style="max-width:{drawn.width * UNIT:.0f}px" role=img '
        f'aria-label="sketch of the structure">{ground}{links}{boxes}</svg>'
    )


def _link(link: Link, chosen: bool) -> str:
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


def _box(box: Box) -> str:
    x, y = (box.x - 0.5 * BOX) * UNIT, -(box.y + 0.5 * HIGH) * UNIT
    size = min(15.0, 130.0 / len(box.name))
    drawn = (
        f'<rect class="box{"" if box.measured else " blind"}" x="{x:.1f}" y="{y:.1f}" rx=6 width="{BOX * UNIT:.1f}" '
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
