"""Cumulative coherence: what share of the force each term explains, line by line."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from study.figures import labels
from study.figures.curves import InputCoherence
from study.figures.styles import look

LOOKS = (("C1", (0, (5.0, 2.0))), ("C2", (0, (1.5, 1.2))), ("C3", (0, (7.0, 1.5, 1.5, 1.5))), ("C5", "-."))
MARKS = ("o", "s", "^", "v")
ALL = ("C0", "-")  # the last curve is the multiple coherence: what the whole model explains
OTHER_MOTION = {"instrumental": "fitted model's own motion"}  # near one whatever the model: it is no test


def cumulative_panel(axes: Axes, shares: Sequence[InputCoherence]) -> Axes:
    """Cumulative coherences (4.29) to (4.38): each curve adds one conditioned input to those below it.

    The area under a curve, down to the one below, is what its input adds.
    """
    below = np.zeros(len(shares[0].frequency))
    for index, share in enumerate(shares):
        whole = index == len(shares) - 1
        colour, dash = ALL if whole else LOOKS[index % len(LOOKS)]
        axes.fill_between(share.frequency, below, share.cumulative, color=colour, alpha=0.16, linewidth=0.0)
        axes.plot(
            share.frequency, share.cumulative, color=colour, linestyle=dash, linewidth=2.6 if whole else 1.6,
            label=f"{'+ ' if index else ''}{_shape(share)}: {labels.term_names(share.terms)}",
            zorder=2.9 if whole else 3.0,
        )  # fmt: skip
        below = share.cumulative
    axes.set_ylim(0.0, 1.03)
    axes.set_xlim(0.0, float(np.ceil(shares[0].frequency[-1])))
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel("cumulative coherence (dimensionless)")
    return axes


def marks_of_another(axes: Axes, shares: Sequence[InputCoherence], estimator: str) -> Axes:
    """Cumulative coherences of a further estimator as marks on a hair line, one label for each curve."""
    whose = OTHER_MOTION.get(estimator, look(estimator).label)
    for index, share in enumerate(shares):
        between = 9  # lines between two marks, so that the curve under them stays visible
        plus = "+ " if index else ""
        axes.plot(
            share.frequency, share.cumulative, MARKS[index % len(MARKS)], linestyle="-", color="black", linewidth=0.4,
            markerfacecolor="none", markersize=5.0, markeredgewidth=0.9, zorder=2.95,
            markevery=(between * index // len(shares), between), label=f"{whose}: {plus}{_shape(share)}",
        )  # fmt: skip
    return axes


def _shape(share: InputCoherence) -> str:
    return labels.formula(share.shape)
