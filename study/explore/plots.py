"""The panels, each from named sources: a panel draws columns and knows nothing of where they come from."""

from collections.abc import Mapping
from typing import Any, cast

from bokeh.models import (
    ColorBar,
    ColumnDataSource,
    CustomJSTickFormatter,
    FactorRange,
    HoverTool,
    LinearColorMapper,
    Quad,
    Span,
    VStrip,
)
from bokeh.palettes import RdBu11

from study.explore import theme

Sources = Mapping[str, ColumnDataSource]


def response(s: Sources, time: Any) -> Any:
    """Measured and predicted response."""
    drawn = theme.panel("response", 170, "", "response", select=True, ranges=(time, None))
    drawn.xaxis.visible = False
    _blocks(drawn, s)
    measured = drawn.line("t", "measured", source=s["time"], **theme.MEASURED_LINE)
    predicted = drawn.line("t", "predicted", source=s["time"], **theme.PREDICTED_LINE)
    theme.chosen(drawn, "box_response")
    theme.follows(drawn, [measured, predicted])
    theme.legend(drawn, [("measured", [measured]), ("free run of the model", [predicted])])
    return drawn


def difference(s: Sources, time: Any) -> Any:
    """What the model misses, the noise, and what a candidate would leave."""
    drawn = theme.panel("difference", 178, "time / s", "difference", select=True, ranges=(time, None))
    drawn.yaxis[0].ticker.desired_num_ticks = 4  # it is low
    _blocks(drawn, s)
    line = drawn.line("t", "difference", source=s["time"], **theme.DIFFERENCE)
    would = drawn.line("t", "y", source=s["ghost_time"], **theme.WOULD)
    pinned = drawn.line("t", "y", source=s["pinned_time"], **theme.PINNED)
    noise = drawn.multi_line("t", "level", source=s["noise"], **theme.NOISE)
    theme.chosen(drawn, "box_difference")
    theme.follows(drawn, [line, noise])
    named = [("difference", [line]), ("± twice the noise", [noise])]
    theme.legend(drawn, [*named, ("candidate", [would]), ("pinned", [pinned])])
    return drawn


def close(s: Sources) -> Any:
    """The same where the model misses most, or where a stretch was selected."""
    drawn = theme.panel("close", 348, "time / s", "response", narrow=True)
    measured = drawn.line("t", "measured", source=s["close"], **theme.MEASURED_LINE | {"line_width": 3.4})
    predicted = drawn.line("t", "predicted", source=s["close"], **theme.PREDICTED_LINE | {"line_width": 1.5})
    theme.legend(drawn, [("measured", [measured]), ("free run", [predicted])])
    return drawn


def _blocks(drawn: Any, s: Sources) -> None:
    """The stretches of time in which a selected band or amplitude is at home."""
    strips = VStrip(x0="left", x1="right", fill_color=theme.AMBER, fill_alpha="weight", line_color=None)
    drawn.add_glyph(s["blocks"], strips, level="underlay", nonselection_glyph=None)


def force(s: Sources, frequency: Any) -> Any:
    """Unexplained share of the force with the noise floor; ends of its axis are set with its data."""
    share = theme.fixed("range_force", 1.0, 100.0)
    drawn = theme.panel(
        "force", 240, "frequency / Hz", "unexplained share / %", select=True, ranges=(frequency, share),
        narrow=True, y_axis_type="log",
    )  # fmt: skip
    left = drawn.line("f", "parametric", source=s["force"], line_color=theme.BLUE, line_width=1.6)
    least = drawn.line("f", "unexplained", source=s["force"], line_color=theme.ORANGE, line_width=1.4, line_dash=[6, 3])
    noise = drawn.line("f", "noise", source=s["force"], **theme.NOISE)
    theme.chosen(drawn, "box_force")
    theme.legend(drawn, [("fitted", [left]), ("1 − coherence", [least]), ("noise", [noise])])
    return drawn


def coherence(s: Sources, frequency: Any) -> Any:
    """Cumulative coherence: what the inputs explain, one after the other."""
    ranges = (frequency, theme.fixed("range_coherence", 0.0, 1.03))
    drawn = theme.panel("coherence", 240, "frequency / Hz", "cumulative coherence / 1", select=True, ranges=ranges,
                        narrow=True)  # fmt: skip
    lines = drawn.multi_line("f", "share", source=s["coherence"], line_color="colour", line_dash="dash", line_width=1.5)
    theme.legend(drawn, [({"field": "name"}, [lines])])
    theme.chosen(drawn, "box_coherence")
    return drawn


def spectrum(s: Sources, frequency: Any) -> Any:
    """The difference of the response by frequency, the noise, what is selected and what a candidate would leave."""
    drawn = theme.panel(
        "spectrum", 240, "frequency / Hz", "difference", select=True, ranges=(frequency, None),
        narrow=True, y_axis_type="log",
    )  # fmt: skip
    line = drawn.line("f", "difference", source=s["spectrum"], line_color=theme.ORANGE, line_width=1.5)
    noise = drawn.line("f", "noise", source=s["spectrum"], **theme.NOISE)
    would = drawn.line("f", "y", source=s["ghost_spectrum"], **theme.WOULD)
    drawn.line("f", "y", source=s["pinned_spectrum"], **theme.PINNED)
    picked = drawn.line("f", "y", source=s["picked_spectrum"], **theme.PICKED)
    theme.chosen(drawn, "box_spectrum")
    theme.follows(drawn, [line, noise])
    theme.legend(drawn, [("difference", [line]), ("noise", [noise]), ("candidate", [would]), ("selected", [picked])])
    return drawn


def sensors(s: Sources) -> Any:
    """Error of each sensor over its rms motion, beside what noise alone would leave."""
    names = _names(s["sensors"], 0.1)
    height = 74 + 24 * max(len(names.factors), 3)  # pixels
    drawn = theme.panel("sensors", height, "error of the sensor / %", "", narrow=True, ranges=(None, names))
    error = drawn.hbar(y="name", right="error", height=0.6, source=s["sensors"], fill_color="#e08a4a", line_color=None)
    floor = drawn.hbar(y="name", right="floor", height=0.22, source=s["sensors"], fill_color=theme.INK, line_color=None)
    drawn.x_range.start = 0.0
    drawn.yaxis.major_label_text_color = theme.INK
    theme.legend(drawn, [("error of the free run", [error]), ("noise floor", [floor])])
    return drawn


def _names(source: ColumnDataSource, padding: float) -> Any:
    """The range of an axis with the names of a source from top to bottom."""
    names = cast("list[str]", source.data["name"])[::-1]
    return FactorRange(factors=names, name=f"range_{source.name}", range_padding=padding)


def lacking(s: Sources, frequency: Any) -> Any:
    """Density of the force that is missing at a place."""
    drawn = theme.panel("lacking", 250, "frequency / Hz", "missing force", narrow=True, ranges=(frequency, None))
    line = drawn.line("f", "force", source=s["lacking"], line_color=theme.ORANGE, line_width=1.5)
    drawn.y_range.start = 0.0
    theme.legend(drawn, [("missing at the place", [line])])
    return drawn


def stiffness(s: Sources, frequency: Any) -> Any:
    """Real part of the dynamic stiffness of a connection, as measured and as the model has it."""
    drawn = theme.panel("stiffness", 250, "frequency / Hz", "stiffness", narrow=True, ranges=(frequency, None))
    look: dict[str, Any] = {"source": s["stiffness"], "line_color": theme.BLUE}
    measured = drawn.line("f", "measured", **look, line_width=1.2)
    band = drawn.segment("f", "low", "f", "high", **look, line_alpha=0.35)
    model = drawn.line("f", "model", source=s["stiffness"], line_color=theme.INK, line_width=1.6, line_dash=[6, 3])
    reach = drawn.line("f", "reach", source=s["stiffness"], line_alpha=0.0)  # what is badly measured leaves the panel
    theme.follows(drawn, [model, reach])
    theme.legend(drawn, [("measured, 95 %", [measured, band]), ("model", [model])])
    return drawn


def plane(s: Sources) -> Any:
    """The missing force over displacement and velocity; negative cells bear a dash, dots may be noise."""
    drawn = theme.panel("plane", 268, "displacement", "velocity", narrow=True)
    drawn.xaxis[0].ticker.desired_num_ticks = 3  # beside the colour bar there is little room
    mapper = LinearColorMapper(palette=RdBu11, low=-1.0, high=1.0, name="mapper", nan_color="rgba(0,0,0,0)")
    cells = drawn.quad(
        "left", "right", "top", "bottom", source=s["plane"], fill_color={"field": "mean", "transform": mapper},
        line_color=None,
    )  # fmt: skip
    at = {"x": "middle_u", "y": "middle_v", "source": s["plane"]}
    # No hatching: a browser makes a picture of every cell's pattern, which takes it a second.
    drawn.scatter(**at, size="below", marker="dash", line_color="#00000088", line_width=1.0)
    drawn.scatter(**at, size="unsure", fill_color="#4a4a4a", line_color=None)
    outline = Quad(
        left="left", right="right", top="top", bottom="bottom", fill_color=None, line_width=1.6, line_alpha="picked",
        line_color=theme.PICKED["line_color"],
    )  # fmt: skip
    drawn.add_glyph(s["plane"], outline, nonselection_glyph=None)
    bar = ColorBar(
        color_mapper=mapper, name="plane_bar", width=9, padding=4, background_fill_color=None,
        major_label_text_font=theme.FONT, major_label_text_font_size="11px", major_label_text_color=theme.GREY,
        label_standoff=4, bar_line_color=None, formatter=CustomJSTickFormatter(code=theme.EVEN),
    )  # fmt: skip
    drawn.add_layout(bar, "right")
    drawn.min_border_right = 60  # its numbers grow when its scale changes, the room for them does not
    drawn.grid.visible = False
    drawn.add_tools(HoverTool(renderers=[cells], tooltips=[("missing force", "@mean{0.000}")], mode="mouse"))
    return drawn


def against(s: Sources, of: str) -> Any:
    """Mean missing force against displacement (u) or velocity (v) with 95 % intervals."""
    name = f"against_{of}"
    drawn = theme.panel(name, 268, of, "missing force", select=True, narrow=True)
    drawn.add_layout(Span(location=0.0, dimension="width", line_color=theme.AXIS, line_width=1.0))
    mean = drawn.line("at", "mean", source=s[name], line_color=theme.BLUE, line_width=1.4)
    dots = drawn.scatter("at", "mean", source=s[name], fill_color=theme.BLUE, line_color=None, size=4.5)
    bars = drawn.segment("at", "low", "at", "high", source=s[name], line_color=theme.BLUE, line_width=1.0)
    would = drawn.line("at", "y", source=s[f"ghost_{of}"], **theme.WOULD)
    drawn.line("at", "y", source=s[f"pinned_{of}"], **theme.PINNED)
    picked = drawn.line("at", "y", source=s[f"picked_{of}"], **theme.PICKED)
    theme.chosen(drawn, f"box_{name}")
    reach = drawn.line("at", "reach", source=s[name], line_alpha=0.0)  # how near the axis may come
    theme.follows(drawn, [mean, bars, reach])
    theme.legend(drawn, [("mean, 95 %", [mean, dots, bars]), ("candidate", [would]), ("selected", [picked])])
    return drawn


def constancy(s: Sources) -> Any:
    """A_j(f): the coefficient of one candidate along frequency; that of a true term is a constant."""
    drawn = theme.panel("constancy", 162, "frequency / Hz", "coefficient", ranges=(None, None))
    drawn.x_range.range_padding = 0.05
    line = drawn.line("f", "value", source=s["shown"], line_color=theme.BLUE, line_width=1.3)
    drawn.scatter("f", "value", source=s["shown"], fill_color=theme.BLUE, line_color=None, size=5)
    drawn.segment("f", "low", "f", "high", source=s["shown"], line_color=theme.BLUE, line_width=1.0)
    zero = drawn.line("f", "zero", source=s["shown"], line_color=theme.AXIS, line_width=1.0)
    theme.follows(drawn, [line, zero])
    drawn.y_range.range_padding = 0.25
    return drawn


def history(s: Sources, height: int) -> Any:
    """Error by model, one below the other, with the noise floor."""
    drawn = theme.panel(
        "history", height, "held-out error / %", "", x_axis_type="log", ranges=(None, _names(s["history"], 0.15))
    )
    drawn.x_range.range_padding = 0.08
    at: dict[str, Any] = {"y": "name", "source": s["history"]}
    floor = drawn.scatter(
        "floor", **at, marker="dash", angle=1.5708, size=22, line_color="#000000", line_width=1.3, line_dash="dotted"
    )
    drawn.line("response", **at, line_color=theme.INK, line_width=1.3)
    response = drawn.scatter("response", **at, size="size", fill_color=theme.INK, line_color=None)
    drawn.line("force", **at, line_color="#8a949e", line_dash="dashed", line_width=1.2)
    force = drawn.scatter(
        "force", **at, marker="square", size=6, fill_color="white", line_color="#5c6873", line_width=1.3
    )
    drawn.yaxis.major_label_text_color = theme.INK
    drawn.yaxis.major_label_text_font_size = "12px"
    theme.legend(drawn, [("response", [response]), ("force", [force]), ("noise floor", [floor])])
    return drawn


PANEL_HEIGHT = 228  # pixels


def loop(s: Sources, of: str) -> Any:
    """Force over the motion that was prescribed, measured and by the model."""
    drawn = theme.panel(f"loop_{of}", PANEL_HEIGHT, of, "force", narrow=True)
    measured = drawn.scatter(of, "measured", source=s["loops"], size=3.2, fill_color="#a3adb7", line_color=None)
    predicted = drawn.scatter(of, "predicted", source=s["loops"], size=1.8, fill_color=theme.BLUE, line_color=None)
    theme.legend(drawn, [("measured", [measured]), ("model", [predicted])])
    return drawn


def cycles(s: Sources) -> Any:
    """Energy that each cycle takes, over its stroke."""
    drawn = theme.panel("cycles", PANEL_HEIGHT, "stroke", "energy", narrow=True)
    look: dict[str, Any] = {"source": s["cycles"], "line_width": 1.3}
    measured = drawn.scatter("stroke", "measured", size=6, fill_color="#a3adb7", line_color="#5c6873", **look)
    predicted = drawn.scatter("stroke", "predicted", marker="x", size=7, line_color=theme.BLUE, **look)
    drawn.x_range.range_padding = 0.08
    theme.legend(drawn, [("measured", [measured]), ("model", [predicted])])
    return drawn


def decay(s: Sources, of: str, label: str) -> Any:
    """Frequency or damping ratio of a decay against its amplitude."""
    drawn = theme.panel(f"decay_{of}", PANEL_HEIGHT, "amplitude", label, x_axis_type="log")
    bars = drawn.segment("at", f"{of}_low", "at", f"{of}_high", source=s["decay"], line_color="#5c6873", line_width=1.0)
    dots = drawn.scatter("at", of, source=s["decay"], size=5.5, fill_color="#a3adb7", line_color="#5c6873")
    model = drawn.line("at", of, source=s["decay_model"], **theme.PREDICTED_LINE)
    drawn.x_range.range_padding = 0.06
    theme.legend(drawn, [("measured, 95 %", [dots, bars]), ("model", [model])])
    return drawn


def magnitude(s: Sources, frequency: Any) -> Any:
    """Response over force, measured with its 95 % band and by the model."""
    drawn = theme.panel(
        "frf", PANEL_HEIGHT, "frequency / Hz", "magnitude", narrow=True, ranges=(frequency, None), y_axis_type="log"
    )
    band = drawn.varea("f", "low", "high", source=s["frf"], fill_color="#a3adb7", fill_alpha=0.35)
    measured = drawn.line("f", "measured", source=s["frf"], **theme.MEASURED_LINE)
    predicted = drawn.line("f", "predicted", source=s["frf"], **theme.PREDICTED_LINE)
    theme.follows(drawn, [measured, predicted])
    theme.legend(drawn, [("measured, 95 %", [measured, band]), ("model", [predicted])])
    return drawn


def phase(s: Sources, frequency: Any) -> Any:
    """Its phase in degrees."""
    ranges = (frequency, theme.fixed("range_phase", -190.0, 190.0))
    drawn = theme.panel("phase", PANEL_HEIGHT, "frequency / Hz", "phase / °", narrow=True, ranges=ranges)
    drawn.yaxis.ticker = [-180, -90, 0, 90, 180]
    measured = drawn.line("f", "phase", source=s["frf"], **theme.MEASURED_LINE)
    predicted = drawn.line("f", "phase_predicted", source=s["frf"], **theme.PREDICTED_LINE)
    theme.legend(drawn, [("measured", [measured]), ("model", [predicted])])
    return drawn


def linearity(s: Sources, frequency: Any) -> Any:
    """Ordinary coherence of force and response: below one in both, the system is nonlinear; in one, noise or a lack."""
    ranges = (frequency, theme.fixed("range_linearity", 0.0, 1.03))
    drawn = theme.panel("linearity", PANEL_HEIGHT, "frequency / Hz", "coherence / 1", narrow=True, ranges=ranges)
    measured = drawn.line("f", "coherence", source=s["frf"], **theme.MEASURED_LINE)
    predicted = drawn.line("f", "coherence_predicted", source=s["frf"], **theme.PREDICTED_LINE)
    theme.legend(drawn, [("measured", [measured]), ("model", [predicted])])
    return drawn


def correlation(s: Sources, name: str, label: str) -> Any:
    """A correlation of the residual, with the 99 % band of what is noise."""
    drawn = theme.panel(name, PANEL_HEIGHT, "lag / s", label, narrow=True)
    drawn.add_layout(Span(location=0.0, dimension="width", line_color=theme.AXIS, line_width=1.0))
    line = drawn.line("lag", "value", source=s[name], line_color=theme.ORANGE, line_width=1.3)
    band = drawn.multi_line("lag", "level", source=s[f"{name}_band"], **theme.NOISE)
    theme.follows(drawn, [line, band])
    theme.legend(drawn, [("residual", [line]), ("99 % band", [band])])
    return drawn


def histogram(s: Sources) -> Any:
    """Distribution of the residual beside a normal one."""
    drawn = theme.panel("histogram", PANEL_HEIGHT, "difference / σ", "density / 1", narrow=True)
    bars = drawn.quad(
        left="left", right="right", top="top", bottom=0.0, source=s["histogram"], fill_color="#a3adb7",
        fill_alpha=0.6, line_color=None,
    )  # fmt: skip
    normal = drawn.line("x", "y", source=s["normal"], line_color=theme.INK, line_width=1.3)
    theme.legend(drawn, [("residual", [bars]), ("normal", [normal])])
    return drawn
