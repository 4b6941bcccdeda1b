"""Numba, with the settings every kernel shares, behind one typed decorator."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, ParamSpec, TypeVar, cast

import numba  # pyright: ignore[reportMissingTypeStubs]
from llvmlite import ir  # pyright: ignore[reportMissingTypeStubs]
from numba.core import cgutils  # pyright: ignore[reportMissingTypeStubs]
from numba.extending import intrinsic as _intrinsic  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]
from numba.np import arrayobj  # pyright: ignore[reportMissingTypeStubs]

P = ParamSpec("P")
R = TypeVar("R")
_untyped: Any = SimpleNamespace(numba=numba, ir=ir, cgutils=cgutils, arrayobj=arrayobj)
builders: Any = SimpleNamespace(  # what an intrinsic writes its machine code with
    void=_untyped.numba.types.void,
    nothing=_untyped.ir.VoidType(),
    function_type=_untyped.ir.FunctionType,
    make_array=_untyped.arrayobj.make_array,
    unpack_tuple=_untyped.cgutils.unpack_tuple,
)


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile to machine code on the first call, keep the code on disk, release the GIL while it runs.

    ``error_model="numpy"`` makes a division by zero an infinity instead of an exception: the
    integrators look for non-finite states themselves and name the time at which they appear.
    """
    decorate = _untyped.numba.njit(cache=True, nogil=True, error_model="numpy")
    return cast(Callable[P, R], decorate(function))


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """The same, as part of every kernel that calls it: for what is called in each step, with many arrays."""
    decorate = _untyped.numba.njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
    return cast(Callable[P, R], decorate(function))


def intrinsic(function: Callable[..., Any]) -> Callable[..., None]:
    """What a compiled kernel may call for its effect, and whose machine code the function itself describes."""
    return cast(Callable[..., None], cast(Any, _intrinsic)(function))
