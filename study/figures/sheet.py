"""The project's style sheet, which every picture is drawn in."""

from contextlib import AbstractContextManager
from pathlib import Path

from matplotlib import style

SHEET = Path(__file__).with_name("study.mplstyle")


def in_style() -> AbstractContextManager[None]:
    """Matplotlib's settings within a block."""
    return style.context(SHEET)
