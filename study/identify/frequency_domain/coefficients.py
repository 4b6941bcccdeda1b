"""Frequency response functions A_j(f), the coefficients that make them up, and their standard errors.

From A_j(f) to coefficients input by input; from spectra to all coefficients at once, for inputs that may determine each
other at every single line; and back, from coefficients to the A_j(f) of the form that they give it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study.identify.frequency_domain.inputs import Input, symbols_of
from study.records.spectra import SpectralMatrix
from study.support.arrays import Complexes, Floats
from study.support.least_squares import floored, influence, normal_inverse


@dataclass(frozen=True)
class Responses:
    """Frequency response functions of q inputs with their errors, however they were estimated."""

    frequency: Floats  # in hertz, shape (lines,)
    response: Complexes  # A_j from input j, output unit per input unit, shape (q, lines)
    covariance: Complexes  # random-error covariance E[dA dA^H] of the estimates of A, shape (lines, q, q)
    noise: Floats  # autospectral density of what the inputs leave of the output, G_nn, shape (lines,)


@dataclass(frozen=True)
class Estimate:
    """Coefficients of a model, estimated together."""

    symbols: tuple[str, ...]  # p names
    values: Floats  # shape (p,)
    covariance: Floats  # of their random errors, shape (p, p)
    freedom: float = math.inf  # its degrees of freedom; few where it comes from the scatter between parts of a record

    def __getitem__(self, symbol: str) -> float:
        return float(self.values[self.symbols.index(symbol)])

    def __contains__(self, symbol: str) -> bool:
        return symbol in self.symbols

    def error(self, symbol: str) -> float:
        """Standard error of one estimate."""
        i = self.symbols.index(symbol)
        return float(np.sqrt(self.covariance[i, i]))

    def derived_error(self, gradient: dict[str, float]) -> float:
        """Standard error of a function of the coefficients with these partial derivatives."""
        g = np.array([gradient.get(s, 0.0) for s in self.symbols])
        return float(np.sqrt(max(g @ self.covariance @ g, 0.0)))


def lines_in(frequency: Floats, band: tuple[float, float]) -> NDArray[np.bool_]:
    """Which lines lie from the first to the second frequency (Hz)."""
    return (frequency >= band[0]) & (frequency <= band[1])


def fit_coefficients(
    result: Responses, inputs: Sequence[Input], band: tuple[float, float], line_inflation: float
) -> Estimate:
    """Weighted least squares of A_j(f) on powers of j 2 pi f, over the lines of a band (Hz).

    Each input is fitted by itself, every line weighted by the inverse of its random-error variance
    (Bendat and Piersol). Real and imaginary part are fitted together, the coefficients being real. Estimates
    from different inputs keep their covariance, which holds for circular errors of A. ``line_inflation`` is that of
    the segments: neighbouring lines of a windowed spectrum are not independent.
    """
    keep = lines_in(result.frequency, band)
    covariance, maps, values = result.covariance[keep], list[Complexes](), list[Floats]()
    for j, item in enumerate(inputs):
        response, divisor = result.response[j, keep], floored(covariance[:, j, j].real)
        weight = np.max(divisor, initial=0.0) / divisor
        silent = response == 0.0  # the input has no power there, and nothing is known of its response
        maps.append(influence(item.powers(result.frequency[keep]), np.where(silent, 0.0, weight)))
        values.append((maps[-1] @ response).real)
    blocks = [
        [((a * covariance[:, i, j]) @ b.conj().T).real / 2.0 for j, b in enumerate(maps)] for i, a in enumerate(maps)
    ]
    return Estimate(symbols_of(inputs), np.concatenate(values), np.block(blocks) * line_inflation)


@dataclass(frozen=True, eq=False)
class JointFit:
    """Coefficients of all inputs of one output, and how each line of it moves them."""

    estimate: Estimate
    channels: tuple[int, ...]  # numbers in the spectral matrix, output last
    influence: Complexes  # what a line's cross-spectra G_xn with noise n add to the coefficients (real part), (f, p, q)
    rest: Complexes  # weights of the channels in what is left of the output, shape (lines, channels)


def fit_jointly(
    matrix: SpectralMatrix, channels: Sequence[int], result: Responses, inputs: Sequence[Input],
    band: tuple[float, float],
) -> JointFit:  # fmt: skip
    """Coefficients of all inputs at once from the lines of a band (Hz), each weighted by the inverse of its noise.

    With few forces on a structure inputs may determine each other at every single line. Driven at its first mass alone,
    a chain of two moves as its second mass's equation has it: ``(m2 s^2 + c s + k) U_21 + k3 (U_21)^3 + m2 s^2 U_1 =
    0``, s = j 2 pi f, so that no A_j(f) of the first equation follows from one line. Over all lines the coefficients
    do, for each has its own power of s: the output is fitted by all inputs times their powers of s,
    ``sum_f w |Y - sum_j A_j X_j|^2``, which needs no inverse of the inputs' spectra.

    ``channels`` are the numbers in ``matrix`` of what ``result`` is the analysis of. Of parts whose sum alone the
    record tells, the shortest amounts are taken.
    """
    lines, rows = lines_in(matrix.frequency, band), list(channels)
    density = matrix.density[lines][:, rows][:, :, rows]
    powers = form(inputs, symbols_of(inputs), matrix.frequency[lines])
    weight = 1.0 / floored(result.noise[lines])
    normal = np.einsum("f,fjp,fjk,fkq->pq", weight, powers.conj(), density[:, :-1, :-1], powers, optimize=True).real
    inverse = normal_inverse(normal)
    moves = np.asarray(weight[:, None, None] * (inverse @ powers.conj().transpose(0, 2, 1)), dtype=np.complex128)
    values = np.einsum("fpj,fj->p", moves, density[:, :-1, -1]).real
    rest = np.concatenate([-(powers @ values), np.ones((len(powers), 1))], axis=1).astype(np.complex128)
    bare = JointFit(Estimate(symbols_of(inputs), values, inverse), tuple(channels), moves, rest)
    own = covariance_between_outputs(matrix, bare, bare, band)
    return replace(bare, estimate=replace(bare.estimate, covariance=own))


def covariance_between_outputs(
    matrix: SpectralMatrix, first: JointFit, second: JointFit, band: tuple[float, float]
) -> Floats:
    """Covariance of two outputs' coefficients, shape (first's, second's).

    What is left of the outputs may go together, as where two equations of motion share a noisy motion:
    ``E[dG_xn dG_zr*] = G_xz G_rn / n_d`` for noises n, r of inputs x, z.
    """
    density = matrix.density[lines_in(matrix.frequency, band)]
    a, b = list(first.channels), list(second.channels)
    noise = np.einsum("fi,fij,fj->f", second.rest.conj(), density[:, b][:, :, a], first.rest, optimize=True)
    freedom = matrix.averages - max(len(a), len(b)) + 1.0
    cross = density[:, a[:-1]][:, :, b[:-1]] * (noise / freedom)[:, None, None]
    total = np.einsum("fpj,fjk,fqk->pq", first.influence, cross, second.influence.conj(), optimize=True)
    return total.real / 2.0 * matrix.segments.line_inflation()


def independent_share(result: Responses, matrix: SpectralMatrix) -> Floats:
    """Share of each input's power that the other inputs do not determine linearly, shape (lines, inputs).

    Where it is small, A_j(f) does not follow from the line: its random error grows with the inverse of the share, and
    so does the bias from what the segments' ends leak.
    """
    power = np.einsum("fjj->fj", matrix.density[:, :-1, :-1]).real
    inverse = np.einsum("fjj->fj", result.covariance).real * (matrix.averages - power.shape[1])
    scaled = inverse * power / np.where(result.noise > 0.0, result.noise, np.inf)[:, None]
    return np.where(scaled > 0.0, 1.0 / np.maximum(scaled, 1.0), 0.0)


def responses_with_errors(inputs: Sequence[Input], estimate: Estimate, matrix: SpectralMatrix) -> Responses:
    """``A_j(f) = sum of coefficient * factor * (j 2 pi f)^order`` with the covariance of the coefficients.

    The matrix, that of the inputs and the force, gives the lines and what the functions leave of the force. The
    estimate may have other coefficients too.
    """
    powers = form(inputs, estimate.symbols, matrix.frequency)
    covariance = powers @ estimate.covariance @ powers.conj().transpose(0, 2, 1)
    known = (powers @ estimate.values).T
    return Responses(matrix.frequency, known, covariance, residual_density(matrix, known))


def fitted_functions(inputs: Sequence[Input], estimate: Estimate, frequency: Floats) -> Complexes:
    """The functions alone, shape (inputs, lines)."""
    return (form(inputs, estimate.symbols, frequency) @ estimate.values).T


def form(inputs: Sequence[Input], symbols: Sequence[str], frequency: Floats) -> Complexes:
    """What a unit of each coefficient adds to each A_j(f), shape (lines, inputs, coefficients)."""
    found = np.zeros((len(frequency), len(inputs), len(symbols)), dtype=np.complex128)
    for j, item in enumerate(inputs):
        found[:, j, [symbols.index(part.symbol) for part in item.parts]] = item.powers(frequency)
    return found


def residual_density(matrix: SpectralMatrix, response: Complexes) -> Floats:
    """Autospectral density of the output less what comes through the inputs by these A_j(f), shape (lines,)."""
    through = np.concatenate([-response, np.ones((1, response.shape[1]))]).T
    return np.clip(np.einsum("fi,fij,fj->f", through.conj(), matrix.density, through).real, 0.0, None)
