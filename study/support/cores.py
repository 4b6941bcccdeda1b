"""How much may run at once."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import TypeVar

from study.support import work

Item = TypeVar("Item")
Result = TypeVar("Result")
Other = TypeVar("Other")
_SHARED = {"processes": 1}
_AT_WORK: list[object] = []  # an item for each thread that has one


def cores() -> int:
    """Cores that this process may use, which a batch system or a container may hold below those of the machine."""
    tells = hasattr(os, "sched_getaffinity")  # Linux alone
    there = len(os.sched_getaffinity(0)) if tells else os.cpu_count() or 1
    return max(1, there // _SHARED["processes"])


def share_cores(processes: int) -> None:
    """Say that so many processes share these cores, this one included."""
    _SHARED["processes"] = processes


def one_thread_of_algebra() -> None:
    """Keep NumPy, which is not to be loaded yet, from threads of its own: beside others they wait and take a core."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def two_at_once(one: Callable[[], Result], other: Callable[[], Other]) -> tuple[Result, Other]:
    """Results of two functions, the first in a thread of its own if a core is idle; what it does is counted here.

    Both are called in any case, so that as much is counted whatever else has to be done; of two errors the other's is
    raised.
    """
    if max(1, len(_AT_WORK)) < cores():
        with ThreadPoolExecutor(1) as beside:
            begun = beside.submit(work.counted_here(one))
            second = other()
            return begun.result(), second
    try:
        second = other()
    except Exception:
        with suppress(Exception):
            one()
        raise
    return one(), second


def side_by_side(
    function: Callable[[Item], Result], items: Sequence[Item], effort: Callable[[Item], float] | None = None,
    workers: int | None = None,
) -> Iterator[Result]:  # fmt: skip
    """Results in the order of the items, as soon as they are there, by one thread a core, or so many ``workers``.

    The compiled loops and the transforms release the interpreter's lock.

    What takes the most ``effort`` is begun first: last, it would keep the other cores waiting.
    """
    hardest_first = sorted(range(len(items)), key=lambda i: -effort(items[i]) if effort else 0.0)

    def at_work(item: Item) -> Result:
        _AT_WORK.append(item)
        try:
            return function(item)
        finally:
            _AT_WORK.pop()

    with ThreadPoolExecutor(workers or cores()) as pool:
        counted = work.counted_here(at_work)
        begun = {i: pool.submit(counted, items[i]) for i in hardest_first}
        try:
            for i in range(len(items)):
                yield begun.pop(i).result()  # which nobody holds any longer
        finally:  # where the user ends it, what has not begun is left
            pool.shutdown(wait=False, cancel_futures=True)
