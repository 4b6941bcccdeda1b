"""Amplitude, frequency and damping ratio at the instant at which a decay begins.

An analytic signal knows too little near an end of the record, and a window of some periods holds their mean, while a
stiffening structure changes its frequency fastest where it is let go. A carrier with slowly changing amplitude and
phase (complex demodulation: P. Bloomfield, Fourier Analysis of Time Series, 1976), fitted to the first periods alone by
least squares, is evaluated where they begin; it needs nothing from outside of the window.
"""

import numpy as np

from study.support.arrays import Floats

DEGREE = 3  # of the polynomial that the carrier's complex amplitude is
OVERTONES = 3  # of the motion, which a carrier alone would leave


def at_the_release(values: Floats, dt: float, omega: float, independent: float) -> tuple[float, ...]:
    """Amplitude, natural frequency in Hz, damping ratio, and the standard errors of these two.

    Parameters
    ----------
    values : array of shape (n,)
        The first periods of a decay.
    dt : float
        Sampling interval in seconds.
    omega : float
        Of the carrier, near that of the motion, in rad/s.
    independent : float
        How many independent values the samples hold: what is left swings with the motion.
    """
    t = dt * np.arange(len(values))
    turn = omega * t
    slow = np.asarray(t[:, None] ** np.arange(DEGREE + 1), dtype=np.float64)
    around = [slow * np.cos(turn)[:, None], -slow * np.sin(turn)[:, None]]
    carrier: Floats = np.stack(around, axis=2).reshape(len(t), -1)
    beside: list[Floats] = [f(n * turn) for n in range(2, OVERTONES + 1) for f in (np.cos, np.sin)]
    design = np.asarray(np.column_stack([carrier, *beside, np.ones_like(t)]), dtype=np.float64)
    size = np.asarray(np.linalg.norm(design, axis=0), dtype=np.float64)
    scaled: Floats = design / size
    inverse = np.asarray(np.linalg.pinv(scaled.T @ scaled), dtype=np.float64)
    found: Floats = inverse @ (scaled.T @ values)
    left = values - scaled @ found
    spare = max(independent * (1.0 - scaled.shape[1] / len(values)), 1.0)
    covariance: Floats = inverse[:4, :4] * float(left @ left) / spare
    a, b, da, db = (float(x) for x in found[:4] / size[:4])
    z, slope = complex(a, b), complex(da, db)
    growth = slope / z  # rate of the amplitude's logarithm, and of the phase beside the carrier's
    fall, rate = growth.real, omega + growth.imag
    natural = float(np.hypot(rate, fall))
    gradient = np.array([-growth / z, -1j * growth / z, 1.0 / z, 1j / z]) / size[:4]
    errors = [float(np.sqrt(part @ covariance @ part)) for part in (gradient.imag, gradient.real)]
    return abs(z), natural / (2.0 * np.pi), -fall / natural, errors[0] / (2.0 * np.pi), errors[1] / natural
