"""Panels of a fit: response functions and checks of the residual. Axes in, Axes out."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from study.compare.panels import DOTTED
from study.compare.residual_checks import ResidualChecks
from study.compare.response_functions import ResponseFunctions
from study.equations import dimensions

MEASURED_CURVE: dict[str, Any] = {"color": "0.55", "linewidth": 2.4, "label": "measured"}
MODEL: dict[str, Any] = {"color": "C0", "linewidth": 1.3, "label": "model"}


def response_magnitude(axes: Axes, functions: ResponseFunctions, unit: str, highest: float) -> Axes:
    """|H(f)| measured, with the 95 % band of its random error, and predicted."""
    measured, predicted = functions.magnitude
    half = 1.96 * functions.error
    axes.fill_between(
        functions.frequency, np.maximum(measured - half, 1e-2 * measured), measured + half, color="0.85", linewidth=0.0
    )
    axes.plot(functions.frequency, measured, **MEASURED_CURVE)
    axes.plot(functions.frequency, predicted, **MODEL)
    axes.set_yscale("log")
    heights = np.concatenate([measured, predicted])
    axes.set_ylim(float(np.min(heights)) / 1.6, float(np.max(heights)) * 1.6)
    axes.set_ylabel(f"response / force ({dimensions.pretty(unit)})")
    axes.legend(loc="upper right")
    return _frequencies(axes, highest)


def response_phase(axes: Axes, functions: ResponseFunctions, highest: float) -> Axes:
    """Phase of H(f) in degrees."""
    for values, look in zip(functions.phase, (MEASURED_CURVE, MODEL), strict=True):
        gaps = np.concatenate([[False], np.abs(np.diff(values)) > 180.0])
        axes.plot(functions.frequency, np.where(gaps, np.nan, values), **look)
    axes.set_ylim(-190.0, 190.0)
    axes.set_yticks([-180, -90, 0, 90, 180])
    axes.set_ylabel("phase (deg)")
    return _frequencies(axes, highest)


def coherence_panel(axes: Axes, functions: ResponseFunctions, highest: float) -> Axes:
    """Ordinary coherence of force and response, of the record and of the model's free run."""
    axes.plot(functions.frequency, functions.coherence, **MEASURED_CURVE)
    axes.plot(functions.frequency, functions.coherence_predicted, **MODEL)
    axes.set_ylim(0.0, 1.03)
    axes.set_ylabel("coherence (1)")
    return _frequencies(axes, highest)


def _frequencies(axes: Axes, highest: float) -> Axes:
    axes.set_xlim(0.0, highest)
    axes.set_xlabel("frequency (Hz)")
    return axes


def autocorrelation(axes: Axes, checks: ResidualChecks) -> Axes:
    """Autocorrelation of the residual with the 99 % band of white noise."""
    axes.plot(checks.lag, checks.autocorrelation, color="C1", linewidth=1.2)
    return _banded(axes, checks.band, "autocorrelation of the residual")


def with_force(axes: Axes, checks: ResidualChecks) -> Axes:
    """Correlation of residual and force with the 99 % band of independent ones."""
    axes.plot(checks.lag_force, checks.with_force, color="C1", linewidth=1.2)
    return _banded(axes, checks.band_force, "correlation with the force")


def _banded(axes: Axes, band: float, label: str) -> Axes:
    for side in (-band, band):
        axes.axhline(side, label="99 % band" if side > 0.0 else None, **DOTTED)
    axes.set_xlabel("lag (s)")
    axes.set_ylabel(label)
    return axes


def residual_histogram(axes: Axes, checks: ResidualChecks) -> Axes:
    """Distribution of the residual beside the normal density of its standard deviation."""
    axes.stairs(checks.counts, checks.edges, fill=True, color="0.8", label="residual")
    x = np.linspace(float(checks.edges[0]), float(checks.edges[-1]), 201).astype(np.float64)
    axes.plot(x, np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi), color="black", linewidth=1.2, label="normal")
    axes.set_xlabel("residual (standard deviations)")
    axes.set_ylabel("density")
    return axes
