"""Lines that stand out of what a structure leaves: frequencies that a periodic effect may have."""

import numpy as np
from scipy.fft import irfft, rfft

from study.identify.time_domain.shape_search import highest_lines, windowed
from study.support.arrays import Complexes, Floats

PEAKS = 8  # lines that are tried as the frequency of a periodic effect
RARE = 1e-3  # of the largest: lines at which a modulation could hardly show


def placed_residual_lines(residual: Floats) -> Floats:
    """Lines that stand out of the residuals' own spectra; ``residual`` has shape (samples, sensors)."""
    return np.array(highest_lines(np.sum([np.abs(windowed(x)) ** 2 for x in residual.T], axis=0)))


def placed_modulation_lines(u: Floats, path: Complexes, residual: Floats) -> Floats:
    """Lines at which a stiffness of a place that varies with time would explain most, by a matched filter.

    ``path`` leads from a force at the place to the sensors, shape (lines, sensors), ``residual`` and the relative
    displacement ``u`` have as many samples as these lines are of.
    """
    n = len(u)
    spectra = np.asarray(rfft(residual, axis=0), dtype=np.complex128)
    matched = np.asarray(irfft(np.sum(np.conj(path) * spectra, axis=1), n), dtype=np.float64)
    numerator = np.abs(windowed(matched * u)) ** 2
    passband = np.asarray(irfft(np.sum(np.abs(path) ** 2, axis=1), n), dtype=np.float64)
    spread = np.asarray(irfft(np.abs(np.asarray(rfft(u), dtype=np.complex128)) ** 2, n), dtype=np.float64)
    expected = np.abs(np.asarray(rfft(passband * spread), dtype=np.complex128))
    explained = numerator / np.maximum(expected, RARE * np.max(expected))
    inner = np.arange(3, len(explained) - 1)
    peaks = inner[(explained[inner] >= explained[inner - 1]) & (explained[inner] > explained[inner + 1])]
    return peaks[np.argsort(-explained[peaks])][:PEAKS].astype(np.float64)
