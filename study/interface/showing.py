"""How results show themselves: text that prints as it is, tables in HTML, axes in the project's style."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, Any

from study.support.extras import DRAWING, needed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# of a legend: above the panel, where it hides nothing
LEGEND_ABOVE: dict[str, Any] = {
    "loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "ncols": 3, "borderaxespad": 0.2
}  # fmt: skip
TABLES = ("pandas", "a table in a notebook", "notebook")  # what ``extras.needed`` asks for


class Words(str):
    """A text that a notebook shows with its lines, not as a quoted string."""

    __slots__ = ()

    def __repr__(self) -> str:
        """The text itself."""
        return str(self)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self)}</pre>"


def html_table(caption: str, heads: Sequence[str], rows: Sequence[Sequence[str]], below: str = "") -> str:
    """A small table as HTML; everything in it is escaped."""
    head = "".join(f"<th style='text-align:left'>{escape(h)}</th>" for h in heads)
    body = "".join(
        "<tr>" + "".join(f"<td style='text-align:left'>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    end = f"<p>{escape(below)}</p>" if below else ""
    return f"<div><b>{escape(caption)}</b><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{end}</div>"


def pairs_html(caption: str, pairs: Mapping[str, str]) -> str:
    """Names and what stands for them, as a table without a heading."""
    return html_table(caption, ["", ""], list(pairs.items()))


@contextmanager
def drawing_axes(ax: "Axes | None", rows: int = 1) -> "Generator[list[Axes]]":
    """The axes to draw on, in the project's style: those given, or those of a new figure of pyplot."""
    from study.figures.styles import in_style

    needed(*DRAWING)
    with in_style():
        if ax is not None:
            yield [ax]
            return
        from matplotlib import pyplot

        size = (7.0, 2.6 * rows + 0.4)  # inches
        figure, grid = pyplot.subplots(rows, 1, figsize=size, squeeze=False, layout="constrained", sharex=rows > 1)  # pyright: ignore[reportUnknownMemberType]
        del figure
        yield list(grid.flat)
