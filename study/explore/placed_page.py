"""The page of a structure: sources, panels and template put together, for a live document and a saved one alike."""

from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.models import ColumnDataSource, CustomJS
from jinja2 import Environment, Template

from study.compare import history
from study.compare.comparison_report import as_json
from study.compare.history_picture import history_files as history_pictures
from study.equations import model_file
from study.explore import placed_panels, placed_session, plots, theme, words
from study.explore.axis_scales import Columns
from study.explore.desk import Deeds, Drawn
from study.explore.html_page import history_columns, history_height
from study.explore.placed_session import PlacedSession
from study.explore.placed_view import PlacedView, placed_view
from study.explore.saved import as_file, marked
from study.explore.saved_files import PAGE
from study.structure import structure_report
from study.structure.structure_comparison import structure_document
from study.structure.structure_pictures import diagnosis_pictures, structure_pictures

SHOWN = {  # of all places, sensors and candidates, by the source that the script fills with the selected one's
    "all_map": "map", "all_force": "force", "all_stiffness": "stiffness", "all_motion": "motion", "all_close": "close",
    "all_spectrum": "spectrum",
}  # fmt: skip


class PlacedScene:
    """A session with a structure in a document."""

    def __init__(
        self, session: PlacedSession, stores: Sequence[ColumnDataSource], seen: PlacedView | None = None
    ) -> None:
        self.session = session
        seen = seen or _last_view(session)
        lasting = history_columns(session)
        given = {**seen.columns, **_selected(seen.columns), "history": lasting}
        given["shown"] = {"f": [0.0, 1.0], "zero": [0.0, 0.0]} | {n: [np.nan, np.nan] for n in ("value", "low", "high")}
        self.sources = {name: ColumnDataSource(columns, name=name) for name, columns in given.items()}
        times = seen.columns["all_motion"]["t"]
        time = theme.fixed("range_time", float(times[0]), float(np.max(times)))
        frequency = theme.fixed("range_frequency", 0.0, seen.highest)
        s = self.sources
        self.panels: dict[str, Any] = {
            "history": plots.history(s, lasting["name"], history_height(len(lasting["name"]))),
            "sensors": placed_panels.sensors(s, list(seen.columns["sensors"]["name"])),
            "map": placed_panels.restoring(s), "force": placed_panels.force(s, frequency),
            "stiffness": placed_panels.stiffness(s, frequency), "spectrum": placed_panels.spectrum(s, frequency),
            "motion": placed_panels.motion(s, time), "difference": placed_panels.difference(s, time),
            "close": placed_panels.close(s), "constancy": plots.constancy(s),
        }  # fmt: skip
        # What no panel draws has to hang on one all the same, to be part of the document.
        self.panels["motion"].tags = [*s.values(), *stores]

    def lay(self, document: Document) -> None:
        """Put panels, template and words into an empty document."""
        for panel in self.panels.values():
            document.add_root(panel)
        values = variables(self.session, live=True)
        document.title, document.template = values["title"], template()
        document.template_variables.update(values)
        self.sources["words"].js_on_change("data", CustomJS(code="window.study.words()"))

    def turn_to(self, record: str) -> None:
        """A structure has one record."""

    def show(self, session: PlacedSession) -> None:
        """Draw another model; the words come last, since the page begins anew when they change."""
        self.session, lasting = session, history_columns(session)
        columns = _last_view(session).columns
        for name in columns:
            if name != "words":
                self.sources[name].data = columns[name]
        self.sources["history"].data = lasting
        self.panels["history"].y_range.factors = lasting["name"][::-1]
        self.panels["history"].height = history_height(len(lasting["name"]))
        self.sources["words"].data = columns["words"]


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


@cache
def template() -> Template:
    """The page's template."""
    return Environment(autoescape=False).from_string(_text("placed.html"))


def variables(session: PlacedSession, live: bool) -> dict[str, Any]:
    """What the template needs beside the panels."""
    record, model = session.prepared.record.name, session.now.model.name
    return {
        "record": record, "model": model, "live": live, "title": f"{record}: {model}",
        "style": _text("page.css") + _text("placed.css"), "script": _text("page.js") + _text("placed.js"),
        "steps": [f"{i} {words.in_words(s.label)}" for i, s in enumerate(session.stages)],
    }  # fmt: skip


def _text(name: str) -> str:
    return files("study.explore").joinpath(name).read_text(encoding="utf-8")


def saved_structure(session: PlacedSession) -> bytes:
    """The whole session as a file that a browser opens without a server; it shows the last model first."""
    views = [placed_view(stage, number, live=False) for number, stage in enumerate(session.stages)]
    lasting, stores = history_columns(session), list[ColumnDataSource]()
    for number, seen in enumerate(views if len(views) > 1 else []):
        columns = {**seen.columns, "history": marked(lasting, number - len(views))}
        stores += [ColumnDataSource(c, name=f"{name}@{number}.0") for name, c in columns.items()]
    scene = PlacedScene(session, stores, views[-1])
    return as_file(list(scene.panels.values()), template(), variables(session, live=False))


def structure_files(
    session: PlacedSession, name: str, text: str, values: bool = False, drawn: Drawn | None = None
) -> dict[str, bytes]:
    """What Save writes, by file name: as ``saved_files`` has it for one coordinate."""
    now, steps = session.now, session.steps
    model = now.model.with_values(now.values) if values else now.model
    contents = {
        name: model_file.revised(text, name, model).encode(),
        history.name_for(name): history.as_bytes(steps),
        PAGE: saved_structure(session),
    }
    shown = _drawn(session) if drawn is None else drawn
    return contents | dict(shown) | history_pictures(steps, name.rpartition(".")[0] or name)


def _drawn(session: PlacedSession) -> dict[str, bytes]:
    now = session.now
    contents = {"comparison.json": as_json(structure_document(now.comparison))} | structure_pictures(now.comparison)
    if now.diagnosis is not None:
        contents |= {"diagnosis.json": as_json(structure_report.structure_fields(now.diagnosis, now.unneeded))}
        contents |= diagnosis_pictures(now.diagnosis)
    return contents


def _by_itself(session: PlacedSession) -> PlacedSession:
    return session  # a structure has one record


PLACED = Deeds(
    placed_session.with_placed, placed_session.without_placed, placed_session.undone, placed_session.with_held,
    placed_session.tried, placed_session.examined, placed_session.with_stage, _by_itself, _drawn,
    structure_files,
)  # fmt: skip
