"""The pictures of a diagnosis: as files, and each alone (Axes in, Axes out)."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study.compare.place_pictures import modes, structure_figure
from study.compare.varying_pictures import varying_figure
from study.diagnose.diagnosis_sketch import sketch_of_diagnosis
from study.diagnose.ranked import Ranked
from study.diagnose.verdict import Diagnosis
from study.figures import page
from study.figures.labels import term_names
from study.figures.styles import in_style
from study.support.numbers import percent

CANDIDATES_FOLLOWED = 3  # their coefficient is drawn along frequency and amplitude
LEAST_DRAWN = -30.0  # per cent: a candidate that explains less is drawn there
FURTHEST = (-4.0, 6.0)  # of a coefficient, relative to its value: what lies beyond is no constant


def picture_files(diagnosis: Diagnosis, record: str) -> dict[str, bytes]:
    """The pictures by file name, in the project's style; of a structure with those that its places ask for."""
    comparison = diagnosis.comparison
    with in_style():
        drawn = diagnosis_figures(diagnosis, record) if diagnosis.candidates or not comparison.model.named else {}
        if diagnosis.varying:
            drawn["varying"] = varying_figure(diagnosis.varying, record)
        if comparison.model.named:
            sets = [("as given", comparison.modes)]
            sets += [("with what is missing", diagnosis.modes_after)] if diagnosis.modes_after is not None else []
            drawn["structure"] = structure_figure(comparison, sketch_of_diagnosis(diagnosis))
            if not comparison.model.prescribed:
                drawn["modes"] = modes(comparison, sets)
        return page.image_files(drawn)


def diagnosis_figures(diagnosis: Diagnosis, record: str) -> dict[str, Figure]:
    """Figures by the stem of their file name; the caller applies the style sheet."""
    widest, (axes,) = page.empty_page(
        f"What is missing from the model: {diagnosis.verdict.replace('_', ' ')}",
        f"{record}; the model as fitted misses {percent(diagnosis.comparison.prediction.error)} of the response",
        panel=3.4, legend_rows=0, headed=False, width=(1.4 if diagnosis.comparison.model.named else 1.0) * page.WIDTH,
    )  # fmt: skip
    room = 1.2  # inches beside the axis, for "leaves 1.23e-13 %"
    widest.subplots_adjust(left=0.34, right=1.0 - room / widest.get_figwidth())
    ranking(axes, diagnosis)
    constancy, panels = page.empty_page(
        f"Is the coefficient a constant? {record}", "that of a true term is, along frequency and along amplitude",
        columns=2, width=page.width(2), panel=2.8, share=False,
    )  # fmt: skip
    constancy_panels(panels[0], panels[1], diagnosis.candidates[:CANDIDATES_FOLLOWED])
    page.shared_legend(constancy, panels)
    return {"candidates": widest, "constancy": constancy}


def ranking(axes: Axes, diagnosis: Diagnosis) -> Axes:
    """Share of the held-out difference that each candidate explains, with its standard error; arrows point beyond."""
    rows = diagnosis.candidates[:10]
    place = np.arange(len(rows))
    shares = np.array([100.0 * r.gain.explained for r in rows])
    errors = np.array([100.0 * r.gain.error for r in rows])
    bars = np.clip(shares, LEAST_DRAWN, 100.0)
    left, right = 1.1 * float(np.min(np.clip(shares - errors, LEAST_DRAWN, 0.0), initial=0.0)), 104.0
    axes.barh(place, bars, height=0.62, color=["0.25" if i == 0 else "0.7" for i in place])
    low, high = np.clip([shares - errors, shares + errors], left, right)
    whiskers = np.maximum([bars - low, high - bars], 0.0)
    axes.errorbar(bars, place, xerr=whiskers, fmt="none", ecolor="0.05", elinewidth=1.0, capsize=2.5, clip_on=False)
    for beyond, edge, arrow in ((shares - errors < left, left, "<"), (shares + errors > right, right, ">")):
        axes.plot([edge] * int(np.sum(beyond)), place[beyond], arrow, color="0.05", markersize=4.5, clip_on=False)
    axes.set_yticks(place, [_label(r, rows[0]) for r in rows])
    axes.invert_yaxis()
    axes.set_xlim(left, right)
    axes.set_xticks([0, 20, 40, 60, 80, 100])
    for y, row in zip(place, rows, strict=True):
        axes.annotate(f"leaves {percent(row.response_error)}", (1.0, y), xycoords=("axes fraction", "data"),
                      xytext=(8, 0), textcoords="offset points", ha="left", va="center", fontsize=8)  # fmt: skip
    axes.set_xlabel("share that it explains of what is missing (%)")
    return axes


def _label(row: Ranked, first: Ranked) -> str:
    tied = row.name in first.tied_with or (row is first and bool(first.tied_with))
    return term_names(row.name) + (" (tie)" if tied else "")


def constancy_panels(frequency: Axes, amplitude: Axes, rows: Sequence[Ranked]) -> None:
    """The coefficient of the first candidates along frequency and amplitude, relative to its value."""
    followed(frequency, rows, "frequency")
    followed(amplitude, rows, "amplitude")
    low, high = (f(frequency.get_ylim()[i], amplitude.get_ylim()[i]) for i, f in enumerate((min, max)))
    for axes in (frequency, amplitude):
        axes.set_ylim(low, high)
    amplitude.set_ylabel("")


def followed(axes: Axes, rows: Sequence[Ranked], along: str) -> Axes:
    """The coefficient of candidates along ``frequency`` or ``amplitude``, relative to its value."""
    low, high = -0.5, 2.5
    styles = (("o", "-", "0.1"), ("s", "--", "0.45"), ("^", ":", "0.6"))
    for row, (marker, line, colour) in zip(rows, styles, strict=False):
        curve = row.effect.flatness if along == "frequency" else row.effect.steadiness
        if curve is None:
            continue
        # a curve is one of sizes: along the coefficient's sign
        relative = curve.value.real / abs(row.effect.coefficient)
        low, high = min(low, *relative), max(high, *relative)
        axes.errorbar(
            curve.at, relative, 1.96 * curve.error / abs(row.effect.coefficient),
            marker=marker, linestyle=line, color=colour, capsize=2.0, label=term_names(row.name),
        )  # fmt: skip
    axes.axhline(1.0, color="0.8", linewidth=0.8, zorder=0)
    axes.set_xlabel("frequency (Hz)" if along == "frequency" else "strength of the effect relative to its mean")
    axes.set_ylim(max(1.1 * low, FURTHEST[0]), min(1.1 * high, FURTHEST[1]))
    axes.set_ylabel("coefficient, relative to its value")
    return axes
