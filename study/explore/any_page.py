"""What every page has, of one coordinate or of a structure: sources and panels, history, axes, and the template."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.models import BasicTicker, ColumnDataSource, CustomJS, FixedTicker, Range1d
from jinja2 import Environment, FunctionLoader, Template

from study.compare.history import label
from study.explore import theme, words
from study.explore.axis_scales import Columns
from study.explore.session import Session

ROOT = "study"  # of a document
Row = tuple[str, str, Any]  # a model's name, one of its properties, and the value that a stage gives it
Draw = Callable[[Mapping[str, ColumnDataSource], Range1d], dict[str, Any]]
EMPTY: Columns = {"f": [0.0, 1.0], "zero": [0.0, 0.0]} | {n: [np.nan, np.nan] for n in ("value", "low", "high")}
CLOSE, SHORT, LONG = 0.5, 1.4, 2.6  # decades of an axis with even ticks, three or two in a decade
TICKS = 5.0  # of a longer axis
MARGIN = 1.2  # by which an axis reaches beyond what it shows, at most
DECADES = 300.0  # from the end of an axis of frequency down to its first decade


@dataclass(frozen=True)
class Page:
    """A page of one document: what is drawn, by name, and the figures, by the name of their place in the template.

    The document has one root, of which Bokeh draws nothing: the page's script draws the panels, those in view first.
    """

    sources: dict[str, ColumnDataSource]
    panels: dict[str, Any]
    further: list[Any]  # what no panel draws and the script reads

    def show(self, columns: Mapping[str, Columns], history: Columns) -> None:
        """Draw another model; the words come last, since the page begins anew when they change."""
        for name, data in {**columns, "history": history}.items():
            if name != "words":
                self.sources[name].data = data
        self.panels["history"].y_range.factors = history["name"][::-1]
        self.panels["history"].height = history_height(len(history["name"]))
        self.sources["words"].data = columns["words"]

    def root(self, diagnosed: bool) -> ColumnDataSource:
        """What holds all of it; a page that nobody diagnoses has no place for the constancy of a coefficient."""
        panels = [panel for name, panel in self.panels.items() if diagnosed or name != "constancy"]
        return ColumnDataSource(name=ROOT, tags=[*panels, *self.sources.values(), *self.further])

    @property
    def given(self) -> dict[str, Any]:
        """What the template takes from it: words, and the pixels kept free for each panel until it is drawn."""
        words = self.sources["words"].data
        said = dict(zip(words["place"], words["html"], strict=True))
        return {"said": said, "heights": {name: panel.height for name, panel in self.panels.items()}}

    def lay(self, document: Document, values: Mapping[str, Any]) -> None:
        """Put panels, template and words into an empty document."""
        document.add_root(self.root(values["diagnosed"]))
        document.title, document.template = values["title"], template()
        document.template_variables.update({**values, **self.given})
        self.sources["words"].js_on_change("data", CustomJS(code="window.study.words()"))


def page_of(
    columns: Mapping[str, Columns], frequencies: tuple[float, float], draw: Draw, stores: Sequence[ColumnDataSource]
) -> Page:
    """A page of columns by the name of their source, whose panels are drawn from these and an axis of frequency.

    ``frequencies`` in hertz are the lowest and the highest of it; ``stores`` are further sources of its script.
    """
    sources = {name: ColumnDataSource(data, name=name) for name, data in columns.items()}
    axis = theme.fixed("range_frequency", 0.0, frequencies[1])
    axis.tags = [frequencies[0]]  # where a logarithmic one begins
    panels = draw(sources, axis)
    tickers = [
        BasicTicker(name="frequency_even", desired_num_ticks=4),
        FixedTicker(name="frequency_decades", ticks=[], minor_ticks=[]),
    ]
    return Page(sources, panels, [*stores, *tickers])


def frame(rows: Sequence[Row], frequencies: tuple[float, float], ends: Mapping[str, tuple[float, float]]) -> Columns:
    """What differs from model to model beside the data: ``rows``, the axis of frequency, ticks of logarithmic axes.

    ``ends`` are those of the logarithmic axes by their panel.
    """
    first, highest = frequencies
    everything: list[Row] = [
        *rows, ("range_frequency", "end", highest), ("range_frequency", "tags", [first]),
        ("frequency_decades", "ticks", log_ticks(highest / DECADES, highest)),
        *((f"{name}_ticks", "ticks", log_ticks(*between)) for name, between in ends.items()),
    ]  # fmt: skip
    return dict(zip(("model", "property", "value"), map(list, zip(*everything, strict=True)), strict=True))


def time_rows(first: float, last: float) -> list[Row]:
    """The range of time in seconds: where it stands, and where the tool that resets it puts it."""
    ends = {"start": first, "reset_start": first, "end": last, "reset_end": last}
    return [("range_time", name, value) for name, value in ends.items()]


def history_ends(history: Columns) -> tuple[float, float]:
    """Ends of the axis of the history in per cent."""
    tried = [x for name in ("response", "force", "floor") for x in history[name] if x > 0.0]
    return min(tried, default=1.0), max(tried, default=1.0)


def history_height(steps: int) -> int:
    """Height of the history in pixels."""
    return 104 + 27 * max(steps, 2)


def history_columns(session: Session) -> Columns:
    """The history as columns: errors and noise floor in per cent by the name of the step."""
    steps = session.steps
    earlier = [label(step) for step in steps]
    named = [*earlier[: len(steps) - len(session.stages)], *(stage.label for stage in session.stages)]
    return {
        "name": [f"{i} {words.in_words(done)}" for i, done in enumerate(named)],
        "response": [100.0 * step["error"]["response"] for step in steps],
        "force": [100.0 * (step["error"]["force"] or np.nan) for step in steps],
        "floor": [100.0 * step["noise_floor"]["response"] for step in steps],
        "size": [6.0] * (len(steps) - 1) + [10.0],
    }


def log_ticks(low: float, high: float) -> list[float]:
    """Ticks of a logarithmic axis that do not collide: 1, 2, 5 of a decade, 1 and 3, or decades alone."""
    reach = math.log10(high / low)
    if reach < CLOSE:
        return even_ticks(low / MARGIN, high * MARGIN)
    mantissas = (1.0, 2.0, 5.0) if reach < SHORT else (1.0, 3.0) if reach < LONG else (1.0,)
    every = max(1, math.ceil(reach / TICKS))
    first, last = math.floor(math.log10(low)) - 1, math.ceil(math.log10(high)) + 1
    return [m * 10.0**power for power in range(first, last + 1) if power % every == 0 for m in mantissas]


def even_ticks(low: float, high: float) -> list[float]:
    """Three to eight ticks at equal distances of 1, 2 or 5 in their last digit."""
    least = (high - low) / 7.0
    power = 10.0 ** math.floor(math.log10(least))
    step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= least)
    return [step * k for k in range(max(math.ceil(low / step), 1), math.floor(high / step) + 1)]


@cache
def template() -> Template:
    """The template of all pages."""
    return Environment(autoescape=False, loader=FunctionLoader(_text)).get_template("page.html")


def variables(session: Session, live: bool) -> dict[str, Any]:
    """What the template needs beside the panels.

    Style and script are those of all pages, and of a layer on them for coordinates that have names or one that has not.
    """
    record, model = session.prepared.record.name, session.now.model.name
    layer = "placed" if session.now.model.named else "alone"
    style, script = ("".join(_text(f"{n}.{kind}") for n in ("page", layer)) for kind in ("css", "js"))
    return {
        "record": record, "model": model, "title": f"{record}: {model}", "live": live,
        "layer": layer, "style": style, "script": script,
        "steps": [f"{i} {words.in_words(stage.label)}" for i, stage in enumerate(session.stages)],
        "diagnosed": live or any(stage.diagnosis is not None for stage in session.stages),
    }  # fmt: skip


def _text(name: str) -> str:
    return files("study.explore").joinpath(name).read_text(encoding="utf-8")
