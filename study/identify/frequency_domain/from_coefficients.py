"""Frequency response functions of known form: what estimated coefficients make of each A_j(f)."""

from collections.abc import Sequence

import numpy as np

from study.identify.frequency_domain.coefficients import Estimate
from study.identify.frequency_domain.inputs import Input
from study.identify.frequency_domain.responses import Responses
from study.records.spectra import SpectralMatrix
from study.support.arrays import Complexes, Floats


def responses_with_errors(inputs: Sequence[Input], estimate: Estimate, matrix: SpectralMatrix) -> Responses:
    """``A_j(f) = sum of coefficient * factor * (j 2 pi f)^order`` with the covariance of the coefficients.

    The matrix, that of the inputs and the force, gives the lines and what the functions leave of the force. The
    estimate may have other coefficients too.
    """
    form = _form(inputs, estimate, matrix.frequency)
    covariance = form @ estimate.covariance @ form.conj().transpose(0, 2, 1)
    known = fitted_functions(inputs, estimate, matrix.frequency)
    return Responses(matrix.frequency, known, covariance, residual_density(matrix, known))


def fitted_functions(inputs: Sequence[Input], estimate: Estimate, frequency: Floats) -> Complexes:
    """The functions alone, shape (inputs, lines)."""
    return (_form(inputs, estimate, frequency) @ estimate.values).T


def _form(inputs: Sequence[Input], estimate: Estimate, frequency: Floats) -> Complexes:
    """What a unit of each estimate adds to each A_j(f), shape (lines, inputs, estimates)."""
    form = np.zeros((len(frequency), len(inputs), len(estimate.symbols)), dtype=np.complex128)
    for j, item in enumerate(inputs):
        form[:, j, [estimate.symbols.index(part.symbol) for part in item.parts]] = item.powers(frequency)
    return form


def residual_density(matrix: SpectralMatrix, response: Complexes) -> Floats:
    """Autospectral density of the output less what comes through the inputs by these A_j(f), shape (lines,)."""
    through = np.concatenate([-response, np.ones((1, response.shape[1]))]).T
    return np.clip(np.einsum("fi,fij,fj->f", through.conj(), matrix.density, through).real, 0.0, None)
