"""Figures of a structure in reverse: A_j(f) of every connection, and cumulative coherence by equation."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from study.figures import coherence, curves, frequency_response, labels, page
from study.support.numbers import percent

HIGHEST = 10.0  # hertz, as in the figures of a single mass
ROOM = 2.4  # inches beside a panel for its legend


def connections_figure(table: pd.DataFrame, title: str, highest: float = HIGHEST) -> Figure:
    """Real and imaginary part of every A_j(f), each in the equation where its input depends least on the others."""
    shown = _chosen(table, highest)
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


def _chosen(table: pd.DataFrame, highest: float) -> list[tuple[str, curves.InputResponse, float]]:
    """Every input of every connection once: where the share that other inputs do not determine is largest.

    With words for it, and that share.
    """
    inside = table[(table["frequency"] > 0.0) & (table["frequency"] <= highest)]
    miso = inside[inside["estimator"] == "miso"]
    keys = [str(p) + str(s) + str(e) for p, s, e in zip(miso["place"], miso["shape"], miso["equation"], strict=True)]
    rows = miso.assign(key=keys)
    best: dict[tuple[str, str], tuple[float, str, str]] = {}
    for key in dict.fromkeys(keys):
        own = rows[rows["key"] == key]
        place, shape, equation = (str(own[name].iloc[0]) for name in ("place", "shape", "equation"))
        share = float(np.median(own["independent"].to_numpy(dtype=np.float64)))
        where = (_both_ways(place), shape)
        if where not in best or share > best[where][0]:
            best[where] = share, place, equation
    found: list[tuple[str, curves.InputResponse, float]] = []
    for (_, shape), (share, place, equation) in best.items():
        own = inside[(inside["equation"] == equation) & (inside["place"] == place) & (inside["shape"] == shape)]
        item = curves.input_responses(own.assign(input=len(found) + 1), highest)[0]
        found.append((f"{labels.formula(shape)} of {place}: equation of {equation}", item, share))
    return found


def _both_ways(place: str) -> str:
    """A connection, whichever end comes first."""
    return "-".join(sorted(place.split("-")))


def coherence_figure(table: pd.DataFrame, title: str, highest: float = HIGHEST) -> Figure:
    """Cumulative coherences of MI/SO, a panel an equation."""
    equations, table = list(dict.fromkeys(str(e) for e in table["equation"])), table.assign(terms=table["place"])
    figure, axes = page.empty_page(
        title, "Cumulative coherence of each equation of motion", rows=len(equations), width=page.WIDTH + ROOM,
        legend_rows=0,
    )  # fmt: skip
    figure.subplots_adjust(right=1.0 - ROOM / (page.WIDTH + ROOM))
    for panel, equation in zip(axes, equations, strict=True):
        own = table[table["equation"] == equation]
        coherence.cumulative_panel(panel, curves.coherences(own, highest))
        panel.set_xlabel("frequency (Hz)" if equation == equations[-1] else "")
        panel.set_ylabel("cumulative coherence")
        panel.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8, borderaxespad=0.0)
    page.letter(axes, [f"equation of {equation}" for equation in equations])
    return figure
