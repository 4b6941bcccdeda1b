"""What the figures draw: frequency response functions by input and estimator, and coherences by input."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from study.figures.styles import rank
from study.support.errors import StudyError

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
TWO_SIDED_95 = NormalDist().inv_cdf(0.975)


@dataclass(frozen=True)
class Curve:
    """One estimator's A_j(f); arrays of shape (lines,).

    Attributes
    ----------
    estimator : str
        Its name, by which ``styles`` knows it.
    frequency : array
        In hertz.
    values : complex array
        A_j(f).
    error : array
        Standard error of the complex estimate, ``sqrt(E|dA|^2)``; NaN where it is not known.
    """

    estimator: str
    frequency: Floats
    values: Complexes
    error: Floats

    @property
    def half_width(self) -> Floats:
        """Half width of the 95 % band of the real part, of the imaginary part or of the magnitude.

        The error is circular: each of them carries half of its variance.
        """
        return TWO_SIDED_95 * self.error / np.sqrt(2.0)


@dataclass(frozen=True)
class InputResponse:
    """All estimates of one A_j(f), and what is true.

    Attributes
    ----------
    number : int
        j, counted from 1.
    shape : str
        Formula of the input, such as ``u**3``.
    curves : tuple of Curve
        One an estimator.
    frequency : array, shape (lines,)
        Of the exact function, in hertz.
    exact : complex array, shape (lines,), or None
        The exact function; None where the record is a measured one.
    """

    number: int
    shape: str
    curves: tuple[Curve, ...]
    frequency: Floats
    exact: Complexes | None


@dataclass(frozen=True)
class InputCoherence:
    """One input's share of the output.

    Attributes
    ----------
    shape, terms : str
        Formula of the input and names of the terms it carries.
    frequency, cumulative : arrays, shape (lines,)
        Hertz, and coherence of this and all earlier conditioned inputs with the output.
    """

    shape: str
    terms: str
    frequency: Floats
    cumulative: Floats


def responses(
    table: pd.DataFrame, highest: float, drawn: Sequence[str] | None = None
) -> tuple[InputResponse, ...]:  # fmt: skip
    """Frequency response functions of ``frequency_response.csv``, one entry an input.

    Parameters
    ----------
    table : DataFrame
        Columns ``frequency, estimator, input, shape, real, imag, standard_error, exact_real, exact_imag``.
    highest : float
        Lines above this frequency (Hz) are left out, as is the line at zero, which has no phase.
    drawn : sequence of str, optional
        Estimators that are shown; all of them if left out.
    """
    table = _lines(table if drawn is None else table[table["estimator"].isin(drawn)], highest)
    return tuple(_response(int(number), part) for number, part in _groups(table, "input"))


def _response(number: int, part: pd.DataFrame) -> InputResponse:
    curves = [
        Curve(name, _column(rows, "frequency"), _complex(rows, "real", "imag"), _column(rows, "standard_error"))
        for name, rows in _groups(part, "estimator")
    ]
    first = _groups(part, "estimator")[0][1]
    exact = _complex(first, "exact_real", "exact_imag")
    shape = str(part["shape"].iloc[0])
    known = bool(np.all(np.isfinite(exact)))
    curves.sort(key=lambda c: rank(c.estimator))
    return InputResponse(number, shape, tuple(curves), _column(first, "frequency"), exact if known else None)


def coherences(table: pd.DataFrame, highest: float, estimator: str = "miso") -> tuple[InputCoherence, ...]:
    """Cumulative coherences of ``coherence.csv``, one entry an input, in the order of conditioning.

    Raises
    ------
    StudyError
        If the table holds nothing of this estimator.
    """
    if estimator not in set(table["estimator"]):
        known = ", ".join(table["estimator"].unique())
        raise StudyError(f"the coherences hold nothing of the estimator {estimator!r}; they are of {known}")
    table = _lines(table[table["estimator"] == estimator], highest)
    return tuple(
        InputCoherence(
            str(rows["shape"].iloc[0]),
            str(rows["terms"].iloc[0]),
            _column(rows, "frequency"),
            _column(rows, "cumulative"),
        )
        for _, rows in _groups(table, "input")
    )


def _lines(table: pd.DataFrame, highest: float) -> pd.DataFrame:
    return table[(table["frequency"] > 0.0) & (table["frequency"] <= highest)]


def _groups(table: pd.DataFrame, column: str) -> list[tuple[Any, pd.DataFrame]]:
    """Rows by the values of a column, in the order in which those first appear."""
    return [(value, table[table[column] == value]) for value in table[column].unique()]


def _column(table: pd.DataFrame, name: str) -> Floats:
    return table[name].to_numpy(dtype=np.float64)


def _complex(table: pd.DataFrame, real: str, imaginary: str) -> Complexes:
    return (_column(table, real) + 1j * _column(table, imaginary)).astype(np.complex128)
