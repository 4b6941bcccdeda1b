"""A session as one HTML file, every model of it, no server, no network, the same bytes from the same input.

And what Save writes beside: the model file with its comments, the history, the pictures.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

from bokeh.document import Document
from bokeh.models import ColumnDataSource, CustomJS
from bokeh.resources import Resources

from study.compare import history
from study.compare.comparison import Comparison
from study.compare.comparison_report import as_json, comparison_document, tables
from study.diagnose.confirmed_faults import Diagnosed
from study.diagnose.diagnosis_files import diagnosis_files
from study.diagnose.needless import Needless
from study.equations import model_file
from study.explore import PAGE, html_page
from study.explore.axis_scales import Columns
from study.explore.html_page import ROOT, Page, template
from study.explore.session import Session, Stage, begin_with, with_diagnosis, with_next_test, with_stage, worst
from study.explore.view import View
from study.faults.accounting import Accounted
from study.support.extras import undrawn

EMBED = "Bokeh.safely(() => Bokeh.embed.embed_items({docs}, {items}))"


def saved(session: Session) -> bytes:
    """The whole session as a file that a browser opens; it shows the last model first, where that misses most."""
    views = [
        View(stage, step, False, record)
        for step, stage in enumerate(session.stages)
        for record in range(max(len(stage.on_each), 1))
    ]
    last, worst_missed = len(session.stages) - 1, worst(session.now.on_each)
    first = next(view for view in views if (view.step, view.record) == (last, worst_missed))
    stores = [
        ColumnDataSource(columns, name=f"{name}@{of}")
        for of, given in ((of, given) for view in views for of, given in stored(view, session).items())
        for name, columns in given.items()
    ]
    place = next(iter(first.places))
    turns = len(views) > 1 or len(first.places) > 1 or len(first.sensors) > 1
    made = html_page.build(first, session, first.nearest(place), place, stores if turns else ())
    return as_file(made, html_page.variables(session, live=False))


def stored(view: View, session: Session) -> dict[str, dict[str, Columns]]:
    """What a saved page turns to, by what it is of: a model on a record, with each of its sensors and places."""
    of = f"{view.step}.{view.record}"
    return {
        of: view.of_record(session),
        **{f"{of}.sensor.{sensor}": view.of_sensor(sensor) for sensor in view.sensors},
        **{f"{of}.place.{place}": view.of_place(place) for place in view.places},
    }


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
    return saved(begin_with(Accounted.as_compared(comparison)))


def of_diagnosis(found: Diagnosed, unneeded: tuple[Needless, ...]) -> bytes:
    """The same of a comparison and its diagnosis, and the terms that the model does not need."""
    session = begin_with(found.accounted)
    stage = with_diagnosis(replace(session.now, unneeded=unneeded), found)
    return saved(with_stage(session, with_next_test(stage)))


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


def files(
    session: Session, name: str, text: str, values: bool = False, drawn: Mapping[str, bytes] | None = None
) -> dict[str, bytes]:
    """Contents by file name, of a session whose model came from a file of this name and text: its comments stay.

    With ``values`` the model file gives what was fitted, where the next fit begins; what the session holds stays held.
    ``drawn`` is what :func:`of_stage` gives of the present model, where that is known.
    """
    now = session.now
    held = [key for key, value in now.model.values.items() if value is not None]
    model = now.model.with_values(now.values).opened(held) if values else now.model
    for one in session.several.separate:  # terms that tell the records of this session apart belong to it alone
        for term in [t.name for t in model.terms if set(t.symbols) & set(one.differences)]:
            model = model.without_term(term)
    shown = of_stage(now, by_level=not session.several.separate) if drawn is None else drawn
    steps = session.steps
    return {
        name: model_file.revised(text, name, model).encode(),
        history.name_for(name): history.as_bytes(steps),
        **_history_picture(steps, name.rpartition(".")[0] or name),
        PAGE: saved(session),
        **shown,
    }


def of_stage(now: Stage, by_level: bool = True) -> dict[str, bytes]:
    """Tables of one model, and pictures if they can be drawn, on each of its records and, if ``by_level``, by level."""
    each = now.on_each or (now.comparison,)
    levels = now.by_record.levels if now.by_record is not None and by_level else ()
    contents = {
        "comparison.json": as_json(comparison_document(each, levels)),
        **{f"{table}.csv": content for table, content in tables(each, levels).items()},
    }
    if now.diagnosis is not None:
        contents |= diagnosis_files(now.diagnosis, now.said, now.unneeded or ())
    if undrawn():
        return contents
    from study.compare.comparison_pictures import comparison_pictures, level_pictures

    for comparison in each:
        prefix = f"{comparison.record.name}_" if len(each) > 1 else ""
        contents |= {prefix + name: content for name, content in comparison_pictures(comparison).items()}
    return contents | level_pictures(levels, now.comparison.record.force_and_length[0])


def _history_picture(steps: Sequence[dict[str, Any]], name: str) -> dict[str, bytes]:
    if undrawn():
        return {}
    from study.compare.history_picture import history_files

    return history_files(steps, name)
