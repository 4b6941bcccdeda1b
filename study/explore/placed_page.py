"""What is drawn of coordinates that have names: its sources and panels, put together."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource

from study.explore import check_plots, placed_panels, plots, theme
from study.explore.any_page import EMPTY, Page, frame, history_ends, history_height, page_of, time_rows
from study.explore.axis_scales import Columns
from study.explore.placed_view import PlacedView

SHOWN = {  # of all places, sensors and candidates, by the source that the script fills with the selected one's
    "all_map": "map", "all_force": "force", "all_stiffness": "stiffness", "all_motion": "motion", "all_close": "close",
    "all_spectrum": "spectrum", "all_autocorrelation": "autocorrelation", "all_histogram": "histogram",
}  # fmt: skip


def placed_page(seen: PlacedView, lasting: Columns, stores: Sequence[ColumnDataSource]) -> Page:
    """A page that shows one structure, with the columns of its history; ``stores`` are further sources."""
    times, count = seen.columns["all_motion"]["t"], len(lasting["name"])
    time = theme.fixed("range_time", float(times[0]), float(np.max(times)))

    def draw(s: placed_panels.Sources, frequency: Any) -> dict[str, Any]:
        return {
            "history": plots.history(s, lasting["name"], history_height(count)),
            "sensors": placed_panels.sensors(s, list(seen.columns["sensors"]["name"])),
            "map": placed_panels.restoring(s), "force": placed_panels.force(s, frequency),
            "stiffness": placed_panels.stiffness(s, frequency), "spectrum": placed_panels.spectrum(s, frequency),
            "motion": placed_panels.motion(s, time), "difference": placed_panels.difference(s, time),
            "close": placed_panels.close(s), "constancy": plots.constancy(s),
            "autocorrelation": check_plots.correlation(s, "autocorrelation", "autocorrelation / 1"),
            "histogram": check_plots.histogram(s),
        }  # fmt: skip

    given = {**placed_columns(seen, lasting), **_selected(seen.columns), "history": lasting, "shown": EMPTY}
    return page_of(given, _frequencies(seen), draw, stores)


def placed_columns(seen: PlacedView, lasting: Columns) -> dict[str, Columns]:
    """What a structure gives the sources of a page."""
    times = seen.columns["all_motion"]["t"]
    rows = [*((axis, "axis_label", label) for axis, label in seen.labels.items()),
            *time_rows(float(times[0]), float(np.max(times)))]  # fmt: skip
    return {**seen.columns, "frame": frame(rows, _frequencies(seen), {"history": history_ends(lasting)})}


def _frequencies(seen: PlacedView) -> tuple[float, float]:
    """The lowest frequency in hertz that the panels draw, and the highest."""
    lines = seen.columns["all_spectrum"]["f"]
    return float(np.min(lines, initial=seen.highest)), seen.highest


def _selected(columns: dict[str, Columns]) -> dict[str, Columns]:
    """The sources that the script fills, as long as it has not: with the first place or sensor."""
    found: dict[str, Columns] = {}
    for name, shown in SHOWN.items():
        own = {n: np.asarray(c) for n, c in columns[name].items() if n != "of"}
        marks = np.array(columns[name]["of"])
        empty = np.array([0.0, 1.0])  # an axis needs some; nobody sees it
        found[shown] = {n: c[marks == marks[0]] if len(marks) else empty for n, c in own.items()}
    return found
