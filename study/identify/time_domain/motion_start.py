"""A fit that begins at the measured motion itself, for one that has lost it, as a free run between two wells does.

Least squares of the force on the forces of all terms along the motion has no local minima and asks for no free run, but
noise on the motion biases it. So it is where multiple shooting begins, and the end of nothing.
"""

import numpy as np
from scipy.fft import rfft

from study.equations.linear_part import acting
from study.equations.model import Model
from study.identify.frequency_domain.inputs import along, histories, reverse_inputs
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.multiple_shooting import fit_in_segments
from study.identify.time_domain.stretch_states import is_smooth, resembles_a_motion
from study.records.completion import derivative
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Record
from study.support.arrays import Complexes, Floats
from study.support.errors import StudyError
from study.support.least_squares import least_squares

LATEST, LATE_STEP = 4.0, 0.1  # samples by which a response may be late, tried so far apart


def has_lost_the_motion(fit: FreeRunFit, prepared: Prepared) -> bool:
    """Whether a driven model leaves more of the response's power than it explains, and that as smooth as a motion."""
    driven = not (prepared.free or prepared.response == FORCE or prepared.record.stretches)
    return driven and 2.0 * fit.rms**2 > prepared.spread**2 and is_smooth(fit.residual, len(fit.outputs))


def seen_everywhere(model: Model, prepared: Prepared) -> bool:
    """Whether the sensors show the state of a model at any time."""
    return model.modal is None and set(model.coordinates) <= set(prepared.coordinates)


def from_the_motion(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """The fit; where it has lost the motion, one in segments begun there if these leave nothing like a motion.

    Segments with states of their own leave less than one free run of any model, and that says nothing for it.
    """
    if not (seen_everywhere(fit.model, prepared) and has_lost_the_motion(fit, prepared)):
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
    """Coefficients by least squares of all equations along the measured motion; what is held stays.

    Raises
    ------
    StudyError
        If a shape parameter is not known, or a force has no finite value somewhere along the motion.
    """
    part = prepared.record.part(*prepared.inner(prepared.plan.fit))
    forces = _unit_forces(model, part)
    known = [(model.values[s] or 0.0) * forces[s] for s in forces if s in held]
    target = np.sum([_driving(model, part), *(-force for force in known)], axis=0)
    wanted = [s for s in forces if s not in held]
    lines = _as_power(np.stack([*(forces[s] for s in wanted), target], axis=2), model, part)
    both = np.concatenate([lines.real, lines.imag]).reshape(-1, len(wanted) + 1)
    found = least_squares(both[:, :-1], both[:, -1], 1e-9)
    return dict(zip(wanted, found.tolist(), strict=True))


def delay_along_the_motion(model: Model, prepared: Prepared) -> float:
    """Samples by which all motions seem to be late; nan where no delay within reach lets the terms explain most.

    Least squares of the forces on those of all terms along the motion, the former as late as the motion, asks for no
    free run, which a record that is late by a part of a period sends to a minimum of its own. Noise and missing effects
    move it: a start.

    Raises
    ------
    StudyError
        If a shape parameter is not known, or a force has no finite value somewhere along the motion.
    """
    part = prepared.record.part(*prepared.inner(prepared.plan.fit))
    lines = _as_power(np.stack([*_unit_forces(model, part).values(), _driving(model, part)], axis=2), model, part)
    both = np.concatenate([lines[..., :-1].real, lines[..., :-1].imag]).reshape(-1, lines.shape[2] - 1)
    basis = np.linalg.qr(both / np.maximum(np.linalg.norm(both, axis=0), np.finfo(float).tiny))[0]
    late = np.arange(-LATEST, LATEST + LATE_STEP, LATE_STEP)
    explained = list[float]()
    for samples in late.tolist():  # one by one: all of them would be many times the record
        turn = np.exp(-2j * np.pi * samples / len(part) * np.arange(len(lines)))
        turned = lines[..., -1] * turn[:, None]
        explained.append(float(np.sum((basis.T @ np.concatenate([turned.real, turned.imag]).reshape(-1)) ** 2)))
    most = int(np.argmax(explained))
    return float(late[most]) if 0 < most < len(late) - 1 else float("nan")


def _unit_forces(model: Model, part: Record) -> dict[str, Floats]:
    """The forces of each coefficient's unit along the measured motion, by coordinate: shape (n, coordinates) each."""
    forces: dict[str, Floats] = {}
    for i, coordinate in enumerate(model.coordinates):
        for item in reverse_inputs(model, coordinate):
            motion = along(item.direction, model, part)
            (shape,) = histories((item,), motion)
            for place in item.parts:
                added = forces.setdefault(place.symbol, np.zeros((len(part), len(model.coordinates))))
                # the derivatives of the displacement are channels of a prepared record
                known = item.shape == "u"
                force = motion[MOTIONS[place.order]] if known else derivative(shape, motion.dt, place.order)
                added[:, i] += place.factor * force
    return forces


def _driving(model: Model, part: Record) -> Floats:
    """The measured force on each coordinate, shape (n, coordinates)."""
    return part.columns([name for name, _ in model.forces]) @ acting(model).T


def _as_power(forces: Floats, model: Model, part: Record) -> Complexes:
    """Spectra of forces, passed where those that drive do work and less and less above, shape (lines, coordinates, q).

    Each counts as its power on the motion, which has one unit for translations and rotations. Above, an acceleration is
    noise that grows with the square of frequency, and falls so behind the filter. A window and a filter leave the
    balance of the forces as it is.
    """
    window = np.hanning(len(forces))
    spectra = np.asarray(rfft(window[:, None, None] * forces, axis=0), dtype=np.complex128)
    velocity = np.stack([part.motion(c)[1] for c in model.coordinates], axis=1)
    driving = window[:, None] * _driving(model, part)
    work = np.sum(np.abs(rfft(driving, axis=0) * rfft(window[:, None] * velocity, axis=0)), axis=1)
    lines = np.arange(len(work))
    passed = 1.0 + (lines / float(np.average(lines, weights=work))) ** 2
    speed = np.std(velocity, axis=0)
    return spectra * (speed / np.max(speed))[:, None] / (passed**2)[:, None, None]
