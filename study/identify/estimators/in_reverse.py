"""Estimators in reverse: inputs are shapes of the measured motion, as the model's terms have them, output the force.

Coefficients of the model are ignored, its shape parameters are used.
"""

import math
from collections.abc import Sequence

import numpy as np

from study.equations.model import Model
from study.equations.terms import LIBRARY
from study.identify.estimators.base import Identified, Parameter, Settings, named_parameters
from study.identify.frequency_domain.coefficients import Responses, fit_coefficients, lines_in
from study.identify.frequency_domain.conditioned import MisoResult, analyse
from study.identify.frequency_domain.inputs import Input, histories, reverse_inputs
from study.identify.frequency_domain.local_polynomial import (
    Lines,
    fit_local_polynomial,
    local_polynomial_responses,
    transform,
)
from study.identify.frequency_domain.periodic import fit_periodic, steady
from study.records.record import Record
from study.records.spectra import Segments, SpectralMatrix, cross_spectra
from study.support.arrays import Complexes, Floats

LOWEST_LINES = 3  # "the asymptotic behavior of A_1 for f -> 0": the first lines above zero, where no mean is lost


def siso(model: Model, record: Record, settings: Settings) -> Identified:
    """The best linear fit, L_1(f) = G_1y / G_11, (4.23), which the report's dashed curves show."""
    inputs = [i for i in reverse_inputs(model) if i.linear]
    return identify_spectra(inputs, analyse(reverse_spectra(inputs, record, settings.segments)), settings)


def miso(model: Model, record: Record, settings: Settings) -> Identified:
    """The report's estimator: A_j(f) of every input by (4.23) to (4.28), coefficients by weighted least squares."""
    inputs = reverse_inputs(model)
    return identify_spectra(inputs, analyse(reverse_spectra(inputs, record, settings.segments)), settings)


def reverse_spectra(inputs: Sequence[Input], record: Record, segments: Segments) -> SpectralMatrix:
    """Cross-spectra of the inputs and, last, the force."""
    return cross_spectra([*histories(inputs, record), record["force"]], record.dt, segments)


def identify_spectra(inputs: Sequence[Input], result: MisoResult, settings: Settings) -> Identified:
    """Coefficients from the analysis of the inputs' spectra."""
    estimate = fit_coefficients(result, inputs, settings.band, settings.segments.line_inflation())
    return Identified(tuple(inputs), result, named_parameters(estimate), estimate)


def local_polynomial(model: Model, record: Record, settings: Settings) -> Identified:
    """One transform of the whole record, no window, no leakage of its ends: A_j(f) in narrow bands."""
    inputs = reverse_inputs(model)
    lines = transform([*histories(inputs, record), record["force"]], record.dt)
    return identify_lines(inputs, lines, settings)[0]


def identify_lines(inputs: tuple[Input, ...], lines: Lines, settings: Settings) -> tuple[Identified, Floats]:
    """The same for the transforms of any inputs and, last, of what they make up; and the fit's shifts."""
    estimate, shifts = fit_local_polynomial(lines, inputs, settings.band, settings.local_polynomial)
    responses = local_polynomial_responses(lines, settings.local_polynomial) if settings.curves else None
    return Identified(inputs, responses, named_parameters(estimate), estimate), shifts


def errors_in_variables(model: Model, record: Record, settings: Settings) -> Identified:
    """Noise on force and response, several periods of one excitation: instruments from other periods."""
    inputs = reverse_inputs(model)
    estimate = fit_periodic(steady(record, settings.settle_periods), inputs, settings.band)
    return Identified(inputs, None, named_parameters(estimate), estimate)


def miso_hand_read(model: Model, record: Record, settings: Settings) -> Identified:
    """The report's own recipes (Section 5.2.1): k, f_n, m, c, zeta off A_1, the plateaus off the other A_j."""
    result = miso(model, record, settings)
    assert result.responses is not None
    frequency = result.responses.frequency
    keep = lines_in(frequency, settings.band)
    values: dict[str, float] = {}
    for item, response in zip(result.inputs, result.responses.response, strict=True):
        if item.linear:
            values |= read_linear(frequency, response, settings.band)
        else:  # each coefficient is the mean height of its part of A_j: real for order 0, imaginary for order 1
            heights = np.mean((response[keep, None] / item.powers(frequency[keep])).real, axis=0)
            values |= {part.symbol: float(height) for part, height in zip(item.parts, heights, strict=True)}
    for term in (t for t in LIBRARY.values() if t.reported and t.symbols[0] in values):
        own = [values.pop(symbol) for symbol in term.symbols]
        values |= dict(zip(term.reported, term.as_reported(own), strict=True))
    return Identified(result.inputs, None, tuple(Parameter(n, v, math.nan) for n, v in values.items()))


def read_curve(result: Responses, band: tuple[float, float]) -> dict[str, float]:
    """What a hand reads off the first response function of any analysis, the SI/SO curve included."""
    return read_linear(result.frequency, result.response[0], band)


def read_linear(frequency: Floats, response: Complexes, band: tuple[float, float]) -> dict[str, float]:
    """k as f -> 0, f_n at the minimum of abs(A_1), m = k / (2 pi f_n)^2, c = abs(A_1(f_n)) / (2 pi f_n).

    The minimum is looked for in ``band``, in hertz. Only k is read where abs(A_1) has none inside it (a system
    without a resonance).
    """
    k = float(np.mean(response[frequency > 0.0][:LOWEST_LINES].real))
    keep = lines_in(frequency, band)
    frequency, size = frequency[keep], np.abs(response[keep])
    i = int(np.argmin(size))
    if i in (0, len(size) - 1):
        return {"k": k}
    before, at, after = (float(y) for y in size[i - 1 : i + 2])
    bend, slope = before - 2.0 * at + after, (after - before) / 2.0
    shift = -slope / bend if bend > 0.0 else 0.0  # to the vertex of a parabola, as the eye puts it between the lines
    f_n, lowest = float(frequency[i]) + shift * float(frequency[i] - frequency[i - 1]), at + slope * shift / 2.0
    omega = 2.0 * math.pi * f_n
    m, c = k / omega**2, lowest / omega
    return {"m": m, "c": c, "k": k, "f_n": f_n, "zeta": c / (2.0 * omega * m)}
