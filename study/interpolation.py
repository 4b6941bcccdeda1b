"""Band-limited values between the samples.

A measured force is known at its samples only. Holding it, or joining the samples by straight lines,
adds harmonics and a delay that an integrator with several steps a sample would take for real. The
band-limited interpolation is exact for a record without content above its Nyquist frequency.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft

Floats = NDArray[np.float64]
EDGE = 512  # samples by which a record that does not close on itself is continued at each end


def between_samples(values: Floats, factor: int) -> Floats:
    """Values on a grid ``factor`` times as fine.

    Parameters
    ----------
    values : array, shape (n,)
        Samples. If the record closes on itself to within its own typical step it is taken as
        periodic, which is exact for a periodic excitation; otherwise its ends are continued by
        point reflection and faded, which confines the error to the first and last few samples.
    factor : int
        Grid points for each sample.

    Returns
    -------
    array, shape (factor (n - 1) + 1,)
        Its every ``factor``-th value is the sample itself.
    """
    n = len(values)
    if factor == 1 or n == 1:
        return values.copy()
    step = float(np.sqrt(np.mean(np.diff(values) ** 2)))
    if abs(values[-1] - values[0]) <= 3.0 * step:
        return _periodic(values, factor)[: factor * (n - 1) + 1]
    edge = min(EDGE, n - 1)
    fade = 0.5 - 0.5 * np.cos(np.pi * np.arange(edge) / edge)
    before = (2.0 * values[0] - values[edge:0:-1]) * fade
    after = (2.0 * values[-1] - values[-2 : -edge - 2 : -1]) * fade[::-1]
    fine = _periodic(np.concatenate([before, values, after]), factor)
    return fine[factor * edge : factor * (edge + n - 1) + 1]


def _periodic(values: Floats, factor: int) -> Floats:
    n = len(values)
    spectrum = rfft(values)
    if n % 2 == 0:
        spectrum[-1] *= 0.5  # the Nyquist line stands for both signs of frequency
    return irfft(spectrum, factor * n) * factor
