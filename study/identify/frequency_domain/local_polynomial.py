"""Frequency response functions and coefficients by local polynomials: one transform of the whole record, no window.

In a narrow band of lines the spectrum of the output is, line by line,
``Y(k) = sum_j A_j(f_k) X_j(k) + T(f_k) + N(k)``. ``T`` is the leakage of a record that does not close on
itself: by partial integration, ``u'`` has the transform ``j 2 pi f U`` and the jump from the last sample to
the first, which is smooth in f whatever the input. So A_j and T are polynomials of low degree across the
band, and least squares separates them (Pintelon and Schoukens, System Identification, 2012, chapter 7).
A window would smear both. In reverse A_j is a polynomial everywhere: m (j 2 pi f)^2 + c j 2 pi f + k.

The weighted least squares fit of A_j(f) to powers of j 2 pi f, on local polynomials that do not overlap and with their
full covariance, is equivalent to least squares of the output on the inputs times those powers, band by band with a
transient of its own, each band weighted by the noise that the local polynomials find in it. The latter is done here.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, rfft

from study.identify.frequency_domain.coefficients import Estimate, Responses, lines_in
from study.identify.frequency_domain.inputs import Input, symbols_of
from study.support.arrays import Complexes, Floats, Ints
from study.support.errors import StudyError
from study.support.least_squares import INDISTINCT, floored, influence

AT_A_TIME = 256  # bands solved together: memory does not grow with bands times inputs
SPARE_LINES = 8  # in a band beyond the unknowns, to estimate the noise from
PARTS = 32  # of the record, whose scatter gives the errors of coefficients


@dataclass(frozen=True)
class LocalPolynomial:
    """Width of the local bands, and degree of the polynomials in them."""

    degree: int = 2  # of every polynomial
    half_width: int = 40  # lines of the band on either side of its middle

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
        if self.width < unknowns + SPARE_LINES:
            raise StudyError(
                f"local_polynomial.half_width is {self.half_width}; {inputs} inputs of degree {self.degree} have "
                f"{unknowns} unknowns in a band, which needs {(unknowns + SPARE_LINES) // 2} or more"
            )


@dataclass(frozen=True)
class Lines:
    """Transforms of whole records."""

    frequency: Floats  # in hertz, shape (lines,); zero and Nyquist frequency are left out
    inputs: Complexes  # of the inputs, zero where one is silent, shape (q, lines)
    output: Complexes  # shape (lines,)
    density: float  # factor from the mean square of a line to a one-sided autospectral density
    samples: int  # of the record


def transform(channels: Sequence[Floats], dt: float) -> Lines:
    """Transform inputs and, last, the output."""
    samples = len(channels[-1])
    lines = (samples - 1) // 2
    spectra = np.stack([np.asarray(rfft(c), dtype=np.complex128) for c in channels])
    floor = INDISTINCT * np.max(np.abs(spectra[:-1]), axis=1, initial=0.0)  # below is the rounding of other lines
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
    values, covariance, variance = _middles(lines, index, settings)
    return Responses(lines.frequency[first + settings.half_width], values.T, covariance, variance * lines.density)


def noise_variance(lines: Lines, index: Ints, settings: LocalPolynomial) -> Floats:
    """Mean square per line of what no A_j and no transient explains, for each row of line numbers in ``index``."""
    return _middles(lines, index, settings)[2]


def transients(width: int, degree: int) -> Floats:
    """Polynomials across a band, orthonormal over its lines, shape (width, degree + 1)."""
    return np.linalg.qr(_powers(width, degree))[0]


def _powers(width: int, degree: int) -> Floats:
    return np.linspace(-1.0, 1.0, width)[:, None] ** np.arange(degree + 1)


def _middles(lines: Lines, index: Ints, settings: LocalPolynomial) -> tuple[Complexes, Complexes, Floats]:
    """A_j in the middle of each band (bands, q), its covariance (bands, q, q), variance of the noise (bands,)."""
    found = [_solved(lines, index[i : i + AT_A_TIME], settings) for i in range(0, len(index), AT_A_TIME)]
    values, covariance = (np.concatenate([part[k] for part in found]).astype(np.complex128) for k in (0, 1))
    return values, covariance, np.concatenate([part[2] for part in found])


def _solved(lines: Lines, index: Ints, settings: LocalPolynomial) -> tuple[Complexes, Complexes, Floats]:
    """The same for some of the bands.

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
    kept = singular > INDISTINCT * singular[:, :1]
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


def fit_local_polynomial(
    lines: Lines, inputs: Sequence[Input], band: tuple[float, float], settings: LocalPolynomial
) -> tuple[Estimate, Floats]:
    """Coefficients of all inputs that have power from the first to the second frequency of ``band`` (Hz).

    Local bands are widened until few lines are left over.

    The residual force is no stationary noise. Without measurement noise it comes from too coarse a sampling, in bursts
    where the motion is large; with noise on the motion, it is that noise times u^2. Lines are then not independent, and
    inverse variances give errors that are too small by up to a factor of ten. The influence of each line on a
    coefficient is therefore transformed back to time, where sums of influence times residual over stretches that are
    longer than the system's memory are independent; their scatter gives the covariance (a sandwich estimate with
    clusters, by jackknife: Bell and McCaffrey, Survey Methodology 28, 2002).

    Returns
    -------
    estimate : Estimate
    shifts : array, shape (PARTS, coefficients)
        How far the coefficients move when one stretch of time after the other is left out: those of two equations of
        one record give the covariance between them.
    """
    settings.check(len(inputs))
    inside = np.flatnonzero(lines_in(lines.frequency, band))
    count = len(inside) // settings.width
    if count == 0:
        raise StudyError(
            f"the record of {lines.samples} samples has {len(inside)} lines from {band[0]:g} to {band[1]:g} Hz; "
            f"local_polynomial needs {settings.width}; expected a longer record, a wider band or a smaller half_width"
        )
    width = len(inside) // count
    index = inside[: count * width].reshape(count, width)  # bands side by side, equally wide
    weight = 1.0 / np.sqrt(floored(noise_variance(lines, index, settings)))[:, None]
    basis = transients(width, settings.degree)

    def clean(values: Complexes) -> Complexes:
        """Lines of each band less their transient, weighted, in one row."""
        return ((values - (values @ basis) @ basis.T) * weight).ravel()

    powers = [item.powers(lines.frequency[index].ravel()).T.reshape(-1, *index.shape) for item in inputs]
    design = np.stack([clean(p * lines.inputs[j][index]) for j, own in enumerate(powers) for p in own], axis=1)
    target, size = clean(lines.output[index]), np.linalg.norm(design, axis=0)
    driven, size = size > 0.0, size[size > 0.0]
    design = design[:, driven] / size
    moves = influence(design, np.ones(len(design)))
    values = (moves @ target).real
    each = np.broadcast_to(weight, index.shape).ravel()
    residual = (target - design @ values) / each
    shifts = _shifts(moves.conj() * each, design.T / each, residual, index.ravel(), lines.samples) / size
    symbols = tuple(s for s, known in zip(symbols_of(inputs), driven, strict=True) if known)
    return Estimate(symbols, values / size, covariance_between(shifts, shifts), PARTS - 1.0), shifts


def covariance_between(first: Floats, second: Floats) -> Floats:
    """Covariance of two sets of coefficients from how far both move without each stretch of time (jackknife)."""
    return first.T @ second * ((PARTS - 1.0) / PARTS)


def _shifts(
    moves: Complexes, design: Complexes, residual: Complexes, index: Ints, samples: int
) -> Floats:  # fmt: skip
    """Shifts of ``Re(conj(moves) . noise)`` on leaving out one stretch of time after the other, (PARTS, p).

    Over a stretch, influence times residual sums to s and influence times design to H; all H sum to the
    identity. Without the stretch the coefficients would shift by ``(1 - H)^-1 s``: H is the share of the stretch's own
    noise that they have followed, which is large where a single burst of motion determines most of a coefficient.
    """
    count = len(moves)
    spectra = np.zeros((2 * count + 1, samples // 2 + 1), dtype=np.complex128)
    spectra[:, index + 1] = np.concatenate([moves, design, residual[None]])
    histories = np.asarray(irfft(spectra, samples, axis=1), dtype=np.float64)
    long = samples // PARTS
    cut = histories[:, : PARTS * long].reshape(-1, PARTS, long).transpose(1, 0, 2) * np.sqrt(0.5 * samples)
    sums = cut[:, :count] @ cut[:, count:].transpose(0, 2, 1)
    remaining = np.eye(count) - sums[:, :, :count]
    return np.asarray(np.linalg.solve(remaining, sums[:, :, count:]), dtype=np.float64)[:, :, 0]
