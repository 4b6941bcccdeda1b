"""The page: sources, panels and template put together, for a live document and for a saved one alike."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from bokeh.models import BasicTicker, ColumnDataSource, CustomJS, FixedTicker
from jinja2 import Environment, Template

from study.compare.history import label
from study.explore import check_plots, plots, theme, words
from study.explore.any_session import AnySession
from study.explore.axis_scales import Columns
from study.explore.check_columns import FREE, PRESCRIBED, kind_of
from study.explore.page_units import in_text
from study.explore.session import Session
from study.explore.view import View

GHOSTS: dict[str, Columns] = {
    **{f"{kind}_{name}": {x: [], "y": []} for kind in ("ghost", "pinned")
       for name, x in (("time", "t"), ("spectrum", "f"), ("u", "at"), ("v", "at"))},
    "picked_spectrum": {"f": [], "y": []}, "picked_u": {"at": [], "y": []}, "picked_v": {"at": [], "y": []},
    "shown": {"f": [0.0, 1.0], "zero": [0.0, 0.0]} | {name: [np.nan, np.nan] for name in ("value", "low", "high")},
}  # fmt: skip
KINDS = {
    "response": "time", "difference": "time", "force": "band", "coherence": "band", "spectrum": "band",
    "against_u": "u", "against_v": "v",
}  # fmt: skip
CLOSE, SHORT, LONG = 0.5, 1.4, 2.6  # decades of an axis with even ticks, three or two in a decade
TICKS = 5.0  # of a longer axis
MARGIN = 1.2  # by which an axis reaches beyond what it shows, at most
BEGINS, ENDS = ("start", "reset_start"), ("end", "reset_end")  # of a range, the second for the tool that resets it
SELECTED = "if (cb_obj.final) window.study.selected(kind, cb_obj.geometry.x0, cb_obj.geometry.x1)"


@dataclass(frozen=True)
class Page:
    """A page of one document: what is drawn, by name, and the figures, by the name of their place in the template."""

    sources: dict[str, ColumnDataSource]
    panels: dict[str, Any]

    def show(self, seen: View, history: Columns) -> None:
        """Draw another model; the words come last, since the page begins anew when they change."""
        for name, columns in {**seen.columns, "history": history, "frame": frame(seen, history)}.items():
            if name != "words":
                self.sources[name].data = columns
        self.panels["history"].y_range.factors = history["name"][::-1]
        self.panels["history"].height = history_height(len(history["name"]))
        self.sources["words"].data = seen.columns["words"]


def build(seen: View, history: Columns, stores: Sequence[ColumnDataSource] = ()) -> Page:
    """A page that shows one model, with the columns of its history; ``stores`` are further sources of its script."""
    given = {**seen.columns, **GHOSTS, "history": history, "frame": frame(seen, history)}
    sources = {name: ColumnDataSource(columns, name=name) for name, columns in given.items()}
    t, highest = seen.columns["time"]["t"], seen.highest
    time = theme.fixed("range_time", float(t[0]), float(t[-1]))
    frequency = theme.fixed("range_frequency", 0.0, highest)
    frequency.tags = [first_line(seen)]  # where a logarithmic axis begins
    panels: dict[str, Any] = {
        "response": plots.response(sources, time), "difference": plots.difference(sources, time),
        "close": plots.close(sources),
        "force": plots.force(sources, frequency, theme.fixed("range_force", *seen.limits)),
        "coherence": plots.coherence(sources, frequency),
        "spectrum": plots.spectrum(sources, frequency), "plane": plots.plane(sources),
        "against_u": plots.against(sources, "u"), "against_v": plots.against(sources, "v"),
        "history": plots.history(sources, history["name"], history_height(len(history["name"]))),
        "constancy": plots.constancy(sources), **check_plots.panels(sources, frequency, seen.kind),
    }  # fmt: skip
    for name, kind in KINDS.items():
        panels[name].js_on_event("selectiongeometry", CustomJS(args={"kind": kind}, code=SELECTED))
        panels[name].js_on_event("reset", CustomJS(code="window.study.clear()"))
    # What no panel draws has to hang on one all the same, to be part of the document.
    tickers = [
        BasicTicker(name="frequency_even", desired_num_ticks=4),
        FixedTicker(name="frequency_decades", ticks=[], minor_ticks=[]),
    ]
    panels["response"].tags = [*sources.values(), *stores, *tickers]
    return Page(sources, panels)


def placed(made: Page, diagnosed: bool) -> list[Any]:
    """The panels that the template has places for."""
    return [panel for name, panel in made.panels.items() if diagnosed or name != "constancy"]


def history_height(steps: int) -> int:
    """Height of the history in pixels."""
    return 104 + 27 * max(steps, 2)


def history_columns(session: AnySession) -> Columns:
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


def frame(seen: View, history: Columns) -> Columns:
    """Labels and limits that differ from model to model, as settings of named models."""
    scale, t = seen.scales, seen.columns["time"]["t"]
    largest = max(float(np.nanmax(np.abs(seen.columns["plane"]["mean"]), initial=0.0)), seen.least)
    u, v, f, y, d = (
        in_text(s.unit) for s in (scale.displacement, scale.velocity, scale.force, scale.response, scale.difference)
    )
    labels = {
        "response": f"{seen.quantity} / {y}", "close": f"{seen.quantity} / {y}", "difference": f"difference / {d}",
        "spectrum": f"density / ({d}/√Hz)", "plane": f"velocity / {v}", "against_u": f"missing force / {f}",
        "against_v": f"missing force / {f}", "loop_u": f"force / {y}", "loop_v": f"force / {y}",
        "cycles": f"energy / ({y} {u})",
        "frf": f"stiffness / ({y}/{u})" if seen.kind == PRESCRIBED else f"magnitude / ({y}/{seen.force_unit})",
    }  # fmt: skip
    motions = {
        **dict.fromkeys(("plane", "against_u", "loop_u"), f"displacement / {u}"),
        **dict.fromkeys(("against_v", "loop_v"), f"velocity / {v}"), "cycles": f"stroke / {u}",
        **dict.fromkeys(("decay_frequency", "decay_damping"), f"amplitude / {y}"),
    }  # fmt: skip
    rows: list[tuple[str, str, Any]] = [
        *((f"{name}_y", "axis_label", label) for name, label in labels.items()),
        *((f"{name}_x", "axis_label", label) for name, label in motions.items()),
        ("mapper", "low", -largest), ("mapper", "high", largest), ("range_frequency", "end", seen.highest),
        *(("range_time", name, float(t[0])) for name in BEGINS), *(("range_time", name, float(t[-1])) for name in ENDS),
        ("range_force", "start", seen.limits[0]), ("range_force", "end", seen.limits[1]),
        ("range_frequency", "tags", [first_line(seen)]),
        ("frequency_decades", "ticks", log_ticks(seen.highest / 300.0, seen.highest)),
        *((f"{name}_ticks", "ticks", log_ticks(*ends)) for name, ends in _log_axes(seen, history).items()),
    ]  # fmt: skip
    return dict(zip(("model", "property", "value"), map(list, zip(*rows, strict=True)), strict=True))


def first_line(seen: View) -> float:
    """The lowest frequency in hertz that the panels draw."""
    return float(seen.columns["force"]["f"][0])


def _log_axes(seen: View, history: Columns) -> dict[str, tuple[float, float]]:
    """Ends of the logarithmic axes of what is drawn, by the panel."""
    tried = [x for name in ("response", "force", "floor") for x in history[name] if x > 0.0]
    shown = {"force": seen.limits, "history": (min(tried, default=1.0), max(tried, default=1.0))}
    drawn = {"spectrum": [("spectrum", "difference"), ("spectrum", "noise")]}
    if seen.kind == FREE:
        amplitudes = [("decay", "at"), ("decay_model", "at")]
        drawn |= {"decay_frequency": amplitudes, "decay_damping": amplitudes}
    else:
        drawn["frf"] = [("frf", "measured"), ("frf", "predicted")]
    for panel, sources in drawn.items():
        values = np.concatenate([np.asarray(seen.columns[s][name], dtype=np.float64) for s, name in sources])
        values = values[np.isfinite(values) & (values > 0.0)]
        shown[panel] = (float(np.min(values)), float(np.max(values))) if len(values) else (1.0, 1.0)
    return shown


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
    """The page's template."""
    return Environment(autoescape=False).from_string(_text("page.html"))


def variables(session: Session, live: bool) -> dict[str, Any]:
    """What the template needs beside the panels."""
    return {
        "record": session.prepared.record.name, "model": session.now.model.name, "live": live,
        "style": _text("page.css"), "script": _text("page.js"),
        "steps": [words.name(r, i) for i, r in enumerate(session.stages)],
        "several": bool(session.now.on_each), "checks": check_plots.CARDS[kind_of(session.prepared)],
        "diagnosed": live or any(r.diagnosis is not None for r in session.stages),
    }  # fmt: skip


def title(session: Session) -> str:
    """Title of the page."""
    return f"{session.prepared.record.name}: {session.now.model.name}"


def _text(name: str) -> str:
    return files("study.explore").joinpath(name).read_text(encoding="utf-8")
