"""Pictures of the preliminary analysis: force against displacement, histories and autospectra."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from study.equations import dimensions
from study.figures import labels
from study.reproduction.preliminary import Pattern

Floats = NDArray[np.float64]
HARMONIC: dict[str, Any] = {"color": "C0", "linewidth": 1.8, "label": "harmonic motion"}
ENVELOPE: dict[str, Any] = {**HARMONIC, "linewidth": 1.2}
RANDOM: dict[str, Any] = {"color": "0.45", "linewidth": 0.4}
DECADES = 1e-5  # an autospectrum is shown down to this share of its largest line


def pattern_panels(
    harmonic_axes: Axes, random_axes: Axes, harmonic: Pattern, random: Pattern, unit: Mapping[str, str]
) -> None:
    """Restoring force against displacement under harmonic motion and under random excitation.

    Both panels have the same scales, and the harmonic pattern is drawn again about the random one:
    that their envelopes are alike is what the two together are to show (Section 3.2).
    """
    largest = max(float(np.abs(p.displacement).max()) for p in (harmonic, random))
    factor, shown = labels.prefixed(unit["displacement"], largest)
    reach = 1.06 * max(float(np.abs(p.force).max()) for p in (harmonic, random))
    random_axes.plot(random.displacement / factor, random.force, label="random excitation", **RANDOM)
    for axes, look in ((harmonic_axes, HARMONIC), (random_axes, ENVELOPE)):
        axes.plot(harmonic.displacement / factor, harmonic.force, **look)
        axes.set_xlim(-1.06 * largest / factor, 1.06 * largest / factor)
        axes.set_ylim(-reach, reach)
        axes.set_xlabel(f"displacement ({dimensions.pretty(shown)})")
    harmonic_axes.set_ylabel(f"restoring force $F_r$ ({dimensions.pretty(unit['force'])})")


def autospectrum_panel(axes: Axes, frequency: Floats, density: Floats, unit: str, highest: float) -> Axes:
    """A one-sided autospectrum on a logarithmic scale, from the first line above zero."""
    keep = (frequency > 0.0) & (frequency <= highest)
    axes.semilogy(frequency[keep], density[keep], color="C0", linewidth=1.6)
    axes.set_xlim(0.0, highest)
    axes.set_ylim(bottom=max(DECADES * float(density[keep].max()), 0.5 * float(density[keep].min())))
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(f"autospectrum ({_squared(unit)}/Hz)")
    return axes


def frequency_marks(axes: Axes, lines: Mapping[str, float]) -> Axes:
    """Vertical lines at named frequencies (mathtext without its dollars), the names above the panel."""
    for name, frequency in lines.items():
        axes.axvline(frequency, color="C1", linestyle=(0, (5.0, 2.0)), linewidth=1.2, zorder=1.5)
        axes.annotate(
            f"${name}$\n{frequency:.3g} Hz", (frequency, 1.0), (0, 3), xycoords=("data", "axes fraction"),
            textcoords="offset points", ha="center", va="bottom", fontsize=9,
        )  # fmt: skip
    return axes


def history_panel(axes: Axes, time: Floats, values: Floats, quantity: str, unit: str) -> Axes:
    """A stretch of a time history."""
    axes.plot(time, values, color="C0", linewidth=0.9)
    axes.set_xlim(float(time[0]), float(time[-1]))
    axes.set_xlabel("time (s)")
    axes.set_ylabel(f"{quantity} ({dimensions.pretty(unit)})")
    return axes


def _squared(unit: str) -> str:
    """The square of a unit, in brackets where it is a quotient."""
    return dimensions.pretty(f"({unit})^2" if "/" in unit else f"{unit}^2")
