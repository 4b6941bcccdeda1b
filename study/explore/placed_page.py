"""The page of a structure: sources and panels put together, for a live document and a saved one alike."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.models import ColumnDataSource

from study.compare.comparison_pictures import comparison_pictures
from study.compare.comparison_report import as_json, comparison_document
from study.diagnose.diagnosis_files import diagnosis_files
from study.explore import any_session, check_plots, placed_panels, placed_session, plots, theme
from study.explore.any_page import EMPTY, Page, frame, history_columns, history_ends, history_height, page_of
from study.explore.any_page import variables as any_variables
from study.explore.axis_scales import Columns
from study.explore.desk import Deeds, Drawn
from study.explore.placed_session import PlacedSession
from study.explore.placed_view import PlacedView, placed_view
from study.explore.saved import as_file, stored
from study.explore.saved_files import PAGE, beside

TEMPLATE = "placed.html"
SHOWN = {  # of all places, sensors and candidates, by the source that the script fills with the selected one's
    "all_map": "map", "all_force": "force", "all_stiffness": "stiffness", "all_motion": "motion", "all_close": "close",
    "all_spectrum": "spectrum", "all_autocorrelation": "autocorrelation", "all_histogram": "histogram",
}  # fmt: skip


class PlacedScene:
    """A session with a structure in a document."""

    def __init__(self, session: PlacedSession, stores: Sequence[ColumnDataSource]) -> None:
        self.page = build(_last_view(session), history_columns(session), stores)
        self.session = session

    def lay(self, document: Document) -> None:
        """Put panels, template and words into an empty document."""
        self.page.lay(document, TEMPLATE, variables(self.session, live=True))

    def turn_to(self, record: str) -> None:
        """A structure has one record."""

    def show(self, session: PlacedSession) -> None:
        """Draw another model."""
        self.session, lasting = session, history_columns(session)
        self.page.show(columns(_last_view(session), lasting), lasting)


def build(seen: PlacedView, lasting: Columns, stores: Sequence[ColumnDataSource] = ()) -> Page:
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

    given = {**columns(seen, lasting), **_selected(seen.columns), "history": lasting, "shown": EMPTY}
    return page_of(given, _frequencies(seen), draw, stores)


def columns(seen: PlacedView, lasting: Columns) -> dict[str, Columns]:
    """What a structure gives the sources of a page."""
    rows = [(axis, "axis_label", label) for axis, label in seen.labels.items()]
    return {**seen.columns, "frame": frame(rows, _frequencies(seen), {"history": history_ends(lasting)})}


def _frequencies(seen: PlacedView) -> tuple[float, float]:
    """The lowest frequency in hertz that the panels draw, and the highest."""
    lines = seen.columns["all_spectrum"]["f"]
    return float(np.min(lines, initial=seen.highest)), seen.highest


def _last_view(session: PlacedSession) -> PlacedView:
    return placed_view(session.now, len(session.stages) - 1)


def _selected(columns: dict[str, Columns]) -> dict[str, Columns]:
    """The sources that the script fills, as long as it has not: with the first place or sensor."""
    found: dict[str, Columns] = {}
    for name, shown in SHOWN.items():
        own = {n: np.asarray(c) for n, c in columns[name].items() if n != "of"}
        marks = np.array(columns[name]["of"])
        empty = np.array([0.0, 1.0])  # an axis needs some; nobody sees it
        found[shown] = {n: c[marks == marks[0]] if len(marks) else empty for n, c in own.items()}
    return found


def variables(session: PlacedSession, live: bool) -> dict[str, Any]:
    """What the template needs beside the panels."""
    return any_variables(session, live, "placed")


def saved_structure(session: PlacedSession) -> bytes:
    """The whole session as a file that a browser opens without a server; it shows the last model first."""
    lasting = history_columns(session)
    views = [placed_view(stage, n, live=False) for n, stage in enumerate(session.stages)]
    stores = stored({(n, 0): columns(seen, lasting) for n, seen in enumerate(views)}, lasting)
    return as_file(build(views[-1], lasting, stores), TEMPLATE, variables(session, live=False))


def structure_files(
    session: PlacedSession, name: str, text: str, values: bool = False, drawn: Drawn | None = None
) -> dict[str, bytes]:
    """What Save writes, by file name: as ``saved_files`` has it for one coordinate."""
    now = session.now
    model = now.model.with_values(now.values) if values else now.model
    shown = _drawn(session) if drawn is None else drawn
    return {**beside(session, name, text, model), PAGE: saved_structure(session), **shown}


def _drawn(session: PlacedSession) -> dict[str, bytes]:
    now = session.now
    contents = {"comparison.json": as_json(comparison_document([now.comparison]))} | comparison_pictures(now.comparison)
    if now.diagnosis is not None:
        contents |= diagnosis_files(now.diagnosis, now.said, now.unneeded)
    return contents


def _by_itself(session: PlacedSession) -> PlacedSession:
    return session  # a structure has one record


PLACED = Deeds(
    placed_session.with_placed, placed_session.without_placed, any_session.undone, placed_session.with_held,
    placed_session.tried, placed_session.examined, placed_session.with_stage, _by_itself, _drawn,
    structure_files,
)  # fmt: skip
