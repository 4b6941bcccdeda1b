"""The report's own recipes for reading parameters off the curves (Section 5.2.1)."""

import math

import numpy as np

from study.equations.model import Model
from study.equations.terms import LIBRARY
from study.identify.estimators import miso
from study.identify.estimators.base import Identified, Parameter, Settings
from study.identify.frequency_domain.inputs import Input
from study.identify.frequency_domain.responses import Responses
from study.records.record import Record
from study.support.arrays import Complexes, Floats

LOWEST_LINES = 3  # "the asymptotic behavior of A_1 for f -> 0": the first lines above zero, where no mean is lost


def identify(model: Model, record: Record, settings: Settings) -> Identified:
    """Read k, f_n, m, c, zeta off A_1 and the plateaus off the other A_j, as a hand would."""
    result = miso.identify(model, record, settings)
    assert result.responses is not None
    band, frequency = settings.band, result.responses.frequency
    keep = (frequency >= band[0]) & (frequency <= band[1])
    values: list[tuple[str, float]] = []
    for item, response in zip(result.inputs, result.responses.response, strict=True):
        if item.shape == "u":
            values += read_linear(frequency, response, band)
        else:
            values += _plateaus(item, frequency[keep], response[keep])
    return Identified(result.inputs, None, tuple(Parameter(n, v, math.nan) for n, v in _as_reported(values)))


def read_linear(frequency: Floats, response: Complexes, band: tuple[float, float]) -> list[tuple[str, float]]:
    """k as f -> 0, f_n at the minimum of abs(A_1), m = k / (2 pi f_n)^2, c = abs(A_1(f_n)) / (2 pi f_n).

    The minimum is looked for in ``band``, in hertz. Only k is read where abs(A_1) has none inside it (a system
    without a resonance).
    """
    above = frequency > 0.0
    k = float(np.mean(response[above][:LOWEST_LINES].real))
    keep = (frequency >= band[0]) & (frequency <= band[1])
    frequency, size = frequency[keep], np.abs(response[keep])
    i = int(np.argmin(size))
    if i in (0, len(size) - 1):
        return [("k", k)]
    f_n, lowest = _vertex(frequency[i - 1 : i + 2], size[i - 1 : i + 2])
    omega = 2.0 * math.pi * f_n
    m, c = k / omega**2, lowest / omega
    return [("m", m), ("c", c), ("k", k), ("f_n", f_n), ("zeta", c / (2.0 * omega * m))]


def read_curve(result: Responses, band: tuple[float, float]) -> dict[str, float]:
    """The same for the first response function of any analysis, the SI/SO curve included."""
    return dict(read_linear(result.frequency, result.response[0], band))


def _vertex(x: Floats, y: Floats) -> tuple[float, float]:
    """Lowest point of the parabola through three points, as the eye puts it between the lines."""
    step = float(x[1] - x[0])
    bend = float(y[0] - 2.0 * y[1] + y[2])
    slope = float(y[2] - y[0]) / 2.0
    shift = -slope / bend if bend > 0.0 else 0.0
    return float(x[1]) + shift * step, float(y[1]) + slope * shift / 2.0


def _plateaus(item: Input, frequency: Floats, response: Complexes) -> list[tuple[str, float]]:
    """Each coefficient as the mean height of its own part of A_j: real for order 0, imaginary for order 1."""
    powers = item.powers(frequency)
    return [(part.symbol, float(np.mean((response / powers[:, p]).real))) for p, part in enumerate(item.parts)]


def _as_reported(values: list[tuple[str, float]]) -> list[tuple[str, float]]:
    """Coefficients that the report gives in another form, in that form and under its names."""
    named = dict(values)
    for term in (t for t in LIBRARY.values() if t.reported and t.symbols[0] in named):
        own = [named.pop(symbol) for symbol in term.symbols]
        named |= dict(zip(term.reported, term.as_reported(own), strict=True))
    return list(named.items())
