"""The error of the force: what the reverse system leaves of the measured force, frequency by frequency.

Inputs are the shapes of the model's terms along the measured motion, the output is the measured force
(the report's Figure 14). What no linear combination of the inputs explains is 1 - multiple coherence,
(4.38); what the fitted coefficients leave is at least that. Noise on the motion is part of both.

In a structure the equation of each coordinate is such a system, as far as its motions are measured; where no force
acts, the force of inertia is what the others have to balance. A single mass has one equation.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from study.compare.noise import segments_of
from study.compare.prediction import Prediction, SensorPrediction
from study.equations.linear_part import acting, matrices
from study.equations.model import Model
from study.identify.frequency_domain import conditioned
from study.identify.frequency_domain.inputs import (
    INERTIA,
    Input,
    along,
    histories,
    reverse_inputs,
    with_known_changes,
    without_inertia,
)
from study.records.plan import SHORTEST_PART
from study.records.prepared import FORCE
from study.records.record import MOTIONS, Record, Sensor
from study.records.spectra import Segments, SpectralMatrix, cross_spectra, cross_spectra_within
from study.support.arrays import Floats
from study.support.errors import StudyError

FEWEST_AVERAGES = 4  # for each input
AUDIBLE = 1e-6  # of its largest density: the force has no power on lines below
HEARD = 1e-4  # of its largest density
ABOVE_NOISE = 2.0  # the motion stands above its noise where its density is at least so many times that of the noise


@dataclass(frozen=True)
class ForceError:
    """Unexplained share of the force on the judging part in one equation; q inputs, arrays of shape (lines,)."""

    coordinate: str  # whose equation of motion it is; of a single mass without a name
    frequency: Floats  # in hertz
    force: Floats  # autospectral density of the force
    unexplained: Floats  # 1 - multiple coherence, corrected for the degrees of freedom that the inputs take
    parametric: Floats  # density of what the fitted coefficients leave of the force, over that of the force
    noise: Floats  # share that noise on the response alone makes of it, to first order: ``|A_u|^2 G_nn / G_FF``
    cumulative: Floats  # cumulative coherences, one input after the other; shape (q, lines)
    inputs: tuple[Input, ...]
    band: NDArray[np.bool_]  # lines on which the motion stands above its noise and the force has power

    @property
    def highest(self) -> float:
        """Frequency in hertz above which the force has hardly any power: pictures end there."""
        heard = np.flatnonzero(self.force > HEARD * float(np.max(self.force)))
        return float(self.frequency[heard[-1] if len(heard) else -1])

    def _over_band(self, share: Floats) -> float:
        weight = self.force[self.band]
        if not np.sum(weight) > 0.0:
            return math.nan  # of no force there is no share
        return float(np.sum(share[self.band] * weight) / np.sum(weight))

    @property
    def total(self) -> float:
        """Share of the force's power that is unexplained, over the band; not a number where there is no force."""
        return self._over_band(self.unexplained)

    @property
    def parametric_total(self) -> float:
        """The same for the fitted coefficients."""
        return self._over_band(self.parametric)

    @property
    def noise_total(self) -> float:
        """The share of noise alone, over the band; at most one."""
        return float(np.minimum(self._over_band(self.noise), 1.0))


@dataclass(frozen=True, eq=False)
class JudgedEquation:
    """One equation of motion along the judging part; n samples, q inputs."""

    inputs: tuple[Input, ...]
    whole: tuple[Input, ...]  # the same with inertia, where that takes the place of the force
    channels: tuple[Floats, ...]  # histories of the inputs, response, and force; q + 2 arrays of shape (n,)


def judged_equation(
    model: Model, view: SensorPrediction, record: Record, span: tuple[int, int], free: bool = False
) -> JudgedEquation | None:
    """The equation of a sensor's coordinate; None where a motion in it was not measured, or nothing balances the force.

    Inertia takes the place of the force along a ``span`` of the record without one, or of a record of ``free`` decays.
    """
    prepared, coordinate, part = view.prepared, view.sensor.coordinate, slice(*span)
    whole = inputs = with_known_changes(reverse_inputs(model, coordinate), model)
    seen = model.coordinates if model.prescribed else prepared.coordinates
    directions = np.array([i.direction for i in inputs]).reshape(-1, len(model.coordinates))
    if not {c for c, weights in zip(model.coordinates, directions.T, strict=True) if np.any(weights)} <= {*seen}:
        return None
    if model.prescribed:
        drives = [record[Sensor(coordinate, FORCE)]]
    else:
        units = acting(model)[model.coordinates.index(coordinate)]
        drives = [unit * record[name] for unit, (name, _) in zip(units, model.forces, strict=True) if unit]
    force = np.sum([np.zeros(len(record)), *drives], axis=0)
    if free or not (model.prescribed or np.any(force[part])):
        inputs, row = without_inertia(inputs), matrices(model, model.numbers())[2][model.coordinates.index(coordinate)]
        coupled = [(c, mass) for c, mass in zip(model.coordinates, row.tolist(), strict=True) if mass]
        force = -np.sum([mass * record.motion(c)[INERTIA] for c, mass in coupled], axis=0)
    if not inputs:
        return None
    moved = {d: along(d, model, record) for d in {i.direction for i in inputs}}
    channels = [*(histories((i,), moved[i.direction])[0] for i in inputs), record[view.sensor], force]
    return JudgedEquation(inputs, whole, tuple(channel[part] for channel in channels))


Judge = Callable[[Model, SensorPrediction], ForceError | None]  # of one equation


def force_errors(model: Model, prediction: Prediction, judge: Judge) -> tuple[ForceError, ...]:
    """Judge a fitted model in reverse on the judging part, each equation of motion that the sensors show.

    ``judge`` does so for one, as :func:`force_error`. None where the linear part is a sum of modes.

    Raises
    ------
    StudyError
        If the judging part is too short for the inputs of the only equation; one of several is left out then.
    """
    if model.modal:
        return ()
    found: list[ForceError | None] = []
    for view in prediction.views:
        try:
            found.append(judge(model, view))
        except StudyError:
            if len(model.coordinates) == 1:
                raise
    return tuple(one for one in found if one is not None)


def mean_share(shares: Sequence[float]) -> float:
    """That of several equations, of those in which a force acts; not a number where there is none."""
    known = [share for share in shares if not math.isnan(share)]
    return float(np.mean(known)) if known else math.nan


def force_error(model: Model, view: SensorPrediction) -> ForceError | None:
    """Judge the equation of a sensor's coordinate; None as :func:`judged_equation`.

    Raises
    ------
    StudyError
        If the judging part is too short for its inputs.
    """
    prepared, noise = view.prepared, view.noise
    first, last = prepared.inner(prepared.plan.judge)
    equation = judged_equation(model, view, prepared.record, (first, last), prepared.free)
    if equation is None:
        return None
    inputs = equation.inputs
    channels = equation.channels
    begins = prepared.record.part(first, last).joints
    cut = _segments([b - a for a, b in pairwise((0, *begins, last - first))], len(inputs))
    within = cross_spectra_within(channels, begins, prepared.dt, cut) if begins else None
    matrix = within or cross_spectra(channels, prepared.dt, cut)
    keep = [*range(len(inputs)), len(inputs) + 1]  # all but the response
    reverse = replace(matrix, density=matrix.density[:, keep][:, :, keep])
    response = matrix.density[:, -2, -2].real
    result = conditioned.analyse(reverse)
    freedom = result.averages / (result.averages - len(inputs))
    force = np.where(result.output > 0.0, result.output, np.inf)
    density = np.interp(matrix.frequency, noise.frequency, noise.density)
    return ForceError(
        coordinate=view.sensor.coordinate,
        frequency=matrix.frequency,
        force=result.output,
        unexplained=np.clip((1.0 - result.multiple) * freedom, 0.0, 1.0),
        parametric=_left(reverse, inputs, model) / force,
        noise=from_noise(matrix.frequency, equation.whole, model, view) / force,
        cumulative=result.cumulative,
        inputs=inputs,
        band=lines_to_judge(matrix.frequency, response, density, result.output, prepared.band[0]),
    )


def _segments(stretches: Sequence[int], inputs: int) -> Segments:
    """The usual segments, shortened until there are enough averages for so many inputs; lengths of the stretches."""
    cut, wanted = segments_of(sum(stretches)), FEWEST_AVERAGES * inputs
    while cut.length > SHORTEST_PART and sum(cut.effective_averages(n) for n in stretches if n >= cut.length) < wanted:
        cut = replace(cut, length=cut.length // 2)
    return cut


def _left(matrix: SpectralMatrix, inputs: Sequence[Input], model: Model) -> Floats:
    """Density of the force less what the coefficients make of the inputs: ``w^H G w`` with ``w = (-A, 1)``."""
    values = model.numbers()
    parts = [-i.response(matrix.frequency, values) for i in inputs]
    weights = np.stack([*parts, np.ones(len(matrix.frequency))], axis=1)
    return np.einsum("fi,fij,fj->f", weights.conj(), matrix.density, weights).real.clip(0.0)


def from_noise(frequency: Floats, inputs: Sequence[Input], model: Model, view: SensorPrediction) -> Floats:
    """Density of force that noise on the responses makes through the linear terms of an equation, inertia too.

    Where the force itself is the response, that of its own noise.
    """
    if view.prepared.response == FORCE:
        return np.interp(frequency, view.noise.frequency, view.noise.density)
    omega, total = 2.0 * np.pi * np.maximum(frequency, 0.5 * frequency[1]), np.zeros(len(frequency))
    linear = [(i.direction, i.response(frequency, model.numbers())) for i in inputs if i.shape == "u"]
    for seen in view.whole.views:
        j = model.coordinates.index(seen.sensor.coordinate)
        density = np.interp(frequency, seen.noise.frequency, seen.noise.density)
        path = np.sum([np.zeros(len(frequency)), *(weights[j] * response for weights, response in linear)], axis=0)
        with np.errstate(over="ignore"):  # a mass that nothing holds may run off
            stiffness = np.abs(path) ** 2
        total += stiffness * density / omega ** (2 * MOTIONS.index(seen.sensor.motion))
    return total


def lines_to_judge(frequency: Floats, response: Floats, noise: Floats, force: Floats, low: float) -> NDArray[np.bool_]:
    """Lines to judge by; if none passes, all of those on which the force has power."""
    heard = (force > AUDIBLE * float(np.max(force))) & (frequency >= max(low, frequency[1]))
    clear = heard & (response >= ABOVE_NOISE * noise)
    return clear if np.any(clear) else heard
