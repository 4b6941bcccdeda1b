"""What the figures draw: frequency response functions by input and estimator, and coherences by input."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np

from study.figures.styles import legend_place
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError

if TYPE_CHECKING:
    import pandas as pd

TWO_SIDED_95 = NormalDist().inv_cdf(0.975)


@dataclass(frozen=True)
class ResponseCurve:
    """One estimator's A_j(f); arrays of shape (lines,)."""

    estimator: str  # its name, by which styles knows it
    frequency: Floats  # hertz
    values: Complexes
    error: Floats  # standard error of the complex estimate, sqrt(E|dA|^2); NaN where it is not known

    @property
    def half_width(self) -> Floats:
        """Half width of the 95 % band of the real part, of the imaginary part or of the magnitude.

        The error is circular: each of them carries half of its variance.
        """
        return TWO_SIDED_95 * self.error / np.sqrt(2.0)


@dataclass(frozen=True)
class InputResponse:
    """All estimates of one A_j(f), and what is true."""

    number: int  # j, counted from 1
    shape: str  # formula of the input, such as u**3
    curves: tuple[ResponseCurve, ...]  # one for each estimator
    frequency: Floats  # lines of the exact function, in hertz
    exact: Complexes | None  # the exact function; None where the record is a measured one


@dataclass(frozen=True)
class InputCoherence:
    """One input's share of the output."""

    shape: str  # formula of the input
    terms: str  # names of the terms that the input carries
    frequency: Floats  # hertz, shape (lines,)
    cumulative: Floats  # coherence of this and all earlier conditioned inputs with the output, shape (lines,)


def input_responses(
    table: "pd.DataFrame", highest: float, drawn: Sequence[str] | None = None
) -> tuple[InputResponse, ...]:
    """Frequency response functions of ``frequency_response.csv``, one entry an input.

    Lines above ``highest`` (in hertz) are left out, as is the line at zero, which has no phase. ``drawn`` names the
    estimators that are shown; all of them if it is left out.
    """
    table = _lines(table if drawn is None else table[table["estimator"].isin(drawn)], highest)
    found: list[InputResponse] = []
    for number, part in _groups(table, "input"):
        groups = _groups(part, "estimator")
        curves: list[ResponseCurve] = []
        for name, rows in sorted(groups, key=lambda group: legend_place(group[0])):
            values, error = _complex(rows, "real", "imag"), _column(rows, "standard_error")
            curves.append(ResponseCurve(name, _column(rows, "frequency"), values, error))
        _, first = groups[0]
        exact = _complex(first, "exact_real", "exact_imag")
        known = exact if np.all(np.isfinite(exact)) else None
        shape = str(part["shape"].iloc[0])
        found.append(InputResponse(int(number), shape, tuple(curves), _column(first, "frequency"), known))
    return tuple(found)


def coherences(table: "pd.DataFrame", highest: float, estimator: str = "miso") -> tuple[InputCoherence, ...]:
    """Cumulative coherences of ``coherence.csv``, one entry an input, in the order of conditioning."""
    if estimator not in set(table["estimator"]):
        known = ", ".join(table["estimator"].unique())
        raise StudyError(f"the coherences hold nothing of the estimator {estimator!r}; expected one of {known}")
    table = _lines(table[table["estimator"] == estimator], highest)
    coherences: list[InputCoherence] = []
    for _, rows in _groups(table, "input"):
        shape, terms = (str(rows[name].iloc[0]) for name in ("shape", "terms"))
        coherences.append(InputCoherence(shape, terms, _column(rows, "frequency"), _column(rows, "cumulative")))
    return tuple(coherences)


def _lines(table: "pd.DataFrame", highest: float) -> "pd.DataFrame":
    return table[(table["frequency"] > 0.0) & (table["frequency"] <= highest)]


def _groups(table: "pd.DataFrame", column: str) -> "list[tuple[Any, pd.DataFrame]]":
    """Rows by the values of a column, in the order in which those first appear."""
    return [(value, table[table[column] == value]) for value in table[column].unique()]


def _column(table: "pd.DataFrame", name: str) -> Floats:
    return table[name].to_numpy(dtype=np.float64)


def _complex(table: "pd.DataFrame", real: str, imaginary: str) -> Complexes:
    return (_column(table, real) + 1j * _column(table, imaginary)).astype(np.complex128)
