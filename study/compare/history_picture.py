"""The history as a picture: the error of the response falling towards the noise floor."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator

from study.compare.history import label
from study.figures import page
from study.figures.labels import term_names
from study.figures.styles import in_style
from study.support.terminal import on_a_line


def errors_by_step(axes: Axes, steps: Sequence[dict[str, Any]]) -> Axes:
    """Held-out error of the response and of the force by model, on a logarithmic scale, noise floor dotted."""
    place = np.arange(len(steps))
    for key, style, colour in (("response", "-o", "0.1"), ("force", "--s", "0.5")):
        values = [100.0 * s["error"][key] if s["error"][key] else np.nan for s in steps]
        axes.plot(place, values, style, color=colour, label=f"error of the {key}")
    floor = [100.0 * s["noise_floor"]["response"] for s in steps]
    axes.plot(place, floor, ":", color="0.1", label="noise floor")
    axes.set_yscale("log", subs=[])
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    names = [term_names(label(s)) for s in steps]
    axes.set_xticks(place, names, rotation=20, ha="right")
    axes.set_ylabel("held-out error (%)")
    axes.margins(x=0.08)
    return axes


def history_files(steps: Sequence[dict[str, Any]], name: str) -> dict[str, bytes]:
    """The picture by file name, in the project's style."""
    with in_style():
        figure, (axes,) = page.empty_page(
            f"The history of {on_a_line(name)}",
            "every model so far, judged on what was not fitted",
            panel=3.0,
            headed=False,
        )
        figure.subplots_adjust(bottom=0.26)
        errors_by_step(axes, steps)
        page.shared_legend(figure, [axes])
        return page.image_files({"history": figure})
