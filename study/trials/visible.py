"""Whether a drawn record can show its hidden effect at all, before any diagnosis of it.

What shows is asked of the true model alone (the bound of Cramer and Rao), so that no property of the search decides
which trials there are.
"""

import numpy as np
from scipy.special import ndtri

from study.equations.free_run import predict_response
from study.equations.model import Model
from study.faults.kinds_of_tests import made_ready
from study.identify.time_domain.part_fit import fit_part, linearise
from study.records.record import SI_UNITS, Record
from study.records.record_layout import Layout
from study.support.arrays import Floats
from study.support.errors import StudyError
from study.support.thresholds import ALPHA

CANDIDATES = 20  # about as many are asked for
VISIBLE = float(-ndtri(ALPHA / CANDIDATES) + ndtri(0.95))  # standard errors at which 19 of 20 tests find an effect
PUSH, SLIGHT = 20, 1e-6  # samples in which the force is disturbed, and by which share of its size
RUNS = 6  # of the fit that finds the states of the stretches of a record without noise, from the truth


def stands_out(clean: Record, truth: Model, name: str, noise: float) -> bool:
    """Whether the coefficient of an effect would stand ``VISIBLE`` standard errors from zero, of white noise.

    Parameters
    ----------
    clean : Record
        As measured, without noise.
    truth : Model
        What made it.
    name : str
        The hidden effect.
    noise : float
        Standard deviation of the noise on what is predicted, in its unit.
    """
    try:
        error = noise * _spread(clean, truth, name)
    except StudyError:
        return False
    entry = next(t for t in truth.terms if t.name == name)
    return abs(entry.coefficients[0] or 0.0) >= VISIBLE * error


def _spread(clean: Record, truth: Model, name: str) -> float:
    """Standard error of the coefficient of an effect in a fit of the true model, by noise of unit variance."""
    model, prepared = made_ready([clean], truth.with_values(dict.fromkeys(truth.values)), Layout())
    start = {key: value for key, value in truth.numbers().items() if key not in model.held_keys}
    fit = fit_part(model, prepared, model.held_keys, start, max_iterations=RUNS)
    jacobian = linearise(fit, prepared)
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    inverse = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale), rcond=1e-12, hermitian=True)
    symbol = next(t for t in truth.terms if t.name == name).symbols[0]
    at = fit.keys.index(symbol)
    return float(np.sqrt(max(inverse[at, at], 0.0)) / scale[at])


def forgets(truth: Model, force: Floats, dt: float, steps: int) -> bool:
    """Whether a slight disturbance of the force at its start matters less and less.

    That of a chaotic system matters more and more: no free run follows it.
    """
    disturbed = force.copy()
    begin = int(np.argmax(np.abs(force) > 0.5 * float(np.max(np.abs(force)))))
    disturbed[begin : begin + PUSH] += SLIGHT * float(np.max(np.abs(force)))
    initial = (0.0,) * (2 + len(truth.states))
    records = [Record(dt, {"force": f}, dict(SI_UNITS)) for f in (force, disturbed)]
    one, other = (predict_response(truth, r, steps_per_sample=steps, initial=initial) for r in records)
    early, late = np.array_split((one - other)[begin:], 2)
    return float(np.std(late)) < float(np.std(early))
