"""The style sheet of every picture, and one look for each estimator: colour, dash and width, so that grey suffices."""

from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SHEET = Path(__file__).with_name("study.mplstyle")


def in_style() -> AbstractContextManager[None]:
    """Matplotlib's settings within a block."""
    from matplotlib import style  # which looks of curves, and words of axes, do without

    return style.context(SHEET)


@dataclass(frozen=True)
class LineLook:
    """How a curve is drawn."""

    label: str  # what the legend calls it
    colour: str  # a place in the style sheet's colour cycle
    dash: str | tuple[int, tuple[float, ...]]  # line style as Matplotlib knows it
    width: float  # points
    level: float  # which curve covers which: the higher lies on top

    @property
    def line(self) -> dict[str, Any]:
        """Keyword arguments for ``Axes.plot``."""
        return {
            "color": self.colour, "linestyle": self.dash, "linewidth": self.width, "zorder": self.level,
            "label": self.label,
        }  # fmt: skip


EXACT = LineLook("exact", "black", "-", 0.8, 5.0)
ESTIMATOR_LOOKS = {
    "miso": LineLook("MI/SO", "C0", "-", 2.0, 3.0),
    "siso": LineLook("SI/SO", "C1", (0, (5.0, 2.0)), 1.7, 3.8),
    "local_polynomial": LineLook("local polynomial", "C2", (0, (7.0, 1.5, 1.5, 1.5)), 1.6, 3.5),
    "instrumental": LineLook("instrumental", "C3", (0, (1.0, 1.1)), 2.4, 3.6),
    "miso_free_shape": LineLook("MI/SO, shape estimated", "C4", (0, (1.6, 1.0)), 1.6, 3.2),
    "output_error": LineLook("output error", "C5", (0, (1.0, 1.0)), 2.2, 3.7),
}


def look(estimator: str) -> LineLook:
    """The look of an estimator; one that the table does not know is drawn dash-dotted in sky blue."""
    fallback = LineLook(estimator.replace("_", " "), "C4", "-.", 1.6, 3.8)
    return ESTIMATOR_LOOKS.get(estimator, fallback)


def legend_place(estimator: str) -> int:
    """Place of an estimator in legends: as in the table above, unknown ones last."""
    names = list(ESTIMATOR_LOOKS)
    return names.index(estimator) if estimator in names else len(names)
