"""Coefficients from the lines of a whole record, with errors that hold for bursts of noise as well.

The weighted least squares fit of A_j(f) to powers of j 2 pi f, on local polynomials that overlap nowhere and with
all that their covariance says, comes to the same as least squares of the output on the inputs times those powers,
band by band with a transient of its own, each band weighted by the noise that the local polynomials find in it.
So it is done: nothing is lost in between.

What is left of the force is no stationary noise. Without measurement noise it is what was sampled too coarsely,
and comes in bursts where the motion is large; with noise on the motion, it is that noise times u^2. Lines are
then not independent, and inverse variances say too little by up to ten times. The influence of each line on a
coefficient is therefore carried back to time, where sums of influence times residual over stretches that are
longer than the system's memory are independent; their scatter gives the covariance (a sandwich estimate with
clusters, by jackknife: Bell and McCaffrey, Survey Methodology 28, 2002).
"""

from collections.abc import Sequence

import numpy as np
from scipy.fft import irfft

from study.identify.frequency_domain.coefficients import Estimate
from study.identify.frequency_domain.inputs import Input
from study.identify.frequency_domain.local_polynomial_method import (
    EXACT,
    Lines,
    LocalPolynomial,
    noise_variance,
    transients,
)
from study.support.arrays import Complexes, Floats, Ints
from study.support.errors import StudyError

STRETCHES = 32  # of the record, that errors are judged by


def fit(lines: Lines, inputs: Sequence[Input], band: tuple[float, float], how: LocalPolynomial) -> Estimate:
    """Coefficients of all inputs together.

    Parameters
    ----------
    lines : Lines
        Transforms of the inputs and the output.
    inputs : sequence of Input
        What each A_j is made of, in the order of ``lines.inputs``.
    band : pair of float
        Lines from the first to the second frequency (Hz) are used, each in one band.
    how : LocalPolynomial
        Smallest bands; they are widened until few lines are left over.

    Returns
    -------
    Estimate
        Coefficients of all inputs that have power in the band; the others are not known.

    Raises
    ------
    StudyError
        If there are fewer lines than one band needs.
    """
    how.check(len(inputs))
    index = _bands(lines, band, how)
    weight = 1.0 / np.sqrt(_floored(noise_variance(lines, index, how)))[:, None]
    basis = transients(index.shape[1], how.degree)
    parts = [(j, part) for j, item in enumerate(inputs) for part in item.parts]
    omega = 2j * np.pi * lines.frequency[index]
    columns = [_clean(p.factor * omega**p.order * lines.inputs[j][index], basis) * weight for j, p in parts]
    design = np.stack([c.ravel() for c in columns], axis=1)
    target = (_clean(lines.output[index], basis) * weight).ravel()
    size = np.linalg.norm(design, axis=0)
    heard, size = size > 0.0, size[size > 0.0]
    design = design[:, heard] / size
    inverse = _inverse(design)
    values = (inverse.conj() @ target).real
    each = np.broadcast_to(weight, index.shape).ravel()
    residual = (target - design @ values) / each
    covariance = _scatter(inverse * each, design.T / each, residual, index.ravel(), lines.samples)
    symbols = tuple(p.symbol for (_, p), known in zip(parts, heard, strict=True) if known)
    return Estimate(symbols, values / size, covariance / np.outer(size, size), STRETCHES - 1.0)


def _inverse(design: Complexes) -> Complexes:
    """The influence of each line: real coefficients are ``Re(conj(influence) . target)``, shape (p, lines)."""
    stacked = np.concatenate([design.real, design.imag])
    inverse: Floats = np.asarray(np.linalg.pinv(stacked, rcond=EXACT), dtype=np.float64)
    half = design.shape[0]
    return inverse[:, :half] + 1j * inverse[:, half:]


def _bands(lines: Lines, band: tuple[float, float], how: LocalPolynomial) -> Ints:
    """Lines of each band, shape (bands, lines of a band): side by side, equally wide."""
    inside = np.flatnonzero((lines.frequency >= band[0]) & (lines.frequency <= band[1]))
    count = len(inside) // how.width
    if count == 0:
        raise StudyError(
            f"the record of {lines.samples} samples has {len(inside)} lines from {band[0]:g} to {band[1]:g} Hz; "
            f"local_polynomial needs {how.width}: a longer record, a wider band or a smaller half_width is right"
        )
    width = len(inside) // count
    return inside[: count * width].reshape(count, width)


def _floored(variance: Floats) -> Floats:
    """Variances that can be divided by; a model that explains all to the last digit weighs all bands alike."""
    largest = float(np.max(variance))
    return np.maximum(variance, EXACT * largest) if largest > 0.0 else np.ones_like(variance)


def _clean(values: Complexes, basis: Floats) -> Complexes:
    """What is left of values (bands, lines) when the transients are taken out."""
    return values - (values @ basis) @ basis.T


def _scatter(
    influence: Complexes, design: Complexes, residual: Complexes, index: Ints, samples: int
) -> Floats:  # fmt: skip
    """Covariance of ``Re(conj(influence) . noise)`` by leaving out one stretch of time after the other, (p, p).

    Over a stretch, influence times residual sums to s and influence times design to H; all H sum to the
    identity. Without the stretch the coefficients would be ``(1 - H)^-1 s`` away: H stands for the share of the
    stretch's own noise that they have followed, much where a single burst of motion tells most of a coefficient.
    """
    count = len(influence)
    spectra = np.zeros((2 * count + 1, samples // 2 + 1), dtype=np.complex128)
    spectra[:, index + 1] = np.concatenate([influence, design, residual[None]])
    histories = np.asarray(irfft(spectra, samples, axis=1), dtype=np.float64)
    long = samples // STRETCHES
    cut = histories[:, : STRETCHES * long].reshape(-1, STRETCHES, long).transpose(1, 0, 2) * np.sqrt(0.5 * samples)
    sums = cut[:, :count] @ cut[:, count:].transpose(0, 2, 1)
    remaining = np.eye(count) - sums[:, :, :count]
    shifts: Floats = np.asarray(np.linalg.solve(remaining, sums[:, :, count:]), dtype=np.float64)[:, :, 0]
    return shifts.T @ shifts * ((STRETCHES - 1.0) / STRETCHES)
