"""Where a model fails: response beside prediction, force error, missing force over the motion, error in time."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.ticker import LogLocator
from numpy.typing import NDArray

from study.compare.along_time import AlongTime
from study.compare.fitted_coefficients import Level
from study.compare.force_error import ForceError
from study.compare.force_map import ForceCurve, Surface
from study.equations import dimensions
from study.figures import labels
from study.support.arrays import Floats

DRAWN_COLUMNS = 1500  # of a panel: a longer history is drawn as its extremes in so many columns
MEASURED: dict[str, Any] = {"color": "0.62", "label": "measured"}
PREDICTED: dict[str, Any] = {"color": "C0", "label": "free run of the model"}
RESIDUAL: dict[str, Any] = {"color": "C1", "label": "measured less predicted"}
DOTTED: dict[str, Any] = {"color": "black", "linestyle": (0, (1.0, 1.5)), "linewidth": 1.2}
LOWEST_DRAWN = 1e-6  # shares below are drawn there


def time_history(axes: Axes, time: Floats, values: Floats, look: dict[str, Any], **more: Any) -> Axes:
    """A history, or, if it is long, the band between its extremes in each column of the picture."""
    if len(values) <= 2 * DRAWN_COLUMNS:
        style: dict[str, Any] = {"linewidth": 0.9, **look, **more}
        axes.plot(time, values, **style)
        return axes
    bounds = np.linspace(0, len(values), DRAWN_COLUMNS + 1).astype(int)[:-1]
    low, high = np.minimum.reduceat(values, bounds), np.maximum.reduceat(values, bounds)
    filled: dict[str, Any] = {**look, **more, "linewidth": 0.3}
    axes.fill_between(time[bounds], low, high, **filled)
    return axes


def response_panel(axes: Axes, time: Floats, measured: Floats, predicted: Floats, unit: str) -> Axes:
    """Measured and predicted response."""
    factor, shown = labels.prefixed(unit, float(np.max(np.abs(measured))))
    close = len(time) <= 1000  # samples: fewer are drawn so that one curve does not hide the other
    time_history(axes, *with_breaks(time, measured / factor), MEASURED, linewidth=2.6 if close else 0.6)
    dashed = {"linestyle": (0, (3.0, 1.2)), "linewidth": 1.3} if close else {"alpha": 0.75, "linewidth": 0.6}
    time_history(axes, *with_breaks(time, predicted / factor), PREDICTED, **dashed)
    return _time_axis(axes, time, f"response ({dimensions.pretty(shown)})")


def residual(axes: Axes, time: Floats, difference: Floats, noise: float, unit: str) -> Axes:
    """What the model misses, beside twice the noise floor."""
    factor, shown = labels.prefixed(unit, float(np.max(np.abs(difference))))
    time_history(axes, *with_breaks(time, difference / factor), RESIDUAL)
    for k, side in enumerate((-2.0, 2.0)):
        axes.axhline(side * noise / factor, label="twice the rms of the noise" if k else None, zorder=3.0, **DOTTED)
    return _time_axis(axes, time, f"difference ({dimensions.pretty(shown)})")


def with_breaks(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Times and values with one that is none wherever time is left out, so that no line is drawn across."""
    steps = np.diff(time)
    places = 1 + np.flatnonzero(np.abs(steps - np.median(steps)) > 0.5 * np.median(steps))
    return np.insert(time, places, time[places - 1]), np.insert(values, places, np.nan)


def _time_axis(axes: Axes, time: Floats, label: str) -> Axes:
    axes.set_xlim(float(time[0]), float(time[-1]))
    axes.set_xlabel("time (s)")
    axes.set_ylabel(label)
    return axes


def force_error_panel(axes: Axes, error: ForceError, highest: float) -> Axes:
    """Unexplained share of the force, line by line; shaded where the motion stands above its noise."""
    keep = (error.frequency > 0.0) & (error.frequency <= highest)
    f = error.frequency[keep]
    axes.fill_between(
        f, 0.0, 1.0, where=error.band[keep].tolist(), transform=axes.get_xaxis_transform(), color="0.93", linewidth=0.0,
        label="motion above its noise", zorder=0.5,
    )  # fmt: skip
    axes.plot(f, _shown(error.parametric[keep]), color="C0", label="left by the fitted coefficients")
    axes.plot(f, _shown(error.unexplained[keep]), color="C1", linestyle=(0, (5.0, 2.0)), label="1 - multiple coherence")
    axes.plot(f, _shown(error.noise[keep]), label="noise on the response alone", **DOTTED)
    axes.set_yscale("log")
    axes.set_ylim(_limits(error, keep))
    axes.set_xlim(0.0, highest)
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel("unexplained share of the force")
    return axes


def _limits(error: ForceError, keep: NDArray[np.bool_]) -> tuple[float, float]:
    """From the lowest share to the highest of the shaded band: beyond it the noise leaves the panel."""
    shares = _shown(np.concatenate([error.parametric[keep], error.unexplained[keep]]))
    inside = np.concatenate([error.parametric[error.band], error.unexplained[error.band]])
    return 0.5 * float(np.min(shares)), max(2.0, 1.5 * float(np.max(inside)))


def _shown(share: Floats) -> Floats:
    return np.maximum(share, LOWEST_DRAWN)


def missing_force_panel(axes: Axes, plane: Surface, unit: dict[str, str]) -> Axes:
    """Mean missing force over displacement and velocity; a dot marks a cell whose mean may be noise."""
    factor, shown = labels.prefixed(unit["displacement"], float(np.max(np.abs(plane.displacement))))
    rate, rate_shown = _rate(unit["velocity"], plane.velocity)
    largest = float(np.nanmax(np.abs(plane.mean), initial=0.0)) or 1.0
    mesh = axes.pcolormesh(
        plane.displacement / factor, plane.velocity / rate, plane.mean.T, cmap="RdBu_r",
        norm=TwoSlopeNorm(0.0, -largest, largest), rasterized=True,
    )  # fmt: skip
    middle_u = 0.5 * (plane.displacement[1:] + plane.displacement[:-1]) / factor
    middle_v = 0.5 * (plane.velocity[1:] + plane.velocity[:-1]) / rate
    # cells whose mean is below two standard errors are marked as not sure
    i, j = np.nonzero(np.abs(plane.mean) < 2.0 * plane.error)
    axes.plot(middle_u[i], middle_v[j], ".", color="0.45", markersize=1.5, label="may be noise")
    axes.grid(visible=False)
    place = axes.get_position()
    axes.set_position((place.x0, place.y0, 0.85 * place.width, place.height))  # room for the scale of colours
    figure = axes.get_figure()
    assert figure is not None, "the axes stand on a page"
    bar = figure.colorbar(mesh, cax=axes.inset_axes((1.025, 0.0, 0.025, 1.0)))
    bar.set_label(f"missing force ({dimensions.pretty(unit['force'])})")
    axes.set_xlabel(f"displacement ({dimensions.pretty(shown)})")
    axes.set_ylabel(f"velocity ({dimensions.pretty(rate_shown)})")
    return axes


def force_curve(axes: Axes, curve: ForceCurve, against: str, unit: dict[str, str]) -> Axes:
    """Mean missing force against displacement or velocity, with 95 % intervals."""
    largest = float(np.max(np.abs(curve.at), initial=0.0))
    scaled = labels.prefixed(unit[against], largest) if against == "displacement" else _rate(unit[against], curve.at)
    factor, shown = scaled
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    axes.errorbar(
        curve.at / factor, curve.mean, 1.96 * curve.error, fmt="o-", color="C0", markersize=3.5, linewidth=1.2,
        elinewidth=1.0, capsize=2.0, label="mean and 95 % interval",
    )  # fmt: skip
    axes.set_xlabel(f"{against} ({dimensions.pretty(shown)})")
    axes.set_ylabel(f"missing force ({dimensions.pretty(unit['force'])})")
    return axes


def _rate(unit: str, values: Floats) -> tuple[float, str]:
    """Divisor and unit in which velocities are easy to read: m/s become mm/s where that is better."""
    if unit != "m/s":
        return 1.0, unit
    factor, shown = labels.prefixed("m", float(np.max(np.abs(values), initial=0.0)))
    return factor, f"{shown}/s"


def error_in_time(axes: Axes, along: AlongTime, floor: float) -> Axes:
    """Error and level of the response, stretch by stretch, over the rms response of the whole judging part."""
    edges = [*(s.begin for s in along.stretches), along.stretches[-1].end]
    response, error = [100.0 * s.response for s in along.stretches], [100.0 * s.error for s in along.stretches]
    axes.stairs(response, edges, baseline=None, color="0.35", linewidth=1.4, label="response")
    axes.stairs(error, edges, baseline=None, color="C1", linewidth=2.0, label="error")
    axes.axhline(100.0 * floor, label="noise floor", **DOTTED)
    axes.set_yscale("log", subs=[])
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_ylabel("rms (% of the rms response)")
    return _stretch_axis(axes, edges)


def error_beyond_level(axes: Axes, along: AlongTime) -> Axes:
    """Power of the residual over what is usual at that level of the response."""
    edges = [*(s.begin for s in along.stretches), along.stretches[-1].end]
    axes.axhline(1.0, color="0.6", linewidth=0.8)
    axes.stairs([s.ratio for s in along.stretches], edges, baseline=None, color="C0", linewidth=2.0)
    axes.set_yscale("log", base=2)
    reach = max(2.0, *(1.2 * max(s.ratio, 1.0 / max(s.ratio, 1e-9)) for s in along.stretches))
    axes.set_ylim(1.0 / reach, reach)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_ylabel("power of the error over\nthat usual at this level")
    return _stretch_axis(axes, edges)


def _stretch_axis(axes: Axes, edges: Sequence[float]) -> Axes:
    axes.set_xlim(edges[0], edges[-1])
    axes.set_xlabel("time (s)")
    return axes


def coefficient_by_level(axes: Axes, level: Level, force_unit: str) -> Axes:
    """One coefficient against the rms force, with 95 % intervals."""
    axes.errorbar(
        level.force, level.value, 1.96 * np.array(level.error), fmt="o-", color="C1" if level.moves else "C0",
        markersize=4.0, linewidth=1.2, capsize=2.5,
    )  # fmt: skip
    axes.set_xlabel(f"rms force ({dimensions.pretty(force_unit)})")
    axes.set_ylabel(f"{level.key} ({dimensions.pretty(level.unit)})")
    return axes
