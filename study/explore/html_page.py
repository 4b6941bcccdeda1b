"""The page of a session: sources and panels put together, for a live document and for a saved one alike."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, CustomJS

from study.explore import any_page, check_plots, plots, theme
from study.explore.any_page import Page
from study.explore.axis_scales import Columns
from study.explore.check_columns import FREE, PRESCRIBED, kind_of
from study.explore.page_units import in_text
from study.explore.placed_page import placed_columns, placed_page
from study.explore.placed_view import PlacedView, placed_view
from study.explore.session import Session, Stage
from study.explore.view import View, view

Seen = View | PlacedView
GHOSTS: dict[str, Columns] = {
    **{f"{kind}_{name}": {x: [], "y": []} for kind in ("ghost", "pinned")
       for name, x in (("time", "t"), ("spectrum", "f"), ("u", "at"), ("v", "at"))},
    "picked_spectrum": {"f": [], "y": []}, "picked_u": {"at": [], "y": []}, "picked_v": {"at": [], "y": []},
    "shown": any_page.EMPTY,
}  # fmt: skip
KINDS = {
    "response": "time", "difference": "time", "force": "band", "coherence": "band", "spectrum": "band",
    "against_u": "u", "against_v": "v",
}  # fmt: skip
SELECTED = "if (cb_obj.final) window.study.selected(kind, cb_obj.geometry.x0, cb_obj.geometry.x1)"


def seen_of(stage: Stage, step: int, live: bool = True, record: int = 0) -> Seen:
    """What is drawn of a model, by its number in the session, on one of its records; only a ``live`` page can act."""
    return placed_view(stage, step, live, record) if stage.model.named else view(stage, step, live, record)


def build(seen: Seen, history: Columns, stores: Sequence[ColumnDataSource] = ()) -> Page:
    """A page that shows one model, with the columns of its history; ``stores`` are further sources of its script."""
    if isinstance(seen, PlacedView):
        return placed_page(seen, history, stores)
    t = seen.columns["time"]["t"]
    time = theme.fixed("range_time", float(t[0]), float(t[-1]))
    count = len(history["name"])

    def draw(sources: plots.Sources, frequency: Any) -> dict[str, Any]:
        return {
            "response": plots.response(sources, time), "difference": plots.difference(sources, time),
            "close": plots.close(sources),
            "force": plots.force(sources, frequency, theme.fixed("range_force", *seen.limits)),
            "coherence": plots.coherence(sources, frequency),
            "spectrum": plots.spectrum(sources, frequency), "plane": plots.plane(sources),
            "against_u": plots.against(sources, "u"), "against_v": plots.against(sources, "v"),
            "history": plots.history(sources, history["name"], any_page.history_height(count)),
            "constancy": plots.constancy(sources), **check_plots.panels(sources, frequency, seen.kind),
        }  # fmt: skip

    made = any_page.page_of({**columns(seen, history), **GHOSTS, "history": history}, _frequencies(seen), draw, stores)
    for name, kind in KINDS.items():
        made.panels[name].js_on_event("selectiongeometry", CustomJS(args={"kind": kind}, code=SELECTED))
        made.panels[name].js_on_event("reset", CustomJS(code="window.study.clear()"))
    return made


def columns(seen: Seen, history: Columns) -> dict[str, Columns]:
    """What a model gives the sources of a page."""
    if isinstance(seen, PlacedView):
        return placed_columns(seen, history)
    return {**seen.columns, "frame": frame(seen, history)}


def _frequencies(seen: View) -> tuple[float, float]:
    """The lowest frequency in hertz that the panels draw, and the highest."""
    return float(seen.columns["force"]["f"][0]), seen.highest


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
    rows: list[any_page.Row] = [
        *((f"{name}_y", "axis_label", label) for name, label in labels.items()),
        *((f"{name}_x", "axis_label", label) for name, label in motions.items()),
        ("mapper", "low", -largest), ("mapper", "high", largest),
        *any_page.time_rows(float(t[0]), float(t[-1])),
        ("range_force", "start", seen.limits[0]), ("range_force", "end", seen.limits[1]),
    ]  # fmt: skip
    return any_page.frame(rows, _frequencies(seen), _log_axes(seen, history))


def _log_axes(seen: View, history: Columns) -> dict[str, tuple[float, float]]:
    """Ends of the logarithmic axes of what is drawn, by the panel."""
    shown = {"force": seen.limits, "history": any_page.history_ends(history)}
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


def variables(session: Session, live: bool) -> dict[str, Any]:
    """What the template needs beside the panels."""
    checks = () if session.now.model.named else check_plots.CARDS[kind_of(session.prepared)]
    return {**any_page.variables(session, live), "several": bool(session.now.on_each), "checks": checks}
