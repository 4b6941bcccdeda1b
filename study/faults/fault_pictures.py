"""Pictures of the faults: a record as it is in grey, as the faulty instrument reads it in black, and the difference."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study.equations import dimensions
from study.faults.fault import (
    CLIPPING,
    CONVERTER_STEPS,
    DELAY,
    DRIFT,
    DROP_OUTS,
    FORCE_NOISE,
    GAIN_CHANGE,
    HIGH_PASS,
    HUM,
    OFFSET,
    SPIKES,
)
from study.faults.fault_examples import Example
from study.figures import page

WIDTH, PANEL = 8.4, 1.45  # inches
TRUE: dict[str, Any] = {"color": "0.68", "linewidth": 3.0, "zorder": 2.0}
READ: dict[str, Any] = {"color": "black", "linewidth": 1.0, "zorder": 3.0}
FEW = 120  # samples, up to which each is drawn as a dot
TITLES = MappingProxyType(
    {
        OFFSET: "Offset", DRIFT: "Drift", HUM: "Hum", DELAY: "Delay", HIGH_PASS: "High-pass", SPIKES: "Spikes",
        DROP_OUTS: "Drop-outs", CLIPPING: "Clipping", CONVERTER_STEPS: "Steps of the converter",
        GAIN_CHANGE: "Changing gain", FORCE_NOISE: "Noise on the force",
    }
)  # fmt: skip
USUAL = 300  # samples that are shown of a fault that is not listed
SHOWN = MappingProxyType(
    {HUM: 120, DELAY: 80, CONVERTER_STEPS: 60, CLIPPING: 200, DROP_OUTS: 110, FORCE_NOISE: 110, HIGH_PASS: 800}
)
WHOLE = (DRIFT, GAIN_CHANGE)  # shown along all of the record: they are as slow as it is long
AT_TIMES = (SPIKES, DROP_OUTS, CLIPPING)  # only some of the samples have these
SMALL = (CONVERTER_STEPS, FORCE_NOISE)  # seen where the channel moves little


def picture(example: Example) -> Figure:
    """A page with a stretch of the channel on top and what the fault has done to it below.

    The caller applies the style sheet.
    """
    found = example.found
    figure, (signal, difference) = page.empty_page(
        f"{TITLES[found.fault]} (in truth {_truth(example)})", f"found: {found.note.split(';')[0]}",
        rows=2, width=WIDTH, panel=PANEL, headed=False,
    )  # fmt: skip
    first, last = shown_samples(example)
    example_panel(signal, example, first, last)
    change(difference, example, first, last)
    signal.set_xlabel("")
    figure.align_ylabels([signal, difference])
    page.shared_legend(figure, [signal])
    return figure


def _truth(example: Example) -> str:
    """Size of the fault that was put on the record."""
    unit = example.found.unit
    return f"{100.0 * example.size:.3g} %" if unit == "1" else f"{example.size:.3g} {dimensions.pretty(unit)}"


def shown_samples(example: Example) -> tuple[int, int]:
    """First sample that is shown and the one after the last: where the fault is seen."""
    n, fault = len(example.clean), example.found.fault
    if fault in WHOLE:
        return 0, n
    length, first = min(SHOWN.get(fault, USUAL), n), n // 4
    if fault in AT_TIMES:
        changed = np.flatnonzero(example.faulty[example.channel] != example.clean[example.channel])
        after = changed[changed >= first]
        first = int(after[0] if len(after) else changed[-1]) - length // 3
    elif fault in SMALL:
        windows = np.lib.stride_tricks.sliding_window_view(example.clean[example.channel], length)
        first = int(np.argmin(np.ptp(windows, axis=1)))
    first = max(0, min(first, n - length))
    return first, first + length


def example_panel(axes: Axes, example: Example, first: int, last: int) -> Axes:
    """The channel as it is, and as it is read."""
    time = example.clean.time[first:last]
    dots: dict[str, Any] = {"marker": "o", "markersize": 3.0} if last - first <= FEW else {}
    axes.plot(time, example.clean[example.channel][first:last], **TRUE, label="as it is")
    axes.plot(time, example.faulty[example.channel][first:last], **READ, **dots, label="as the instrument reads it")
    return _named(axes, example, example.channel)


def change(axes: Axes, example: Example, first: int, last: int) -> Axes:
    """What the fault has added to the channel."""
    time = example.clean.time[first:last]
    added = example.faulty[example.channel][first:last] - example.clean[example.channel][first:last]
    axes.plot(time, added, **READ, snap=False)
    axes.axhline(0.0, color="0.5", linewidth=0.8, zorder=1.5)
    return _named(axes, example, "difference")


def _named(axes: Axes, example: Example, what: str) -> Axes:
    axes.set_xlabel("time (s)")
    axes.set_ylabel(f"{what} ({dimensions.pretty(example.clean.units[example.channel])})")
    axes.margins(x=0.01, y=0.08)
    return axes
