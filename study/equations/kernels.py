"""The compiled loops: running a program, and integrating equations of motion with it; their sources are in ``c/``.

They take and fill arrays as they lie in memory, and run while other threads do.
"""

import ctypes
import os
from collections.abc import Mapping
from contextlib import suppress
from enum import IntEnum
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from study.equations.graph import Program
from study.support import work
from study.support.arrays import Floats, Ints
from study.support.errors import StudyError

if TYPE_CHECKING:
    from study.equations.motion_program import MotionProgram

COMPILED = Path(__file__).parent / f"_kernels{'.dll' if os.name == 'nt' else '.so'}"
SOURCES = Path(__file__).parent / "c"
PROJECT = "reverse-miso-study"
NO_MEMORY = -2  # what a function returns that found none
WRITTEN_OUT = 12  # columns that a step treats at once; of more it takes one part after the other
ARGUMENTS = {  # of each function of the library: a(rrays), w(hole numbers) and n(umbers)
    "evaluate": "aww a aw aw aw a",
    "integrate": "w awwww a aww aw aaa anw aw aw aww w aw waa",
}


class Method(IntEnum):
    """How to integrate; the numbers are those of ``c/motion.c``."""

    SUMMED = 0  # Runge-Kutta: the stages of a step are added up, and then to the state
    ONE_BY_ONE = 1  # the same, each added to the state, which is rounded more often
    ADAMS = 2  # Adams-Bashforth predictor, Adams-Moulton corrector of order 4, without derivatives


@cache
def _function(name: str) -> Any:
    function = getattr(ctypes.CDLL(str(compiled_library())), name)
    kinds = {"a": ctypes.c_void_p, "w": ctypes.c_int64, "n": ctypes.c_double}
    function.argtypes = [kinds[letter] for letter in ARGUMENTS[name].replace(" ", "")]
    function.restype = ctypes.c_int64
    return function


def compiled_library() -> Path:
    """The library beside this file, or the installed one: a job on a cluster has sources alone."""
    if COMPILED.exists():
        return COMPILED
    with suppress(PackageNotFoundError):
        installed = Path(str(distribution(PROJECT).locate_file(f"study/equations/{COMPILED.name}")))
        if installed.exists():
            return installed
    raise StudyError(f"{COMPILED} is not there, which installing builds; expected `pip install .` to have been run")


def evaluate(program: Program, columns: Mapping[str, Floats], samples: int) -> Floats:
    """What a program computes along samples of some of its inputs, shape (samples, outputs)."""
    data = np.empty((samples, len(columns)))
    for i, values in enumerate(columns.values()):
        data[:, i] = values
    where = np.array([program.inputs[name] for name in columns], dtype=np.int64)
    out, registers = np.empty((samples, len(program.outputs))), program.registers.copy()
    _checked(
        _function("evaluate")(
            _at(program.code), len(program.code), program.first, _at(registers), _at(where), len(where), _at(data),
            samples, _at(program.outputs), len(program.outputs), _at(out),
        )
    )  # fmt: skip
    return out


def integrate(
    motion: "MotionProgram", starts: Floats, dt: float, steps: int, drive: Floats, bounds: Ints, states: Floats,
    out: Floats, method: Method = Method.SUMMED,
) -> tuple[int, int]:  # fmt: skip
    """Motions with their exact derivatives, one between each two neighbouring ``bounds``.

    Returns the first sample that is not finite, -1 where all are, and how many operations it took. Each motion begins
    at its time in ``starts`` from its own of the ``states``, shape (motions, states, 1 + derivatives), which become
    those where it ends: at the first sample of the next. ``drive`` has two rows a step, of which there are ``steps`` a
    sample. ``out``, shape (samples, observed, 1 + derivatives), gets what the program observes; the sample at the last
    bound is left to whoever integrates on.
    """
    p, drive = motion.program, np.ascontiguousarray(drive, dtype=np.float64)
    fits = states.shape[1:] == (motion.states, out.shape[2]) and len(states) == len(starts) == len(bounds) - 1
    fits = fits and out.shape[1] == len(motion.observed) and drive.shape[1] == len(motion.drive)
    fits = fits and bounds[-1] <= len(out) and len(drive) > 2 * steps * (min(int(bounds[-1]) + 1, len(out)) - 1)
    if not fits or any(not a.flags.carray for a in (states, out, starts, bounds)):  # the loops would write elsewhere
        raise ValueError("the arrays of a compiled loop do not fit each other; expected the shapes in its description")
    registers, done = p.registers.copy(), np.zeros(1, dtype=np.int64)
    failed = _checked(
        _function("integrate")(
            method, _at(p.code), len(p.code), motion.split, len(p.inputs), p.first, _at(registers),
            _at(motion.slots), *motion.slots.shape, _at(motion.sides), len(motion.sides), _at(motion.by_side),
            _at(motion.directions), _at(motion.shifts), _at(starts), dt, steps, _at(drive), drive.shape[1],
            _at(bounds), len(bounds), _at(states), motion.dofs, motion.states, out.shape[2],
            _at(motion.observed), len(motion.observed), len(out), _at(out), _at(done),
        )
    )  # fmt: skip
    work.add(int(done[0]))
    return failed, int(done[0])


def _at(array: Ints | Floats) -> int:
    """Where an array lies; its caller holds it."""
    return int(array.__array_interface__["data"][0])


def _checked(failed: int) -> int:
    if failed == NO_MEMORY:
        raise MemoryError("there is no memory left for a free run")
    return failed
