"""Fit a model to one part of a record in free run, and judge it on another part.

What both ``compare`` and ``diagnose`` stand on. The fit begins from the best linear approximation
``H(f) = G_Fy / G_FF``, which noise on the response does not bias, with every other coefficient at zero.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.equations.free_run import FreeRun, prepare
from study.equations.model import Model
from study.identify.time_domain.free_run_fit import FreeRunFit, fit_free_run
from study.records.plan import Plan
from study.records.record import MOTIONS, Record
from study.records.spectra import Segments, cross_spectra
from study.support.errors import StudyError
from study.support.least_squares import least_squares

Floats = NDArray[np.float64]
LINEAR_ORDERS = {"k": 0, "c": 1, "m": 2}
FAINT = 1e-3  # ... and whose force is above this share of the strongest line: leakage tells nothing
SHORT = 512  # samples below which missing coherence may be the record's own shortness
CHANCE = 0.01  # the linear start uses lines whose coherence noise alone would reach this rarely


def linear_start(model: Model, record: Record, how: Plan) -> dict[str, float]:
    """Mass, damping and stiffness of the best linear approximation; zero for everything else.

    Raises
    ------
    StudyError
        If force and response have nothing in common.
    """
    part = record.part(*how.fit)
    length = min(1024, 2 ** int(np.log2(max(len(part) // 8, 16))))
    force, motion = (part[name] - np.mean(part[name]) for name in ("force", how.response))
    matrix = cross_spectra([force, motion], part.dt, Segments(length=length))
    g, f = matrix.density[1:-1], matrix.frequency[1:-1]
    power = g[:, 0, 0].real * g[:, 1, 1].real
    coherence = np.abs(g[:, 0, 1]) ** 2 / np.where(power > 0.0, power, np.inf)
    coherence = np.clip(coherence, 0.0, 1.0 - 1e-6)
    by_chance = 1.0 - CHANCE ** (1.0 / max(matrix.averages - 1.0, 1.0))
    keep = (coherence > by_chance) & (g[:, 0, 0].real > FAINT * np.max(g[:, 0, 0].real))
    if np.count_nonzero(keep) < 4 and len(part) < SHORT:
        raise StudyError(
            f"the part to fit of {record.name!r} has {len(part)} samples, too few to see what force and {how.response} "
            f"have in common; fit a longer part, {SHORT} samples or more"
        )
    if np.count_nonzero(keep) < 4:
        raise StudyError(f"force and {how.response} of {record.name!r} have nothing in common at any frequency")
    omega = 2j * np.pi * f[keep]
    receptance = g[keep, 0, 1] / g[keep, 0, 0] / omega ** MOTIONS.index(how.response)
    weight = np.abs(receptance) * np.sqrt(coherence[keep] / (1.0 - coherence[keep]))
    values = model.values
    wanted = [key for key in LINEAR_ORDERS if key in values]
    design = np.stack([omega ** LINEAR_ORDERS[key] for key in wanted], axis=1) * weight[:, None]
    target = weight / receptance
    found = least_squares(
        np.concatenate([design.real, design.imag]), np.concatenate([target.real, target.imag])
    )  # fmt: skip
    start = dict.fromkeys(values, 0.0) | dict(zip(wanted, (float(v) for v in found), strict=True))
    if start["m"] <= 0.0:
        inertial = omega**2 * weight
        start["m"] = float(np.linalg.norm(target)) / float(np.linalg.norm(inertial))
    return start


def fit(
    model: Model,
    record: Record,
    how: Plan,
    held: tuple[str, ...],
    start: Mapping[str, float] | None = None,
    max_iterations: int = 60,
) -> FreeRunFit:
    """Fit what is not held on the plan's fitting part; starting values from ``start`` or the linear start.

    Raises
    ------
    StudyError
        If the model cannot run, or a shape parameter has no starting value.
    """
    begin = dict(start) if start is not None else linear_start(model, record, how)
    begin = {key: value for key, value in begin.items() if key not in held}
    return fit_free_run(
        model, record, start=begin, held=held, response=how.response,
        steps_per_sample=how.steps_per_sample, span=how.fit, max_iterations=max_iterations,
    )  # fmt: skip


@dataclass(frozen=True)
class JudgingStart:
    """Where the free run begins that covers the judging part.

    Attributes
    ----------
    initial : array, shape (2 + states,)
        Initial state.
    first : int
        The record's sample at which it holds.
    """

    initial: Floats
    first: int


def judging_start(found: FreeRunFit, record: Record, how: Plan) -> JudgingStart:
    """Where the judging part follows the fitting part the free run goes on through both.

    Elsewhere its initial state, and nothing else, is estimated from the judging part.

    Raises
    ------
    DivergenceError
        If the free run leaves the range of finite numbers.
    """
    if how.judge[0] == how.fit[1]:
        return JudgingStart(found.initial, how.fit[0])
    again = fit_free_run(
        found.model, record, held=tuple(found.model.values), response=how.response,
        steps_per_sample=how.steps_per_sample, span=how.judge,
    )  # fmt: skip
    return JudgingStart(again.initial, how.judge[0])


def held_out_residual(found: FreeRunFit, record: Record, how: Plan, start: JudgingStart | None = None) -> Floats:
    """Measured minus predicted response on the judging part, shape (samples to judge,).

    ``start`` is what :func:`judging_start` gives, for those who ask for more than one thing.

    Raises
    ------
    DivergenceError
        If the free run leaves the range of finite numbers.
    """
    return record[how.response][slice(*how.judge)] - held_out_motion(found, record, how, how.response, start)


def held_out_motion(
    found: FreeRunFit, record: Record, how: Plan, motion: str, start: JudgingStart | None = None
) -> Floats:
    """A motion of the free run on the judging part, as :func:`held_out_residual` has it.

    Raises
    ------
    DivergenceError
        If the free run leaves the range of finite numbers.
    """
    begin = start or judging_start(found, record, how)
    return _judging_run(found, record, how, motion, begin).respond({}, begin.initial)[0][how.judge[0] - begin.first :]


def held_out_derivatives(found: FreeRunFit, record: Record, how: Plan, start: JudgingStart | None = None) -> Floats:
    """As :func:`linearise`, on the judging part."""
    begin = start or judging_start(found, record, how)
    run = _judging_run(found, record, how, how.response, begin, found.keys)
    values = dict(zip(found.keys, (float(v) for v in found.values), strict=True))
    return run.respond(values, begin.initial, 2)[1][how.judge[0] - begin.first :]


def _judging_run(
    found: FreeRunFit, record: Record, how: Plan, motion: str, start: JudgingStart, keys: tuple[str, ...] = ()
) -> FreeRun:
    """A free run that covers the judging part."""
    span = (start.first, how.judge[1])
    return prepare(found.model, record, keys, response=motion, steps_per_sample=how.steps_per_sample, span=span)


def linearise(found: FreeRunFit, record: Record, how: Plan) -> Floats:
    """Derivatives of the response on the fitting part, shape (n, keys + 2): keys, then the initial state."""
    run = prepare(
        found.model, record, found.keys, response=how.response,
        steps_per_sample=how.steps_per_sample, span=how.fit,
    )  # fmt: skip
    values = dict(zip(found.keys, (float(v) for v in found.values), strict=True))
    return run.respond(values, found.initial, 2)[1]
