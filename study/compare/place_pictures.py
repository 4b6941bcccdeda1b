"""Pictures of a structure: where a force is missing, errors by sensor, shared forces, connections and modes."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from study.compare import panels, place_panels
from study.compare.comparison import Comparison
from study.compare.place_sketch import sketch_of
from study.equations.linear_part import Modes
from study.equations.place import place_in_words
from study.figures import page
from study.figures.sketch import Sketch
from study.figures.sketch_drawing import structure_sketch
from study.support.numbers import percent

MAPS, SENSORS, MODES = 9, 6, 6  # panels on one page at most: the first connections, the worst sensors, slowest modes


def place_figures(comparison: Comparison) -> dict[str, Figure]:
    """The pictures that a structure has besides those of any comparison, by file name."""
    return {
        "structure": structure_figure(comparison, sketch_of(comparison)), "sensors": sensors_figure(comparison),
        **({"shared_force": shared_force_figure(comparison)} if comparison.missing.equations else {}),
        **({} if comparison.model.prescribed else {"modes": modes(comparison, [("fitted", comparison.modes)])}),
        **restoring_forces(comparison),
    }  # fmt: skip


def structure_figure(comparison: Comparison, drawn: Sketch) -> Figure:
    """The sketch on a page."""
    places = [link for link in drawn.links if link.share > 0.0]
    most = max(places, key=lambda link: link.share, default=None)
    about, width = "nothing that is left depends on the motion anywhere", max(page.WIDE, drawn.width)
    if most is not None:
        about = f"brightest: {place_in_words(most.place)}, explains {percent(most.share)} of what is left"
    figure, (axes,) = page.empty_page(
        f"{comparison.prepared.record.name}: where a force is missing", f"model {comparison.model.name}; {about}",
        width=width, panel=(width - 1.04) * drawn.height / drawn.width, legend_rows=0, headed=False,
    )  # fmt: skip
    structure_sketch(axes, drawn)
    return figure


def sensors_figure(comparison: Comparison) -> Figure:
    """Errors by sensor, and the force that is left of each equation of motion."""
    prediction, count = comparison.prediction, len(comparison.prediction.prepared.outputs.sensors)
    prescribed = comparison.model.prescribed  # then what is left of an equation is what a sensor misses
    columns = 2 if comparison.missing.equations and not prescribed else 1
    figure, axes = page.empty_page(
        f"{comparison.prepared.record.name}: error by sensor",
        f"model {comparison.model.name}; all sensors {percent(prediction.error)}, noise {percent(prediction.floor)}",
        columns=columns, width=page.width(columns), panel=max(1.4, 0.48 * count), share=False,
    )  # fmt: skip
    figure.subplots_adjust(left=0.26 / columns, wspace=0.3)
    place_panels.sensor_errors(axes[0], prediction)
    for panel in axes[1:]:
        place_panels.coordinate_forces(panel, comparison.missing)
    page.letter(axes, ("forces" if prescribed else "motions", "equations of motion")[:columns])
    page.shared_legend(figure, axes, columns=4)
    return figure


def responses_figure(comparison: Comparison) -> Figure:
    """Measured and predicted motion of the sensors that are predicted worst, where the difference is largest.

    Or force, where the motion is prescribed.
    """
    prediction = comparison.prediction
    order = np.argsort(-prediction.errors)[:SENSORS]
    figure, axes = page.empty_page(
        f"{comparison.prepared.record.name}: {'forces' if comparison.model.prescribed else 'motions'}",
        f"model {comparison.model.name}; close-up where it fails most",
        rows=len(order), width=page.WIDE, panel=1.5, share=False,
    )  # fmt: skip
    time = prediction.prepared.record.time[slice(*prediction.prepared.plan.judge)]
    names: list[str] = []
    for panel, i in zip(axes, order, strict=True):
        sensor, near = prediction.prepared.sensors[int(i)], prediction.of(int(i)).closeup
        panels.response_panel(
            panel, time[near], prediction.measured[near, int(i)], prediction.predicted[near, int(i)],
            prediction.prepared.record.unit(sensor),
        )  # fmt: skip
        panel.set_ylabel(panel.get_ylabel().replace("response", sensor.motion))
        names.append(f"{sensor}: error {percent(float(prediction.errors[int(i)]))}")
    page.letter(axes, names)
    page.shared_legend(figure, axes, columns=2)
    return figure


def shared_force_figure(comparison: Comparison) -> Figure:
    """The matrix of shared residual force between places."""
    count = len(comparison.missing.equations)
    figure, (axes,) = page.empty_page(
        f"{comparison.prepared.record.name}: shared residual force",
        "off the diagonal it acts between two coordinates, on it from outside or the ground",
        panel=max(1.8, 0.5 * count), width=max(page.WIDE, 2.6 + 0.8 * count), legend_rows=0, headed=False,
    )  # fmt: skip
    figure.subplots_adjust(left=0.2, right=0.8)
    place_panels.shared_force(axes, comparison.missing)
    return figure


def restoring_forces(comparison: Comparison) -> Mapping[str, Figure]:
    """Missing force of each connection against its relative displacement; nothing where the difference is noise."""
    labels = [n for n in comparison.missing.curves if len(comparison.missing.curves[n].at)][:MAPS]
    if not labels:
        return {}
    columns = min(2, len(labels))
    figure, axes = page.empty_page(
        f"{comparison.prepared.record.name}: force that each connection lacks",
        f"model {comparison.model.name}; as both equations have it, those first where a force explains most",
        rows=-(-len(labels) // columns), columns=columns, width=page.width(columns), panel=1.9, share=False,
    )  # fmt: skip
    for panel, label in zip(axes, labels, strict=False):
        place_panels.connection_force(panel, comparison.missing, label)
        share = next((s for p, s in comparison.missing.aligned if p.label == label), 0.0)
        panel.set_title(f"{label} ({percent(share)})")
    for panel in axes[len(labels) :]:
        panel.set_visible(False)
    page.shared_legend(figure, axes[:1])
    return {"restoring_forces": figure}


def modes(comparison: Comparison, sets: list[tuple[str, Modes]]) -> Figure:
    """Natural frequencies, damping ratios and shapes with 95 % intervals, before and after."""
    names = comparison.model.coordinates
    count = min(MODES, max(len(found.frequency) for _, found in sets))
    figure, axes = page.empty_page(
        f"{comparison.prepared.record.name}: modes of the underlying linear system",
        f"model {comparison.model.name}; bars are 95 % intervals",
        rows=-(-(count + 1) // 2), columns=2, width=page.width(2), panel=1.8, share=False,
    )  # fmt: skip
    place_panels.mode_frequencies(axes[0], sets)
    for number in range(count):
        place_panels.mode_shapes(axes[1 + number], sets, number, names)
    for panel in axes[1 + count :]:
        panel.set_visible(False)
    page.shared_legend(figure, axes[:1])
    return figure
