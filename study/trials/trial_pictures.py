"""Pictures of many trials: Axes in, Axes out."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from study.figures.labels import term_names
from study.figures.page import frame_cells

STEPS_OF_ADDING = {
    "before": ("before", "C1", "s", -0.27),
    "after": ("after adding what was found", "C0", "o", -0.09),
    "after_two": ("after adding twice", "C4", "D", 0.09),
    "true": ("true model", "black", "_", 0.27),
}


def confusion_panel(axes: Axes, counts: pd.DataFrame) -> Axes:
    """Shares of each row, in per cent: hidden effects down, what was said across.

    ``counts`` are as ``reach.confusion`` gives them.
    """
    table = counts.set_index("hidden")
    names = [term_names(str(name)) for name in table.columns]
    hidden = [term_names(str(name)) for name in table.index]
    numbers = table.to_numpy(dtype=np.float64)
    share = numbers / np.maximum(numbers.sum(axis=1, keepdims=True), 1.0)
    axes.imshow(share, cmap="Greys", vmin=0.0, vmax=1.0, aspect="auto")
    for (i, j), value in np.ndenumerate(share):
        if value > 0.0:
            axes.text(
                j, i, f"{100.0 * value:.0f}", ha="center", va="center", fontsize=8,
                color="white" if value > 0.6 else "black",
            )  # fmt: skip
    titles = [f"{name} ({int(n.sum())})" for name, n in zip(hidden, numbers, strict=True)]
    frame_cells(axes, titles, names, 90.0)
    axes.set_xlabel("diagnose says")
    axes.set_ylabel("hidden (trials)")
    return axes


def error_by_noise_panel(axes: Axes, rows: pd.DataFrame) -> Axes:
    """Mean held-out error of the response with its standard error, at each noise, for one kind of trial."""
    noises = sorted(rows["noise"].unique())
    place = {noise: i for i, noise in enumerate(noises)}
    for step, (label, colour, marker, shift) in STEPS_OF_ADDING.items():
        own = rows[rows["step"] == step]
        if not len(own):
            continue
        axes.errorbar(
            [place[n] + shift for n in own["noise"]], 100.0 * own["mean_error"], 196.0 * own["standard_error"],
            linestyle="none", marker=marker, markersize=11 if marker == "_" else 6, markeredgewidth=1.8, capsize=2.5,
            color=colour, label=label,
        )  # fmt: skip
    axes.set_xticks(range(len(noises)), [f"{100.0 * n:g} %" for n in noises])
    axes.set_xlabel("noise, mean square on the response")
    axes.set_ylabel("held-out response error / %")
    axes.set_ylim(bottom=0.0)
    axes.grid(visible=False, axis="x")
    return axes
