"""How much a search has done, and when that is enough: counted in operations, not in seconds.

So where a search ends turns neither on the machine nor on what else that has to do.
"""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from threading import Lock
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
Result = TypeVar("Result")

MOST = 56e9, 56e9 / 8192  # operations of a diagnosis, faults included (a minute of two cores); of each sample
ENDED = "at its limit of work (--thorough goes on)"


class WorkDoneError(Exception):
    """A search has done all that it may."""


class Work:
    """Operations that a search may take, and those that it took; its threads count together."""

    def __init__(self, most: float) -> None:
        self.most, self.done, self._lock = most, 0, Lock()

    def add(self, operations: int) -> None:
        """Count what one thread did."""
        with self._lock:
            self.done += operations


_CURRENT: ContextVar[Work | None] = ContextVar("work", default=None)


def most_for(samples: int) -> float:
    """Operations that a diagnosis of a record of so many samples may take: of a long one in proportion."""
    least, each = MOST
    return max(least, each * samples)


@contextmanager
def limited_to(most: float) -> Generator[None]:
    """Count what is done within; ``most`` operations, unless what is around has set a limit of its own."""
    token = _CURRENT.set(_CURRENT.get() or Work(most))
    try:
        yield
    finally:
        _CURRENT.reset(token)


def add(operations: int) -> None:
    """Count operations where somebody has set a limit."""
    current = _CURRENT.get()
    if current is not None:
        current.add(operations)


def done() -> int:
    """Operations so far; 0 where nobody has set a limit."""
    current = _CURRENT.get()
    return 0 if current is None else current.done


def is_done() -> bool:
    """Whether as much is done as may be."""
    current = _CURRENT.get()
    return current is not None and current.done >= current.most


def go_on() -> None:
    """Raise :class:`WorkDoneError` where as much is done as may be."""
    if is_done():
        raise WorkDoneError


def counted_here(function: Callable[P, Result]) -> Callable[P, Result]:
    """The function for another thread: what it does there is counted here."""
    context = copy_context()

    def run(*arguments: P.args, **named: P.kwargs) -> Result:
        return context.copy().run(function, *arguments, **named)  # a context is entered by one thread at a time

    return run
