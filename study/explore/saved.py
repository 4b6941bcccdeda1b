"""A session as one HTML file: every model of the session, no server, no network, the same bytes from the same input."""

import json
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

from bokeh.document import Document
from bokeh.models import ColumnDataSource, CustomJS
from bokeh.resources import Resources

from study.compare.comparison import Comparison
from study.explore import html_page
from study.explore.axis_scales import Columns
from study.explore.by_record import worst
from study.explore.session import Session, begin_with
from study.explore.view import view

EMBED = "Bokeh.safely(() => Bokeh.embed.embed_items({docs}, {items}))"


def saved(session: Session) -> bytes:
    """The whole session as a file that a browser opens; it shows the last model first, where that misses most."""
    many, first = len(session.stages), (len(session.stages) - 1, worst(session.now.on_each))
    views = {
        (number, record): view(stage, number, live=False, record=record)
        for number, stage in enumerate(session.stages)
        for record in range(max(len(stage.on_each), 1))
    }
    history = html_page.history_columns(session)
    stores: list[ColumnDataSource] = []
    for (number, record), seen in views.items() if len(views) > 1 else ():
        columns: dict[str, Columns] = {
            **seen.columns, "frame": html_page.frame(seen, history), "history": _marked(history, number - many)
        }  # fmt: skip
        stores += [ColumnDataSource(c, name=f"{name}@{number}.{record}") for name, c in columns.items()]
    made = html_page.build(views[first], history, stores)
    values = html_page.variables(session, live=False)
    shown = html_page.placed(made, values["diagnosed"])
    document = Document()
    with document.models.freeze():  # what belongs to the document is gathered once, not anew for each panel
        for panel in shown:
            document.add_root(panel)
    document.js_on_event("document_ready", CustomJS(code="window.study.begin()"))
    content, ids = _numbered(document.to_json(deferred=False))
    roots = {p.name: SimpleNamespace(id=ids[p.id], elementid=f"study-{p.name}") for p in shown}
    items = [{"docid": "study", "roots": {r.id: r.elementid for r in roots.values()},
              "root_ids": [r.id for r in roots.values()]}]  # fmt: skip
    script = EMBED.format(docs=_in_script({"study": content}), items=_in_script(items))
    text = html_page.template().render(
        **values, title=html_page.title(session), roots=roots, plot_script=f"<script>{script}</script>",
        bokeh_js=Resources(mode="inline", components=["bokeh"], minified=True, log_level="error").render_js(),
    )  # fmt: skip
    return text.encode()


def of_comparison(comparison: Comparison) -> bytes:
    """The same of a comparison alone, which nobody has diagnosed."""
    return saved(begin_with(comparison))


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
