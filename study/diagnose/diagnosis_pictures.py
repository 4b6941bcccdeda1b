"""Pictures of a diagnosis: Axes in, Axes out."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes

from study.diagnose.constancy import CoefficientCurve
from study.figures.labels import term_names
from study.support.numbers import percent
from study.support.statistics import Gain

SHOWN = 10
LEAST = -30.0  # per cent: a candidate that explains less than nothing is drawn no further
FURTHEST = (-4.0, 6.0)  # of a coefficient, relative to its value: what lies beyond is no constant


class PicturedCandidate(Protocol):
    """What the pictures show of a candidate, at a place or without one."""

    @property
    def name(self) -> str:
        """Effect, and place if it has one."""
        ...

    @property
    def gain(self) -> Gain:
        """What it explains, held out."""
        ...

    @property
    def response_error(self) -> float:
        """Error of the response with it, held out."""
        ...

    @property
    def coefficient(self) -> float:
        """Its size."""
        ...

    @property
    def flatness(self) -> CoefficientCurve | None:
        """The coefficient along frequency."""
        ...

    @property
    def steadiness(self) -> CoefficientCurve | None:
        """The coefficient along amplitude."""
        ...

    @property
    def tied_with(self) -> tuple[str, ...]:
        """Names of those that the record cannot tell from it."""
        ...


class _Judged(Protocol):
    @property
    def error(self) -> float: ...


class _Compared(Protocol):
    @property
    def prediction(self) -> _Judged: ...


class PicturedDiagnosis(Protocol):
    """What they show of a diagnosis, of a structure or of a single mass."""

    @property
    def verdict(self) -> str:
        """What is said."""
        ...

    @property
    def candidates(self) -> Sequence[PicturedCandidate]:
        """Best first."""
        ...

    @property
    def comparison(self) -> _Compared:
        """Of the model as it is."""
        ...


def ranking(axes: Axes, diagnosis: PicturedDiagnosis) -> Axes:
    """Share of the held-out difference that each candidate explains, with its standard error."""
    rows = diagnosis.candidates[:SHOWN]
    place = np.arange(len(rows))
    shares = np.array([100.0 * r.gain.explained for r in rows])
    errors = np.array([100.0 * r.gain.error for r in rows])
    axes.barh(place, np.clip(shares, LEAST, 100.0), height=0.62, color=["0.25" if i == 0 else "0.7" for i in place])
    axes.errorbar(
        np.clip(shares, LEAST, 100.0), place, xerr=errors, fmt="none", ecolor="0.05", elinewidth=1.0, capsize=2.5
    )
    axes.set_yticks(place, [_label(r, rows[0]) for r in rows])
    axes.invert_yaxis()
    axes.set_xlim(min(0.0, 1.1 * float(np.min(np.clip(shares, LEAST, 0.0), initial=0.0))), 136.0)
    axes.set_xticks([0, 20, 40, 60, 80, 100])
    for y, row in zip(place, rows, strict=True):
        axes.annotate(f"leaves {percent(row.response_error)}", (1.0, y), xycoords=("axes fraction", "data"),
                      xytext=(-3, 0), textcoords="offset points", ha="right", va="center", fontsize=8,
                      bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0})  # fmt: skip
    before = diagnosis.comparison.prediction
    axes.set_xlabel(f"explained share of the difference (%), which is {percent(before.error)} of the response")
    return axes


def _label(row: PicturedCandidate, first: PicturedCandidate) -> str:
    tied = row.name in first.tied_with or (row is first and bool(first.tied_with))
    return term_names(row.name) + (" (tie)" if tied else "")


def constancy_panels(frequency: Axes, amplitude: Axes, rows: Sequence[PicturedCandidate]) -> None:
    """The coefficient of the first candidates along frequency and amplitude, relative to its value."""
    followed(frequency, rows, "frequency")
    followed(amplitude, rows, "amplitude")
    low, high = (f(frequency.get_ylim()[i], amplitude.get_ylim()[i]) for i, f in enumerate((min, max)))
    for axes in (frequency, amplitude):
        axes.set_ylim(low, high)
    amplitude.set_ylabel("")


def followed(axes: Axes, rows: Sequence[PicturedCandidate], along: str) -> Axes:
    """The coefficient of candidates along ``frequency`` or ``amplitude``, relative to its value."""
    low, high = -0.5, 2.5
    styles = (("o", "-", "0.1"), ("s", "--", "0.45"), ("^", ":", "0.6"))
    for row, (marker, line, colour) in zip(rows, styles, strict=False):
        curve = row.flatness if along == "frequency" else row.steadiness
        if curve is None:
            continue
        relative = curve.value.real / abs(row.coefficient)  # a curve is one of sizes: along the coefficient's sign
        low, high = min(low, *relative), max(high, *relative)
        axes.errorbar(
            curve.at, relative, 1.96 * curve.error / abs(row.coefficient),
            marker=marker, linestyle=line, color=colour, capsize=2.0, label=term_names(row.name),
        )  # fmt: skip
    axes.axhline(1.0, color="0.8", linewidth=0.8, zorder=0)
    axes.set_xlabel("frequency (Hz)" if along == "frequency" else "strength of the effect relative to its mean")
    axes.set_ylim(max(1.1 * low, FURTHEST[0]), min(1.1 * high, FURTHEST[1]))
    axes.set_ylabel("coefficient, relative to its value")
    return axes
