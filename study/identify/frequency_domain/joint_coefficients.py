"""Coefficients of all inputs at once, from spectra: for inputs that may determine each other at every single line.

With few forces on a structure they do. Driven at its first mass alone, a chain of two moves as its second mass's
equation has it: ``(m2 s^2 + c s + k) U_21 + k3 (U_21)^3 + m2 s^2 U_1 = 0``, s = j 2 pi f, so that no A_j(f) of the
first equation follows from one line. Over all lines the coefficients do, for each has its own power of s. The output
is fitted by all inputs times their powers of s, ``sum_f w |Y - sum_j A_j X_j|^2``, which needs no inverse of the
inputs' spectra.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from study.identify.frequency_domain.coefficients import Estimate, floored
from study.identify.frequency_domain.conditioned import MisoResult
from study.identify.frequency_domain.inputs import Input
from study.records.spectra import SpectralMatrix
from study.support.arrays import Complexes, Floats

_pinv = cast(Any, np.linalg.pinv)  # its annotation leaves the element type open


@dataclass(frozen=True, eq=False)
class JointFit:
    """Coefficients of one output, and how each line of it moves them.

    Attributes
    ----------
    estimate : Estimate
        The coefficients with their covariance.
    channels : tuple of int
        Numbers of the channels in the spectral matrix, output last.
    influence : complex array, shape (lines, coefficients, inputs)
        What a line's ``G_xn``, the cross-spectra of the inputs with the noise, adds to the coefficients (real part).
    rest : complex array, shape (lines, channels)
        Weights of the channels in what is left of the output.
    """

    estimate: Estimate
    channels: tuple[int, ...]
    influence: Complexes
    rest: Complexes


def fit_jointly(
    matrix: SpectralMatrix,
    channels: Sequence[int],
    result: MisoResult,
    inputs: Sequence[Input],
    band: tuple[float, float],
) -> JointFit:
    """Coefficients of all inputs from the lines of a band (Hz), each weighted by the inverse of its noise.

    ``channels`` are the numbers in ``matrix`` of what ``result`` is the analysis of. Of parts whose sum alone the
    record tells, the shortest amounts are taken.
    """
    lines = _inside(matrix, band)
    rows = list(channels)
    density = matrix.density[lines][:, rows][:, :, rows]
    powers = _powers(matrix.frequency[lines], inputs)
    weight = 1.0 / floored(result.noise[lines])
    normal = np.einsum("f,fjp,fjk,fkq->pq", weight, powers.conj(), density[:, :-1, :-1], powers, optimize=True).real
    size = np.sqrt(np.diag(normal))
    size = np.where(size > 0.0, size, np.inf)
    scale = np.outer(size, size)
    inverse: Floats = np.asarray(_pinv(normal / scale, rcond=1e-13, hermitian=True), dtype=np.float64) / scale
    influence = np.asarray(weight[:, None, None] * (inverse @ powers.conj().transpose(0, 2, 1)), dtype=np.complex128)
    values = np.einsum("fpj,fj->p", influence, density[:, :-1, -1]).real
    rest = np.concatenate([-(powers @ values), np.ones((len(powers), 1))], axis=1)
    symbols = tuple(p.symbol for item in inputs for p in item.parts)
    bare = JointFit(Estimate(symbols, values, inverse), tuple(channels), influence, rest.astype(np.complex128))
    return replace(bare, estimate=Estimate(symbols, values, covariance(matrix, bare, bare, band)))


def covariance(matrix: SpectralMatrix, first: JointFit, second: JointFit, band: tuple[float, float]) -> Floats:
    """Covariance of two outputs' coefficients, shape (first's, second's).

    What is left of the outputs may go together, as where two equations of motion share a noisy motion:
    ``E[dG_xn dG_zr*] = G_xz G_rn / n_d`` for noises n, r of inputs x, z.
    """
    density = matrix.density[_inside(matrix, band)]
    a, b = list(first.channels), list(second.channels)
    noise = np.einsum("fi,fij,fj->f", second.rest.conj(), density[:, b][:, :, a], first.rest, optimize=True)
    freedom = matrix.averages - max(len(a), len(b)) + 1.0
    cross = density[:, a[:-1]][:, :, b[:-1]] * (noise / freedom)[:, None, None]
    total = np.einsum("fpj,fjk,fqk->pq", first.influence, cross, second.influence.conj(), optimize=True)
    return total.real / 2.0 * matrix.segments.line_inflation()


def independent_share(result: MisoResult, matrix: SpectralMatrix) -> Floats:
    """Share of each input's power that the other inputs do not determine linearly, shape (lines, inputs).

    Where it is small, A_j(f) does not follow from the line: its random error grows with the inverse of the share, and
    so does the bias from what the segments' ends leak.
    """
    power = np.einsum("fjj->fj", matrix.density[:, :-1, :-1]).real
    inverse = np.einsum("fjj->fj", result.covariance).real * (matrix.averages - power.shape[1])
    scaled = inverse * power / np.where(result.noise > 0.0, result.noise, np.inf)[:, None]
    return np.where(scaled > 0.0, 1.0 / np.maximum(scaled, 1.0), 0.0)


def _inside(matrix: SpectralMatrix, band: tuple[float, float]) -> NDArray[np.bool_]:
    return (matrix.frequency >= band[0]) & (matrix.frequency <= band[1])


def _powers(frequency: Floats, inputs: Sequence[Input]) -> Complexes:
    """Factor of each coefficient in each input's A_j(f), shape (lines, inputs, coefficients)."""
    count = sum(len(item.parts) for item in inputs)
    found = np.zeros((len(frequency), len(inputs), count), dtype=np.complex128)
    first = 0
    for j, item in enumerate(inputs):
        found[:, j, first : first + len(item.parts)] = item.powers(frequency)
        first += len(item.parts)
    return found
