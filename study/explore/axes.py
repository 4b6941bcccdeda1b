"""Labels, limits and ticks of a page's axes: rows of a named model, one of its properties, and the value.

A row of the property ``html`` names an element of the document instead.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from study.compare.comparison import Comparison
from study.compare.loops import along_what, stroke_of
from study.explore.axis_scales import Columns, Focus, heard, highest, log_axis, log_ticks
from study.explore.cards import history_height
from study.explore.check_columns import FREE, PRESCRIBED, kind_of
from study.explore.page_units import Scale, in_text

Row = tuple[str, str, Any]


def record_axes(comparison: Comparison, columns: Mapping[str, Columns]) -> list[Row]:
    """Those that one record's panels share: time, frequency, share of the force, and the history of errors."""
    time, last, frequency = comparison.prediction.time, highest(comparison), comparison.prediction.of(0).noise.frequency
    ends = {"start": float(time[0]), "end": float(time[-1])}
    history = [columns["history"][name] for name in ("response", "force", "floor")]
    limits = force_limits(comparison)
    return [
        *(("range_time", f"{reset}{name}", at) for name, at in ends.items() for reset in ("", "reset_")),
        ("range_frequency", "end", last),
        ("range_frequency", "tags", [float(np.min(frequency[heard(comparison, frequency)], initial=last))]),  # of log f
        # the first decade of an axis of frequency lies so far below its end
        ("frequency_decades", "ticks", log_ticks(last / 300.0, last)),
        ("range_force", "start", limits[0]), ("range_force", "end", limits[1]),
        ("force_ticks", "ticks", log_ticks(*limits)), ("history_ticks", "ticks", log_ticks(*log_axis(*history))),
        ("range_history", "factors", columns["history"]["name"][::-1]),
        ("panel_history", "height", history_height(len(columns["history"]["name"]))),
    ]  # fmt: skip


def force_limits(comparison: Comparison) -> tuple[float, float]:
    """Ends of the axis of the force in per cent: where the motion is lost in noise, shares leave the panel."""
    if not comparison.forces:
        return 1.0, 100.0
    least, most = math.inf, 0.0
    for force in comparison.forces:
        keep = heard(comparison, force.frequency)
        shares = force.parametric, force.unexplained, force.noise
        least = min(least, *(float(np.min(s[keep], initial=math.inf)) for s in shares))
        most = max(most, *(float(np.max(s[force.band], initial=0.0)) for s in shares[:2]))
    low = 50.0 * max(least, 1e-9) if math.isfinite(least) else 1.0  # a short record may have no line in the panel
    return low, max(200.0, 150.0 * most)


def sensor_axes(focus: Focus, columns: Mapping[str, Columns]) -> list[Row]:
    """Those of the panels that show one sensor, and the logarithmic ones of what is drawn of it."""
    kind, record, quantity = kind_of(focus.comparison), focus.comparison.record, focus.sensor.sensor.motion
    y, d, u, v = (in_text(s.unit) for s in (focus.response, focus.difference, focus.displacement, focus.velocity))
    stroke = along_what(stroke_of(focus.comparison.model, focus.sensor.sensor.coordinate))
    of = f"{stroke} " if stroke else ""
    drive = in_text(record.unit(record.forces[0])) if record.forces else ""  # a structure's decay has none
    labels = {
        "response_y": f"{quantity} / {y}", "close_y": f"{quantity} / {y}", "difference_y": f"difference / {d}",
        "spectrum_y": f"density / ({d}/√Hz)", "loop_u_y": f"force / {y}", "loop_v_y": f"force / {y}",
        "loop_u_x": f"{of}displacement / {u}", "loop_v_x": f"{of}velocity / {v}", "cycles_x": f"stroke / {u}",
        "cycles_y": f"energy / ({y} {u})",
        **dict.fromkeys(("decay_frequency_x", "decay_damping_x"), f"amplitude / {y}"),
        "frf_y": f"stiffness / ({y}/{u})" if kind == PRESCRIBED else f"magnitude / ({y}/{drive})",
    }  # fmt: skip
    drawn = {"spectrum": [("spectrum", "difference"), ("spectrum", "noise")]}
    if kind == FREE:
        amplitudes = [("decay", "at"), ("decay_model", "at")]
        drawn |= {"decay_frequency": amplitudes, "decay_damping": amplitudes}
    else:
        drawn["frf"] = [("frf", "measured"), ("frf", "predicted")]
    logs = {panel: [columns[s][name] for s, name in of if s in columns] for panel, of in drawn.items()}
    return [
        *((axis, "axis_label", label) for axis, label in labels.items()),
        *((f"{panel}_ticks", "ticks", log_ticks(*log_axis(*shown))) for panel, shown in logs.items() if shown),
    ]


def place_axes(focus: Focus, columns: Mapping[str, Columns], stiffness: Scale, least: float) -> list[Row]:
    """Those of the panels that show one place; ``least`` is a force on their axis that is too small to see."""
    u, v, f, a = (in_text(s.unit) for s in (focus.displacement, focus.velocity, focus.force, stiffness))
    largest = max(float(np.nanmax(np.abs(columns["plane"]["mean"]), initial=0.0)), least)
    labels = {
        "plane_x": f"displacement / {u}", "plane_y": f"velocity / {v}", "against_u_x": f"displacement / {u}",
        "against_v_x": f"velocity / {v}", "against_u_y": f"missing force / {f}", "against_v_y": f"missing force / {f}",
        "lacking_y": f"missing force / ({f}/√Hz)", "stiffness_y": f"stiffness / ({a})",
    }  # fmt: skip
    rows: Sequence[Row] = [(axis, "axis_label", label) for axis, label in labels.items()]
    return [*rows, ("mapper", "low", -largest), ("mapper", "high", largest)]
