"""The panels of a structure's page, as ``plots`` has those of one coordinate; the page's script fills them."""

from collections.abc import Mapping
from typing import Any

from bokeh.models import ColumnDataSource, FactorRange, Span

from study.explore import theme

Sources = Mapping[str, ColumnDataSource]
EACH, ROOM = 24, 74  # pixels: a sensor's bar, and what axis and legend take


def sensors_height(count: int) -> int:
    """Height of the panel of sensors in pixels."""
    return ROOM + EACH * max(count, 3)


def sensors(s: Sources, names: list[str]) -> Any:
    """Error of each sensor over its rms motion, beside what noise alone would leave."""
    factors = FactorRange(factors=names[::-1], name="range_sensors", range_padding=0.1)
    drawn = theme.panel(
        "sensors", sensors_height(len(names)), "error of the sensor / %", "", narrow=True, ranges=(None, factors)
    )
    error = drawn.hbar(y="name", right="error", height=0.6, source=s["sensors"], fill_color="#e08a4a", line_color=None)
    floor = drawn.hbar(y="name", right="floor", height=0.22, source=s["sensors"], fill_color=theme.INK, line_color=None)
    drawn.x_range.start = 0.0
    drawn.yaxis.major_label_text_color = theme.INK
    theme.legend(drawn, [("error of the free run", [error]), ("noise floor", [floor])])
    return drawn


def restoring(s: Sources) -> Any:
    """Mean missing force of the selected connection against its relative displacement, with 95 % intervals."""
    drawn = theme.panel("map", 250, "relative displacement", "missing force", narrow=True)
    drawn.add_layout(Span(location=0.0, dimension="width", line_color=theme.AXIS, line_width=1.0))
    line = drawn.line("at", "mean", source=s["map"], line_color=theme.BLUE, line_width=1.4)
    dots = drawn.scatter("at", "mean", source=s["map"], fill_color=theme.BLUE, line_color=None, size=4.5)
    bars = drawn.segment("at", "low", "at", "high", source=s["map"], line_color=theme.BLUE, line_width=1.0)
    theme.follows(drawn, [line, bars])
    theme.legend(drawn, [("mean, 95 %", [line, dots, bars])])
    return drawn


def force(s: Sources, frequency: Any) -> Any:
    """Density of the force that the selected place lacks."""
    drawn = theme.panel("force", 250, "frequency / Hz", "missing force", narrow=True, ranges=(frequency, None))
    line = drawn.line("f", "force", source=s["force"], line_color=theme.ORANGE, line_width=1.5)
    drawn.y_range.start = 0.0
    theme.legend(drawn, [("missing at the place", [line])])
    return drawn


def stiffness(s: Sources, frequency: Any) -> Any:
    """Real part of the dynamic stiffness of the selected connection, as measured and as the model has it."""
    drawn = theme.panel("stiffness", 250, "frequency / Hz", "stiffness", narrow=True,
                        ranges=(frequency, None))  # fmt: skip
    measured = drawn.line("f", "measured", source=s["stiffness"], line_color=theme.BLUE, line_width=1.2)
    band = drawn.segment("f", "low", "f", "high", source=s["stiffness"], line_color=theme.BLUE, line_alpha=0.35)
    model = drawn.line("f", "model", source=s["stiffness"], line_color=theme.INK, line_width=1.6, line_dash=[6, 3])
    theme.follows(drawn, [model])
    drawn.y_range.range_padding = 0.6
    theme.legend(drawn, [("measured, 95 %", [measured, band]), ("model", [model])])
    return drawn


def motion(s: Sources, time: Any) -> Any:
    """Measured motion of the selected sensor and the free run."""
    drawn = theme.panel("motion", 210, "time / s", "motion", ranges=(time, None))
    measured = drawn.line("t", "measured", source=s["motion"], **theme.MEASURED)
    predicted = drawn.line("t", "predicted", source=s["motion"], **theme.PREDICTED)
    theme.legend(drawn, [("measured", [measured]), ("free run", [predicted])])
    return drawn


def difference(s: Sources, time: Any) -> Any:
    """What the free run misses of it."""
    drawn = theme.panel("difference", 150, "time / s", "difference", ranges=(time, None))
    drawn.yaxis[0].ticker.desired_num_ticks = 3  # it is low
    line = drawn.line("t", "difference", source=s["motion"], **theme.DIFFERENCE)
    theme.legend(drawn, [("measured less predicted", [line])])
    return drawn


def close(s: Sources) -> Any:
    """The same where the model misses most."""
    drawn = theme.panel("close", 360, "time / s", "motion", narrow=True)
    measured = drawn.line("t", "measured", source=s["close"], **theme.MEASURED | {"line_width": 3.4})
    predicted = drawn.line("t", "predicted", source=s["close"], **theme.PREDICTED | {"line_width": 1.5})
    theme.legend(drawn, [("measured", [measured]), ("free run", [predicted])])
    return drawn


def spectrum(s: Sources, frequency: Any) -> Any:
    """Density of the difference of the selected sensor and of its noise, over its rms motion."""
    drawn = theme.panel("spectrum", 250, "frequency / Hz", "density over rms / (1/√Hz)", narrow=True,
                        ranges=(frequency, None))  # fmt: skip
    line = drawn.line("f", "difference", source=s["spectrum"], line_color=theme.ORANGE, line_width=1.5)
    noise = drawn.line("f", "noise", source=s["spectrum"], **theme.NOISE)
    drawn.y_range.start = 0.0
    theme.legend(drawn, [("difference", [line]), ("noise", [noise])])
    return drawn
