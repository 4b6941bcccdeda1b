"""Work side by side: in order, each begun, no error lost."""

import time
from threading import Barrier, current_thread

import pytest

from study.support import cores as all_cores
from study.support import work
from study.support.cores import share_cores, side_by_side, two_at_once


@pytest.mark.parametrize("workers", [None, 1, 4])
def test_results_come_in_the_order_of_the_items(workers: int | None) -> None:
    def slow_first(item: int) -> int:
        time.sleep(0.02 / (1 + item))
        return item**2

    assert list(side_by_side(slow_first, range(8), workers=workers)) == [i**2 for i in range(8)]


def test_the_hardest_is_begun_first() -> None:
    begun: list[int] = []
    assert list(side_by_side(begun.append, [1, 3, 2], effort=float, workers=1)) == [None] * 3
    assert begun == [3, 2, 1]


def test_an_error_in_one_item_is_not_lost() -> None:
    with pytest.raises(ZeroDivisionError):
        list(side_by_side(lambda item: 1 / item, [1, 0, 2]))


def machine_of(cores: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(all_cores.os, "sched_getaffinity", lambda _: set(range(cores)), raising=False)
    monkeypatch.setattr(all_cores, "_SHARED", {"processes": 1})


def two_threads() -> int:
    return len(set(two_at_once(current_thread, current_thread)))


@pytest.mark.parametrize(("cores", "processes", "own"), [(1, 1, 1), (2, 1, 2), (2, 2, 1), (4, 2, 2), (2, 8, 1)])
def test_a_second_thread_is_for_a_core_that_is_idle(
    cores: int, processes: int, own: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine_of(cores, monkeypatch)
    share_cores(processes)
    assert all_cores.cores() == own
    assert two_threads() == (2 if own > 1 else 1)
    together = Barrier(own)

    def beside_others(_: int) -> int:
        together.wait(timeout=10.0)  # until all have begun
        threads = two_threads()
        together.wait(timeout=10.0)
        return threads

    assert list(side_by_side(beside_others, range(own))) == [1] * own
    assert two_threads() == (2 if own > 1 else 1)  # they have ended


@pytest.mark.parametrize("cores", [1, 2])
@pytest.mark.parametrize("failing", [{"one"}, {"other"}, {"one", "other"}])
def test_where_one_of_two_fails_as_much_is_counted_on_any_number_of_cores(
    cores: int, failing: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def done(name: str) -> None:
        work.add(1)
        if name in failing:
            raise ValueError(name)

    machine_of(cores, monkeypatch)
    with work.limited_to(10.0):
        with pytest.raises(ValueError, match="other" if "other" in failing else "one"):
            two_at_once(lambda: done("one"), lambda: done("other"))
        assert work.done() == 2
