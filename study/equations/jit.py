"""Numba, with the settings every kernel shares, behind one typed decorator."""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

from numba import njit  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile to machine code on the first call, keep the code on disk, release the GIL while it runs.

    ``error_model="numpy"`` makes a division by zero an infinity instead of an exception: the
    integrators look for non-finite states themselves and name the time at which they appear.
    """
    decorate = cast(Any, njit(cache=True, nogil=True, error_model="numpy"))
    return cast(Callable[P, R], decorate(function))


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """The same, as part of every kernel that calls it: for what is called in each step, with many arrays."""
    decorate = cast(Any, njit(cache=True, nogil=True, error_model="numpy", forceinline=True))
    return cast(Callable[P, R], decorate(function))
