"""Histograms beside the Gaussian of the same mean and variance."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from matplotlib.axes import Axes

from study.equations import dimensions
from study.figures import labels
from study.reproduction.preliminary import Histogram


def histogram_panel(axes: Axes, counts: Histogram, quantity: str, unit: str) -> Axes:
    """Probability density of a quantity; skewness and kurtosis stand above the panel.

    ``unit`` is that of ``counts``; metres are shown as mm or µm where that reads better.
    """
    factor, shown = labels.prefixed(unit, float(abs(counts.edges).max()))
    axes.stairs(counts.density * factor, counts.edges / factor, fill=True, facecolor="C4", alpha=0.55, label=quantity)
    axes.stairs(counts.density * factor, counts.edges / factor, color="C0", linewidth=0.9)
    axes.plot(
        counts.points / factor, counts.gaussian * factor, color="black", linestyle=(0, (5.0, 2.0)), linewidth=1.5,
        label="Gaussian of the same variance",
    )  # fmt: skip
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(counts.points[0] / factor, counts.points[-1] / factor)
    axes.set_xlabel(f"{quantity} ({dimensions.pretty(shown)})")
    axes.set_ylabel(f"probability density (1/{dimensions.pretty(shown)})")
    spread, skewness = labels.quantity(counts.deviation, unit), round(counts.skewness, 2) + 0.0  # not "-0.00"
    axes.set_title(
        f"std. deviation {spread}, skewness {skewness:.2f} (Gaussian: 0), kurtosis {counts.kurtosis:.2f} (3)"
    )
    return axes
