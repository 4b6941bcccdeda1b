"""Figures of the study: of a case from its files, and the errors of the estimators side by side."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from study.equations import dimensions
from study.equations.model_file import read_model
from study.figures import coherence, curves, frequency_response, labels, page
from study.figures.styles import look
from study.records.record import read_csv
from study.records.spectra import Segments, autospectrum
from study.reproduction import preliminary
from study.reproduction.preliminary import Histogram, Pattern
from study.support.arrays import Floats

HIGHEST = 10.0  # hertz: the report's systems have their dynamics below it (Section 2.2)
DRAWN_OVER = (labels.FREE_SHAPE, "instrumental")  # whose coherences stand over those of MI/SO
DASHED = (0, (5.0, 2.0))


@dataclass(frozen=True)
class CaseFiles:
    """Files of a case, its title, and what of it is shown."""

    record: Path
    model: Path
    responses: Path
    coherences: Path
    title: str
    parameters: Path | None = None  # shape parameters that were estimated stand in the headings
    drawn: Sequence[str] | None = None  # estimators whose frequency response functions are shown; all if left out
    segments: Segments = field(default_factory=Segments)  # of the spectra

    @property
    def heading(self) -> str:
        """The title, with shape parameters that were estimated."""
        shapes = "" if self.parameters is None else labels.estimated(pd.read_csv(self.parameters))
        return f"{self.title}: {shapes}" if shapes else self.title


def draw_case(case: CaseFiles, outputs: Mapping[str, Sequence[Path]], style: Path) -> None:
    """Draw figures of a case: for each kind of ``KINDS`` that is wanted the files to write, PNG or SVG."""
    page.write_each({kind: partial(draw, case) for kind, draw in KINDS.items()}, outputs, style)


# ---- what was identified


def linear(case: CaseFiles) -> Figure:
    """Magnitude and phase of A_1."""
    first = curves.input_responses(pd.read_csv(case.responses), HIGHEST, case.drawn)[0]
    figure, axes = page.empty_page(
        case.heading, "Linear frequency response function $A_1(f)$", rows=2,
        legend_rows=page.rows_for(len(first.curves) + 2),
    )  # fmt: skip
    frequency_response.magnitude_panel(axes[0], first, labels.response_unit(first.shape))
    frequency_response.phase_panel(axes[1], first)
    page.letter(axes, ("magnitude", "phase"))
    page.shared_legend(figure, axes, bands=True)
    return figure


def nonlinear(case: CaseFiles) -> Figure:
    """Real and imaginary part of A_2 and every further one, side by side."""
    shown = curves.input_responses(pd.read_csv(case.responses), HIGHEST, case.drawn)[1:]
    if not shown:
        figure, axes = page.empty_page(case.heading, "No nonlinear input is assumed")
        axes[0].set_axis_off()
        return figure
    count = len(shown)
    names, s = ", ".join(f"$A_{r.number}(f)$" for r in shown), "s" if count > 1 else ""
    figure, axes = page.empty_page(
        case.heading, f"Nonlinear frequency response function{s} {names}", rows=2, columns=count,
        width=page.width(count), legend_rows=page.rows_for(len(shown[0].curves) + 3),
    )  # fmt: skip
    for item, real, imaginary in zip(shown, axes[:count], axes[count:], strict=True):
        unit = labels.response_unit(item.shape)
        alike = [other for other in shown if labels.response_unit(other.shape) == unit]
        frequency_response.real_and_imaginary(real, imaginary, item, unit, frequency_response.common_span(alike))
    by_input = [panel for pair in zip(axes[:count], axes[count:], strict=True) for panel in pair]
    parts = ("real part", "imaginary part")
    page.letter(by_input, [f"{p} of $A_{r.number}$, input {labels.formula(r.shape)}" for r in shown for p in parts])
    page.shared_legend(figure, axes, bands=True)
    return figure


def cumulative_coherence(case: CaseFiles) -> Figure:
    """Cumulative coherences of MI/SO; over them those with estimated shape parameters, and of motion free of noise."""
    table = pd.read_csv(case.coherences)
    shares = curves.coherences(table, HIGHEST)
    known = set(table["estimator"])
    others = [e for e in DRAWN_OVER if e in known and (case.drawn is None or e in case.drawn)]
    figure, axes = page.empty_page(
        case.heading, "Cumulative coherence", panel=2.7, legend_rows=len(shares) * (1 + len(others)), headed=False
    )  # fmt: skip
    coherence.cumulative_panel(axes[0], shares)
    for estimator in others:
        coherence.marks_of_another(axes[0], curves.coherences(table, HIGHEST, estimator), estimator)
    page.shared_legend(figure, axes, columns=1)
    return figure


# ---- the preliminary analysis of Section 3, and the force


def pattern(case: CaseFiles) -> Figure:
    """Restoring force against displacement (Figures 2 to 7): as large a harmonic motion as the random one."""
    record, model = read_csv(case.record), read_model(case.model)
    random = preliminary.random_pattern(record, model.numbers()["m"])
    amplitude, frequency = preliminary.harmonic_beside(model, record)
    cycles = preliminary.closing_cycles(model, frequency)
    harmonic = preliminary.harmonic_pattern(model, amplitude, frequency, cycles)
    figure, axes = page.empty_page(
        case.title, "Restoring force against displacement", columns=2, width=7.6, panel=3.1
    )  # fmt: skip
    pattern_panels(axes[0], axes[1], harmonic, random, record.units)
    size = labels.quantity(amplitude, record.units["displacement"])
    page.letter(axes, (f"harmonic motion, {size} at {frequency:.3g} Hz", "random excitation"))
    page.shared_legend(figure, axes)
    return figure


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
    random_axes.plot(
        random.displacement / factor, random.force, color="0.45", linewidth=0.4, label="random excitation"
    )  # fmt: skip
    for axes, width in ((harmonic_axes, 1.8), (random_axes, 1.2)):
        axes.plot(
            harmonic.displacement / factor, harmonic.force, color="C0", linewidth=width, label="harmonic motion"
        )  # fmt: skip
        axes.set_xlim(-1.06 * largest / factor, 1.06 * largest / factor)
        axes.set_ylim(-reach, reach)
        axes.set_xlabel(f"displacement ({dimensions.pretty(shown)})")
    harmonic_axes.set_ylabel(f"restoring force $F_r$ ({dimensions.pretty(unit['force'])})")


def periodic_lines(case: CaseFiles) -> Figure:
    """Autospectrum of a Mathieu system's response (Figure 8), its lines marked."""
    record, values = read_csv(case.record), read_model(case.model).numbers()
    natural = preliminary.natural_frequency(values)
    lines = preliminary.mathieu_frequencies(natural, values["periodic_stiffness.f_m"])
    figure, (axes,) = page.empty_page(case.title, "Autospectrum of the displacement", panel=2.9, legend_rows=1)
    frequency, density = autospectrum(record["displacement"], record.dt, case.segments)
    autospectrum_panel(axes, frequency, density, record.units["displacement"], HIGHEST)
    frequency_marks(axes, lines)
    return figure


def autospectrum_panel(axes: Axes, frequency: Floats, density: Floats, unit: str, highest: float) -> Axes:
    """A one-sided autospectrum on a logarithmic scale, from the first line above zero."""
    keep = (frequency > 0.0) & (frequency <= highest)
    axes.semilogy(frequency[keep], density[keep], color="C0", linewidth=1.6)
    axes.set_xlim(0.0, highest)
    axes.set_ylim(bottom=max(1e-5 * float(density[keep].max()), 0.5 * float(density[keep].min())))  # five decades
    axes.set_xlabel("frequency (Hz)")
    squared = f"({unit})^2" if "/" in unit else f"{unit}^2"
    axes.set_ylabel(f"autospectrum ({dimensions.pretty(squared)}/Hz)")
    return axes


def frequency_marks(axes: Axes, lines: Mapping[str, float]) -> Axes:
    """Vertical lines at named frequencies (mathtext without its dollars), the names above the panel."""
    for name, frequency in lines.items():
        axes.axvline(frequency, color="C1", linestyle=DASHED, linewidth=1.2, zorder=1.5)
        axes.annotate(
            f"${name}$\n{frequency:.3g} Hz", (frequency, 1.0), (0, 3), xycoords=("data", "axes fraction"),
            textcoords="offset points", ha="center", va="bottom", fontsize=9,
        )  # fmt: skip
    return axes


def force_history(case: CaseFiles) -> Figure:
    """A stretch of the force as long as a segment, the report's subrecord, and its autospectrum (Figure 16)."""
    record = read_csv(case.record)
    figure, (history, spectrum) = page.empty_page(
        "Excitation", "Force history (segment) and autospectrum", rows=2, legend_rows=0, share=False
    )
    shown = record.part(0, case.segments.length)
    history.plot(shown.time, shown["force"], color="C0", linewidth=0.9)
    history.set_xlim(float(shown.time[0]), float(shown.time[-1]))
    history.set_xlabel("time (s)")
    history.set_ylabel(f"force ({dimensions.pretty(record.units['force'])})")
    frequency, density = autospectrum(record["force"], record.dt, case.segments)
    autospectrum_panel(spectrum, frequency, density, record.units["force"], float(frequency[-1]))
    page.letter((history, spectrum), ("history", "autospectrum"))
    return figure


def histogram_figure(case: CaseFiles, channel: str = "displacement", title: str | None = None) -> Figure:
    """Histogram of a channel of a record (Figures 17 and 20 on)."""
    record = read_csv(case.record)
    figure, axes = page.empty_page(title or case.title, f"Histogram of the {channel}", panel=2.7)
    histogram_panel(axes[0], preliminary.histogram(record[channel]), channel, record.units[channel])
    page.shared_legend(figure, axes)
    return figure


def histogram_panel(axes: Axes, counts: Histogram, quantity: str, unit: str) -> Axes:
    """Probability density of a quantity beside the Gaussian of the same mean and variance; its moments stand above.

    ``unit`` is that of ``counts``; metres are shown as mm or µm where that reads better.
    """
    factor, shown = labels.prefixed(unit, float(abs(counts.edges).max()))
    axes.stairs(counts.density * factor, counts.edges / factor, fill=True, facecolor="C4", alpha=0.55, label=quantity)
    axes.stairs(counts.density * factor, counts.edges / factor, color="C0", linewidth=0.9)
    axes.plot(
        counts.points / factor, counts.gaussian * factor, color="black", linestyle=DASHED, linewidth=1.5,
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


KINDS: Mapping[str, Callable[[CaseFiles], Figure]] = {
    "linear": linear, "nonlinear": nonlinear, "coherence": cumulative_coherence, "histogram": histogram_figure,
    "pattern": pattern, "autospectrum": periodic_lines, "force_history": force_history,
    "force_histogram": lambda case: histogram_figure(case, "force", "Excitation"),
}  # fmt: skip


# ---- errors of the estimators

PANELS = {  # by their headings, the parameters in them
    "mass m": ("m",), "damping c": ("c",), "stiffness k": ("k",), "natural frequency $f_n$": ("f_n",),
    r"damping ratio $\zeta$": ("zeta",), "cubic stiffness $k_3$": ("k3",), "nonlinear damping $c_3$": ("c3",),
    "$k_m$, dead-band $k$": ("k_m", "k_dead_band"),
}  # fmt: skip
PANELS_A_ROW = 4
MARKERS = {"siso": ("x", False), "miso": ("s", True), "local_polynomial": ("^", True), "instrumental": ("D", False),
           "output_error": ("o", False)}  # fmt: skip
LOWEST_ERROR, HIGHEST_ERROR = 1e-7, 1e3  # percent: what lies outside stands at the edge
INSET, TOP, ROW = 1.5, 1.15, 0.19  # inches


def error_dots(table: pd.DataFrame, cases: Sequence[str]) -> Figure:
    """Errors of :func:`study.reproduction.ensemble.estimator_errors`: a panel for each parameter, a row a case.

    Parameters that are zero have no relative error and are not drawn. ``cases`` are the rows, from above.
    """
    drawn = table[table["kind"] == "relative"]
    rows = -(-len(PANELS) // PANELS_A_ROW)
    width, height = 10.2, TOP + rows * (ROW * len(cases) + 0.35) + 0.5
    figure = Figure(figsize=(width, height))
    figure.subplots_adjust(left=INSET / width, right=0.985, top=1.0 - TOP / height, bottom=0.5 / height, wspace=0.08,
                           hspace=0.35 / (ROW * len(cases)))  # fmt: skip
    axes = list(figure.subplots(rows, PANELS_A_ROW, sharex=True, sharey=True, squeeze=False).flat)
    for panel, (title, parameters) in zip(axes, PANELS.items(), strict=True):
        _error_panel(panel, drawn[drawn["parameter"].isin(parameters)], cases)
        panel.set_title(title)
    for panel in axes[-PANELS_A_ROW:]:
        panel.set_xlabel("error (%)")
    seeds = int(table["seeds"].max())
    subtitle = f"median over {seeds} seeds of the relative error, with the median's standard error; less is to the left"
    page.head(figure, "Errors of the estimators on the same records", subtitle, INSET, 0.1)
    entries = page.legend_entries(axes)
    figure.legend(list(entries.values()), list(entries), loc="upper left", ncols=len(entries), borderaxespad=0.0,
                  bbox_to_anchor=(INSET / width, 1.0 - 0.58 / height), borderpad=0.0, handlelength=1.2)  # fmt: skip
    return figure


def _error_panel(panel: Axes, table: pd.DataFrame, cases: Sequence[str]) -> None:
    """The estimators are told apart in grey too."""
    place = {case: index for index, case in enumerate(cases)}
    for case in dict.fromkeys(table["case"]):
        panel.axhline(place[case], color="0.85", linewidth=0.7, zorder=1.0)
    for name in dict.fromkeys(str(name) for name in table["estimator"]):
        own = table[table["estimator"] == name]
        error = np.clip(100.0 * own["median_error"].to_numpy(dtype=np.float64), LOWEST_ERROR, HIGHEST_ERROR)
        spread = 100.0 * own["standard_error"].to_numpy(dtype=np.float64)
        # A standard error, to first order in the logarithm; a stretch of exp(20) is wider than the picture.
        stretch = np.exp(np.minimum(spread / error, 20.0))
        heights = np.array([place[case] for case in own["case"]], dtype=np.float64)
        marker, filled = MARKERS.get(name, ("P", True))
        shown = look(name)
        below, above = np.maximum(error / stretch, LOWEST_ERROR), np.minimum(error * stretch, HIGHEST_ERROR)
        level = shown.level + (1.0 if filled else 2.0)
        panel.hlines(heights, below, above, color=shown.colour, linewidth=1.0, zorder=shown.level)
        panel.plot(error, heights, marker, color=shown.colour, markersize=5.5, label=shown.label, zorder=level,
                   markerfacecolor=shown.colour if filled else "white", markeredgewidth=1.3)  # fmt: skip
    panel.set_xscale("log")
    panel.set_xlim(LOWEST_ERROR / 2.0, HIGHEST_ERROR * 2.0)
    panel.xaxis.set_major_locator(LogLocator(base=10.0, numticks=20))
    panel.xaxis.set_minor_locator(NullLocator())
    panel.set_xticks([10.0**power for power in range(-6, 3, 2)])
    panel.set_yticks(range(len(cases)), [labels.term_names(case) for case in cases])
    panel.set_ylim(len(cases) - 0.4, -0.6)
    panel.grid(visible=False, axis="y")
