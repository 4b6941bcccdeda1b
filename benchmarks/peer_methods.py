"""Duffing's k, c and k3 from force and displacement, by other packages and by ours, behind one signature.

Each takes a record and gives ``{"k": ..., "c": ..., "k3": ...}``; what it does not find is nan. Only this file
knows of PySINDy and SysIdentPy. Each is given the settings, among those tried, with which it does best.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pysindy
from sysidentpy.basis_function import Polynomial
from sysidentpy.model_structure_selection import FROLS
from sysidentpy.parameter_estimation import LeastSquares

from study.equations.model import Model
from study.identify import estimators
from study.identify.estimators.base import Settings
from study.identify.time_domain.free_run_fit import fit_free_run
from study.records.record import Record
from study.records.spectra import Segments

Coefficients = dict[str, float]
Method = Callable[[Model, Record], Coefficients]
SETTINGS = Settings(Segments(), (0.3, 10.0))  # the study's own
WANTED = ("k", "c", "k3")
STEPS = 4  # Runge-Kutta steps a sample, as the study's estimator takes them
THRESHOLD = 0.02  # for PySINDy on scaled columns: with its default, 0.1, damping is lost under noise
EDGE = 100  # samples at each end that PySINDy does not see: a spectral derivative rings there
MOST_TERMS = 20  # that FROLS may choose; BIC decides how many


def ours(name: str, model: Model, record: Record) -> Coefficients:
    """One of the study's estimators."""
    found = estimators.identify(name, model, record, SETTINGS).estimate
    assert found is not None
    return dict(zip(found.symbols, found.values.tolist(), strict=True))


def output_error(model: Model, record: Record) -> Coefficients:
    """The fit in free run, begun with MI/SO."""
    fit = fit_free_run(model, record, start=ours("miso", model, record), steps_per_sample=STEPS)
    if not fit.converged:
        return dict.fromkeys(WANTED, math.nan)
    return {key: fit.estimate[key] for key in WANTED}


def pysindy_scaled(_model: Model, record: Record) -> Coefficients:
    """PySINDy with spectral derivatives, every column divided by its root mean square beforehand."""
    derivative = pysindy.SpectralDerivative()
    u, force = record["displacement"], record["force"]
    v = derivative(u[:, None], record.dt)[:, 0]
    a = derivative(v[:, None], record.dt)[:, 0]
    size = {"u": _rms(u), "v": _rms(v), "f": _rms(force), "a": _rms(a)}
    inner = slice(EDGE, -EDGE)
    model = pysindy.SINDy(pysindy.STLSQ(threshold=THRESHOLD), pysindy.PolynomialLibrary(degree=3))
    model.fit(
        np.column_stack([u / size["u"], v / size["v"]])[inner], t=record.dt,
        x_dot=np.column_stack([v / size["v"], a / size["a"]])[inner], u=(force / size["f"])[inner, None],
        feature_names=["u", "v", "f"],
    )  # fmt: skip
    return _from_slope(model, size)


def pysindy_defaults(_model: Model, record: Record) -> Coefficients:
    """PySINDy as it comes, in SI units; told only that cubes may occur, without which there is no k3 to find."""
    u, force = record["displacement"], record["force"]
    v = np.asarray(pysindy.FiniteDifference()(u[:, None], record.dt))[:, 0]
    model = pysindy.SINDy(feature_library=pysindy.PolynomialLibrary(degree=3))
    model.fit(np.column_stack([u, v]), t=record.dt, u=force[:, None], feature_names=["u", "v", "f"])
    return _from_slope(model, dict.fromkeys("uvfa", 1.0))


def _from_slope(model: pysindy.SINDy, size: dict[str, float]) -> Coefficients:
    """From ``dv/dt = (f - c v - k u - k3 u^3) / m`` in scaled variables; a term that was not chosen counts as zero."""
    found = dict(zip(model.get_feature_names(), model.coefficients()[1].tolist(), strict=True))
    if found["f"] == 0.0:
        return dict.fromkeys(WANTED, math.nan)
    force = size["f"] / found["f"]
    return {
        "k": -found["u"] * force / size["u"],
        "c": -found["v"] * force / size["v"],
        "k3": -found["u^3"] * force / size["u"] ** 3,
    }


@dataclass(frozen=True)
class Lags:
    """Lags of displacement and force, in samples; force lags begin with ``first``."""

    displacement: int
    force: int
    first: int = 1


def sysidentpy_frols(lags: Lags, extended: bool, _model: Model, record: Record) -> Coefficients:
    """SysIdentPy: a polynomial NARX of degree 3, terms by FROLS and BIC, on scaled channels."""
    size = {"u": _rms(record["displacement"]), "f": _rms(record["force"])}
    force = np.roll(record["force"], lags.first - 1) / size["f"]
    inner = slice(0, len(force) - 1)  # a rolled force ends with a sample that is not its own
    model = FROLS(
        ylag=lags.displacement, xlag=lags.force, basis_function=Polynomial(degree=3), order_selection=True,
        info_criteria="bic", n_info_values=MOST_TERMS, estimator=LeastSquares(unbiased=extended),
    )  # fmt: skip
    model.fit(X=force[inner, None], y=(record["displacement"] / size["u"])[inner, None])
    codes = [tuple(sorted(code)) for code in np.asarray(model.final_model).tolist()]
    found = dict(zip(codes, np.ravel(model.theta).tolist(), strict=True))
    return _from_difference_equation(found, lags, size, record.dt)


def _from_difference_equation(
    found: dict[tuple[int, ...], float], lags: Lags, size: dict[str, float], dt: float
) -> Coefficients:
    """From a difference equation to the differential one; SysIdentPy codes u(n-1) as 1001 and f(n-1) as 2001.

    At rest all lags of u are one u, and the equation reads ``(1 - sum a) u - (sum d) u^3 = (sum b) f``: k and k3.
    The roots z of the linear part are ``exp(s dt)``; of its two slowest poles s the product is k / m and the sum
    -c / m. This holds whatever dt and lags are, as central differences would not.
    """
    linear = [found.get((0, 0, 1001 + lag), 0.0) for lag in range(lags.displacement)]
    gain = sum(found.get((0, 0, 2001 + lag), 0.0) for lag in range(lags.force)) * size["u"] / size["f"]
    cubic = sum(value for code, value in found.items() if all(1000 < part < 2000 for part in code))
    roots = np.roots([1.0, *(-a for a in linear)])
    roots = roots[np.argsort(-np.abs(roots))][:2]
    if gain == 0.0 or np.any(roots == 0.0):
        return dict.fromkeys(WANTED, math.nan)
    poles = np.log(roots.astype(np.complex128)) / dt
    k = (1.0 - sum(linear)) / gain
    mass = k / float(np.prod(poles).real)
    return {"k": k, "c": -float(np.sum(poles).real) * mass, "k3": -cubic / size["u"] ** 2 / gain}


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


PEERS: dict[str, Method] = {
    "PySINDy, defaults": pysindy_defaults,
    "PySINDy, scaled by hand": pysindy_scaled,
    "SysIdentPy, 2 lags": partial(sysidentpy_frols, Lags(2, 2), False),
    "SysIdentPy, 3 lags, extended": partial(sysidentpy_frols, Lags(3, 3, 0), True),
}
OURS: dict[str, Method] = {
    "`miso`": partial(ours, "miso"),
    "`local_polynomial`": partial(ours, "local_polynomial"),
    "`output_error`": output_error,
}
