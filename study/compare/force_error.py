"""The error of the force: what the reverse system leaves of the measured force, frequency by frequency.

Inputs are the shapes of the model's terms along the measured motion, the output is the measured force
(the report's Figure 14). What no linear combination of the inputs explains is 1 - multiple coherence,
(4.38); what the fitted coefficients leave is at least that. Noise on the motion is part of both.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from study.compare.noise import segments_of
from study.compare.prediction import Prediction
from study.equations.model import Model
from study.identify.frequency_domain import conditioned
from study.identify.frequency_domain.inputs import Input, histories, reverse_inputs, with_known_changes, without_inertia
from study.records.plan import FEWEST
from study.records.record import MOTIONS
from study.records.spectra import Segments, SpectralMatrix, cross_spectra, cross_spectra_within

Floats = NDArray[np.float64]
FEWEST_AVERAGES = 4  # for each input
AUDIBLE = 1e-6  # of its largest density: the force has no power on lines below
HEARD = 1e-4  # of its largest density
ABOVE = 2.0  # the motion stands above its noise where its density is at least so many times that of the noise


@dataclass(frozen=True)
class ForceError:
    """Unexplained share of the force on the judging part; q inputs, arrays of shape (lines,)."""

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


def force_error(model: Model, prediction: Prediction) -> ForceError:
    """Judge a fitted model in reverse on the judging part; a ``StudyError`` if it is too short for the inputs."""
    prepared, noise = prediction.prepared, prediction.of(0).noise
    record, (first, last) = prepared.record, prepared.inner(prepared.plan.judge)
    inputs = with_known_changes(reverse_inputs(model), model)
    if prepared.free or not np.any(record["force"][first:last]):  # the inertia force is what the others balance
        inputs = without_inertia(inputs)
        record = record.with_channels({"force": -model.numbers()["m"] * record["acceleration"]})
    channels = [h[first:last] for h in histories(inputs, record)]
    channels += [record[prepared.response][first:last], record["force"][first:last]]
    begins = record.part(first, last).joints
    cut = _segments([b - a for a, b in pairwise((0, *begins, last - first))], len(inputs))
    within = cross_spectra_within(channels, begins, record.dt, cut) if begins else None
    matrix = within or cross_spectra(channels, record.dt, cut)
    keep = [*range(len(inputs)), len(inputs) + 1]  # all but the response
    reverse = replace(matrix, density=matrix.density[:, keep][:, :, keep])
    response = matrix.density[:, -2, -2].real
    result = conditioned.analyse(reverse)
    freedom = result.averages / (result.averages - len(inputs))
    force = np.where(result.output > 0.0, result.output, np.inf)
    density = np.interp(matrix.frequency, noise.frequency, noise.density)
    return ForceError(
        frequency=matrix.frequency,
        force=result.output,
        unexplained=np.clip((1.0 - result.multiple) * freedom, 0.0, 1.0),
        parametric=_left(reverse, inputs, model) / force,
        noise=from_noise(matrix.frequency, inputs, model, prepared.response, density) / force,
        cumulative=result.cumulative,
        inputs=inputs,
        band=lines_to_judge(matrix.frequency, response, density, result.output, prepared.band[0]),
    )


def _segments(stretches: Sequence[int], inputs: int) -> Segments:
    """The usual segments, shortened until there are enough averages for so many inputs; lengths of the stretches."""
    cut, wanted = segments_of(sum(stretches)), FEWEST_AVERAGES * inputs
    while cut.length > FEWEST and sum(cut.effective_averages(n) for n in stretches if n >= cut.length) < wanted:
        cut = replace(cut, length=cut.length // 2)
    return cut


def _left(matrix: SpectralMatrix, inputs: Sequence[Input], model: Model) -> Floats:
    """Density of the force less what the coefficients make of the inputs: ``w^H G w`` with ``w = (-A, 1)``."""
    values = model.numbers()
    parts = [-i.response(matrix.frequency, values) for i in inputs]
    weights = np.stack([*parts, np.ones(len(matrix.frequency))], axis=1)
    return np.einsum("fi,fij,fj->f", weights.conj(), matrix.density, weights).real.clip(0.0)


def from_noise(frequency: Floats, inputs: Sequence[Input], model: Model, response: str, density: Floats) -> Floats:
    """Density of force that noise on the response makes through the linear terms."""
    if response == "force":
        return density
    linear = next((i.response(frequency, model.numbers()) for i in inputs if i.shape == "u"), np.zeros(len(frequency)))
    omega = 2.0 * np.pi * np.maximum(frequency, 0.5 * frequency[1])
    with np.errstate(over="ignore"):  # a mass that nothing holds may run off
        stiffness = np.abs(linear) ** 2
    return stiffness * density / omega ** (2 * MOTIONS.index(response))


def lines_to_judge(frequency: Floats, response: Floats, noise: Floats, force: Floats, low: float) -> NDArray[np.bool_]:
    """Lines to judge by; if none passes, all of those on which the force has power."""
    heard = (force > AUDIBLE * float(np.max(force))) & (frequency >= max(low, frequency[1]))
    clear = heard & (response >= ABOVE * noise)
    return clear if np.any(clear) else heard
