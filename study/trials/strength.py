"""How strong is an effect: the share of the restoring force that it carries and no linear model can take over."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.equations.model import Model, ModelTerm
from study.equations.simulate import Integrator, simulate
from study.identify.frequency_domain.inputs import Input, input_history, reverse_inputs
from study.records.record import Record
from study.support.errors import DivergenceError
from study.support.least_squares import least_squares

Floats = NDArray[np.float64]
SHARE = (0.10, 0.40)  # of the rms restoring force, in every trial
ROUNDS = 12  # of the iteration on the amount
STEEPEST = 3.0  # power of the amount by which a share is taken to grow, or one over it, at most
FARTHEST = 100.0  # logarithm of what an amount may grow by at once; with far less the motion escapes
CLOSE = 0.05  # relative distance from the wanted share at which it ends


def grown_to_share(
    model: Model, entry: ModelTerm, drive: Floats, dt: float, target: float, steps: int = 2, *, secant: bool = False
) -> tuple[Model, float] | None:
    """The model with an effect that carries the target share, by iteration on the simulated motion.

    The coefficients of ``entry`` say in which proportion, and with which sign, they grow; ``drive`` is the force in N,
    shape (n,), ``target`` the wanted share and ``steps`` those of the integration a sample. With ``secant`` the share
    is taken for that power of the amount which the last two show, otherwise for its square: slow where damping calms
    the motion that it acts on. With the model comes the share that was reached; None where the motion diverges or the
    share cannot be reached.
    """
    unit = tuple(c if c is not None else 1.0 for c in entry.coefficients)
    amount, share, before = 0.0, 0.0, (0.0, 0.0)
    record = simulate(model, drive, dt, Integrator("rk4", steps))
    for _ in range(ROUNDS):
        alone = _unshared(replace(entry, coefficients=unit), record)
        restoring = drive - (model.values["m"] or 0.0) * record["acceleration"]
        share = amount * alone / float(np.std(restoring))
        if amount > 0.0 and abs(share / target - 1.0) < CLOSE:
            return model.with_term(replace(entry, coefficients=tuple(amount * c for c in unit))), share
        if alone == 0.0:
            return None
        wanted = target * float(np.std(restoring)) / alone
        at = (amount, share)
        amount, before = _amount(before, at, wanted) if secant else _between(amount, wanted), at
        larger = model.with_term(replace(entry, coefficients=tuple(amount * c for c in unit)))
        try:
            record = simulate(larger, drive, dt, Integrator("rk4", steps))
        except DivergenceError:
            return None
    return None


def _between(amount: float, wanted: float) -> float:
    return wanted if amount == 0.0 else float(np.sqrt(amount * wanted))


def _amount(one: tuple[float, float], other: tuple[float, float], wanted: float) -> float:
    """The next amount from the last two with their shares; ``wanted`` if the share grew as the amount does."""
    if not (min(*one, *other) > 0.0 and math.isfinite(other[1]) and one[0] != other[0]):
        return _between(other[0], wanted)
    slope = math.log(other[1] / one[1]) / math.log(other[0] / one[0])
    steps = math.log(wanted / other[0]) / min(max(slope, 1.0 / STEEPEST), STEEPEST)
    return other[0] * math.exp(min(steps, FARTHEST))


def share_of(model: Model, name: str, record: Record) -> float:
    """Share of the rms restoring force that a term carries and no linear model can take over."""
    entry = next(t for t in model.terms if t.name == name)
    restoring = record["force"] - (model.values["m"] or 0.0) * record["acceleration"]
    return _unshared(entry, record) / float(np.std(restoring))


def _unshared(entry: ModelTerm, record: Record) -> float:
    """Root mean square of a term's force less its best fit by displacement, velocity and acceleration."""
    own = _force(entry, record)
    motion = np.column_stack([record[c] for c in ("displacement", "velocity", "acceleration")])
    rest = own - motion @ least_squares(motion, own)
    return float(np.sqrt(np.mean(rest**2)))


def _force(entry: ModelTerm, record: Record) -> Floats:
    """The force of one term along a record: what a system of this term and unit mass leaves of no force."""
    total = np.zeros(len(record))
    model = Model("alone", (entry,))
    for item in reverse_inputs(model):
        values = input_history(item, record)
        for part in item.parts:
            rate = values if part.order == 0 else _rate(item, record)
            total = total + (model.values[part.symbol] or 0.0) * part.factor * rate
    return total


def _rate(item: Input, record: Record) -> Floats:
    """Time derivative of a shape of displacement alone, by the chain rule on a fine difference."""
    u = record["displacement"]
    step = 1e-6 * float(np.std(u))
    ahead = input_history(item, record.with_channels({"displacement": u + step}))
    behind = input_history(item, record.with_channels({"displacement": u - step}))
    return (ahead - behind) / (2.0 * step) * record["velocity"]
