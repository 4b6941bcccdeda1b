"""Coefficients that vary, drawn: each along what it varies with, its band and its knots."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study.compare.varying_coefficients import VaryingCoefficient
from study.equations import dimensions
from study.figures import page
from study.figures.labels import term_names


def varying_panel(axes: Axes, one: VaryingCoefficient) -> Axes:
    """The coefficient along what it varies with, its band of 95 %, and its knots."""
    half = 1.96 * one.error
    axes.fill_between(one.at, one.value - half, one.value + half, color="0.8", linewidth=0.0, label="95 % band")
    axes.plot(one.at, one.value, color="C0", linewidth=1.6, label="coefficient")
    if one.knots:
        inside = [k for k in one.knots if one.at[0] <= k <= one.at[-1]]
        heights = np.interp(inside, one.at, one.value)
        axes.plot(
            inside, heights, linestyle="none", marker="o", markersize=4.0, color="C0", label="knots", clip_on=False
        )
    axes.set_xlim(float(one.at[0]), float(one.at[-1]))
    axes.set_xlabel(one.along.replace("_", " ") + (f" ({dimensions.pretty(one.along_unit)})" if one.along_unit else ""))
    axes.set_ylabel(f"{one.symbol} ({dimensions.pretty(one.unit)})")
    return axes


def varying_figure(found: Sequence[VaryingCoefficient], record: str) -> Figure:
    """All coefficients that vary, one below the other."""
    figure, axes = page.empty_page(
        f"{record}: coefficients that vary", "with bands of 95 %, over what the record covers", rows=len(found),
        width=page.WIDE, panel=2.3, share=False,
    )  # fmt: skip
    for panel, one in zip(axes, found, strict=True):
        varying_panel(panel, one)
    page.letter(axes, tuple(f"{term_names(one.entry.name)}, {one.unknowns:.1f} unknowns" for one in found))
    page.shared_legend(figure, axes)
    return figure
