"""What the analysis in reverse gives in expectation where force and response carry white noise of known size.

Noise n on u changes what the inputs correlate with in two ways: the mean of a distorted input is not the input's, as
``E[(u + n)^3 | u] = u^3 + 3 sigma^2 u`` shows, and what varies about that mean adds power of its own. As the noise is
independent from sample to sample, so is the second part: a white spectrum of the conditional covariance's mean over
time. The expected spectral matrix follows without a random number, and from it what least squares of noisy inputs
tends to.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from study.identify.frequency_domain.inputs import Input, histories
from study.identify.frequency_domain.instruments import NODES
from study.records.record import Record
from study.records.spectra import Segments, SpectralMatrix, cross_spectra
from study.support.arrays import Floats


def expected_spectra(
    inputs: Sequence[Input], clean: Record, displacement: float, force: float, segments: Segments
) -> SpectralMatrix:
    """Expected cross-spectra of the inputs and, last, the force.

    Parameters
    ----------
    inputs : sequence of Input
        Shapes of displacement and velocity without memory; the velocity is taken as free of noise.
    clean : Record
        Motion and force without noise.
    displacement, force : float
        Variance of the noise that is added to each, in their own units squared.
    segments : Segments
        Of the spectra.
    """
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    weights = weights / np.sum(weights)
    moved: list[Floats] = [
        np.stack(histories(inputs, clean.with_channels({"displacement": clean["displacement"] + shift})))
        for shift in np.sqrt(displacement) * nodes
    ]
    mean = np.sum([w * h for w, h in zip(weights, moved, strict=True)], axis=0)
    own = np.sum([w * (h - mean) @ (h - mean).T for w, h in zip(weights, moved, strict=True)], axis=0) / len(clean)
    matrix = cross_spectra([*mean, clean["force"]], clean.dt, segments)
    covariance = np.zeros((len(mean) + 1, len(mean) + 1))
    covariance[:-1, :-1] = own
    return with_force_noise(_with_white(matrix, covariance, clean.dt), force, clean.dt)


def with_force_noise(matrix: SpectralMatrix, force: float, dt: float) -> SpectralMatrix:
    """Expected cross-spectra with white noise of so large a variance on the force, which goes with no input."""
    covariance = np.zeros(matrix.density.shape[1:])
    covariance[-1, -1] = force
    return _with_white(matrix, covariance, dt)


def _with_white(matrix: SpectralMatrix, covariance: Floats, dt: float) -> SpectralMatrix:
    white = np.full(len(matrix.frequency), 2.0 * dt)
    white[[0, -1]] /= 2.0  # one-sided: zero and Nyquist frequency are not doubled
    return replace(matrix, density=matrix.density + white[:, None, None] * covariance)
