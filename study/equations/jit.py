"""Numba, with the settings every kernel shares, behind one typed decorator."""

import sys
from collections.abc import Callable
from functools import cache, partial
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
    return cast(Callable[P, R], _decorated(function))


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """The same, as part of every kernel that calls it: for what is called in each step, with many arrays."""
    return cast(Callable[P, R], _decorated(function, forceinline=True))


def intrinsic(function: Callable[..., Any]) -> Callable[..., None]:
    """What a compiled kernel may call for its effect, and whose machine code the function itself describes."""
    return cast(Callable[..., None], cast(Any, _intrinsic)(function))


def _decorated(function: Callable[..., Any], **options: bool) -> Any:
    """Numba's dispatcher; it keeps nothing where neither the installation nor the user has a folder to write to."""
    decorate = partial(_untyped.numba.njit, nogil=True, error_model="numpy", **options)
    try:
        return _once(decorate(cache=True)(function))
    except RuntimeError as error:
        if "cache" not in str(error):
            raise
    _say_once()
    return _once(decorate()(function))


def _once(dispatcher: Any) -> Any:
    """Compile once for all whole numbers; Numba would anew for each that a calling kernel writes out, 0 or 1 or 2."""
    of_types, unliteral = dispatcher.get_call_template, _untyped.numba.types.unliteral

    def of_plain_types(given: Any, named: Any) -> Any:
        plain = {name: unliteral(kind) for name, kind in named.items()}
        return of_types(tuple(unliteral(kind) for kind in given), plain)

    dispatcher.get_call_template = of_plain_types
    return dispatcher


@cache
def _say_once() -> None:
    print(
        "study: compiled code cannot be kept (the installation is read-only and there is no writable home), so each run"
        " compiles anew; set NUMBA_CACHE_DIR to a writable folder to save that time",
        file=sys.stderr,
    )
