"""The project's style sheet, for pictures that the command line draws."""

from contextlib import AbstractContextManager
from pathlib import Path

from matplotlib import style

SHEET = Path(__file__).parent.parent.parent / "config" / "study.mplstyle"


def in_style() -> AbstractContextManager[None]:
    """Matplotlib's settings within a block; its own defaults where the package stands without its project."""
    return style.context(SHEET if SHEET.is_file() else "default")
