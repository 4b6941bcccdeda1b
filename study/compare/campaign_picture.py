"""Coefficients of many records of one rig as a picture: a panel each, values with their 95 % intervals."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence
from datetime import date

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

from study.compare.fitted_coefficients import Level
from study.equations import dimensions
from study.figures import page
from study.figures.styles import in_style

Places = Sequence[str] | Sequence[float] | Sequence[date]  # of the records: names, levels, or days


def coefficients_picture(title: str, found: Sequence[Level], places: Places, along: str) -> bytes:
    """The picture as PNG.

    Parameters
    ----------
    title : str
        What the records are of.
    found : sequence of Level
        A coefficient each, with an entry for each record.
    places : sequence
        Where the records stand, in the same order.
    along : str
        What that is, with its unit.
    """
    columns = 2 if len(found) > 1 else 1
    with in_style():
        figure, axes = page.empty_page(
            title, "values with 95 % intervals; the line is their weighted mean", rows=-(-len(found) // columns),
            columns=columns, width=8.6, panel=1.9, legend_rows=0, share=False,
        )  # fmt: skip
        names = [str(place) for place in places] if places and isinstance(places[0], str) else []
        longest = max(map(len, names), default=0)
        slanted = longest * len(names) > 36
        room = 0.62 + (0.055 * min(longest, 20) if slanted else 0.0)  # inches below each panel
        rows = -(-len(found) // columns)
        figure.set_size_inches(8.6, 0.85 + rows * (1.9 + room + 0.25))
        height = figure.get_size_inches()[1]
        figure.subplots_adjust(
            top=1.0 - 0.85 / height, bottom=room / height, hspace=(room + 0.35) / 1.9, wspace=0.36, left=0.11
        )
        for panel, level in zip(axes, found, strict=False):
            _coefficient(panel, level, places)
            panel.set_xlabel(along)
            if names:
                shown = [name if len(name) <= 20 else name[:19] + "…" for name in names]
                panel.set_xticks(
                    range(len(names)), shown, rotation=35 if slanted else 0, ha="right" if slanted else "center"
                )
        for panel in axes[len(found) :]:
            panel.set_visible(False)
        for text in figure.texts[:2]:  # the head stays at the top, though the page has grown
            text.set_y(1.0 - (0.12 if text is figure.texts[0] else 0.33) / height)
        return page.rendered(figure, "png")


def _coefficient(axes: Axes, level: Level, places: Places) -> None:
    """One coefficient, filled where it differs between the records by more than chance."""
    of_names = bool(places) and isinstance(places[0], str)
    at = np.arange(len(places)) if of_names else np.array(places)
    error = np.array(level.error)
    weight = 1.0 / np.maximum(error, np.finfo(float).eps * max(map(abs, level.value))) ** 2
    axes.axhline(float(np.average(level.value, weights=weight)), color="0.6", linewidth=1.0)
    axes.errorbar(
        at, level.value, 1.96 * error, fmt="o" if of_names else "o-", color="C1" if level.moves else "C0",
        markerfacecolor="C1" if level.moves else "white", markersize=5.0, linewidth=1.0, capsize=3.0,
    )  # fmt: skip
    if places and isinstance(places[0], date):
        ticks = AutoDateLocator(maxticks=6)
        axes.xaxis.set_major_locator(ticks)
        axes.xaxis.set_major_formatter(ConciseDateFormatter(ticks))
    axes.margins(x=0.12 if of_names else 0.05)
    axes.set_ylabel(f"{level.key} ({dimensions.pretty(level.unit)})" if level.unit else level.key)
    said = "differs" if level.moves else "no difference seen"
    axes.set_title(f"{level.key}: {said} (p {level.chance})")
