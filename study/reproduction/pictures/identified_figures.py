"""Figures of what was identified of a case: A_1, A_2 (and A_3), coherence, histogram; from its products."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from study.figures import coherence, curves, frequency_response, labels, page
from study.records.record import read_csv
from study.reproduction import preliminary
from study.reproduction.pictures import distribution

HIGHEST = 10.0  # hertz: the report's systems have their dynamics below it (Section 2.2)
BESIDE = (labels.FREE_SHAPE, "instrumental")  # whose coherences stand over those of MI/SO
PARTS = ("real part", "imaginary part")


def linear(response_csv: Path, title: str, highest: float = HIGHEST, drawn: Sequence[str] | None = None) -> Figure:
    """Magnitude and phase of A_1."""
    first = curves.input_responses(pd.read_csv(response_csv), highest, drawn)[0]
    figure, axes = page.empty_page(
        title, "Linear frequency response function $A_1(f)$", rows=2,
        legend_rows=page.rows_for(len(first.curves) + 2),
    )  # fmt: skip
    frequency_response.magnitude_panel(axes[0], first, labels.response_unit(first.shape))
    frequency_response.phase_panel(axes[1], first)
    page.letter(axes, ("magnitude", "phase"))
    page.shared_legend(figure, axes, bands=True)
    return figure


def nonlinear(response_csv: Path, title: str, highest: float = HIGHEST, drawn: Sequence[str] | None = None) -> Figure:
    """Real and imaginary part of A_2 and every further one, side by side."""
    shown = curves.input_responses(pd.read_csv(response_csv), highest, drawn)[1:]
    if not shown:
        figure, axes = page.empty_page(title, "No nonlinear input is assumed")
        axes[0].set_axis_off()
        return figure
    count = len(shown)
    names, s = ", ".join(f"$A_{r.number}(f)$" for r in shown), "s" if count > 1 else ""
    figure, axes = page.empty_page(
        title, f"Nonlinear frequency response function{s} {names}", rows=2, columns=count,
        width=page.width(count), legend_rows=page.rows_for(len(shown[0].curves) + 3),
    )  # fmt: skip
    for item, real, imaginary in zip(shown, axes[:count], axes[count:], strict=True):
        unit = labels.response_unit(item.shape)
        alike = [other for other in shown if labels.response_unit(other.shape) == unit]
        frequency_response.real_and_imaginary(real, imaginary, item, unit, frequency_response.common_span(alike))
    by_input = [panel for pair in zip(axes[:count], axes[count:], strict=True) for panel in pair]
    page.letter(by_input, [f"{p} of $A_{r.number}$, input {labels.formula(r.shape)}" for r in shown for p in PARTS])
    page.shared_legend(figure, axes, bands=True)
    return figure


def cumulative_figure(
    coherence_csv: Path, title: str, highest: float = HIGHEST, drawn: Sequence[str] | None = None
) -> Figure:
    """Cumulative coherences of MI/SO; over them those with estimated shape parameters, and of motion free of noise."""
    table = pd.read_csv(coherence_csv)
    shares = curves.coherences(table, highest)
    known = set(table["estimator"])
    others = [e for e in BESIDE if e in known and (drawn is None or e in drawn)]
    figure, axes = page.empty_page(
        title, "Cumulative coherence", panel=2.7, legend_rows=len(shares) * (1 + len(others)), headed=False
    )  # fmt: skip
    coherence.cumulative_panel(axes[0], shares)
    for estimator in others:
        coherence.marks_of_another(axes[0], curves.coherences(table, highest, estimator), estimator)
    page.shared_legend(figure, axes, columns=1)
    return figure


def histogram_figure(record_csv: Path, title: str, channel: str = "displacement") -> Figure:
    """Histogram of a channel of a record."""
    record = read_csv(record_csv)
    figure, axes = page.empty_page(title, f"Histogram of the {channel}", panel=2.7)
    distribution.histogram_panel(axes[0], preliminary.histogram(record[channel]), channel, record.units[channel])
    page.shared_legend(figure, axes)
    return figure


def draw_identified(
    record_csv: Path, response_csv: Path, coherence_csv: Path, outputs: Mapping[str, Sequence[Path]],
    *, title: str, style: Path, highest: float = HIGHEST, drawn: Sequence[str] | None = None,
    parameters_csv: Path | None = None,
) -> None:  # fmt: skip
    """Draw the wanted kinds of picture of a case.

    Parameters
    ----------
    record_csv, response_csv, coherence_csv : Path
        The case's products.
    outputs : mapping
        For each of ``linear, nonlinear, coherence, histogram`` the files to write, PNG or SVG.
    title : str
        Name of the system or case.
    style : Path
        The style sheet.
    highest : float
        Where the frequency axis ends, in hertz.
    drawn : sequence of str, optional
        Estimators whose frequency response functions are shown; all of them if left out.
    parameters_csv : Path, optional
        The case's parameters: shape parameters that were estimated stand in the headings.

    Raises
    ------
    StudyError
        If a kind of picture is asked for that there is not.
    """
    shapes = "" if parameters_csv is None else labels.estimated(pd.read_csv(parameters_csv))
    system = f"{title}: {shapes}" if shapes else title
    kinds = {
        "linear": lambda: linear(response_csv, system, highest, drawn),
        "nonlinear": lambda: nonlinear(response_csv, system, highest, drawn),
        "coherence": lambda: cumulative_figure(coherence_csv, system, highest, drawn),
        "histogram": lambda: histogram_figure(record_csv, title),
    }
    page.write_each(kinds, outputs, style)
