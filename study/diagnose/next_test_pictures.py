"""What each rival would answer to the test that comes next: as files, and each panel alone (Axes in, Axes out)."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import ndtri

from study.diagnose.designs import LET_GO
from study.diagnose.next_test import DECIDES, NextTest
from study.diagnose.next_test_report import design_in_words, rival_in_words
from study.diagnose.separation import respond
from study.equations.dimensions import pretty
from study.figures import page
from study.figures.labels import power_of_ten, prefixed
from study.figures.styles import in_style
from study.records.interpolation import between_samples
from study.support.arrays import Floats
from study.support.numbers import percent
from study.support.thresholds import K

RIVAL_LOOKS: tuple[dict[str, Any], ...] = (
    {"linestyle": "-", "color": "C0", "linewidth": 2.2}, {"linestyle": "--", "color": "C1", "linewidth": 1.6},
    {"linestyle": ":", "color": "C2", "linewidth": 2.0}, {"linestyle": "-.", "color": "C3", "linewidth": 1.5},
    {"linestyle": (0, (6, 1, 1, 1, 1, 1)), "color": "0.3", "linewidth": 1.3},
    {"linestyle": (0, (1, 3)), "color": "C5", "linewidth": 2.4},
)  # fmt: skip


def next_test_pictures(found: NextTest) -> dict[str, bytes]:
    """The picture by file name, in the project's style."""
    with in_style():
        return page.image_files({"next_test": next_test_figure(found)})


def next_test_figure(found: NextTest) -> Figure:
    """What drives the test, what each rival answers where they differ most, and what no coefficient makes up for."""
    words = design_in_words(found.choice.design, found.rivals.present)
    panels = {
        "what drives it": driving_panel, "what each would answer, where they differ most": answers_panel,
        "evidence against each of the others, if the first is true": evidence_panel,
    }  # fmt: skip
    width = 7.8  # inches
    drawn = list(panels.items())[1 if found.choice.design.kind == LET_GO else 0 :]
    columns = page.legend_columns([rival_in_words(row, found.rivals.rows) for row in found.rivals.rows], width)
    figure, axes = page.empty_page(
        f"Which test next? {found.rivals.prepared.record.name}", words, rows=len(drawn), panel=1.7,
        legend_rows=-(-len(found.rivals.rows) // columns), share=False, width=width,
    )  # fmt: skip
    for own, (_, draw) in zip(axes, drawn, strict=True):
        draw(own, found)
    page.letter(axes, [name for name, _ in drawn])
    page.shared_legend(figure, axes[-2:-1], columns)
    return figure


def driving_panel(axes: Axes, found: NextTest) -> Axes:
    """What drives the test along time."""
    record, present = found.choice.design.record, found.rivals.present
    values = present.signals(record)
    factor, unit = _easy(present.unit, values)
    for own, look in zip(values.T, RIVAL_LOOKS, strict=False):
        axes.plot(record.dt * np.arange(len(record)), own / factor, linewidth=0.7, color=look["color"])
    axes.set_ylabel(f"{'displacement' if present.prescribed else present.driven_by} ({unit})")
    axes.set_xlabel("time (s)")
    return axes


def answers_panel(axes: Axes, found: NextTest) -> Axes:
    """The response of each rival at the sensor, and about the time, at which they differ most."""
    rivals, design = found.rivals, found.choice.design
    sensors = rivals.seen(found.choice.sensor)[0].sensors
    answers = np.stack([respond(fit, design, sensors)[0] for fit in rivals.fits])
    apart: Floats = np.max(answers, axis=0) - np.min(answers, axis=0)
    noise = found.rivals.noise_of(found.choice.sensor)
    sizes = [float(np.mean(apart[:, i] ** 2)) / noise[s] ** 2 for i, s in enumerate(sensors)]
    most = int(np.argmax(sizes))
    sensor, samples = (
        sensors[most],
        min(len(apart), max(32, round(6.0 / (rivals.present.resonance * design.record.dt)))),
    )
    at = int(np.argmax(np.convolve(apart[:, most] ** 2, np.ones(samples), "valid")))
    shown = answers[:, :, most]
    factor, unit = _easy(rivals.prepared.record.unit(sensor), shown[:, at : at + samples])
    time = design.record.dt * np.arange(at, at + samples, 0.125)[: 8 * (samples - 1) + 1]
    for row, own, look in zip(rivals.rows, shown, RIVAL_LOOKS, strict=False):
        smooth = between_samples(own, 8)[8 * at : 8 * (at + samples - 1) + 1]
        axes.plot(time, smooth / factor, label=rival_in_words(row, rivals.rows), **look)
    axes.set_ylabel(f"{sensor} ({unit})")
    axes.set_xlabel("time (s)")
    return axes


def evidence_panel(axes: Axes, found: NextTest) -> Axes:
    """How the squares that each rival leaves of the first one's answer add up, over the noise's variance.

    Where they come in a few jumps they decide less than their sum says.
    """
    rivals, choice = found.rivals, found.choice
    outputs, noise = rivals.seen(choice.sensor)
    time = choice.design.record.dt * np.arange(len(choice.design.record))
    for j, look in list(enumerate(RIVAL_LOOKS))[1 : len(rivals.rows)]:
        left = outputs.whitened(outputs.stacked(rivals.left(choice.design, 0, j, choice.sensor)), noise) / rivals.size
        power = np.sum(left.reshape(len(time), -1) ** 2, axis=1)
        axes.semilogy(time, np.maximum(np.cumsum(power), 0.1), **look)
    needed = (2.0 * (K + float(ndtri(DECIDES)))) ** 2
    axes.axhline(needed, color="0.35", linewidth=0.9)
    axes.annotate(
        f"decides with {percent(DECIDES, '.0f')}, if it grows evenly", (1.0, needed),
        xycoords=("axes fraction", "data"), xytext=(0, -3), textcoords="offset points", ha="right", va="top",
        fontsize=8, bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
    )  # fmt: skip
    axes.set_ylim(1.0, max(10.0 * needed, axes.get_ylim()[1]))
    axes.set_ylabel("evidence")
    axes.set_xlabel("time (s)")
    return axes


def _easy(unit: str, values: Floats) -> tuple[float, str]:
    """A divisor, and what to write for the unit, with which values are easy to read."""
    largest = float(np.max(np.abs(values)))
    factor, shown = prefixed(unit, largest)
    more, power = power_of_ten(largest / factor)
    return factor * more, pretty(f"{power}{shown}")
