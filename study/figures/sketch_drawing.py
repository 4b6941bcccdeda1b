"""The sketch of a model with several coordinates as a picture: Axes in, Axes out."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch, PathPatch
from matplotlib.path import Path

from study.figures.sketch import GROUND_AT, HATCH, HIGH, SEEN, SIDE, Box, Link, Sketch
from study.support.numbers import percent

GLOW = "C1"


def structure_sketch(axes: Axes, drawn: Sketch) -> Axes:
    """Coordinates as boxes, connections as lines; a line glows with its share, which stands beside it."""
    for link in drawn.links:
        _line(axes, link)
    for box in drawn.boxes:
        _box(axes, box)
    ends = [-1.0, drawn.boxes[-1].x + 1.0]
    axes.plot(ends, [GROUND_AT, GROUND_AT], color="0.2", linewidth=1.6)
    axes.fill_between(ends, GROUND_AT - HATCH, GROUND_AT, hatch="////", facecolor="none", edgecolor="0.55")
    axes.set_xlim(-SIDE, drawn.boxes[-1].x + SIDE)
    axes.set_ylim(drawn.bottom, drawn.top)
    axes.set_aspect("equal")
    axes.set_axis_off()
    return axes


def _line(axes: Axes, link: Link) -> None:
    path = Path([link.begin, link.bend, link.end], [Path.MOVETO, Path.CURVE3, Path.CURVE3])
    for width, strength in ((13.0, 0.35), (8.0, 0.5)):
        if link.share > 0.0:
            axes.add_patch(
                PathPatch(path, facecolor="none", edgecolor=GLOW, linewidth=width, alpha=strength * link.share**0.5)
            )
    coupled = link.place.kind == "couples"
    dash = "dashed" if coupled else "solid" if link.tied else "dotted"
    axes.add_patch(
        PathPatch(
            path, facecolor="none", edgecolor="0.15" if link.tied else "0.45", linestyle=dash,
            linewidth=1.8 if link.tied else 0.9,
        )
    )  # fmt: skip
    x, y = link.middle
    if link.share >= SEEN:
        upright = link.begin[0] == link.end[0]
        axes.annotate(
            percent(link.share), (x, y), xytext=(7, 0) if upright else (0, 8), textcoords="offset points",
            ha="left" if upright else "center", va="center", fontsize=8,
        )  # fmt: skip


def _box(axes: Axes, box: Box) -> None:
    axes.add_patch(
        FancyBboxPatch(
            (box.x - 0.5, box.y - 0.5 * HIGH), 1.0, HIGH, boxstyle="round,pad=0,rounding_size=0.08",
            facecolor="0.94" if box.measured else "white", edgecolor="0.15",
            linestyle="solid" if box.measured else "dashed", linewidth=1.3,
        )
    )  # fmt: skip
    axes.text(box.x, box.y, box.name, ha="center", va="center", fontsize=max(5.0, min(8.5, 68.0 / len(box.name))))
    for i, force in enumerate(box.forces):
        axes.annotate(
            force, (box.x, box.y + 0.5 * HIGH), xytext=(0, 24 + 10 * i), textcoords="offset points", ha="center",
            fontsize=8, color="C0", arrowprops={"arrowstyle": "->", "color": "C0", "linewidth": 1.3},
        )  # fmt: skip
