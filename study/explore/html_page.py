"""The page: sources, panels and template put together, for a live document and for a saved one alike."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, CustomJS
from jinja2 import Environment, Template

from study.explore import plots, theme, words
from study.explore.page_units import in_text
from study.explore.session import Session, Step
from study.explore.view import Columns, View

GHOSTS: dict[str, Columns] = {
    "ghost_time": {"t": [], "y": []}, "ghost_spectrum": {"f": [], "y": []}, "ghost_u": {"at": [], "y": []},
    "ghost_v": {"at": [], "y": []}, "picked_spectrum": {"f": [], "y": []}, "picked_u": {"at": [], "y": []},
    "picked_v": {"at": [], "y": []},
    "shown": {"f": [0.0, 1.0], "zero": [0.0, 0.0]} | {name: [np.nan, np.nan] for name in ("value", "low", "high")},
}  # fmt: skip
KINDS = {
    "response": "time", "difference": "time", "force": "band", "coherence": "band", "spectrum": "band",
    "against_u": "u", "against_v": "v",
}  # fmt: skip
SELECTED = "if (cb_obj.final) window.study.selected(kind, cb_obj.geometry.x0, cb_obj.geometry.x1)"


@dataclass(frozen=True)
class Page:
    """A page of one document.

    Attributes
    ----------
    sources : dict
        What is drawn, by name.
    panels : dict
        The figures, by the name of their place in the template.
    """

    sources: dict[str, ColumnDataSource]
    panels: dict[str, Any]

    def show(self, seen: View, ladder: Columns) -> None:
        """Draw another rung; the words come last, since the page begins anew when they change."""
        for name, columns in {**seen.columns, "ladder": ladder, "frame": frame(seen)}.items():
            if name != "words":
                self.sources[name].data = columns
        self.panels["ladder"].y_range.factors = ladder["name"][::-1]
        self.panels["ladder"].height = ladder_height(len(ladder["name"]))
        self.sources["words"].data = seen.columns["words"]


def build(seen: View, ladder: Columns, stores: Sequence[ColumnDataSource] = ()) -> Page:
    """A page that shows one rung.

    Parameters
    ----------
    seen : View
        The rung.
    ladder : dict
        Columns of :func:`ladder_columns`.
    stores : sequence of ColumnDataSource
        Further sources that the page's script looks up by name.
    """
    given = {**seen.columns, **GHOSTS, "ladder": ladder, "frame": frame(seen)}
    sources = {name: ColumnDataSource(columns, name=name) for name, columns in given.items()}
    t, highest = seen.columns["time"]["t"], seen.highest
    time = theme.fixed("range_time", float(t[0]), float(t[-1]))
    frequency = theme.fixed("range_frequency", 0.0, highest)
    panels: dict[str, Any] = {
        "response": plots.response(sources, time), "difference": plots.difference(sources, time),
        "close": plots.close(sources),
        "force": plots.force(sources, frequency, theme.fixed("range_force", *seen.limits)),
        "coherence": plots.coherence(sources, frequency),
        "spectrum": plots.spectrum(sources, frequency), "plane": plots.plane(sources),
        "against_u": plots.against(sources, "u"), "against_v": plots.against(sources, "v"),
        "ladder": plots.ladder(sources, ladder["name"], ladder_height(len(ladder["name"]))),
        "constancy": plots.constancy(sources),
    }  # fmt: skip
    for name, kind in KINDS.items():
        panels[name].js_on_event("selectiongeometry", CustomJS(args={"kind": kind}, code=SELECTED))
        panels[name].js_on_event("reset", CustomJS(code="window.study.clear()"))
    # What no panel draws has to hang on one all the same, to be part of the document.
    panels["response"].tags = [*sources.values(), *stores]
    return Page(sources, panels)


def placed(made: Page, diagnosed: bool) -> list[Any]:
    """The panels that the template has places for."""
    return [panel for name, panel in made.panels.items() if diagnosed or name != "constancy"]


def ladder_height(steps: int) -> int:
    """Height of the ladder in pixels."""
    return 84 + 27 * max(steps, 2)


def ladder_columns(session: Session) -> Columns:
    """The ladder as columns: errors and noise floor in per cent by the name of the step."""
    return ladder_of(session.steps, [r.label for r in session.rungs])


def ladder_of(steps: Sequence[Step], labels: Sequence[str]) -> Columns:
    """The same of steps as they are kept; the last of them have labels of their own."""
    named = ["as given" if not s.get("added") else f"+ {s['added']}" for s in steps]
    named[len(named) - len(labels) :] = labels
    size = [6.0] * (len(steps) - 1) + [10.0]
    return {
        "name": [f"{i} {words.in_words(label)}" for i, label in enumerate(named)],
        "response": [100.0 * s["error"]["response"] for s in steps],
        "force": [100.0 * (s["error"]["force"] or np.nan) for s in steps],
        "floor": [100.0 * s["noise_floor"]["response"] for s in steps],
        "size": size,
    }


def frame(seen: View) -> Columns:
    """Labels and limits that differ from rung to rung, as settings of named models."""
    scale = seen.scales
    largest = max(float(np.nanmax(np.abs(seen.columns["plane"]["mean"]), initial=0.0)), seen.least)
    u, v, f = (in_text(s.unit) for s in (scale.displacement, scale.velocity, scale.force))
    rows: list[tuple[str, str, Any]] = [
        ("response_y", "axis_label", f"{seen.quantity} / {in_text(scale.response.unit)}"),
        ("close_y", "axis_label", f"{seen.quantity} / {in_text(scale.response.unit)}"),
        ("difference_y", "axis_label", f"difference / {in_text(scale.difference.unit)}"),
        ("spectrum_y", "axis_label", f"amplitude density / {in_text(scale.difference.unit)}/√Hz"),
        ("plane_x", "axis_label", f"displacement / {u}"), ("plane_y", "axis_label", f"velocity / {v}"),
        ("against_u_x", "axis_label", f"displacement / {u}"), ("against_u_y", "axis_label", f"missing force / {f}"),
        ("against_v_x", "axis_label", f"velocity / {v}"), ("against_v_y", "axis_label", f"missing force / {f}"),
        ("mapper", "low", -largest), ("mapper", "high", largest),
        ("range_frequency", "end", seen.highest), ("range_force", "start", seen.limits[0]),
        ("range_force", "end", seen.limits[1]),
    ]  # fmt: skip
    return {"model": [r[0] for r in rows], "property": [r[1] for r in rows], "value": [r[2] for r in rows]}


@cache
def template() -> Template:
    """The page's template."""
    return Environment(autoescape=False).from_string(_text("page.html"))


def variables(session: Session, live: bool) -> dict[str, Any]:
    """What the template needs beside the panels."""
    return {
        "record": session.prepared.record.name, "model": session.now.model.name, "live": live,
        "style": _text("page.css"), "script": _text("page.js"),
        "steps": [words.name(r, i) for i, r in enumerate(session.rungs)],
        "diagnosed": live or any(r.diagnosis is not None for r in session.rungs),
    }  # fmt: skip


def title(session: Session) -> str:
    """Title of the page."""
    return f"{session.prepared.record.name}: {session.now.model.name}"


def _text(name: str) -> str:
    return files("study.explore").joinpath(name).read_text(encoding="utf-8")
