"""Pictures of a diagnosis: Axes in, Axes out."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from study.diagnose.ranked import Ranked
from study.diagnose.verdict import Diagnosis
from study.figures.labels import term_names

SHOWN = 10
FURTHEST = (-4.0, 6.0)  # of a coefficient, relative to its value: what lies beyond is no constant


def ranking(axes: Axes, diagnosis: Diagnosis) -> Axes:
    """Held-out error of the response after adding each candidate, beside the error before and the noise floor."""
    rows, before = diagnosis.candidates[:SHOWN], diagnosis.comparison.prediction.error
    place = np.arange(len(rows))
    values = [100.0 * min(r.response_error, 10.0 * before) for r in rows]
    axes.barh(place, values, height=0.62, color=["0.25" if i == 0 else "0.7" for i in place])
    axes.set_yticks(place, [_label(r, rows[0]) for r in rows])
    axes.invert_yaxis()
    axes.set_xlim(0.0, 118.0 * before)
    axes.axvline(100.0 * before, color="0.1", linewidth=1.4, linestyle="-", label="without it")
    floor = rows[0].prediction.floor if rows else diagnosis.comparison.prediction.floor
    axes.axvline(100.0 * floor, color="0.1", linewidth=1.4, linestyle=":", label="noise floor")
    axes.set_xlabel("held-out error of the response after adding it (%)")
    return axes


def _label(row: Ranked, first: Ranked) -> str:
    tied = row.name in first.tied_with or (row is first and bool(first.tied_with))
    return term_names(row.name) + (" (tie)" if tied else "")


def constancy(frequency: Axes, amplitude: Axes, rows: Sequence[Ranked]) -> None:
    """The coefficient of the first candidates along frequency and amplitude, relative to its value."""
    low, high = -0.5, 2.5
    styles = (("o", "-", "0.1"), ("s", "--", "0.45"), ("^", ":", "0.6"))
    for row, (marker, line, colour) in zip(rows, styles, strict=False):
        for axes, curve in ((frequency, row.flatness), (amplitude, row.steadiness)):
            if curve is None:
                continue
            relative = curve.value.real / abs(row.coefficient)  # a curve is one of sizes: along the coefficient's sign
            low, high = min(low, *relative), max(high, *relative)
            axes.errorbar(
                curve.at, relative, 1.96 * curve.error / abs(row.coefficient),
                marker=marker, linestyle=line, color=colour, capsize=2.0, label=term_names(row.name),
            )  # fmt: skip
    for axes, what in ((frequency, "frequency (Hz)"), (amplitude, "strength of the effect relative to its mean")):
        axes.axhline(1.0, color="0.8", linewidth=0.8, zorder=0)
        axes.set_xlabel(what)
        axes.set_ylim(max(1.1 * low, FURTHEST[0]), min(1.1 * high, FURTHEST[1]))
    frequency.set_ylabel("coefficient, relative to its value")
