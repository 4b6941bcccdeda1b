"""A figure's page: its size, its panels, a title and a legend that never cover a curve, and its bytes.

Figures are made without pyplot: no global state, nothing to close. Margins are fixed in inches; a layout
engine would measure every text on every page, which costs more than drawing it.
"""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from pathlib import Path

from matplotlib import rcParams
from matplotlib import style as styles
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patches import Patch
from matplotlib.textpath import TextToPath

from study.support.errors import StudyError
from study.support.files import replace_file

LEFT, BOTTOM, TITLE_ROOM, GAP = 0.88, 0.55, 0.58, 0.34  # inches
WIDTH, WIDE = 6.4, 7.2  # inches
TEXT_TO_PATH = TextToPath()
METADATA = {
    "svg": {"Date": None},
    "png": {"Software": None},
    "pdf": {"CreationDate": None},
}  # neither the hour nor the version: same bytes


def width(columns: int) -> float:
    """Width of a page with so many panels side by side, in inches."""
    return WIDTH if columns == 1 else 0.7 * WIDTH * columns


def empty_page(
    title: str, subtitle: str, rows: int = 1, columns: int = 1, *,
    width: float = WIDTH, panel: float = 2.1, legend_rows: int = 1,
    headed: bool = True, share: bool = True,
) -> tuple[Figure, list[Axes]]:  # fmt: skip
    """An empty page.

    Title (the system, in bold) and subtitle stand at the top left. There are ``rows`` times ``columns`` panels, from
    left to right, then down; ``width`` of the page and height of a ``panel`` are in inches. ``legend_rows`` is the room
    to leave between title and panels, ``headed`` whether the first panels have headings of their own, which need room,
    ``share`` whether the panels of a column share their abscissa.
    """
    top = TITLE_ROOM + 0.21 * legend_rows + (GAP if headed else GAP / 2.0)
    between = GAP if share else GAP + BOTTOM - 0.1
    height = top + rows * panel + (rows - 1) * between + BOTTOM
    figure = Figure(figsize=(width, height))
    figure.subplots_adjust(
        left=LEFT / width, right=1.0 - 0.16 / width, bottom=BOTTOM / height, top=1.0 - top / height,
        hspace=between / panel, wspace=0.24,
    )  # fmt: skip
    grid = figure.subplots(rows, columns, sharex="col" if share else False, squeeze=False)
    head(figure, title, subtitle, LEFT, 0.12)
    return figure, list(grid.flat)


def head(figure: Figure, title: str, subtitle: str, left: float, top: float) -> None:
    """Title and subtitle, so many inches from the left and the title so many from the top; smaller where too long."""
    width, height = figure.get_size_inches()
    for text, below, largest, weight in ((title, top, 11.0, "bold"), (subtitle, 0.33, 10.0, "normal")):
        font = FontProperties(size=largest, weight=weight)
        if text:
            font.set_size(largest * min(1.0, (width - left - 0.16) / text_width(text, font)))
        figure.text(left / width, 1.0 - below / height, text, ha="left", va="top", fontproperties=font)


def text_width(text: str, font: FontProperties) -> float:
    """Inches that a line of text takes; what stands between ``$`` is a formula."""
    return TEXT_TO_PATH.get_text_width_height_descent(text, font, ismath="$" in text)[0] / 72.0


def rows_for(entries: int) -> int:
    """Rows of a legend of so many entries: four fit in one row, of more there are three in each."""
    return 1 if entries <= 4 else -(-entries // 3)


def legend_columns(labels: Sequence[str], width: float, most: int = 3) -> int:
    """How many labels stand side by side in the legend of a page of so many inches."""
    font = FontProperties(size=rcParams["legend.fontsize"])
    widest = max(text_width(label, font) for label in labels) + 0.6  # its line, and the gap to the next
    return max(1, min(most, int((width - LEFT) / widest)))


def shared_legend(figure: Figure, axes: Sequence[Axes], columns: int | None = None, *, bands: bool = False) -> None:
    """One legend for all panels, between the title and the first of them; equal labels stand once.

    With ``bands`` it explains the shade about a curve.
    """
    entries = legend_entries(axes)
    if bands:
        entries["95 % band"] = Patch(facecolor="0.8", edgecolor="none")
    width, height = figure.get_size_inches()
    anchor = ((LEFT - 0.04) / width, 1.0 - TITLE_ROOM / height)
    shown = figure.legend(
        list(entries.values()), list(entries), loc="upper left", bbox_to_anchor=anchor,
        ncols=columns or -(-len(entries) // rows_for(len(entries))), borderaxespad=0.0, borderpad=0.0, labelspacing=0.3,
    )  # fmt: skip
    for line in shown.get_lines():
        line.set_linewidth(max(line.get_linewidth(), 1.0))  # a hairline would be lost in a legend


def legend_entries(axes: Sequence[Axes]) -> dict[str, Artist]:
    """What the legends of the panels would hold, by label; of equal labels the first."""
    entries: dict[str, Artist] = {}
    for panel in axes:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            entries.setdefault(str(label), handle)
    return entries


def letter(axes: Sequence[Axes], names: Sequence[str]) -> None:
    """Name the panels (a), (b), ... as the report does."""
    for index, (panel, name) in enumerate(zip(axes, names, strict=True)):
        panel.set_title(f"({chr(ord('a') + index)}) {name}")


def frame_cells(axes: Axes, rows: Sequence[str], columns: Sequence[str], rotation: float = 0.0) -> None:
    """Names at the rows and columns of an image, and lines between its cells."""
    axes.set_xticks(range(len(columns)), columns, rotation=rotation)
    axes.set_yticks(range(len(rows)), rows)
    axes.set_xticks([at - 0.5 for at in range(len(columns) + 1)], minor=True)
    axes.set_yticks([at - 0.5 for at in range(len(rows) + 1)], minor=True)
    axes.grid(visible=False)
    axes.grid(visible=True, which="minor", color="0.85")
    axes.tick_params(which="minor", length=0)


def write_each(kinds: Mapping[str, Callable[[], Figure]], outputs: Mapping[str, Sequence[Path]], style: Path) -> None:
    """Draw the kinds of figure that are asked for in a style, each into its files, PNG or SVG."""
    with styles.context(style):
        for kind, paths in outputs.items():
            if kind not in kinds:
                raise StudyError(f"there is no kind of figure {kind!r}; known are {', '.join(kinds)}")
            figure = kinds[kind]()
            for path in paths:
                replace_file(path, rendered(figure, path.suffix[1:]))


def rendered(figure: Figure, kind: str) -> bytes:
    """A figure as the bytes of a file, the same bytes each time; ``kind`` is ``png``, ``svg`` or ``pdf``."""
    target = BytesIO()
    if kind == "png":  # packed as well as it may be, a picture is 2 % smaller, in three times the time
        figure.savefig(target, format=kind, metadata=METADATA[kind], pil_kwargs={"compress_level": 4})
    else:
        figure.savefig(target, format=kind, metadata=METADATA[kind])
    return target.getvalue()


def image_files(figures: Mapping[str, Figure]) -> dict[str, bytes]:
    """Figures, by the stem of their file name, as the content of files: each as PNG and as SVG."""
    return {f"{stem}.{kind}": rendered(figure, kind) for stem, figure in figures.items() for kind in ("png", "svg")}
