"""Where a structure's model fails: error by sensor, shared residual force, restoring forces. Axes in, Axes out."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from study.compare.missing_force import Unbalanced
from study.compare.panels import force_curve
from study.compare.prediction import Prediction
from study.equations.linear_part import Modes
from study.figures.page import frame_cells
from study.support.numbers import percent

DARK = 0.55  # share from which a number is written in white


def sensor_errors(axes: Axes, prediction: Prediction) -> Axes:
    """Error of each sensor over its rms motion, beside what noise alone would leave."""
    place = np.arange(len(prediction.prepared.sensors))
    axes.barh(place, 100.0 * prediction.errors, height=0.6, color="C1", label="error of the free run")
    axes.barh(place, 100.0 * prediction.floors, height=0.24, color="0.15", label="noise floor")
    axes.set_yticks(place, [str(s).replace(" ", "\n") for s in prediction.prepared.sensors])
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.18 * 100.0 * float(np.max(prediction.errors)))
    for y, error in zip(place, prediction.errors, strict=True):
        axes.annotate(
            percent(float(error)), (100.0 * float(error), y), xytext=(4, 0), textcoords="offset points", va="center",
            fontsize=8,
        )  # fmt: skip
    axes.set_xlabel("error of the sensor (% of its rms)")
    return axes


def coordinate_forces(axes: Axes, forces: Unbalanced) -> Axes:
    """Rms force that each measured coordinate's equation leaves, beside that of its inertia."""
    place = np.arange(len(forces.equations))
    axes.barh(place, forces.inertia, height=0.6, color="0.82", label="force of inertia")
    axes.barh(place, forces.rms, height=0.3, color="C1", label="left of the equation")
    axes.set_yticks(place, forces.equations)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.2 * float(max(np.max(forces.inertia), np.max(forces.rms), 1e-300)))
    for y, left, name in zip(place, forces.rms, forces.equations, strict=True):
        axes.annotate(
            f"{left:.3g} {forces.units(name)['force']}", (float(left), y), xytext=(4, 0), textcoords="offset points",
            va="center", fontsize=8,
        )  # fmt: skip
    axes.set_xlabel("rms force (N; N m on a rotation)")
    return axes


def shared_force(axes: Axes, forces: Unbalanced) -> Axes:
    """Shares of the residual force that two equations hold with opposite signs; on the diagonal, from outside."""
    names, share = list(forces.equations), 100.0 * forces.matrix
    axes.imshow(share, cmap="Oranges", vmin=0.0, vmax=100.0, aspect="auto")
    for (i, j), value in np.ndenumerate(share):
        axes.text(
            j, i, f"{value:.0f}", ha="center", va="center", fontsize=8,
            color="white" if value > 100.0 * DARK else "black",
        )  # fmt: skip
    frame_cells(axes, names, names, 30.0 if len(names) > 3 else 0.0)
    axes.set_xlabel("and this one, with the opposite sign (%)")
    axes.set_ylabel("in the equation of")
    return axes


def connection_force(axes: Axes, forces: Unbalanced, label: str) -> Axes:
    """Missing force of one connection against its relative displacement."""
    return force_curve(axes, forces.curves[label], "displacement", forces.units(label))


def mode_frequencies(axes: Axes, sets: Sequence[tuple[str, Modes]]) -> Axes:
    """Damping ratio over natural frequency with 95 % intervals, of the model before and after."""
    for (label, modes), marker, colour in zip(sets, ("s", "o"), ("0.55", "C0"), strict=False):
        axes.errorbar(
            modes.frequency, 100.0 * modes.damping, 196.0 * modes.damping_error, 1.96 * modes.frequency_error,
            linestyle="none", marker=marker, color=colour, markersize=5, capsize=2.5, label=label,
        )  # fmt: skip
    axes.set_xlim(left=0.0)
    axes.set_xlabel("natural frequency (Hz)")
    axes.set_ylabel("damping ratio (%)")
    return axes


def mode_shapes(axes: Axes, sets: Sequence[tuple[str, Modes]], number: int, coordinates: Sequence[str]) -> Axes:
    """One mode shape with 95 % intervals, of the model before and after, if it has so many modes."""
    sets = [(label, modes) for label, modes in sets if number < len(modes.frequency)]
    place = np.arange(len(coordinates), dtype=np.float64)
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    looks = zip(sets, ("s", "o"), ("0.55", "C0"), (-0.06, 0.06), strict=False)
    for (label, modes), marker, colour, shift in looks:
        sign = float(np.sign(modes.shape[number] @ sets[0][1].shape[number])) or 1.0  # the largest may be another one
        axes.errorbar(
            place + shift, sign * modes.shape[number], 1.96 * modes.shape_error[number], marker=marker, color=colour,
            markersize=4, linewidth=1.0, capsize=2.0, label=label,
        )  # fmt: skip
    axes.set_xticks(place, coordinates, rotation=30 if len(coordinates) > 4 else 0)
    axes.set_ylim(-1.25, 1.25)
    axes.set_title(f"mode {number + 1}: {sets[-1][1].frequency[number]:.4g} Hz")
    return axes
