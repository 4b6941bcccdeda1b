"""A session as one HTML file: every model of the session, no server, no network, the same bytes from the same input."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

from bokeh.document import Document
from bokeh.models import ColumnDataSource, CustomJS
from bokeh.resources import Resources

from study.compare.comparison import Comparison
from study.diagnose.needless import Needless
from study.diagnose.verdict import Diagnosis
from study.explore import html_page
from study.explore.any_page import ROOT, Page, history_columns, template
from study.explore.axis_scales import Columns
from study.explore.by_record import worst
from study.explore.session import Session, begin_with, with_diagnosis, with_stage

EMBED = "Bokeh.safely(() => Bokeh.embed.embed_items({docs}, {items}))"


def saved(session: Session) -> bytes:
    """The whole session as a file that a browser opens; it shows the last model first, where that misses most."""
    history, first = history_columns(session), (len(session.stages) - 1, worst(session.now.on_each))
    views = {
        (number, record): html_page.seen_of(stage, number, live=False, record=record)
        for number, stage in enumerate(session.stages)
        for record in range(max(len(stage.on_each), 1))
    }
    stores = stored({place: html_page.columns(seen, history) for place, seen in views.items()}, history)
    made = html_page.build(views[first], history, stores)
    return as_file(made, html_page.variables(session, live=False))


def stored(columns: Mapping[tuple[int, int], Mapping[str, Columns]], history: Columns) -> list[ColumnDataSource]:
    """What a saved page turns to: the columns of each stage, counted from 0, and record; nothing of a single one."""
    many = 1 + max(stage for stage, _ in columns)
    stores: list[ColumnDataSource] = []
    for (stage, record), shown in columns.items() if len(columns) > 1 else ():
        given = {**shown, "history": _marked(history, stage - many)}
        stores += [ColumnDataSource(c, name=f"{name}@{stage}.{record}") for name, c in given.items()]
    return stores


def as_file(made: Page, values: Mapping[str, Any]) -> bytes:
    """A page as a file that needs no server; each panel has its place in the template by its own name."""
    document, root = Document(), made.root(values["diagnosed"])
    document.add_root(root)
    document.js_on_event("document_ready", CustomJS(code="window.study.begin()"))
    content, ids = _numbered(document.to_json(deferred=False))
    place = SimpleNamespace(id=ids[root.id], elementid="study-root")
    items = [{"docid": "study", "roots": {place.id: place.elementid}, "root_ids": [place.id]}]
    script = EMBED.format(docs=_in_script({"study": content}), items=_in_script(items))
    text = template().render(
        **values, **made.given, roots={ROOT: place}, plot_script=f"<script>{script}</script>",
        bokeh_js=Resources(mode="inline", components=["bokeh"], minified=True, log_level="error").render_js(),
    )  # fmt: skip
    return text.encode()


def of_comparison(comparison: Comparison) -> bytes:
    """The same of a comparison alone, which nobody has diagnosed."""
    return saved(begin_with(comparison))


def of_diagnosis(comparison: Comparison, diagnosis: Diagnosis, unneeded: tuple[Needless, ...]) -> bytes:
    """The same of a comparison and its diagnosis, and the terms that the model does not need."""
    session = begin_with(comparison)
    return saved(with_stage(session, with_diagnosis(replace(session.now, unneeded=unneeded), diagnosis)))


def _marked(history: Columns, place: int) -> Columns:
    """The history with a larger dot where the page stands."""
    size = [6.0] * len(history["size"])
    size[place] = 10.0
    return {**history, "size": size}


def _in_script(content: object) -> str:
    """JSON within a script: nothing in it can end the script."""
    return json.dumps(content, ensure_ascii=True, separators=(",", ":")).replace("<", "\\u003c")


def _numbered(content: Any) -> tuple[Any, dict[str, str]]:
    """The document with its ids counted from one, in the order in which they come: Bokeh's depend on the past."""
    known: dict[str, str] = {}

    def walk(value: Any) -> Any:
        if isinstance(value, dict):
            pairs = cast("dict[str, Any]", value).items()
            return {key: name(item) if key == "id" else walk(item) for key, item in pairs}
        if isinstance(value, list | tuple):
            return [walk(item) for item in cast("Sequence[Any]", value)]
        return value

    def name(item: Any) -> Any:
        return known.setdefault(item, f"e{len(known) + 1}") if isinstance(item, str) else walk(item)

    return walk(content), known
