"""Frequency response functions that noise on the response does not bias: instruments and corrected inputs.

Noise on u makes the reverse system's inputs wrong twice over: ``G_XX`` gains the noise's own power, and the mean
of a distorted input is not the input's, as ``E[(u + n)^3 | u] = u^3 + 3 sigma^2 u`` shows. The motion of a model
fitted in free run has no noise and removes both errors. Its inputs ``Z_j = g_j(u^)`` are independent of the noise,
so that ``A = G_ZX^-1 G_ZF`` holds as soon as the inputs X_j have the right mean; and they get it by
``X_j = g_j(u + n) - (E[g_j(u^ + n)] - g_j(u^))``, whatever the shape g_j.

A_j(f) still comes from the measured response and may differ from the form that the model gives it.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from study.equations import formulas
from study.identify.frequency_domain.coefficients import Estimate, Responses, lines_in, residual_density
from study.identify.frequency_domain.inputs import Input, input_history, symbols_of
from study.records import spectra
from study.records.record import Record
from study.records.spectra import Segments, SpectralMatrix
from study.support.arrays import Complexes, Floats
from study.support.least_squares import INDISTINCT, floored, normal_inverse

NODES = 15  # nodes of the Gauss-Hermite rule: exact for shapes up to the power 29, close for kinked ones
NOISY = {"u": "displacement", "v": "velocity"}  # channels with noise, by their names in a formula
TINY = float(np.finfo(np.float64).tiny)
MOST_STRETCHES, FEWEST_STRETCHES = 16, 8  # parts of the record whose scatter gives the errors of coefficients
RUN_ERROR = 1e-8  # of a channel's mean square: noise below is the error of the free run


def channels(inputs: Sequence[Input], record: Record, clean: Record) -> list[Floats]:
    """q instruments, then q corrected inputs, then the force; ``clean`` has the motion of the fitted model."""
    return [
        *(input_history(item, clean) for item in inputs),
        *inputs_without_noise(inputs, record, clean),
        record["force"],
    ]


def stretches(values: Sequence[Floats], dt: float, segments: Segments) -> list[SpectralMatrix]:
    """Spectral matrices of stretches of the record that do not overlap; none if it is too short for them."""
    count = min(MOST_STRETCHES, len(values[0]) // segments.length)
    if count < FEWEST_STRETCHES:
        return []
    length = len(values[0]) // count
    return [spectra.cross_spectra([v[i * length :][:length] for v in values], dt, segments) for i in range(count)]


def instrumental_responses(matrix: SpectralMatrix) -> Responses:
    """``A = G_ZX^-1 G_ZF`` from the matrix of :func:`channels`; e is what is left of the force.

    The covariance is ``G_ZX^-1 G_ZZ G_ZX^-H G_ee / (n_d - q)``.
    """
    density, count = matrix.density, matrix.density.shape[1] // 2
    scale = np.sqrt(np.maximum(np.einsum("fii->fi", density).real, TINY))
    scaled = density / (scale[:, :, None] * scale[:, None, :])
    inverse: Complexes = np.asarray(np.linalg.pinv(scaled[:, :count, count:-1], rcond=INDISTINCT), dtype=np.complex128)
    gain = scale[:, -1:] / scale[:, count:-1]
    response = (np.einsum("fij,fj->fi", inverse, scaled[:, :count, -1]) * gain).T
    noise = residual_density(_without_instruments(matrix), response)
    share = noise / (np.maximum(density[:, -1, -1].real, TINY) * (matrix.averages - count))
    spread = inverse @ scaled[:, :count, :count] @ inverse.conj().transpose(0, 2, 1)
    covariance = spread * share[:, None, None] * (gain[:, :, None] * gain[:, None, :])
    return Responses(matrix.frequency, response, covariance, noise)


def fit_with_instruments(
    matrix: SpectralMatrix,
    inputs: Sequence[Input],
    band: tuple[float, float],
    known: Complexes,
    parts: Sequence[SpectralMatrix] = (),
) -> Estimate:
    """Coefficients of all inputs from all lines of a band at once.

    With ``Psi`` the instruments and ``Phi`` the inputs, each times its powers of ``j 2 pi f``, the
    coefficients solve ``Re sum Psi^H Phi / G_ee theta = Re sum Psi^H F / G_ee``. Fitting A_j(f) line by line
    would weight lines by errors that are estimated with them, which biases under much noise.

    The noise of a corrected cube is proportional to u^2, hence large where the motion is. Errors are therefore
    judged by the scatter between stretches of the record; by G_ee, as if it were stationary, where the record is too
    short for that.

    Parameters
    ----------
    matrix : SpectralMatrix
        Of :func:`channels`.
    inputs : sequence of Input
        Those of the reverse system.
    band : pair of float
        Lines from the first to the second frequency (Hz) are used.
    known : complex array, shape (q, lines)
        A_j(f) of the fitted model: what it leaves of the force, G_ee, weights the lines.
    parts : sequence of SpectralMatrix
        As :func:`stretches` gives them.
    """
    keep = lines_in(matrix.frequency, band)
    density, count = matrix.density[keep], len(inputs)
    noise = residual_density(_without_instruments(matrix), known)[keep]
    noise = floored(noise)
    powers = np.concatenate([item.powers(matrix.frequency[keep]) for item in inputs], axis=1)
    owner = np.repeat(np.arange(count), [len(item.parts) for item in inputs])
    weighted = powers.conj() / noise[:, None]
    own = density[:, owner][:, :, owner]
    size = np.sqrt(np.einsum("fp,fpp,fp->p", weighted, own, powers).real)

    def equations(lines: Complexes) -> tuple[Floats, Floats]:
        through = lines[:, owner][:, :, count + owner]
        normal = np.einsum("fp,fpq,fq->pq", weighted, through, powers).real
        return normal, np.einsum("fp,fp->p", weighted, lines[:, owner, -1]).real

    normal, right = equations(density)
    inverse = normal_inverse(normal, size)
    if parts:  # leaving out the equations of one stretch after the other
        left, rights = (np.stack(side) for side in zip(*(equations(p.density[keep]) for p in parts), strict=True))
        inverses = normal_inverse(np.sum(left, axis=0) - left, size)
        without = np.einsum("gpq,gq->gp", inverses, np.sum(rights, axis=0) - rights)
        off = without - np.mean(without, axis=0)
        covariance = (len(off) - 1.0) / len(off) * off.T @ off
        covariance *= sum(p.averages for p in parts) / matrix.averages  # the whole has segments across the joints
    else:
        spread = np.einsum("fp,fpq,fq->pq", weighted, own, powers).real
        covariance = inverse @ spread @ inverse.T * matrix.segments.line_inflation() / (2.0 * matrix.averages)
    return Estimate(symbols_of(inputs), inverse @ right, covariance, len(parts) - 1.0 if parts else math.inf)


def _without_instruments(matrix: SpectralMatrix) -> SpectralMatrix:
    count = matrix.density.shape[1] // 2
    return replace(matrix, density=matrix.density[:, count:, count:])


def inputs_without_noise(inputs: Sequence[Input], record: Record, clean: Record) -> list[Floats]:
    """Inputs from the measured motion whose mean is that of the true ones, each of shape (n,).

    A term with a memory has no such mean at a point of time; its history along the clean motion takes its place.
    """
    spread = noise_spread(record, clean)
    histories: list[Floats] = []
    for item in inputs:
        if item.state is not None:
            histories.append(input_history(item, clean))
        elif item.shape == "u":
            histories.append(input_history(item, record))
        else:
            histories.append(input_history(item, record) - (expected(item, clean, spread) - input_history(item, clean)))
    return histories


def noise_spread(record: Record, clean: Record) -> dict[str, Floats]:
    """A root of the noise's covariance: for each noisy channel its part of every independent source."""
    names = [name for name in NOISY.values() if name in record]
    noise = np.stack([record[name] - clean[name] for name in names])
    noise[np.mean(noise**2, axis=1) < RUN_ERROR * np.mean(np.stack([clean[name] for name in names]) ** 2, axis=1)] = 0.0
    values, vectors = np.linalg.eigh(noise @ noise.T / noise.shape[1])
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return dict(zip(names, root, strict=True))


def expected(item: Input, clean: Record, spread: dict[str, Floats]) -> Floats:
    """Mean of an input's history over Gaussian noise about a clean motion, shape (n,)."""
    used = [NOISY[name] for name in formulas.names(item.shape) if NOISY.get(name) in spread]
    if len(used) == 1:  # noise of several sources on one channel is as that of one
        spread = {used[0]: np.sqrt(np.sum(spread[used[0]] ** 2, keepdims=True))}
    sources = [s for s in range(len(spread)) if any(spread[name][s] != 0.0 for name in used)]
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    weights = weights / np.sum(weights)
    total = np.zeros(len(clean))
    for places in np.ndindex(*(NODES,) * len(sources)):
        moved = {
            name: clean[name] + sum(float(spread[name][s] * nodes[p]) for s, p in zip(sources, places, strict=True))
            for name in used
        }
        weight = float(np.prod(weights[list(places)]))
        total += weight * input_history(item, clean.with_channels(moved))
    return total
