"""The pictures of a comparison, as the bytes of files."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from study.compare import panels
from study.compare.comparison import Comparison
from study.compare.decay import decays_of
from study.compare.fitted_coefficients import Level
from study.compare.force_map import curve, surface
from study.compare.place_pictures import SENSORS, place_figures, responses_figure
from study.compare.varying_pictures import varying_figure
from study.equations.place import place_in_words
from study.figures import coherence, page
from study.figures.curves import InputCoherence
from study.figures.styles import in_style
from study.records.prepared import FORCE
from study.support.numbers import percent


def comparison_pictures(comparison: Comparison) -> dict[str, bytes]:
    """Every picture of one record by file name."""
    with in_style():
        drawn = {
            "response": (responses_figure if comparison.model.named else response_figure)(comparison),
            **({"force_error": force_error_figure(comparison)} if comparison.forces else {}),
            "missing_force": missing_force_figure(comparison), "error_in_time": error_in_time_figure(comparison),
            **(place_figures(comparison) if comparison.model.named else {}), **_of_its_kind(comparison),
            **({"varying": varying_figure(comparison.varying, comparison.record.name)} if comparison.varying else {}),
        }  # fmt: skip
        return page.image_files(drawn)


def _of_its_kind(comparison: Comparison) -> dict[str, Figure]:
    """What those who run a test of this kind expect to see of it."""
    from study.compare import kind_pictures

    if comparison.prepared.response == FORCE:
        return {"loops": kind_pictures.loops_figure(comparison)}
    every = {str(seen.sensor): decays_of(comparison, i) for i, seen in enumerate(comparison.views)}
    found = {name: decays for name, decays in every.items() if decays is not None}
    return {"decay": kind_pictures.decay_figure(comparison, found)} if found else {}


def level_pictures(moving: Sequence[Level], force_unit: str) -> dict[str, bytes]:
    """The picture of coefficients by level; none for one record."""
    if not moving:
        return {}
    with in_style():
        return page.image_files({"coefficients_by_level": by_level(moving, force_unit)})


def response_figure(comparison: Comparison) -> Figure:
    """Measured and predicted response, their difference, and a close-up where that is largest."""
    prediction, unit = comparison.prediction.of(0), comparison.record.units.get(comparison.plan.response, "")
    about = f"error {percent(prediction.error)} of the rms response, noise floor {percent(comparison.prediction.floor)}"
    figure, axes = page.empty_page(
        f"{comparison.record.name}: {comparison.plan.response}", f"model {comparison.model.name}; {about}",
        rows=3, width=page.WIDE, panel=1.8, legend_rows=2, share=False,
    )  # fmt: skip
    panels.response_panel(axes[0], prediction.time, prediction.measured, prediction.predicted, unit)
    panels.residual(axes[1], prediction.time, prediction.residual, prediction.noise.rms, unit)
    near = prediction.closeup
    panels.response_panel(axes[2], prediction.time[near], prediction.measured[near], prediction.predicted[near], unit)
    page.letter(axes, ("all that was predicted", "the difference", "close-up of (a) where the difference is largest"))
    page.shared_legend(figure, axes, columns=2)
    return figure


def force_error_figure(comparison: Comparison) -> Figure:
    """Unexplained share of the force by frequency, and what each input explains.

    Of a structure in the equations that leave most of it, a row each.
    """
    forces = sorted(comparison.forces, key=lambda force: -force.total)[:SENSORS]
    ends = np.array([force.frequency[force.band][[0, -1]] for force in forces])
    about = f"{percent(comparison.force_error)} of its power from {np.min(ends):.3g} to {np.max(ends):.3g} Hz"
    columns = min(len(forces), 2)
    figure, axes = page.empty_page(
        f"{comparison.record.name}: error of the force", f"model {comparison.model.name}; unexplained is {about}",
        rows=2 * len(forces) // columns, columns=columns, width=page.WIDE if columns == 1 else page.width(columns),
        panel=2.3, legend_rows=2, share=False,
    )  # fmt: skip
    titles = list[str]()
    for force, left, explained in zip(forces, axes[::2], axes[1::2], strict=True):
        highest, of = force.highest, f" at {force.coordinate}" if len(forces) > 1 else ""
        panels.force_error_panel(left, force, highest)
        keep = (force.frequency > 0.0) & (force.frequency <= highest)
        shares = [
            InputCoherence(i.shape, " + ".join(i.terms), force.frequency[keep], c[keep])
            for i, c in zip(force.inputs, force.cumulative, strict=True)
        ]
        coherence.cumulative_panel(explained, shares)
        explained.set_xlim(0.0, highest)
        explained.set_ylabel("cumulative coherence")  # in full it is longer than the panel
        explained.legend(loc="lower left", frameon=True, framealpha=0.85, edgecolor="none")
        titles += [f"what is left of the force{of}", "what the inputs explain, one after the other"]
    page.letter(axes, titles)
    page.shared_legend(figure, axes[:1], columns=2)
    return figure


def missing_force_figure(comparison: Comparison) -> Figure:
    """The force that the model lacks over the (u, v) plane and against each of them."""
    lacking, unit = comparison.missing_force, dict(comparison.record.units)
    band = lacking.frequency[lacking.gate]
    about = "the difference is noise" if not len(band) else f"seen in bands from {band[0]:.3g} to {band[-1]:.3g} Hz"
    if comparison.model.named:
        unit = comparison.missing.units(comparison.place.label)
        unit["velocity"] = f"{unit['displacement']}/s"
        about = f"{place_in_words(comparison.place)}, {about}"
    figure, axes = page.empty_page(
        f"{comparison.record.name}: the force that the model lacks", f"model {comparison.model.name}; {about}", rows=3,
        width=page.WIDE, panel=2.3, share=False,
    )  # fmt: skip
    u, v, force = (x[lacking.inner] for x in (lacking.displacement, lacking.velocity, lacking.force))
    panels.missing_force_panel(axes[0], surface(u, v, force), unit)
    panels.force_curve(axes[1], curve(u, force), "displacement", unit)
    panels.force_curve(axes[2], curve(v, force), "velocity", unit)
    page.letter(axes, ("mean over the plane of motion", "against displacement", "against velocity"))
    page.shared_legend(figure, axes)
    return figure


def error_in_time_figure(comparison: Comparison) -> Figure:
    """Error along the judging part."""
    chance = f"differences between stretches of equal level: p = {comparison.time.p_value:.2g}"
    if len(comparison.views) > 1:
        chance = f"{comparison.worst.sensor}; {chance}"
    figure, axes = page.empty_page(
        f"{comparison.record.name}: error along the record", f"model {comparison.model.name}; {chance}",
        rows=2, width=page.WIDE, panel=2.0, share=False,
    )  # fmt: skip
    panels.error_in_time(axes[0], comparison.time, comparison.worst.noise.rms / comparison.worst.size)
    panels.error_beyond_level(axes[1], comparison.time)
    page.letter(axes, ("error and response", "beyond what the level accounts for"))
    page.shared_legend(figure, axes[:1])
    return figure


def by_level(moving: Sequence[Level], force_unit: str) -> Figure:
    """Every fitted coefficient against the level of the force."""
    columns = 2 if len(moving) > 1 else 1
    figure, axes = page.empty_page(
        "Coefficients by level of excitation", "with 95 % intervals; the right model's do not move",
        rows=-(-len(moving) // columns), columns=columns, width=1.25 * page.WIDE, panel=1.9, legend_rows=0, share=False,
    )  # fmt: skip
    figure.subplots_adjust(wspace=0.38)
    for panel, level in zip(axes, moving, strict=False):
        panels.coefficient_by_level(panel, level, force_unit)
        verdict = "moves" if level.moves else "does not move"
        panel.set_title(f"{level.key}: {verdict} (p = {level.p_value:.2g})")
    for panel in axes[len(moving) :]:
        panel.set_visible(False)
    return figure
