"""Figures of structures: A_j(f) of every connection and coherence by equation, or the linear part as measured."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from study.figures import coherence, curves, frequency_response, labels, page
from study.reproduction.structure_tables import COEFFICIENT
from study.reproduction.study_figures import HIGHEST
from study.support.numbers import percent

ROOM = 2.4  # inches beside a panel for its legend


def connections_figure(table: pd.DataFrame, title: str) -> Figure:
    """Real and imaginary part of every A_j(f), each in the equation where its input depends least on the others."""
    shown = _chosen(table)
    figure, axes = page.empty_page(
        title, "Frequency response functions $A_j(f)$ of every connection", rows=len(shown), columns=2,
        width=page.width(2), legend_rows=page.rows_for(len(shown[0][1].curves) + 3), share=False,
    )  # fmt: skip
    names: list[str] = []
    for k, (where, item, own) in enumerate(shown):
        unit, span = labels.response_unit(item.shape), frequency_response.common_span([item])
        real, imaginary = axes[2 * k], axes[2 * k + 1]
        frequency_response.real_and_imaginary(real, imaginary, item, unit, span)
        names += [where, f"imaginary part; {percent(own)} of the input is its own"]
        for panel in (real, imaginary):
            panel.set_xlabel("frequency (Hz)" if k == len(shown) - 1 else "")
    page.letter(axes, names)
    page.shared_legend(figure, axes, bands=True)
    return figure


def _chosen(table: pd.DataFrame) -> list[tuple[str, curves.InputResponse, float]]:
    """Every input of every connection once: where the share that other inputs do not determine is largest.

    With words for it, and that share.
    """
    best: dict[tuple[str, str], tuple[float, str, str, pd.DataFrame]] = {}
    keys = ["place", "shape", "equation"]
    inside = table[(table["frequency"] > 0.0) & (table["frequency"] <= HIGHEST)]
    for key, miso in inside[inside["estimator"] == "miso"].groupby(keys, sort=False):
        (place, shape, equation), own = key, inside[(inside[keys] == list(key)).all(axis=1)]
        share = float(np.median(miso["independent"].to_numpy(dtype=np.float64)))
        where = ("-".join(sorted(str(place).split("-"))), str(shape))  # a connection, whichever end comes first
        if where not in best or share > best[where][0]:
            best[where] = share, str(place), str(equation), own
    found: list[tuple[str, curves.InputResponse, float]] = []
    for (_, shape), (share, place, equation, own) in best.items():
        item = curves.input_responses(own.assign(input=len(found) + 1), HIGHEST)[0]
        found.append((f"{labels.formula(shape)} of {place}: equation of {equation}", item, share))
    return found


def coherence_figure(table: pd.DataFrame, title: str) -> Figure:
    """Cumulative coherences of MI/SO, a panel an equation."""
    equations, table = list(dict.fromkeys(str(e) for e in table["equation"])), table.assign(terms=table["place"])
    figure, axes = page.empty_page(
        title, "Cumulative coherence of each equation of motion", rows=len(equations), width=page.WIDTH + ROOM,
        legend_rows=0,
    )  # fmt: skip
    figure.subplots_adjust(right=1.0 - ROOM / (page.WIDTH + ROOM))
    for panel, equation in zip(axes, equations, strict=True):
        own = table[table["equation"] == equation]
        coherence.cumulative_panel(panel, curves.coherences(own, HIGHEST))
        panel.set_xlabel("frequency (Hz)" if equation == equations[-1] else "")
        panel.set_ylabel("cumulative coherence")
        panel.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8, borderaxespad=0.0)
    page.letter(axes, [f"equation of {equation}" for equation in equations])
    return figure


def modal_figure(table: pd.DataFrame, title: str) -> Figure:
    """Every coefficient by frequency, which must be real and flat, and the linear part at every sensor."""
    groups = list(table.groupby(["quantity", "place"], sort=False))
    figure, axes = page.empty_page(
        title, "Coefficients line by line, and transfer functions of the linear part", rows=len(groups), columns=2,
        width=page.width(2), legend_rows=page.rows_for(5), share=False,
    )  # fmt: skip
    names: list[str] = []
    for k, ((quantity, place), rows) in enumerate(groups):
        known = rows.assign(input=k + 1, shape="u", standard_error=rows["standard_error"].fillna(0.0))
        (item,), (left, right) = curves.input_responses(known, float("inf")), axes[2 * k : 2 * k + 2]
        if quantity == COEFFICIENT:
            unit = str(rows["unit"].iloc[0])
            frequency_response.real_and_imaginary(left, right, item, unit, frequency_response.common_span([item]))
            names += [f"{place}: real part", "imaginary part"]
        else:
            frequency_response.magnitude_panel(left, item, "m/N")
            left.set_ylabel("|H| (m/N)")
            frequency_response.phase_panel(right, item)
            right.set_ylabel("phase (deg)")
            names += [f"shaker to {place}: magnitude", "phase"]
        for panel in (left, right):
            panel.set_xlabel("frequency (Hz)" if k == len(groups) - 1 else "")
    page.letter(axes, names)
    page.shared_legend(figure, axes, bands=True)
    return figure
