"""The look of every panel: colours, fonts and tools. Lines differ in weight and dash, not in colour alone."""

from collections.abc import Sequence
from typing import Any

from bokeh.models import (
    BasicTickFormatter,
    BoxAnnotation,
    CustomJSTickFormatter,
    DataRange1d,
    FixedTicker,
    Legend,
    LegendItem,
    Range1d,
    Title,
)
from bokeh.models.tools import BoxSelectTool, PanTool, ResetTool, SaveTool, WheelZoomTool
from bokeh.plotting import figure

FONT = "Helvetica Neue, Helvetica, Arial, Liberation Sans, sans-serif"
INK, GREY, GRID, AXIS = "#1f2933", "#5c6873", "#e4e7eb", "#9aa5b1"
BLUE, ORANGE = "#0b5394", "#d1600a"
MEASURED_LINE: dict[str, Any] = {"line_color": "#a3adb7", "line_width": 2.4}
PREDICTED_LINE: dict[str, Any] = {"line_color": BLUE, "line_width": 1.2}
DIFFERENCE: dict[str, Any] = {"line_color": ORANGE, "line_width": 1.0}
NOISE: dict[str, Any] = {"line_color": "#000000", "line_width": 1.3, "line_dash": "dotted"}
WOULD: dict[str, Any] = {"line_color": "#111111", "line_width": 1.3}
PINNED: dict[str, Any] = {"line_color": "#1b6e3c", "line_width": 1.7, "line_dash": [7, 3]}
PICKED: dict[str, Any] = {"line_color": "#7a1fa2", "line_width": 2.0, "line_dash": "dashed"}
AMBER = "#f5c04a"
TICKS_IN_POWERS = """
const power = Math.floor(Math.log10(tick) + 1e-9), mantissa = Number((tick / 10 ** power).toPrecision(2))
if (power >= -2 && power <= 3) return String(Number(tick.toPrecision(3)))
const raised = String(power).replace(/./g, (c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻")
return (mantissa === 1 ? "10" : mantissa + "·10") + raised
"""
# Even ticks as the words of the page have their numbers; the digits are those that tell two ticks apart.
EVEN = """
const most = Math.max(...ticks.map(Math.abs)), step = ticks.length > 1 ? Math.abs(ticks[1] - ticks[0]) : most
if (tick === 0 || !(step > 0)) return String(tick)
const plain = most < 1e5 && most >= 1e-3, power = plain ? 0 : Math.floor(Math.log10(most) + 1e-9)
const places = Math.min(12, Math.max(0, power + 1 - Math.floor(Math.log10(step) + 1e-9)))
const text = String(Number((tick / 10 ** power).toFixed(places))).replace("-", "−")
return plain ? text : text + "·10" + String(power).replace(/./g, (c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻")
"""
PASSING = ("candidate", "pinned", "selected")  # entries of legends


def panel(
    name: str, height: int, x: str, y: str, *, select: bool = False, ranges: tuple[Any, Any] = (None, None),
    narrow: bool = False, **more: Any,
) -> Any:  # fmt: skip
    """A figure in the page's style.

    Its place in the page is called ``name``, the figure ``panel_name``, its axes ``name_x`` and ``name_y``; ``x`` and
    ``y`` are their labels. The width is that of its place, the height in pixels. With ``select``, a range of x can be
    selected; ``ranges`` of x and y that are None follow the data. A ``narrow`` panel shares its row: fewer ticks.
    """
    tools: list[Any] = [PanTool(dimensions="width"), WheelZoomTool(dimensions="width"), ResetTool(), SaveTool()]
    if select:
        tools.insert(0, BoxSelectTool(dimensions="width", renderers=[]))
    drawn: Any = figure(
        name=f"panel_{name}", height=height, sizing_mode="stretch_width", min_width=140, tools=tools,
        x_axis_label=x, y_axis_label=y, x_range=ranges[0] or DataRange1d(range_padding=0.0),
        y_range=ranges[1] or DataRange1d(range_padding=0.06),
        active_drag=tools[0] if select else None, active_scroll=None, toolbar_location="above", toolbar_inner=False,
        min_border_right=8, outline_line_color=None, background_fill_color=None, border_fill_color=None, **more,
    )  # fmt: skip
    drawn.toolbar.autohide = True
    drawn.toolbar.logo = None
    for axis, side in ((drawn.xaxis[0], "x"), (drawn.yaxis[0], "y")):
        _axis(axis, f"{name}_{side}")
    if narrow and "x_axis_type" not in more:
        ticker: Any = drawn.xaxis[0].ticker
        ticker.desired_num_ticks = 4
    for side, axis in (("x", drawn.xaxis[0]), ("y", drawn.yaxis[0])):
        if more.get(f"{side}_axis_type") == "log":
            axis.ticker = FixedTicker(name=f"{name}_ticks", ticks=[], minor_ticks=[])
            axis.formatter = CustomJSTickFormatter(code=TICKS_IN_POWERS)
        elif isinstance(axis.formatter, BasicTickFormatter):
            axis.formatter = CustomJSTickFormatter(code=EVEN)
    for grid in drawn.grid:
        grid.grid_line_color = GRID
    return drawn


def _axis(axis: Any, name: str) -> None:
    axis.name = name
    axis.axis_label_text_font = axis.major_label_text_font = FONT
    axis.axis_label_text_font_style = "normal"
    axis.axis_label_text_font_size, axis.major_label_text_font_size = "12px", "11px"
    axis.axis_label_text_color, axis.major_label_text_color = INK, GREY
    axis.axis_label_standoff = 4
    axis.axis_line_color = axis.major_tick_line_color = AXIS
    axis.minor_tick_line_color = None
    axis.major_tick_in, axis.major_tick_out = 0, 4


def legend(drawn: Any, items: Sequence[tuple[Any, list[Any]]], place: Any = "above") -> None:
    """A legend above the panel, or within it at ``place``; a label is a text or a field of the source."""
    words: Any = Legend(
        items=[_item(label, renderers, drawn.name) for label, renderers in items],
        orientation="horizontal" if place == "above" else "vertical", label_text_font=FONT,
        label_text_font_size="11px", label_text_color=INK, label_standoff=4, border_line_color=None,
        background_fill_alpha=0.8, margin=5, spacing=9 if place == "above" else 0, glyph_width=20,
        glyph_height=14, label_height=14,
    )  # fmt: skip
    words.padding = 0
    if place == "above":
        words.location = (-34, 0) if drawn.name != "panel_history" else "right"  # long names leave little room
        drawn.add_layout(Title(text=" ", text_font_size="6px", standoff=0), "above")  # the row of the tools
        drawn.add_layout(words, "above")
    else:
        words.location = place
        drawn.add_layout(words)


def _item(label: Any, renderers: list[Any], panel: str) -> LegendItem:
    """An entry; that of what comes and goes is shown by the page's script when it is there."""
    item = LegendItem(label=label, renderers=renderers)
    if label in PASSING:
        item.name, item.visible = f"{panel}_{label}", False
    return item


def chosen(drawn: Any, name: str) -> BoxAnnotation:
    """The range that was selected in a panel, hidden until there is one."""
    box = BoxAnnotation(
        name=name, visible=False, fill_color=AMBER, fill_alpha=0.35, line_color="#8a6d00", line_dash="dashed",
        line_width=1.0, level="underlay", propagate_hover=True,
    )  # fmt: skip
    drawn.add_layout(box)
    return box


def follows(drawn: Any, renderers: Sequence[Any]) -> None:
    """Let the range of y follow these alone: what is previewed or highlighted does not move an axis."""
    if isinstance(drawn.y_range, DataRange1d):
        drawn.y_range.renderers = list(renderers)


def fixed(name: str, start: float, end: float) -> Range1d:
    """A range that panels share."""
    return Range1d(start=start, end=end, name=name)
