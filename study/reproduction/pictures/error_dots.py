"""Errors of the estimators as dots: a panel for each parameter, a row for each case, told apart in grey too."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from study.figures import page
from study.figures.styles import look
from study.reproduction import estimator_errors

PANELS = (("m",), ("c",), ("k",), ("f_n",), ("zeta",), ("k3",), ("c3",), ("k_m", "k_dead_band"))
COLUMNS = 4
WORDS = {"m": "mass m", "c": "damping c", "k": "stiffness k", "f_n": "natural frequency $f_n$",
         "zeta": r"damping ratio $\zeta$", "k3": "cubic stiffness $k_3$", "c3": "nonlinear damping $c_3$",
         "k_m": "$k_m$", "k_dead_band": "dead-band $k$"}  # fmt: skip
MARKERS = {"siso": ("x", False), "miso": ("s", True), "local_polynomial": ("^", True), "instrumental": ("D", False),
           "output_error": ("o", False)}  # fmt: skip
OTHER = ("P", True)
LOWEST, HIGHEST = 1e-7, 1e3  # percent: what lies outside stands at the edge
WIDEST = 20.0  # a stretch of exp(20) is wider than the picture
LEFT, TOP, ROW = 1.5, 1.15, 0.19  # inches


def error_dots(table: pd.DataFrame, cases: Sequence[str]) -> Figure:
    """The picture of a table of :func:`study.reproduction.estimator_errors.errors`.

    Parameters that are zero have no relative error and are not drawn. ``cases`` are the rows, from above.
    """
    drawn = table[table["kind"] == "relative"]
    rows = -(-len(PANELS) // COLUMNS)
    width, height = 10.2, TOP + rows * (ROW * len(cases) + 0.35) + 0.5
    figure = Figure(figsize=(width, height))
    figure.subplots_adjust(left=LEFT / width, right=0.985, top=1.0 - TOP / height, bottom=0.5 / height, wspace=0.08,
                           hspace=0.35 / (ROW * len(cases)))  # fmt: skip
    axes = list(figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False).flat)
    for panel, parameters in zip(axes, PANELS, strict=True):
        _panel(panel, drawn[drawn["parameter"].isin(parameters)], cases)
        panel.set_title(", ".join(WORDS[name] for name in parameters))
    for panel in axes[-COLUMNS:]:
        panel.set_xlabel("error (%)")
    _heading(figure, axes, int(table["seeds"].max()))
    return figure


def _panel(panel: Axes, table: pd.DataFrame, cases: Sequence[str]) -> None:
    place = {case: index for index, case in enumerate(cases)}
    for case in dict.fromkeys(table["case"]):
        panel.axhline(place[case], color="0.85", linewidth=0.7, zorder=1.0)
    for name in estimator_errors.estimator_names(table):
        own = table[table["estimator"] == name]
        error = np.clip(100.0 * own["median_error"].to_numpy(dtype=np.float64), LOWEST, HIGHEST)
        spread = 100.0 * own["standard_error"].to_numpy(dtype=np.float64)
        stretch = np.exp(np.minimum(spread / error, WIDEST))  # a standard error, to first order in the logarithm
        heights = np.array([place[case] for case in own["case"]], dtype=np.float64)
        marker, filled = MARKERS.get(name, OTHER)
        shown = look(name)
        below, above = np.maximum(error / stretch, LOWEST), np.minimum(error * stretch, HIGHEST)
        level = shown.level + (1.0 if filled else 2.0)
        panel.hlines(heights, below, above, color=shown.colour, linewidth=1.0, zorder=shown.level)
        panel.plot(error, heights, marker, color=shown.colour, markersize=5.5, label=shown.label, zorder=level,
                   markerfacecolor=shown.colour if filled else "white", markeredgewidth=1.3)  # fmt: skip
    panel.set_xscale("log")
    panel.set_xlim(LOWEST / 2.0, HIGHEST * 2.0)
    panel.xaxis.set_major_locator(LogLocator(base=10.0, numticks=20))
    panel.xaxis.set_minor_locator(NullLocator())
    panel.set_xticks([10.0**power for power in range(-6, 3, 2)])
    panel.set_yticks(range(len(cases)), [case.replace("_", " ") for case in cases])
    panel.set_ylim(len(cases) - 0.4, -0.6)
    panel.grid(visible=False, axis="y")


def _heading(figure: Figure, axes: Sequence[Axes], seeds: int) -> None:
    subtitle = f"median over {seeds} seeds of the relative error, with the median's standard error; less is to the left"
    page.head(figure, "Errors of the estimators on the same records", subtitle, LEFT, 0.1)
    width, height = figure.get_size_inches()
    entries = page.legend_entries(axes)
    figure.legend(list(entries.values()), list(entries), loc="upper left", ncols=len(entries), borderaxespad=0.0,
                  bbox_to_anchor=(LEFT / width, 1.0 - 0.58 / height), borderpad=0.0, handlelength=1.2)  # fmt: skip
