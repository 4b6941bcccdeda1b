"""Panels of what shows a test of its kind and of the checks of the residual."""

from collections.abc import Mapping
from typing import Any

from bokeh.models import ColumnDataSource, Span

from study.explore import theme

Sources = Mapping[str, ColumnDataSource]
HEIGHT = 228  # pixels


def loop(s: Sources, of: str) -> Any:
    """Force over the motion that was prescribed, measured and by the model."""
    drawn = theme.panel(f"loop_{of}", HEIGHT, of, "force", narrow=True)
    measured = drawn.scatter(of, "measured", source=s["loops"], size=3.2, fill_color="#a3adb7", line_color=None)
    predicted = drawn.scatter(of, "predicted", source=s["loops"], size=1.8, fill_color=theme.BLUE, line_color=None)
    theme.legend(drawn, [("measured", [measured]), ("model", [predicted])])
    return drawn


def cycles(s: Sources) -> Any:
    """Energy that each cycle takes, over its stroke."""
    drawn = theme.panel("cycles", HEIGHT, "stroke", "energy", narrow=True)
    look: dict[str, Any] = {"source": s["cycles"], "line_width": 1.3}
    measured = drawn.scatter("stroke", "measured", size=6, fill_color="#a3adb7", line_color="#5c6873", **look)
    predicted = drawn.scatter("stroke", "predicted", marker="x", size=7, line_color=theme.BLUE, **look)
    drawn.x_range.range_padding = 0.08
    theme.legend(drawn, [("measured", [measured]), ("model", [predicted])])
    return drawn


def decay(s: Sources, of: str, label: str) -> Any:
    """Frequency or damping ratio of a decay against its amplitude."""
    drawn = theme.panel(f"decay_{of}", HEIGHT, "amplitude", label, x_axis_type="log")
    bars = drawn.segment("at", f"{of}_low", "at", f"{of}_high", source=s["decay"], line_color="#5c6873", line_width=1.0)
    dots = drawn.scatter("at", of, source=s["decay"], size=5.5, fill_color="#a3adb7", line_color="#5c6873")
    model = drawn.line("at", of, source=s["decay_model"], **theme.PREDICTED)
    drawn.x_range.range_padding = 0.06
    theme.legend(drawn, [("measured, 95 %", [dots, bars]), ("model", [model])])
    return drawn


def magnitude(s: Sources, frequency: Any) -> Any:
    """Response over force, measured with its 95 % band and by the model."""
    drawn = theme.panel(
        "frf", HEIGHT, "frequency / Hz", "magnitude", narrow=True, ranges=(frequency, None), y_axis_type="log"
    )
    band = drawn.varea("f", "low", "high", source=s["frf"], fill_color="#a3adb7", fill_alpha=0.35)
    measured = drawn.line("f", "measured", source=s["frf"], **theme.MEASURED)
    predicted = drawn.line("f", "predicted", source=s["frf"], **theme.PREDICTED)
    theme.follows(drawn, [measured, predicted])
    theme.legend(drawn, [("measured, 95 %", [measured, band]), ("model", [predicted])])
    return drawn


def phase(s: Sources, frequency: Any) -> Any:
    """Its phase in degrees."""
    ranges = (frequency, theme.fixed("range_phase", -190.0, 190.0))
    drawn = theme.panel("phase", HEIGHT, "frequency / Hz", "phase / °", narrow=True, ranges=ranges)
    drawn.yaxis.ticker = [-180, -90, 0, 90, 180]
    measured = drawn.line("f", "phase", source=s["frf"], **theme.MEASURED)
    predicted = drawn.line("f", "phase_predicted", source=s["frf"], **theme.PREDICTED)
    theme.legend(drawn, [("measured", [measured]), ("model", [predicted])])
    return drawn


def linearity(s: Sources, frequency: Any) -> Any:
    """Ordinary coherence of force and response: below one in both, the system is nonlinear; in one, noise or a lack."""
    ranges = (frequency, theme.fixed("range_linearity", 0.0, 1.03))
    drawn = theme.panel("linearity", HEIGHT, "frequency / Hz", "coherence / 1", narrow=True, ranges=ranges)
    measured = drawn.line("f", "coherence", source=s["frf"], **theme.MEASURED)
    predicted = drawn.line("f", "coherence_predicted", source=s["frf"], **theme.PREDICTED)
    theme.legend(drawn, [("measured", [measured]), ("model", [predicted])])
    return drawn


def correlation(s: Sources, name: str, label: str) -> Any:
    """A correlation of the residual, with the 99 % band of what is noise."""
    drawn = theme.panel(name, HEIGHT, "lag / s", label, narrow=True)
    drawn.add_layout(Span(location=0.0, dimension="width", line_color=theme.AXIS, line_width=1.0))
    line = drawn.line("lag", "value", source=s[name], line_color=theme.ORANGE, line_width=1.3)
    band = drawn.multi_line("lag", "level", source=s[f"{name}_band"], **theme.NOISE)
    theme.follows(drawn, [line, band])
    theme.legend(drawn, [("residual", [line]), ("99 % band", [band])])
    return drawn


def histogram(s: Sources) -> Any:
    """Distribution of the residual beside a normal one."""
    drawn = theme.panel("histogram", HEIGHT, "difference / σ", "density / 1", narrow=True)
    bars = drawn.quad(
        left="left", right="right", top="top", bottom=0.0, source=s["histogram"], fill_color="#a3adb7",
        fill_alpha=0.6, line_color=None,
    )  # fmt: skip
    normal = drawn.line("x", "y", source=s["normal"], line_color=theme.INK, line_width=1.3)
    theme.legend(drawn, [("residual", [bars]), ("normal", [normal])])
    return drawn
