"""Starting values where coefficients vary: the equation of motion along the measured motion, weighted like a response.

A free run with a constant stiffness loses a motion whose frequency changes by a third, and no step from there finds it
again. The equation of motion is linear in all coefficients and their changes, and needs no run.
"""

import numpy as np
from scipy.fft import rfft, rfftfreq

from study.equations.model import Model, ModelTerm
from study.equations.variation import STEP_AT
from study.identify.frequency_domain.inputs import INERTIA, Input, input_history, reverse_inputs
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Record
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.least_squares import least_squares
from study.support.lowest import lowest


def start_of_changes(model: Model, entry: ModelTerm, prepared: Prepared) -> dict[str, float]:
    """Coefficients by :func:`along_the_equation`, and of a step the moment that leaves least.

    Of those that it may have, then ever closer about the best: a step that is dated some periods wrong turns the phase
    of all that follows, and no free run finds back from there.
    """
    variation = entry.term.variation
    if variation is None or variation.shape != "step" or None not in entry.parameters:
        return along_the_equation(model, prepared)[0]
    moment = next(key for key in entry.keys if key.endswith(f".{STEP_AT}"))
    places = next(p.search.places for p in entry.term.parameters if p.name == STEP_AT)
    tried = np.quantile(variation.values(prepared.record)[slice(*prepared.plan.fit)], places)

    def left(at: float) -> float:
        return along_the_equation(model.with_values({moment: at}), prepared)[1]

    at = lowest(left, tried.tolist(), 0.5 * (variation.lasts or 0.0))
    return along_the_equation(model.with_values({moment: at}), prepared)[0] | {moment: at}


def along_the_equation(model: Model, prepared: Prepared) -> tuple[dict[str, float], float]:
    """Coefficients of a single mass by least squares along each run of the fitting part, and what they leave.

    Shape parameters are known.

    Both sides of the equation pass a low-pass filter like the receptance, under a taper, so that noise on a derivative
    weighs as it does in a response. Of free motions they are per unit of the mass that the model gives.

    Raises
    ------
    StudyError
        If the motions are not there or the solution is not finite.
    """
    expect(prepared.response != FORCE, "a prescribed motion needs no start")
    part = prepared.record.part(*prepared.inner(prepared.plan.fit))
    inputs = reverse_inputs(model)
    rate = float(np.std(part["velocity"]) / np.std(part["displacement"]))
    mass = model.values.get("m") or 1.0
    rows, targets = list[Floats](), list[Floats]()
    symbols = [p.symbol for item in inputs for p in item.parts if not (prepared.free and p.order == INERTIA)]
    for first, last in part.runs((0, len(part))):
        run = part.part(first, last)
        acting = -mass * run["acceleration"] if prepared.free else run[FORCE]
        columns = [_force(item, k, run) for item in inputs for k, p in enumerate(item.parts) if p.symbol in symbols]
        rows.append(np.column_stack([_weighed(column, run.dt, rate) for column in columns]))
        targets.append(_weighed(acting, run.dt, rate))
    design, target = np.concatenate(rows), np.concatenate(targets)
    found = least_squares(design, target, 1e-9)
    if not np.all(np.isfinite(found)):
        raise StudyError(f"the equation of {model.name!r} along {part.name!r} has no solution")
    left = float(np.sum((target - design @ found) ** 2))
    return dict(zip(symbols, found.tolist(), strict=True)) | ({"m": mass} if prepared.free else {}), left


def _force(item: Input, number: int, run: Record) -> Floats:
    """The force of one coefficient of an input with a unit value, shape (n,)."""
    part = item.parts[number]
    if item.linear:
        return part.factor * run[MOTIONS[part.order]]
    values = input_history(item, run)
    for _ in range(part.order):
        values = np.gradient(values, run.dt)
    return np.asarray(part.factor * values, dtype=np.float64)


def _weighed(values: Floats, dt: float, rate: float) -> Floats:
    """Lines of a history under a taper, weighed as a receptance does above the frequency of the motion."""
    lines = np.asarray(rfft(values * np.hanning(len(values) + 2)[1:-1]))
    omega = 2.0 * np.pi * np.asarray(rfftfreq(len(values), dt))
    lines = lines / (1.0 + (omega / rate) ** 2) / np.sqrt(len(values))
    return np.concatenate([lines.real, lines.imag])
