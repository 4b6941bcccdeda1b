"""Coefficients from the lines of a whole record, with errors that hold for bursts of noise as well.

The weighted least squares fit of A_j(f) to powers of j 2 pi f, on local polynomials that do not overlap and with their
full covariance, is equivalent to least squares of the output on the inputs times those powers, band by band with a
transient of its own, each band weighted by the noise that the local polynomials find in it. The latter is done here.

The residual force is no stationary noise. Without measurement noise it comes from too coarse a sampling, in bursts
where the motion is large; with noise on the motion, it is that noise times u^2. Lines are then not independent, and
inverse variances give errors that are too small by up to a factor of ten. The influence of each line on a coefficient
is therefore transformed back to time, where sums of influence times residual over stretches that are longer than the
system's memory are independent; their scatter gives the covariance (a sandwich estimate with clusters, by jackknife:
Bell and McCaffrey, Survey Methodology 28, 2002).
"""

from collections.abc import Sequence

import numpy as np
from scipy.fft import irfft

from study.identify.frequency_domain.coefficients import Estimate, floored
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

STRETCHES = 32  # parts of the record whose scatter gives the errors


def fit_local_polynomial(
    lines: Lines, inputs: Sequence[Input], band: tuple[float, float], settings: LocalPolynomial
) -> Estimate:
    """Coefficients of all inputs that have power from the first to the second frequency of ``band`` (Hz).

    Local bands are widened until few lines are left over.
    """
    return fit_with_shifts(lines, inputs, band, settings)[0]


def fit_with_shifts(
    lines: Lines, inputs: Sequence[Input], band: tuple[float, float], settings: LocalPolynomial
) -> tuple[Estimate, Floats]:
    """The same, and how far the coefficients move when one stretch of time after the other is left out.

    The shifts, shape (STRETCHES, coefficients), of two equations of one record give the covariance between them.
    """
    settings.check(len(inputs))
    index = _bands(lines, band, settings)
    weight = 1.0 / np.sqrt(floored(noise_variance(lines, index, settings)))[:, None]
    basis = transients(index.shape[1], settings.degree)
    parts = [(j, part) for j, item in enumerate(inputs) for part in item.parts]
    omega = 2j * np.pi * lines.frequency[index]
    columns = [_clean(p.factor * omega**p.order * lines.inputs[j][index], basis) * weight for j, p in parts]
    design = np.stack([c.ravel() for c in columns], axis=1)
    target = (_clean(lines.output[index], basis) * weight).ravel()
    size = np.linalg.norm(design, axis=0)
    driven, size = size > 0.0, size[size > 0.0]
    design = design[:, driven] / size
    inverse = _inverse(design)
    values = (inverse.conj() @ target).real
    each = np.broadcast_to(weight, index.shape).ravel()
    residual = (target - design @ values) / each
    shifts = _shifts(inverse * each, design.T / each, residual, index.ravel(), lines.samples)
    symbols = tuple(p.symbol for (_, p), known in zip(parts, driven, strict=True) if known)
    covariance = covariance_between(shifts, shifts) / np.outer(size, size)
    return Estimate(symbols, values / size, covariance, STRETCHES - 1.0), shifts / size


def covariance_between(first: Floats, second: Floats) -> Floats:
    """Covariance of two sets of coefficients from how far both move without each stretch of time (jackknife)."""
    return first.T @ second * ((STRETCHES - 1.0) / STRETCHES)


def _inverse(design: Complexes) -> Complexes:
    """The influence of each line: real coefficients are ``Re(conj(influence) . target)``, shape (p, lines)."""
    stacked = np.concatenate([design.real, design.imag])
    inverse: Floats = np.asarray(np.linalg.pinv(stacked, rcond=EXACT), dtype=np.float64)
    half = design.shape[0]
    return inverse[:, :half] + 1j * inverse[:, half:]


def _bands(lines: Lines, band: tuple[float, float], settings: LocalPolynomial) -> Ints:
    """Lines of each band, shape (bands, lines of a band): side by side, equally wide."""
    inside = np.flatnonzero((lines.frequency >= band[0]) & (lines.frequency <= band[1]))
    count = len(inside) // settings.width
    if count == 0:
        raise StudyError(
            f"the record of {lines.samples} samples has {len(inside)} lines from {band[0]:g} to {band[1]:g} Hz; "
            f"local_polynomial needs {settings.width}; expected a longer record, a wider band or a smaller half_width"
        )
    width = len(inside) // count
    return inside[: count * width].reshape(count, width)


def _clean(values: Complexes, basis: Floats) -> Complexes:
    """Values (bands, lines) less their transients."""
    return values - (values @ basis) @ basis.T


def _shifts(
    influence: Complexes, design: Complexes, residual: Complexes, index: Ints, samples: int
) -> Floats:  # fmt: skip
    """Shifts of ``Re(conj(influence) . noise)`` on leaving out one stretch of time after the other, (STRETCHES, p).

    Over a stretch, influence times residual sums to s and influence times design to H; all H sum to the
    identity. Without the stretch the coefficients would shift by ``(1 - H)^-1 s``: H is the share of the stretch's own
    noise that they have followed, which is large where a single burst of motion determines most of a coefficient.
    """
    count = len(influence)
    spectra = np.zeros((2 * count + 1, samples // 2 + 1), dtype=np.complex128)
    spectra[:, index + 1] = np.concatenate([influence, design, residual[None]])
    histories = np.asarray(irfft(spectra, samples, axis=1), dtype=np.float64)
    long = samples // STRETCHES
    cut = histories[:, : STRETCHES * long].reshape(-1, STRETCHES, long).transpose(1, 0, 2) * np.sqrt(0.5 * samples)
    sums = cut[:, :count] @ cut[:, count:].transpose(0, 2, 1)
    remaining = np.eye(count) - sums[:, :, :count]
    return np.asarray(np.linalg.solve(remaining, sums[:, :, count:]), dtype=np.float64)[:, :, 0]
