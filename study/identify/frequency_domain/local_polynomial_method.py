"""Frequency response functions by local polynomials: one transform of the whole record, no window, no segments.

In a narrow band of lines the spectrum of the output is, line by line,
``Y(k) = sum_j A_j(f_k) X_j(k) + T(f_k) + N(k)``. ``T`` is the leakage of a record that does not close on
itself: by partial integration, ``u'`` has the transform ``j 2 pi f U`` and the jump from the last sample to
the first, which is smooth in f whatever the input. So A_j and T are polynomials of low degree across the
band, and least squares separates them (Pintelon and Schoukens, System Identification, 2012, chapter 7).
A window would smear both. In reverse A_j is a polynomial everywhere: m (j 2 pi f)^2 + c j 2 pi f + k.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import rfft

from study.identify.frequency_domain.responses import Responses
from study.support.arrays import Complexes, Floats, Ints
from study.support.errors import StudyError

CHUNK = 256  # bands solved at a time: memory does not grow with bands times inputs
SPARE = 8  # lines in a band beyond the unknowns, to estimate the noise from
EXACT = 1e-12  # singular values and variances below this share of the largest are rounding
SILENT = 1e-13  # a line below this share of an input's largest is the rounding of the others


@dataclass(frozen=True)
class LocalPolynomial:
    """Width of the local bands, and degree of the polynomials in them.

    Attributes
    ----------
    degree : int
        Of every polynomial.
    half_width : int
        Lines of the band on either side of its middle.
    """

    degree: int = 2
    half_width: int = 40

    def __post_init__(self) -> None:
        """Refuse what is no polynomial or no band."""
        if self.degree < 0:
            raise StudyError(f"local_polynomial.degree is {self.degree}; at least 0 is needed")
        if self.half_width < 1:
            raise StudyError(f"local_polynomial.half_width is {self.half_width}; at least 1 line is needed")

    @property
    def width(self) -> int:
        """Lines in a band."""
        return 2 * self.half_width + 1

    def check(self, inputs: int) -> None:
        """Refuse bands with too few lines for so many inputs, naming the half width that would do."""
        unknowns = (inputs + 1) * (self.degree + 1)
        if self.width < unknowns + SPARE:
            raise StudyError(
                f"local_polynomial.half_width is {self.half_width}; {inputs} inputs of degree {self.degree} have "
                f"{unknowns} unknowns in a band, which needs {(unknowns + SPARE) // 2} or more"
            )


@dataclass(frozen=True)
class Lines:
    """Transforms of whole records.

    Attributes
    ----------
    frequency : array, shape (lines,)
        In hertz; zero and Nyquist frequency are left out.
    inputs : complex array, shape (q, lines)
        Of the inputs, zero where an input is silent.
    output : complex array, shape (lines,)
        Of the output.
    density : float
        Factor from the mean square of a line to a one-sided autospectral density.
    samples : int
        Of the record.
    """

    frequency: Floats
    inputs: Complexes
    output: Complexes
    density: float
    samples: int


def transform(channels: Sequence[Floats], dt: float) -> Lines:
    """Transform inputs and, last, the output."""
    samples = len(channels[-1])
    lines = (samples - 1) // 2
    spectra = np.stack([np.asarray(rfft(c), dtype=np.complex128) for c in channels])
    floor = SILENT * np.max(np.abs(spectra[:-1]), axis=1, initial=0.0)
    inputs = spectra[:-1, 1 : lines + 1]
    inputs = np.where(np.abs(inputs) > floor[:, None], inputs, 0.0)
    frequency = np.arange(1, lines + 1) / (samples * dt)
    return Lines(frequency, inputs, spectra[-1, 1 : lines + 1], 2.0 * dt / samples, samples)


def local_polynomial_responses(lines: Lines, settings: LocalPolynomial) -> Responses:
    """A_j(f) with their covariance and the noise, in the middle of bands that overlap.

    Bands stand half of their half width apart. Estimates of neighbouring ones share lines and so are
    correlated; the covariance is that of each by itself.
    """
    settings.check(len(lines.inputs))
    if len(lines.frequency) < settings.width:
        raise StudyError(
            f"the record of {lines.samples} samples has {len(lines.frequency)} lines, fewer than the {settings.width} "
            "of a band of local_polynomial; expected a longer record or a smaller half_width"
        )
    first = np.arange(0, len(lines.frequency) - settings.width + 1, max(settings.half_width // 2, 1))
    index = first[:, None] + np.arange(settings.width)
    chunks = [_middles(lines, index[i : i + CHUNK], settings) for i in range(0, len(index), CHUNK)]
    values, covariance, variance = (np.concatenate([chunk[i] for chunk in chunks]) for i in range(3))
    return Responses(
        frequency=lines.frequency[first + settings.half_width],
        response=values.T.astype(np.complex128),
        covariance=covariance.astype(np.complex128),
        noise=variance.real * lines.density,
    )


def noise_variance(lines: Lines, index: Ints, settings: LocalPolynomial) -> Floats:
    """Mean square per line of what no A_j and no transient explains, for each row of line numbers in ``index``."""
    parts = [_middles(lines, index[i : i + CHUNK], settings)[2] for i in range(0, len(index), CHUNK)]
    return np.concatenate(parts)


def transients(width: int, degree: int) -> Floats:
    """Polynomials across a band, orthonormal over its lines, shape (width, degree + 1)."""
    return np.linalg.qr(_powers(width, degree))[0]


def _powers(width: int, degree: int) -> Floats:
    return np.linspace(-1.0, 1.0, width)[:, None] ** np.arange(degree + 1)


def _middles(lines: Lines, index: Ints, settings: LocalPolynomial) -> tuple[Complexes, Complexes, Floats]:
    """A_j in the middle of each band (bands, q), its covariance (bands, q, q), variance of the noise (bands,).

    The unknowns of a band are the coefficients of ``x^r`` in every A_j and in T, with x from -1 to 1; in
    the middle, A_j is that of ``x^0``. Inputs are scaled to unit mean square.
    """
    terms, count = settings.degree + 1, len(lines.inputs)
    x = lines.inputs[:, index]
    size = np.sqrt(np.mean(np.abs(x) ** 2, axis=2))
    scale = np.where(size > 0.0, size, 1.0)
    unit = np.concatenate([x / scale[:, :, None], np.ones((1, *index.shape), dtype=np.complex128)])
    powers = _powers(index.shape[1], settings.degree)
    design = (unit.transpose(1, 2, 0)[:, :, :, None] * powers[:, None, :]).reshape(*index.shape, -1)
    left, singular, right = np.linalg.svd(design, full_matrices=False)
    kept = singular > EXACT * singular[:, :1]
    inverse = np.where(kept, 1.0 / np.where(kept, singular, 1.0), 0.0)
    output = lines.output[index]
    projected = np.einsum("blp,bl->bp", left.conj(), output) * kept
    rest = output - np.einsum("blp,bp->bl", left, projected)
    variance = np.sum(np.abs(rest) ** 2, axis=1) / (index.shape[1] - np.count_nonzero(kept, axis=1))
    middle = right.conj().transpose(0, 2, 1)[:, : terms * count : terms] * inverse[:, None, :]
    middle = np.where(size.T > 0.0, 1.0 / scale.T, 0.0)[:, :, None] * middle
    values = np.einsum("bjp,bp->bj", middle, projected)
    covariance = middle @ middle.conj().transpose(0, 2, 1) * variance[:, None, None]
    return values, covariance, variance
