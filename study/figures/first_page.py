"""A page drawn on import: what Matplotlib loads for a first figure stays in a process from which others are forked."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from pathlib import Path

from matplotlib import style

from study.figures import page

with style.context(Path(__file__).with_name("study.mplstyle")):
    FIRST, (PANEL,) = page.empty_page("First page", "$A_1(f)$")
    PANEL.plot([1.0, 2.0], label=r"$\hat{u}^2$")
    page.shared_legend(FIRST, [PANEL])
    for ending in ("png", "svg"):
        page.rendered(FIRST, ending)
