"""Frequency response functions A_j(f): magnitude and phase, real and imaginary part."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from study.equations import dimensions
from study.figures import labels
from study.figures.curves import InputResponse, ResponseCurve
from study.figures.styles import EXACT, look
from study.support.arrays import Complexes, Floats

SHADED: dict[str, Any] = {"alpha": 0.22, "linewidth": 0.0}
OPPOSITE = "opposite sign"
Part = Callable[[Complexes], Floats]


def magnitude_panel(axes: Axes, response: InputResponse, unit: str) -> Axes:
    """|A_j(f)| of every estimator on a logarithmic scale, with 95 % bands and the exact function."""
    for curve in response.curves:
        _size(axes, curve, np.abs(curve.values))
    sizes = [np.abs(c.values) for c in response.curves]
    if response.exact is not None:
        axes.plot(response.frequency, np.abs(response.exact), **EXACT.line)
        sizes.append(np.abs(response.exact))
    axes.set_yscale("log")
    _decades(axes, sizes)
    axes.set_ylabel(f"$|A_{response.number}|$ ({dimensions.pretty(unit)})")
    return _frequency_axis(axes, response)


def phase_panel(axes: Axes, response: InputResponse) -> Axes:
    """Phase of A_j(f) in degrees, from -90 to 270: neither 0 nor 180 is where it would wrap."""
    turns: list[Floats] = []
    for curve in response.curves:
        angle = _degrees(curve.values)
        width = np.degrees(np.minimum(curve.half_width / np.maximum(np.abs(curve.values), 1e-300), np.pi))
        _curve(axes, curve, _broken(angle), angle - width, angle + width)
        turns.append(angle)
    if response.exact is not None:
        turns.append(_degrees(response.exact))
        axes.plot(response.frequency, _broken(turns[-1]), **EXACT.line)
    inside = all(np.all((t > -45.0) & (t < 225.0)) for t in turns)
    axes.set_ylim((-45.0, 225.0) if inside else (-90.0, 270.0))
    axes.set_yticks([0, 90, 180] if inside else [-90, 0, 90, 180, 270])
    axes.set_ylabel(f"phase of $A_{response.number}$ (deg)")
    return _frequency_axis(axes, response)


def real_and_imaginary(real: Axes, imaginary: Axes, response: InputResponse, unit: str, span: float) -> None:
    """Real and imaginary part of A_j(f) with 95 % bands and the exact values.

    ``span`` is the height of every linear scale, in the unit of A_j (see :func:`common_span`): a part which is zero is
    then seen to be small. An imaginary part that grows with frequency (a damping term) has a logarithmic scale, as in
    Figure 26b.
    """
    factor, power = labels.power_of_ten(span)
    label, name = dimensions.pretty(f"{power}{unit}"), f"A_{response.number}"
    _linear(real, response, np.real, factor, span)
    real.set_ylabel(rf"Re ${name}$ ({label})")
    if _grows(response):
        _logarithmic(imaginary, response, span)
        imaginary.set_ylabel(rf"|Im ${name}$| ({dimensions.pretty(unit)})")
    else:
        _linear(imaginary, response, np.imag, factor, span)
        imaginary.set_ylabel(rf"Im ${name}$ ({label})")
    _frequency_axis(real, response)
    _frequency_axis(imaginary, response)


def common_span(responses: Sequence[InputResponse]) -> float:
    """Height of a linear scale that holds both parts of every response, and its typical size if known."""
    heights = [float(np.median(np.abs(r.exact))) for r in responses if r.exact is not None]
    for item in responses:
        for part in (np.real,) if _grows(item) else (np.real, np.imag):
            low, high = _limits(item, part)
            heights.append(high - low)
    return 1.5 * max(heights) or 1.0


def _grows(response: InputResponse) -> bool:
    """Whether the imaginary part is truly other than zero at every line, as a damping term's is."""
    return response.exact is not None and bool(np.all(response.exact.imag != 0.0))


def _linear(axes: Axes, response: InputResponse, part: Part, factor: float, span: float) -> None:
    for curve in map(partial(_within, span=span), response.curves):
        values, width = part(curve.values) / factor, curve.half_width / factor
        _curve(axes, curve, values, values - width, values + width)
    if response.exact is not None:
        axes.plot(response.frequency, part(response.exact) / factor, **EXACT.line)
    middle = sum(_limits(response, part)) / 2.0
    axes.set_ylim((middle - span / 2.0) / factor, (middle + span / 2.0) / factor)


def _limits(response: InputResponse, part: Part) -> tuple[float, float]:
    """What a scale must hold: zero, what is true, and the middle 80 % of each estimate.

    Where the input has little power an estimate scatters widely; those lines may leave the panel.
    """
    exact = [] if response.exact is None else [part(response.exact)]
    middle = [np.quantile(part(c.values), [0.1, 0.9]) for c in response.curves]
    values = np.concatenate([np.zeros(1), *exact, *middle])
    return float(values.min()), float(values.max())


def _logarithmic(axes: Axes, response: InputResponse, span: float) -> None:
    """|Im A_j|; where its sign is not that of the exact function, crosses say so."""
    assert response.exact is not None, "the scale is logarithmic only where the exact function says so"
    for curve in map(partial(_within, span=span), response.curves):
        size, colour = np.abs(curve.values.imag), look(curve.estimator).colour
        _size(axes, curve, size)
        exact_there = np.interp(curve.frequency, response.frequency, response.exact.imag)
        wrong = np.sign(curve.values.imag) * np.sign(exact_there) < 0.0
        if np.any(wrong):
            axes.plot(curve.frequency[wrong], size[wrong], "x", color=colour, ms=5, zorder=6.0, label=OPPOSITE)
    exact = np.abs(response.exact.imag)
    axes.plot(response.frequency, exact, **EXACT.line)
    axes.set_yscale("log")
    middle = [np.quantile(np.abs(c.values.imag), [0.05, 0.95]) for c in response.curves]
    _decades(axes, [*middle, exact])


def _within(curve: ResponseCurve, span: float) -> ResponseCurve:
    """The curve with gaps where its 95 % band is higher than the panel: the record says nothing about A_j there."""
    unknown = 2.0 * curve.half_width > span
    return replace(curve, values=np.where(unknown, complex("nan+nanj"), curve.values))


def _size(axes: Axes, curve: ResponseCurve, size: Floats) -> None:
    """A size with its 95 % band, for a logarithmic scale: the band ends a hundredfold below the curve."""
    _curve(axes, curve, size, np.maximum(size - curve.half_width, 1e-2 * size), size + curve.half_width)


def _curve(axes: Axes, curve: ResponseCurve, values: Floats, low: Floats, high: Floats) -> None:
    """Values of a curve and a band about them, in the estimator's look."""
    style = look(curve.estimator)
    axes.fill_between(curve.frequency, low, high, color=style.colour, zorder=style.level - 1.0, **SHADED)
    axes.plot(curve.frequency, values, **style.line)


def _degrees(values: Complexes) -> Floats:
    return np.mod(np.degrees(np.angle(values)) + 90.0, 360.0) - 90.0


def _broken(angle: Floats) -> Floats:
    """The angle with a gap where it wraps: a stroke across the panel would be no data."""
    gaps = np.concatenate([[False], np.abs(np.diff(angle)) > 180.0])
    return np.where(gaps, np.nan, angle)


def _decades(axes: Axes, sizes: Sequence[Floats]) -> None:
    values = np.concatenate(sizes)
    values = values[values > 0.0]
    axes.set_ylim(float(values.min()) / 1.6, float(values.max()) * 1.6)


def _frequency_axis(axes: Axes, response: InputResponse) -> Axes:
    axes.set_xlim(0.0, float(np.ceil(response.frequency[-1])))
    place = axes.get_subplotspec()
    if place is None or place.is_last_row():
        axes.set_xlabel("frequency (Hz)")
    return axes
