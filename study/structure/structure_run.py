"""A structure running free under measured forces, with the exact derivatives of the motions at its sensors.

State and sensitivities are integrated together by the classical Runge-Kutta method, as for a single coordinate
(``equations.free_run``): the Jacobian is that of the numbers which the simulation yields.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from study.equations import kernels
from study.equations.graph import Program
from study.equations.model import Model, with_registers
from study.records.interpolation import between_samples
from study.records.record import MOTIONS, Record, Sensor
from study.structure.equations_of_motion import MotionProgram, motion_program
from study.support.arrays import Floats, Ints
from study.support.errors import DivergenceError, expect


@dataclass(frozen=True)
class StretchDrive:
    """What acts along a stretch of a record in which the motion goes on without a break.

    Attributes
    ----------
    values : array, shape (2 steps (samples - 1) + 1, forces + channels)
        Forces and channels at every half step.
    start : float
        Time of the first sample in seconds.
    samples : int
        Samples in the stretch.
    """

    values: Floats
    start: float
    samples: int


@dataclass(frozen=True)
class StructureRun:
    """A structure and a part of a record, made ready to run as often as a fit needs.

    Attributes
    ----------
    program : MotionProgram
        Its equations of motion.
    keys : tuple of str
        The coefficients and shape parameters to differentiate by.
    drives : tuple of StretchDrive
        One for each stretch: the motion begins anew at each.
    dt : float
        Sampling interval in seconds.
    steps : int
        Steps in each sampling interval.
    rows : int array, shape (sensors,)
        The motions that are wanted: displacements, velocities and accelerations counted through.
    """

    program: MotionProgram
    keys: tuple[str, ...]
    drives: tuple[StretchDrive, ...]
    dt: float
    steps: int
    rows: Ints

    @property
    def states(self) -> int:
        """Number of states at the beginnings of all stretches together."""
        return self.program.states * len(self.drives)

    @property
    def start(self) -> float:
        """Time of the first sample in seconds."""
        return self.drives[0].start

    def respond(self, values: Mapping[str, float], initial: Floats, free: Sequence[int] = ()) -> tuple[Floats, Floats]:
        """Motions at the sensors and their derivatives.

        Parameters
        ----------
        values : mapping of float
            Value of each key.
        initial : array, shape (states,)
            Displacements, velocities and the terms' own states at the first sample of each stretch, one stretch after
            the other; what is left out is zero.
        free : sequence of int
            States to differentiate by, after the keys.

        Returns
        -------
        response : array, shape (sensors, samples)
        jacobian : array, shape (sensors, samples, keys + free states)

        Raises
        ------
        DivergenceError
            If a motion leaves the range of finite numbers.
        """
        program = with_registers(self.program.program, {key: values[key] for key in self.keys})
        first, n = 1 + len(self.keys), self.program.states
        if len(self.drives) == 1 and len(free) <= n:
            out = self._along(self.drives[0], program, initial, free)
            return out[:, :, 0], out[:, :, 1:]
        out = np.zeros((len(self.rows), sum(drive.samples for drive in self.drives), first + len(free)))
        begin = 0
        for k, drive in enumerate(self.drives):
            columns = [first + i for i, state in enumerate(free) if k * n <= state < (k + 1) * n]
            own = [state - k * n for state in free if k * n <= state < (k + 1) * n]
            part = self._along(drive, program, initial[k * n : (k + 1) * n], own)
            out[:, begin : begin + drive.samples, [*range(first), *columns]] = part
            begin += drive.samples
        return out[:, :, 0], out[:, :, 1:]

    def _along(self, drive: StretchDrive, program: Program, initial: Floats, free: Sequence[int]) -> Floats:
        """Motions and derivatives along one stretch side by side, shape (sensors, samples, 1 + keys + free states)."""
        own, first = self.program, 1 + len(self.keys)
        out = np.empty((len(self.rows), drive.samples, first + len(free)))
        state = np.zeros((own.states, out.shape[2]))
        begun = initial[: own.states]
        state[: len(begun), 0] = begun
        state[list(free), range(first, out.shape[2])] = 1.0
        failed = kernels.integrate_structure(
            program.code, program.first, program.registers.copy(), own.slopes, own.by_state, own.by_key, own.sides,
            own.by_side, own.directions, drive.start, self.dt, self.steps, drive.values, state, self.rows, out,
        )  # fmt: skip
        if failed >= 0:
            time = drive.start + failed * self.dt
            raise DivergenceError(f"the free run diverged at t = {time:.4g} s", time)
        return out


def prepare_run(
    model: Model,
    record: Record,
    keys: Sequence[str] = (),
    *,
    sensors: Sequence[Sensor] | None = None,
    steps_per_sample: int = 2,
    span: tuple[int, int] | None = None,
) -> StructureRun:
    """Make a structure ready to run under the forces of a record.

    Parameters
    ----------
    model : Model
        A structure, every value known but those of ``keys``.
    record : Record
        Gives the forces, and the channels which the user's own terms name.
    keys : sequence of str
        The coefficients and shape parameters to differentiate by.
    sensors : sequence of Sensor, optional
        The motions that are wanted; those of the record if left out.
    steps_per_sample : int
        Runge-Kutta steps in each sampling interval.
    span : pair of int, optional
        First sample, and the one after the last; the whole record if left out.

    Raises
    ------
    StudyError
        If a value, force, channel or sensor is missing, or the span invalid.
    """
    first, last = span or (0, len(record))
    inside = 0 <= first < last - 1 < len(record)
    expect(inside, f"the span {first} to {last} does not lie in the {len(record)} samples of {record.name!r}")
    names = [name for name, _ in model.forces]
    lacking = ", ".join(name for name in names if name not in record.forces)
    expect(not lacking, f"record {record.name!r} has no force {lacking}; expected {', '.join(names)}")
    program = motion_program(model, tuple(record.extra), keys)
    columns = [record[name] for name in (*names, *model.channels)]
    return StructureRun(
        program, tuple(keys), _drives(record, (first, last), columns, 2 * steps_per_sample), record.dt,
        steps_per_sample,
        np.array([_row(model, s) for s in (record.sensors if sensors is None else sensors)], dtype=np.int64),
    )  # fmt: skip


def _drives(record: Record, span: tuple[int, int], columns: Sequence[Floats], factor: int) -> tuple[StretchDrive, ...]:
    """What acts along each stretch of a span, ``factor`` half steps in a sampling interval."""
    found: list[StretchDrive] = []
    time = record.time
    for begin, end in record.runs(span):
        first, last = record.stretch_of(begin)
        values = np.zeros((factor * (end - begin - 1) + 1, len(columns)))
        part = slice(factor * (begin - first), factor * (end - 1 - first) + 1)
        for i, channel in enumerate(columns):
            values[:, i] = between_samples(channel[first:last], factor)[part]
        found.append(StretchDrive(values, float(time[begin]), end - begin))
    return tuple(found)


def _row(model: Model, sensor: Sensor) -> int:
    """Number of a motion when displacements, velocities and accelerations are counted through."""
    known = sensor.coordinate in model.coordinates
    expect(
        known, f"{sensor.coordinate!r} is no coordinate of the model; expected one of {', '.join(model.coordinates)}"
    )
    return MOTIONS.index(sensor.motion) * len(model.coordinates) + model.coordinates.index(sensor.coordinate)
