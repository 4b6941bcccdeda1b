"""Natural frequency and damping ratio of the linear part of a fitted model, (4.4) and (4.5)."""

import math

import numpy as np

from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import linearise, uncertainty
from study.records.prepared import Prepared
from study.support.arrays import Floats

Value = tuple[float, float, str]  # value, standard error, unit


def modal(fit: FreeRunFit, prepared: Prepared) -> tuple[Value | None, Value | None]:
    """f_n in hertz and zeta with standard errors to first order; None where the model lacks what they follow from.

    The units of the record do not matter to f_n if they are consistent: m, c and k are of one system of units.
    """
    values = fit.model.numbers()
    if not (values.get("m", 0.0) > 0.0 and values.get("k", 0.0) > 0.0):
        return None, None
    m, k, c = values["m"], values["k"], values.get("c")
    covariance = _covariance(fit, prepared)
    rate = math.sqrt(k / m)
    f_n = rate / (2.0 * math.pi)
    slope = {"k": f_n / (2.0 * k), "m": -f_n / (2.0 * m)}
    natural = (f_n, _error(slope, fit, covariance), "Hz")
    if c is None:
        return natural, None
    zeta = c / (2.0 * math.sqrt(k * m))
    slope = {"c": 0.5 / math.sqrt(k * m), "k": -zeta / (2.0 * k), "m": -zeta / (2.0 * m)}
    return natural, (zeta, _error(slope, fit, covariance), "")


def _covariance(fit: FreeRunFit, prepared: Prepared) -> Floats:
    """Covariance of what was fitted, for a residual that need not be white."""
    if not fit.keys or fit.restarts:
        return fit.covariance
    return uncertainty(fit, prepared, linearise(fit, prepared))


def _error(slope: dict[str, float], fit: FreeRunFit, covariance: Floats) -> float:
    """Standard error to first order; NaN where all that it follows from was held."""
    places = [fit.keys.index(key) for key in slope if key in fit.keys]
    if not places:
        return math.nan
    gradient = np.array([slope[fit.keys[i]] for i in places])
    return math.sqrt(max(float(gradient @ covariance[np.ix_(places, places)] @ gradient), 0.0))
