"""The compiled loops: running a program, and integrating an equation of motion with it; their sources are in ``c/``.

They take and fill arrays as they lie in memory, and run while other threads do. An integrator returns the first sample
that is not finite, or -1. ``code`` and ``first`` are those of a program (``graph.Program``), ``r`` its registers, which
are overwritten; ``drive`` has two rows a step, of which there are ``steps`` a sample.
"""

import ctypes
import os
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import numpy as np

from study.support.arrays import Floats, Ints
from study.support.errors import StudyError

LIBRARY = Path(__file__).parent / f"_kernels{'.dll' if os.name == 'nt' else '.so'}"
PROJECT = "reverse-miso-study"
NO_MEMORY = -2  # what an integrator returns that found none
ARGUMENTS = {  # of each function of the library: a(rrays), w(hole numbers) and n(umbers)
    "run_program": "aww a",
    "evaluate": "aww a aw aw aw a",
    "integrate": "w aww a a nnw aw aw w a",
    "integrate_state": "aww a aw ww nw aw a",
    "integrate_segments": "awww a aww anw aw aw aww w wa",
    "integrate_known": "aww a aw anw aw aw aww a",
    "integrate_structure": "aww a aw aw aw aw aaw nnw aw aww aw wa",
}


@cache
def _function(name: str) -> Any:
    function = getattr(ctypes.CDLL(str(_library())), name)
    kinds = {"a": ctypes.c_void_p, "w": ctypes.c_int64, "n": ctypes.c_double}
    function.argtypes = [kinds[letter] for letter in ARGUMENTS[name].replace(" ", "")]
    function.restype = ctypes.c_int64
    return function


def _library() -> Path:
    """The library beside this file; beside sources that came without one, as a job's on a cluster, the installed one.

    Raises
    ------
    StudyError
        If the library was not built.
    """
    if LIBRARY.exists():
        return LIBRARY
    with suppress(PackageNotFoundError):
        installed = Path(str(distribution(PROJECT).locate_file(f"study/equations/{LIBRARY.name}")))
        if installed.exists():
            return installed
    raise StudyError(f"{LIBRARY} is not there, which installing builds; expected `pip install .` to have been run")


def run(code: Ints, first: int, r: Floats) -> None:
    """Run a program once."""
    code = _whole(code)
    _function("run_program")(_at(code), len(code), first, _filled(r))


def evaluate(code: Ints, first: int, r: Floats, columns: Ints, data: Floats, outputs: Ints, out: Floats) -> None:
    """Run a program for every sample: ``data[i]`` into registers ``columns``, results into ``out[i]``."""
    code, columns, data, outputs = _whole(code), _whole(columns), _numbers(data), _whole(outputs)
    _expect(data.shape == (len(out), len(columns)) and out.shape[1] == len(outputs))
    _function("evaluate")(
        _at(code), len(code), first, _filled(r), _at(columns), len(columns), _at(data), len(data), _at(outputs),
        len(outputs), _filled(out),
    )  # fmt: skip


def integrate_rk4(
    code: Ints, first: int, r: Floats, outputs: Ints, start: float, dt: float,
    steps: int, drive: Floats, x: Floats, out: Floats,
) -> int:  # fmt: skip
    """Classical Runge-Kutta from the state ``x``, which is overwritten; ``out`` gets (u, v, a, z...) of each sample.

    Registers are u, v, t, force, the extra channels, the states z, coefficients and shape parameters; ``outputs`` those
    of the acceleration and of the slopes of the z (``model.forward_program``).
    """
    return _integrated(0, code, first, r, outputs, start, dt, steps, drive, x, out)


def integrate_abm4(
    code: Ints, first: int, r: Floats, outputs: Ints, start: float, dt: float,
    steps: int, drive: Floats, x: Floats, out: Floats,
) -> int:  # fmt: skip
    """Adams-Bashforth predictor, Adams-Moulton corrector of order 4 (PECE), started by Runge-Kutta.

    Arguments and result as in :func:`integrate_rk4`.
    """
    return _integrated(1, code, first, r, outputs, start, dt, steps, drive, x, out)


def _integrated(
    method: int, code: Ints, first: int, r: Floats, outputs: Ints, start: float, dt: float,
    steps: int, drive: Floats, x: Floats, out: Floats,
) -> int:  # fmt: skip
    code, outputs, drive = _whole(code), _whole(outputs), _numbers(drive)
    _expect(len(outputs) == len(x) - 1 and out.shape[1] == 1 + len(x) and len(drive) > 2 * steps * (len(out) - 1))
    return _checked(
        _function("integrate")(
            method, _at(code), len(code), first, _filled(r), _at(outputs), start, dt, steps, _at(drive), drive.shape[1],
            _filled(x), len(x), len(out), _filled(out),
        )
    )  # fmt: skip


def integrate_state(
    code: Ints, first: int, r: Floats, columns: Ints, state: int, output: int, h: float,
    steps: int, data: Floats, out: Floats,
) -> None:  # fmt: skip
    """State z of a term under a known motion by Runge-Kutta in steps h, from rest.

    ``columns`` are the registers of the data, ``state`` and ``output`` those of z and dz/dt.
    """
    code, columns, data = _whole(code), _whole(columns), _numbers(data)
    _expect(data.shape[1] == len(columns) and len(data) > 2 * steps * (len(out) - 1))
    _function("integrate_state")(
        _at(code), len(code), first, _filled(r), _at(columns), len(columns), state, output, h, steps, _at(data),
        len(out), _filled(out),
    )  # fmt: skip


def integrate_segments(
    code: Ints, inputs: int, first: int, r: Floats, slots: Ints, side: int, starts: Floats, dt: float, steps: int,
    drive: Floats, bounds: Ints, states: Floats, row: int, out: Floats,
) -> int:  # fmt: skip
    """Free runs with their exact derivatives, one between each two neighbouring ``bounds``, by Runge-Kutta.

    Each begins at its time in ``starts`` from its own of the ``states``, which stand beside their sensitivities and
    become those where it ends: the first sample of the next. ``slots`` names the registers of the slopes and of their
    derivatives by states and keys, ``side`` that which stands for sgn v (-1 without one), and ``inputs`` is how many
    inputs the program has. ``out`` gets response ``row`` (0 displacement, 1 velocity, 2 acceleration) of each sample
    beside its derivatives; the sample at the last bound is left to whoever integrates on.
    """
    code, slots, starts, drive, bounds = _whole(code), _whole(slots), _numbers(starts), _numbers(drive), _whole(bounds)
    _expect(states.shape[1:] == (len(slots) + 1, out.shape[1]) and len(states) == len(starts) == len(bounds) - 1)
    _expect(bounds[-1] <= len(out) and len(drive) > 2 * steps * (min(int(bounds[-1]) + 1, len(out)) - 1))
    return _checked(
        _function("integrate_segments")(
            _at(code), len(code), inputs, first, _filled(r), _at(slots), slots.shape[1], side, _at(starts), dt, steps,
            _at(drive), drive.shape[1], _at(bounds), len(bounds), _filled(states), states.shape[1], states.shape[2],
            row, len(out), _filled(out),
        )
    )  # fmt: skip


def integrate_known(
    code: Ints, first: int, r: Floats, slots: Ints, starts: Floats, dt: float,
    steps: int, drive: Floats, bounds: Ints, states: Floats, out: Floats,
) -> int:  # fmt: skip
    """A force along a known motion, with its exact derivatives; the terms' own states alone are integrated.

    ``drive`` has displacement, velocity and channels. Row 0 of ``slots`` names the registers of the force and of its
    derivatives by states and keys, the others those of the states' slopes. ``states`` has, of each segment between
    neighbouring ``bounds``, the states beside their sensitivities.
    """
    code, slots, starts, drive, bounds = _whole(code), _whole(slots), _numbers(starts), _numbers(drive), _whole(bounds)
    states = _numbers(states)
    _expect(states.shape[1:] == (len(slots) - 1, out.shape[1]) and len(states) == len(starts) == len(bounds) - 1)
    _expect(bounds[-1] <= len(out) and len(drive) > 2 * steps * (len(out) - 1))
    return _checked(
        _function("integrate_known")(
            _at(code), len(code), first, _filled(r), _at(slots), slots.shape[1], _at(starts), dt, steps, _at(drive),
            drive.shape[1] - 2, _at(bounds), len(bounds), _at(states), states.shape[1], states.shape[2], _filled(out),
        )
    )  # fmt: skip


def integrate_structure(
    code: Ints, first: int, r: Floats, slopes: Ints, by_state: Ints, by_key: Ints, sides: Ints, by_side: Ints,
    directions: Floats, start: float, dt: float, steps: int, drive: Floats, y: Floats, rows: Ints, out: Floats,
) -> int:  # fmt: skip
    """A free run of a structure with its exact derivatives by Runge-Kutta; see ``equations_of_motion.MotionProgram``.

    ``y``, shape (states, 1 + derivatives), is the state at the first sample and becomes that at the last. ``out``,
    shape (rows, samples, 1 + derivatives), gets the motions ``rows``: displacements, velocities and accelerations are
    counted through.
    """
    code, slopes, by_state, by_key = _whole(code), _whole(slopes), _whole(by_state), _whole(by_key)
    sides, by_side, directions = _whole(sides), _whole(by_side), _numbers(directions)
    drive, rows = _numbers(drive), _whole(rows)
    _expect(y.shape[1] == out.shape[2] and len(rows) == len(out) and len(drive) > 2 * steps * (out.shape[1] - 1))
    return _checked(
        _function("integrate_structure")(
            _at(code), len(code), first, _filled(r), _at(slopes), len(slopes), _at(by_state), len(by_state),
            _at(by_key), len(by_key), _at(sides), len(sides), _at(by_side), _at(directions), directions.shape[1],
            start, dt, steps, _at(drive), drive.shape[1], _filled(y), y.shape[0], y.shape[1], _at(rows), len(rows),
            out.shape[1], _filled(out),
        )
    )  # fmt: skip


def _whole(array: Ints) -> Ints:
    return np.ascontiguousarray(array, dtype=np.int64)


def _numbers(array: Floats) -> Floats:
    return np.ascontiguousarray(array, dtype=np.float64)


def _at(array: Ints | Floats) -> int:
    """Where an array lies; its caller holds it."""
    return int(array.__array_interface__["data"][0])


def _filled(array: Floats) -> int:
    """Where an array lies that is written to."""
    _expect(array.flags.carray and array.dtype == np.float64)
    return _at(array)


def _expect(fits: bool) -> None:
    """Shapes are looked at here: the loops would write beyond the end of an array."""
    if not fits:
        raise ValueError("the arrays of a compiled loop do not fit each other; expected the shapes in its description")


def _checked(failed: int) -> int:
    if failed == NO_MEMORY:
        raise MemoryError("there is no memory left for a free run")
    return failed
