"""Multiple-input/single-output analysis by conditioned spectra (the report's Sections 4.2 to 4.5).

Inputs come in the order in which they are conditioned: ``G_ij.r!`` is ``G_ij`` without the linear effects of inputs
1 to r. Every quantity is computed per frequency line, on inputs scaled to unit power, so that a cube of 1e-8 m^3 beside
a displacement of 1e-3 m does no harm.
"""

from dataclasses import dataclass

import numpy as np

from study.identify.frequency_domain.coefficients import Responses
from study.records.spectra import SpectralMatrix
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError
from study.support.least_squares import INDISTINCT


@dataclass(frozen=True)
class MisoResult(Responses):
    """What each input contributes, at each frequency line; q inputs, arrays of shape (q, lines)."""

    conditioned: Complexes  # L_j, frequency response function from the conditioned input j
    ordinary: Floats  # ordinary coherence of each raw input with the output
    partial: Floats  # of each conditioned input with what is left of the output, (4.30)
    contribution: Floats  # of each conditioned input with the total output: the coherence functions q^2, (4.31)
    cumulative: Floats  # running sums of ``contribution``; the last is the multiple coherence, (4.38)
    output: Floats  # G_yy, shape (lines,); ``noise`` is G_nn of (4.44)
    averages: float  # their effective number

    @property
    def multiple(self) -> Floats:
        """Multiple coherence, shape (lines,)."""
        return self.cumulative[-1]


def analyse(matrix: SpectralMatrix) -> MisoResult:
    """Analyse a spectral matrix whose last channel is the output, all others inputs.

    There must be more effective averages than inputs, else every coherence would be one.
    """
    inputs = matrix.density.shape[1] - 1
    if matrix.averages <= inputs:
        raise StudyError(
            f"{matrix.averages:.1f} effective averages cannot separate {inputs} inputs; "
            "use shorter segments or a longer record"
        )
    scale = _scale(matrix.density)
    scaled = matrix.density / (scale[:, :, None] * scale[:, None, :])
    rows, left, partial = _condition(scaled)
    gain = scale[:, -1:] / scale[:, :-1]
    power, conditioned = np.einsum("fii->fi", scaled).real, np.einsum("fjj->fj", rows[:, :, :-1]).real
    contribution = np.abs(rows[:, :, -1]) ** 2 / _divisor(conditioned) / _divisor(power[:, -1:])
    cumulative = np.minimum(np.cumsum(contribution, axis=1), 1.0)
    noise, output = np.clip(1.0 - cumulative[:, -1], 0.0, None), matrix.density[:, -1, -1].real
    # The many-input form of Bendat and Piersol's normalised random error (1 - gamma^2) / (2 gamma^2 n_d) of a squared
    # gain (Random Data, 1986, chapter 11), with the q degrees of freedom given back that the fit itself used up.
    inverse = np.linalg.pinv(scaled[:, :-1, :-1], rcond=INDISTINCT, hermitian=True)
    covariance = inverse * (noise / (matrix.averages - inputs))[:, None, None]
    return MisoResult(
        frequency=matrix.frequency,
        conditioned=(left * gain).T,
        response=(_unconditioned(rows, left) * gain).T,
        covariance=covariance * (gain[:, :, None] * gain[:, None, :]),
        ordinary=(np.abs(scaled[:, :-1, -1]) ** 2 / _divisor(power[:, :-1] * power[:, -1:])).T,
        partial=partial.T,
        contribution=contribution.T,
        cumulative=cumulative.T,
        output=output,
        noise=noise * output,
        averages=matrix.averages,
    )


def _divisor(power: Floats) -> Floats:
    """What to divide by, where nothing divided by nothing is nothing."""
    return np.where(power > 0.0, power, 1.0)


def _scale(density: Complexes) -> Floats:
    """Root of each autospectrum, shape (lines, channels); infinite where an input is silent, so that it scales to zero.

    A constant has power at its lowest lines only. Rounding at the others is the same in every segment and, scaled to
    unit power, would pass for an input.
    """
    power = np.sqrt(np.clip(np.einsum("fii->fi", density).real, 0.0, None))
    scale = np.where(power > INDISTINCT * power.max(axis=0), power, np.inf)
    scale[:, -1] = _divisor(power[:, -1])
    return scale


def _condition(density: Complexes) -> tuple[Complexes, Complexes, Floats]:
    """Remove the inputs one after the other.

    Returns the rows ``G_rj.(r-1)!`` of every stage (lines, q, q + 1), the conditioned responses
    ``L_r`` of (4.23) to (4.25), and the partial coherences of (4.30) and (4.34).
    """
    left = density.copy()
    lines, channels, _ = density.shape
    rows = np.zeros((lines, channels - 1, channels), dtype=np.complex128)
    responses = np.zeros((lines, channels - 1), dtype=np.complex128)
    partial = np.zeros((lines, channels - 1))
    for r in range(channels - 1):
        power = left[:, r, r].real
        useful = power > INDISTINCT
        row = np.where(useful[:, None], left[:, r, :], 0.0)
        safe = np.where(useful, power, 1.0)
        rows[:, r] = row
        responses[:, r] = row[:, -1] / safe
        remaining = left[:, -1, -1].real
        explained = np.abs(row[:, -1]) ** 2 / safe
        partial[:, r] = np.clip(explained / _divisor(remaining), 0.0, 1.0)
        left = left - row.conj()[:, :, None] * row[:, None, :] / safe[:, None, None]
    return rows, responses, partial


def _unconditioned(rows: Complexes, conditioned: Complexes) -> Complexes:
    """A_j from L_j by back substitution, (4.26) to (4.28)."""
    response = conditioned.copy()
    for i in range(conditioned.shape[1] - 2, -1, -1):
        ratio = rows[:, i, i + 1 : -1] / _divisor(rows[:, i, i].real)[:, None]
        response[:, i] -= np.einsum("fj,fj->f", ratio, response[:, i + 1 :])
    return response
