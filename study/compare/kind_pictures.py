"""Pictures of single kinds of tests: frequency and damping against amplitude, loops of a component's force."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from study.compare import panels
from study.compare.comparison import Comparison
from study.compare.decay import Decays
from study.compare.loops import loops
from study.equations import dimensions
from study.figures import page
from study.records.record import FORCE, MOTIONS, Sensor


def decay_figure(comparison: Comparison, decays: Mapping[str, Decays]) -> Figure:
    """Frequency and damping ratio against amplitude, measured and of the fitted model; a column for each sensor.

    A window that does not tell its frequency from zero, at the end of a motion, is not drawn.
    """
    count = len(decays)
    figure, axes = page.empty_page(
        f"{comparison.record.name}: free decay", f"model {comparison.model.name}; windows of the analytic signal",
        rows=2, columns=count, width=page.WIDE if count == 1 else page.width(count), panel=2.2, share=count == 1,
    )  # fmt: skip
    for column, (sensor, found) in enumerate(decays.items()):
        both, seen = (axes[column], axes[count + column]), found.measured
        told = 2.0 * seen.frequency_error < seen.frequency
        for axis, what, name in zip(both, ("frequency", "damping"), ("frequency (Hz)", "damping ratio"), strict=True):
            axis.errorbar(
                seen.amplitude[told], getattr(seen, what)[told], 2.0 * getattr(seen, f"{what}_error")[told], fmt="o",
                markersize=3.0, color="0.45", elinewidth=0.8, label="measured",
            )  # fmt: skip
            if found.predicted is not None:
                order = np.argsort(found.predicted.amplitude)
                axis.plot(found.predicted.amplitude[order], getattr(found.predicted, what)[order], **panels.PREDICTED)
            axis.set_xscale("log")
            axis.set_ylabel(name)
        unit = dimensions.pretty(comparison.record.units.get(sensor, ""))
        both[1].set_xlabel(f"amplitude of the {sensor} ({unit})")
    page.letter(axes, [what for what in ("frequency", "damping ratio") for _ in decays])
    page.shared_legend(figure, axes[:1])
    return figure


def loops_figure(comparison: Comparison) -> Figure:
    """Force over displacement and over velocity, measured and predicted, and the energy that each cycle takes.

    A row for each force that was measured.
    """
    record, sensors, titles = comparison.record, comparison.prediction.views, list[str]()
    figure, axes = page.empty_page(
        f"{record.name}: loops", f"model {comparison.model.name}; the judging part",
        rows=len(sensors), columns=3, width=1.45 * page.WIDE, panel=2.9, share=False,
    )  # fmt: skip
    for number, seen in enumerate(sensors):
        own, found = axes[3 * number : 3 * number + 3], loops(comparison, number)
        force, *units = (
            dimensions.pretty(record.unit(Sensor(seen.sensor.coordinate, name))) for name in (FORCE, *MOTIONS[:2])
        )
        of = f" {found.across}" if found.across else ""
        for axis, along, against, unit in zip(own, (found.displacement, found.velocity), MOTIONS, units, strict=False):
            axis.plot(along, seen.measured, ".", markersize=1.6, color="0.62")
            axis.plot(along, seen.predicted, ".", markersize=1.2, color="C0")
            axis.locator_params(axis="x", nbins=6)
            axis.set_xlabel(f"{against}{of} ({unit})")
        own[0].set_ylabel(f"{seen.sensor} ({force})")
        own[2].plot(found.stroke, found.measured, "o", markersize=3.5, color="0.45", label="measured")
        own[2].plot(found.stroke, found.predicted, "x", markersize=4.5, color="C0", label="model")
        own[2].locator_params(axis="x", nbins=4)  # strokes that differ by little have long labels
        own[2].set_xlabel(f"stroke of a cycle ({units[0]})")
        own[2].set_ylabel(f"energy ({force} {units[0]})")
        titles += ["force over displacement", "over velocity", "dissipated in a cycle"]
    page.letter(axes, titles)
    page.shared_legend(figure, axes)
    return figure
