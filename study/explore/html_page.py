"""The page of a session: sources and panels put together, for a live document and for a saved one alike."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.models import BasicTicker, ColumnDataSource, CustomJS, FixedTicker
from jinja2 import Environment, FunctionLoader, Template

from study.explore.axis_scales import Columns
from study.explore.cards import cards_of, drawn
from study.explore.session import Session
from study.explore.view import View
from study.explore.words import in_words

ROOT = "study"  # of a document
ALWAYS = ("history", "response", "difference", "close", "constancy")  # panels of every page
SCRIPTED: dict[str, Columns] = {  # what the page's script fills
    **{f"{kind}_{name}": {x: [], "y": []} for kind in ("ghost", "pinned")
       for name, x in (("time", "t"), ("spectrum", "f"), ("u", "at"), ("v", "at"))},
    "picked_spectrum": {"f": [], "y": []}, "picked_u": {"at": [], "y": []}, "picked_v": {"at": [], "y": []},
    "shown": {"f": [0.0, 1.0], "zero": [0.0, 0.0], **{n: [np.nan, np.nan] for n in ("value", "low", "high")}},
}  # fmt: skip
SELECTIONS = {
    "response": "time", "difference": "time", "force": "band", "coherence": "band", "spectrum": "band",
    "against_u": "u", "against_v": "v",
}  # fmt: skip
SELECTED = "if (cb_obj.final) window.study.selected(kind, cb_obj.geometry.x0, cb_obj.geometry.x1)"


@dataclass(frozen=True)
class Page:
    """A page of one document: what is drawn, by name, and the figures, by the name of their place in the template.

    The document has one root, of which Bokeh draws nothing: the page's script draws the panels, those in view first.
    """

    sources: dict[str, ColumnDataSource]
    panels: dict[str, Any]
    further: list[Any]  # what no panel draws and the script reads

    def put(self, columns: Mapping[str, Columns]) -> None:
        """Draw other columns; the words come last, since the page begins anew when they change."""
        for name in sorted(columns, key=lambda name: name == "words"):
            self.sources[name].data = columns[name]

    def root(self, diagnosed: bool) -> ColumnDataSource:
        """What holds all of it; a page that nobody diagnoses has no place for the constancy of a coefficient."""
        panels = [panel for name, panel in self.panels.items() if diagnosed or name != "constancy"]
        return ColumnDataSource(name=ROOT, tags=[*panels, *self.sources.values(), *self.further])

    @property
    def given(self) -> dict[str, Any]:
        """What the template takes from it: words, and the pixels kept free for each panel until it is drawn."""
        words, place = self.sources["words"].data, self.sources["frame_place"].data
        rows = zip(place["model"], place["property"], place["value"], strict=True)
        said = dict(zip(words["place"], words["html"], strict=True)) | {n: x for n, p, x in rows if p == "html"}
        return {"said": said, "heights": {name: panel.height for name, panel in self.panels.items()}}

    def lay(self, document: Document, values: Mapping[str, Any]) -> None:
        """Put panels, template and words into an empty document."""
        document.add_root(self.root(values["diagnosed"]))
        document.title, document.template = values["title"], template()
        document.template_variables.update({**values, **self.given})
        for source, called in (("words", "words"), ("turned", "settled")):
            self.sources[source].js_on_change("data", CustomJS(code=f"window.study.{called}()"))


def turned(sensor: str, place: str) -> Columns:
    """Which sensor and which place the panels show."""
    return {"sensor": [sensor], "place": [place]}


def build(
    view: View, session: Session, sensor: str, place: str, stores: Sequence[ColumnDataSource] = ()
) -> Page:  # fmt: skip
    """A page that shows one model, turned to a sensor and a place; ``stores`` are further sources of its script."""
    columns = {
        **view.of_record(session), **view.of_sensor(sensor), **view.of_place(place), "turned": turned(sensor, place),
        **SCRIPTED,
    }  # fmt: skip
    sources = {name: ColumnDataSource(data, name=name) for name, data in columns.items()}
    cards = [card for part in cards_of(view.stage.comparison) for card in part]
    panels = drawn([*ALWAYS, *(panel.name for card in cards for panel in card)], sources)
    for name in SELECTIONS.keys() & panels.keys():
        panels[name].js_on_event("selectiongeometry", CustomJS(args={"kind": SELECTIONS[name]}, code=SELECTED))
        panels[name].js_on_event("reset", CustomJS(code="window.study.clear()"))
    tickers = [
        BasicTicker(name="frequency_even", desired_num_ticks=4),
        FixedTicker(name="frequency_decades", ticks=[], minor_ticks=[]),
    ]
    return Page(sources, panels, [*stores, *tickers])


@cache
def template() -> Template:
    """The template of all pages."""
    return Environment(autoescape=False, loader=FunctionLoader(_text)).get_template("page.html")


def variables(session: Session, live: bool) -> dict[str, Any]:
    """What the template needs beside the panels."""
    now = session.now
    record, model = now.comparison.record.name, now.model.name
    above, below = cards_of(now.comparison)
    return {
        "record": record, "model": model, "title": f"{record}: {model}", "live": live, "style": _text("page.css"),
        "script": _text("page.js"), "several": bool(now.on_each), "places": now.model.named, "above": above,
        "below": below, "sensors": [str(seen.sensor) for seen in now.comparison.views],
        "steps": [f"{i} {in_words(stage.label)}" for i, stage in enumerate(session.stages)],
        "diagnosed": live or any(stage.diagnosis is not None for stage in session.stages),
    }  # fmt: skip


def _text(name: str) -> str:
    return files("study.explore").joinpath(name).read_text(encoding="utf-8")
