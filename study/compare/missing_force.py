"""The force that a model lacks, along the record, robust against noise.

``r = F - (forces of all terms)`` needs the motion and its derivatives. Those of the measured response
would be swamped by noise; those of the free run know nothing of what is missing. The motion used here
is the free run plus the difference to the measured response in those bands where that stands above the
noise: where the difference is noise, r is zero; where it is not, r is the missing force. (A Wiener filter
instead of a gate leaves a part of the missing motion out everywhere, which flattens powers: a cubic
damping then shows a power of 2.6 at 1 % noise, with the gate 2.8.)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from study.compare.noise import Noise
from study.compare.prediction import Prediction
from study.equations import kernels
from study.equations.equations_of_motion import acceleration_program
from study.equations.model import Model, named_channels
from study.identify.frequency_domain.inputs import input_history, reverse_inputs
from study.identify.frequency_domain.starting_values import oscillator
from study.records.completion import SETTLED, derivative
from study.records.prepared import FORCE, Prepared
from study.records.record import ALONE, MOTIONS, Record, Sensor

Floats = NDArray[np.float64]
CLEAR = 3.0  # standard errors by which the residual must stand above the noise, for a line to be used
SMOOTH = 5  # lines that are averaged
LEAST_DAMPING = 0.02  # of critical, in the weight that a line has


@dataclass(frozen=True)
class MissingForce:
    """The missing force on the judging part; n samples."""

    displacement: Floats  # free of noise; shape (n,)
    velocity: Floats  # the same
    force: Floats  # measured force less inertia and all forces of the model, in the unit of force; shape (n,)
    free: Floats  # its derivatives by each fitted coefficient: what a refit could take over; shape (n, p)
    gate: NDArray[np.bool_]  # lines of ``frequency`` on which the difference stands above the noise; shape (lines,)
    weight: Floats  # response of the best linear oscillator to a unit force: noise is white behind it; shape (lines,)
    frequency: Floats  # in hertz; shape (lines,)
    noise: float  # mean square of the noise that is left in :meth:`weighted` ``force``
    dt: float  # sampling interval in seconds
    edge: int  # samples at each end which filters and integrals leave unsure

    @property
    def inner(self) -> slice:
        """The samples that filters and integrals leave sure."""
        return slice(self.edge, len(self.force) - self.edge)

    def weighted(self, force: Floats) -> Floats:
        """A force as it shows in the response, in the bands that stand above the noise, shape (n,)."""
        return _filtered(force, self.dt, self.frequency, self.weight * self.gate)


def missing_force(model: Model, keys: Sequence[str], prediction: Prediction) -> MissingForce:
    """The missing force on the judging part. Every value of the model is known; ``keys`` are what was fitted of it."""
    if prediction.prepared.response == FORCE:
        return _along_a_known_motion(keys, prediction)
    noise, prepared = prediction.of(0).noise, prediction.prepared
    gate = lines_above_noise(noise, prepared.band[0])
    motion = _motion(prediction, gate, noise.frequency)
    part = prepared.record.part(*prepared.plan.judge)
    named = part.with_channels(dict(zip(MOTIONS, motion, strict=True)))
    forces = unbalanced_force(model, keys, named)
    width = float(noise.frequency[1])
    return MissingForce(
        displacement=motion[0], velocity=motion[1], force=forces[:, 0], free=forces[:, 1:], gate=gate,
        weight=_weight(prepared, noise.frequency), frequency=noise.frequency,
        noise=float(np.sum(noise.density[gate]) * width), dt=prediction.dt, edge=_edge(prediction, width),
    )  # fmt: skip


def _along_a_known_motion(keys: Sequence[str], prediction: Prediction) -> MissingForce:
    """The same where the motion is prescribed: what is left of the measured force, at all frequencies."""
    seen, prepared, run = prediction.of(0), prediction.prepared, prediction.run
    part = prepared.record.part(*prepared.plan.judge)
    free = np.zeros((len(part), len(keys))) if run is None else run.derivatives(run.fit)[:, : len(keys)]
    noise, lines = seen.noise, np.ones(len(seen.noise.frequency), dtype=np.bool_)
    return MissingForce(
        displacement=part["displacement"], velocity=part["velocity"], force=seen.difference, free=free,
        gate=lines, weight=np.ones(len(lines)), frequency=noise.frequency, noise=noise.rms**2, dt=prediction.dt, edge=0,
    )  # fmt: skip


def _edge(prediction: Prediction, width: float) -> int:
    """Half the memory of the gate, and what an integration needs to settle; at most an eighth of all."""
    memory = 0.5 / (width * prediction.dt)
    low = prediction.prepared.band[0]
    settling = SETTLED / (low * prediction.dt) if low > 0.0 else 0.0
    return min(round(max(memory, settling)), len(prediction.measured) // 8)


def lines_above_noise(noise: Noise, low: float) -> NDArray[np.bool_]:
    """Lines on which the residual, averaged over a few of them, surely stands above the noise."""
    few = np.ones(SMOOTH)
    level = np.convolve(noise.residual, few, "same") / np.convolve(np.ones_like(noise.residual), few, "same")
    spread = CLEAR / np.sqrt(noise.averages * SMOOTH / 2.0)  # 2: neighbouring lines share a taper
    return (level > noise.density * (1.0 + spread)) & (noise.frequency >= low)


def _motion(prediction: Prediction, gate: NDArray[np.bool_], frequency: Floats) -> Floats:
    """Displacement, velocity and acceleration: free run plus what is sure of the difference, shape (3, n).

    The difference is integrated before it is gated: a gate blurs the ends, which an integration would blow up.
    """
    parts: list[Floats] = []
    seen, prepared = prediction.of(0).difference, prediction.prepared
    for row in range(3):
        order = row - MOTIONS.index(prepared.response)
        low = prepared.band[0] if order < 0 else 0.0
        moved = derivative(seen, prepared.dt, order, low) if order else seen
        parts.append(_filtered(moved, prepared.dt, frequency, gate.astype(np.float64)))
    free = prediction.motions([Sensor(ALONE, motion) for motion in MOTIONS])
    return np.ascontiguousarray(free.T) + np.stack(parts)


def unbalanced_force(model: Model, keys: Sequence[str], record: Record) -> Floats:
    """``F - (forces of all terms)`` along a record, and its derivatives by some keys, shape (n, 1 + keys).

    Raises
    ------
    StudyError
        If the model is incomplete, or names a channel that the record lacks.
    """
    values, program = model.numbers(), acceleration_program(model, keys)
    columns = {"u:": record["displacement"], "v:": record["velocity"], "t": record.time}
    columns |= {f"drive:{name}": record[name] for name in ("force", *named_channels(model, record.extra))}
    memories = [input_history(item, record) for item in reverse_inputs(model) if item.state is not None]
    columns |= {f"z:{term.name}": z for term, z in zip(model.states, memories, strict=True)}
    out = kernels.evaluate(program, columns, len(record))
    out[:, 0] -= record["acceleration"]
    return out * values["m"]


def _weight(prepared: Prepared, frequency: Floats) -> Floats:
    """|H(f)| of the best linear oscillator from force to the measured response."""
    own = oscillator(prepared)
    omega = 2.0 * np.pi * np.maximum(frequency, 0.5 * frequency[1])
    damping = max(abs(own["c"]), 2.0 * LEAST_DAMPING * float(np.sqrt(abs(own["k"]) * own["m"])))
    stiffness = np.abs(own["k"] - own["m"] * omega**2 + 1j * omega * damping)
    return omega ** MOTIONS.index(prepared.response) / stiffness


def _filtered(values: Floats, dt: float, frequency: Floats, gain: Floats) -> Floats:
    """Values through a real gain without delay; the ends are continued by point reflection."""
    n = len(values)
    edge = min(n - 1, round(2.0 / (float(frequency[1]) * dt)))
    before, after = 2.0 * values[0] - values[edge:0:-1], 2.0 * values[-1] - values[-2 : -edge - 2 : -1]
    longer = np.concatenate([before, values, after])
    size = next_fast_len(len(longer), real=True)
    lines = np.asarray(rfftfreq(size, dt))
    spectrum = rfft(longer, size) * np.interp(lines, frequency, gain)
    return np.asarray(irfft(spectrum, size)[edge : edge + n], dtype=np.float64)
