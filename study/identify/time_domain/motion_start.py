"""A fit that begins at the measured motion itself, for one that has lost it, as a free run between two wells does.

Least squares of the force on the forces of all terms along the motion has no local minima and asks for no free run, but
noise on the motion biases it. So it is where multiple shooting begins, and the end of nothing.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from study.equations.model import Model
from study.identify.frequency_domain.inputs import Input, histories, reverse_inputs
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.multiple_shooting import fit_in_segments
from study.identify.time_domain.stretch_states import is_smooth, resembles_a_motion
from study.records.completion import derivative
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Record
from study.support.errors import StudyError
from study.support.least_squares import least_squares

Floats = NDArray[np.float64]
REACH, STEP = 4.0, 0.1  # samples by which a response may be late, tried so far apart


def has_lost_the_motion(fit: FreeRunFit, prepared: Prepared) -> bool:
    """Whether a driven model leaves more of the response's power than it explains, and that as smooth as a motion."""
    driven = not (prepared.free or prepared.response == FORCE or prepared.record.stretches)
    return driven and 2.0 * fit.rms**2 > prepared.spread**2 and is_smooth(fit.residual, len(fit.outputs))


def from_the_motion(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit; where it has lost the motion, one in segments begun there if these leave nothing like a motion.

    Segments with states of their own leave less than one free run of any model, and that says nothing for it.
    """
    if fit.model.named or not has_lost_the_motion(fit, prepared):  # segments begin from what one coordinate shows
        return fit
    try:
        start = motion_start(fit.model, prepared, fit.held)
        apart = fit_in_segments(
            fit.model, prepared.record, start=start, held=fit.held, outputs=prepared.outputs, span=prepared.plan.fit,
            steps_per_sample=fit.steps_per_sample,
        )  # fmt: skip
    except StudyError:
        return fit
    return fit if resembles_a_motion(apart, prepared.fitted) else apart


def motion_start(model: Model, prepared: Prepared, held: tuple[str, ...]) -> dict[str, float]:
    """Coefficients by least squares of the force along the measured motion; what is held stays.

    Raises
    ------
    StudyError
        If a shape parameter is not known, or a force has no finite value somewhere along the motion.
    """
    part = prepared.record.part(*prepared.inner(prepared.plan.fit))
    forces = _unit_forces(model, part)
    known = [(model.values[s] or 0.0) * forces[s] for s in forces if s in held]
    target = part[FORCE] - np.sum([np.zeros(len(part)), *known], axis=0)
    wanted = [s for s in forces if s not in held]
    lines = _below_the_noise(np.column_stack([*(forces[s] for s in wanted), target]), part)
    found = least_squares(lines[:, :-1], lines[:, -1], 1e-9)
    return dict(zip(wanted, found.tolist(), strict=True))


def delay_along_the_motion(model: Model, prepared: Prepared) -> float:
    """Samples by which the response seems to be late; nan where no delay within reach lets the terms explain most.

    Least squares of the force on the forces of all terms along the motion, the force as late as the motion, asks for no
    free run, which a record that is late by a part of a period sends to a minimum of its own. Noise and missing effects
    move it: a start.

    Raises
    ------
    StudyError
        If a shape parameter is not known, or a force has no finite value somewhere along the motion.
    """
    part = prepared.record.part(*prepared.inner(prepared.plan.fit))
    lines = _below_the_noise(np.column_stack([*_unit_forces(model, part).values(), part[FORCE]]), part)
    basis = np.linalg.qr(lines[:, :-1] / np.maximum(np.linalg.norm(lines[:, :-1], axis=0), np.finfo(float).tiny))[0]
    count = len(lines) // 2
    force, turn = lines[:count, -1] + 1j * lines[count:, -1], -2j * np.pi * np.arange(count) / len(part)
    late = np.arange(-REACH, REACH + STEP, STEP)
    turned = force[:, None] * np.exp(turn[:, None] * late)
    explained = np.sum((basis.T @ np.concatenate([turned.real, turned.imag])) ** 2, axis=0)
    most = int(np.argmax(explained))
    return float(late[most]) if 0 < most < len(late) - 1 else float("nan")


def _unit_forces(model: Model, part: Record) -> dict[str, Floats]:
    """The force of each coefficient's unit along the measured motion, each shape (n,)."""
    inputs = reverse_inputs(model)
    forces: dict[str, Floats] = {}
    for item, shape in zip(inputs, histories(inputs, part), strict=True):
        for place in item.parts:
            added = place.factor * _of_order(item, shape, place.order, part)
            forces[place.symbol] = forces.get(place.symbol, np.zeros(len(part))) + added
    return forces


def _below_the_noise(forces: Floats, part: Record) -> Floats:
    """Spectra of forces, passed where the force does work on the motion and less and less above, shape (2 lines, q).

    Above, an acceleration is noise that grows with the square of frequency, and falls so behind the filter. A window
    and a filter leave the balance of the forces as it is.
    """
    window = np.hanning(len(forces))
    spectra = rfft(window[:, None] * forces, axis=0)
    work = np.abs(rfft(window * part[FORCE]) * rfft(window * part["velocity"]))
    middle = float(np.average(np.arange(len(work)), weights=work))
    passed = spectra / (1.0 + (np.arange(len(work))[:, None] / middle) ** 2) ** 2
    return np.concatenate([passed.real, passed.imag])


def _of_order(item: Input, shape: Floats, order: int, part: Record) -> Floats:
    """The shape's derivative; those of the displacement are channels of a prepared record."""
    return part[MOTIONS[order]] if item.shape == "u" else derivative(shape, part.dt, order)
