"""Several fits side by side: one model on several records, or several models on one."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from study.compare import comparison as comparisons
from study.compare.fitted_coefficients import Level
from study.interface.fitted import Fit
from study.interface.showing import TABLES, drawing_axes, html_table
from study.support import statistics
from study.support.errors import expect
from study.support.extras import needed
from study.support.numbers import percent
from study.support.yaml_text import shown

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class Across:
    """The same model on several records, in the order of the level of the force.

    Attributes
    ----------
    fits : tuple of Fit
        One a record.
    levels : tuple of Level
        Each fitted coefficient at all levels, with the p value that it is the same.
    """

    fits: tuple[Fit, ...]
    levels: tuple[Level, ...]

    @property
    def moving(self) -> tuple[str, ...]:
        """Keys of coefficients that move with the level, as those of a wrong model do; 1 % in all of them together."""
        return tuple(level.key for level in self.levels if level.moves)

    def to_frame(self) -> "pd.DataFrame":
        """One row a coefficient and record: rms force, value, standard error, unit, p value, and whether it moves."""
        needed(*TABLES)
        import pandas as pd

        rows = [
            {"key": level.key, "record": fit.record.name, "rms_force": force, "value": value, "error": error,
             "unit": level.unit, "p_value": level.p_value, "moves": level.moves}
            for level in self.levels
            for fit, force, value, error in zip(self.fits, level.force, level.value, level.error, strict=True)
        ]  # fmt: skip
        return pd.DataFrame(rows).set_index(["key", "record"])

    def plot(self, key: str | None = None, ax: "Axes | None" = None) -> "Axes":
        """One coefficient against the rms force; that which moves most surely if none is named."""
        found = {level.key: level for level in self.levels}
        expect(found, "every coefficient was held; expected a model that leaves one open")
        name = key or min(self.levels, key=lambda level: level.p_value).key
        expect(name in found, f"{name!r} was not fitted; expected one of {', '.join(found)}")
        with drawing_axes(ax) as (axes,):
            from study.compare.panels import coefficient_by_level

            unit = self.fits[0].record.units.get("force", "N")
            return coefficient_by_level(axes, found[name], unit)

    def __repr__(self) -> str:
        """One line: records, and what moves."""
        moving = ", ".join(self.moving) or "no coefficient"
        return f"<Across {', '.join(fit.record.name for fit in self.fits)}: {moving} moves with the level>"

    def _repr_html_(self) -> str:
        rows = [
            [level.key, *(f"{v:.4g} ± {1.96 * e:.2g}" for v, e in zip(level.value, level.error, strict=True)),
             "yes" if level.moves else "no", f"{level.p_value:.1g}", level.unit] for level in self.levels
        ]  # fmt: skip
        heads = ["", *(fit.record.name for fit in self.fits), "moves", "p", "unit"]
        return html_table(f"{self.fits[0].given.name} by level", heads, rows)


def across(fits: Sequence[Fit]) -> Across:
    """Fits of one model to several records, held against each other."""
    expect(len(fits) > 1, f"{len(fits)} record is given; expected two or more")
    ordered = sorted(fits, key=lambda fit: fit.comparison.level)
    return Across(tuple(ordered), comparisons.across_records([fit.comparison for fit in ordered]))


@dataclass(frozen=True)
class RankedModel:
    """One model of :func:`compare`."""

    name: str  # of the model, told apart by its terms
    record: str
    error: float  # held out
    floor: float
    force_error: float
    fitted: int  # values
    explained: float  # share of what this model leaves that the first explains; NaN on other samples
    explained_error: float  # its standard error
    p_value: float  # that the first explains nothing of it, one comparison


@dataclass(frozen=True, eq=False, repr=False)
class Ranking:
    """Models by their held-out error, the best first.

    Attributes
    ----------
    rows : tuple of Row
        In this order; the first is what the others are held against.
    """

    rows: tuple[RankedModel, ...]

    def to_frame(self) -> "pd.DataFrame":
        """One row a model, indexed by its name."""
        needed(*TABLES)
        import pandas as pd

        return pd.DataFrame([vars(row) for row in self.rows]).set_index("name")

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Held-out error of each model with its noise floor, in per cent on a logarithmic scale."""
        with drawing_axes(ax) as (axes,):
            place = np.arange(len(self.rows))
            axes.plot([100.0 * row.error for row in self.rows], place, "o", color="C0", label="held-out error")
            floors = [100.0 * row.floor for row in self.rows]
            axes.plot(floors, place, "|", color="black", markersize=14, label="noise floor")
            axes.set_yticks(place, [row.name for row in self.rows])
            axes.invert_yaxis()
            axes.set_xscale("log")
            axes.set_xlabel("error of the response (%)")
            axes.legend()
        return axes

    def __repr__(self) -> str:
        """One line: the models and their errors."""
        return f"<Ranking {', '.join(f'{row.name} {percent(row.error)}' for row in self.rows)}>"

    def _repr_html_(self) -> str:
        rows = [
            [row.name, row.record, percent(row.error), percent(row.floor), str(row.fitted),
             percent(row.explained, "z.1f", row.explained_error, ".1f"),
             "-" if np.isnan(row.p_value) else f"{row.p_value:.1g}"] for row in self.rows
        ]  # fmt: skip
        heads = ["model", "record", "held-out error", "noise floor", "fitted values", "first explains of it", "p"]
        return html_table("Models by held-out error", heads, rows)


def compare(*fits: "Fit | Sequence[Fit]") -> Ranking:
    """Fits by their held-out error, the best first: ``compare(one, other)``, or ``compare([one, other])``.

    Of those that were judged on the same samples as the first it is said which share of what they leave the first
    explains, with the standard error of that and the p value of one comparison.

    Raises
    ------
    StudyError
        If there are none, or one is no fit.
    """
    given = [fit for item in fits for fit in (item if isinstance(item, list | tuple) else [item])]
    expect(given, "no fit is given; expected one or more")
    for item in given:
        expect(isinstance(item, Fit), f"{shown(item)} is no fit; expected what a model's fit(record) gives")
    ordered = sorted((fit for fit in given if isinstance(fit, Fit)), key=lambda fit: fit.error)
    names = [fit.given.name for fit in ordered]
    common = set(ordered[0].given.terms).intersection(*(fit.given.terms for fit in ordered))
    return Ranking(tuple(_row(fit, ordered[0], _told_apart(fit, names, common)) for fit in ordered))


def _told_apart(fit: Fit, names: Sequence[str], common: Set[str]) -> str:
    """The model's name, with the terms that not all have where several are called so."""
    if names.count(fit.given.name) == 1:
        return fit.given.name
    own = [name for name in fit.given.terms if name not in common]
    return " + ".join([fit.given.name, *own])


def _row(fit: Fit, best: Fit, name: str) -> RankedModel:
    explained = error = p_value = float("nan")
    one, other = fit.comparison.prediction, best.comparison.prediction
    if fit is not best and len(one.measured) == len(other.measured) and np.array_equal(one.measured, other.measured):
        gain = statistics.gain(one.residual, other.residual)
        explained, error, p_value = gain.explained, gain.error, gain.p_value
    return RankedModel(
        name, fit.record.name, fit.error, fit.floor, fit.force_error, len(fit.comparison.fit.keys), explained, error,
        p_value,
    )  # fmt: skip
