"""Records sampled too coarsely for their motion: there third harmonics fold onto the motion itself."""

import numpy as np
from scipy.fft import rfft, rfftfreq

from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS

MOST = 2.0 / 3.0  # of the power: a record of white noise has half of it in the upper half of its band


def too_coarse(prepared: Prepared) -> str:
    """A sentence on a motion most of whose power lies above half the Nyquist frequency; empty where it does not.

    There are fewer than four samples in a period then: the third harmonic of such a motion, which any odd nonlinearity
    makes, folds to frequencies within it, and a motion from above the Nyquist frequency looks no different. The power
    is that of the displacement, which falls above the resonance, whatever motion was measured.
    """
    if prepared.response == FORCE or prepared.free:
        return ""
    values = prepared.fitted - np.mean(prepared.fitted)
    frequency = np.asarray(rfftfreq(len(values), prepared.dt))
    inside = frequency >= max(prepared.band[0], frequency[1])
    power = np.abs(np.asarray(rfft(values * np.hanning(len(values)))))[inside] ** 2
    power /= frequency[inside] ** (2 * MOTIONS.index(prepared.response))
    total, nyquist = np.cumsum(power), 0.5 / prepared.dt
    above = 1.0 - np.interp(0.5 * nyquist, frequency[inside], total) / total[-1]
    if above <= MOST:
        return ""
    middle = float(frequency[inside][np.searchsorted(total, 0.5 * total[-1])])
    return (
        f"the record {prepared.record.name} is sampled too coarsely: {1.0 / (middle * prepared.dt):.1f} times a period "
        f"of its motion at {middle:.3g} Hz, or that comes from above {nyquist:.3g} Hz and only looks so; a fit means "
        "little, as third harmonics fold onto the motion itself; expected four samples a period or more"
    )
