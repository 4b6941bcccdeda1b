"""Work side by side: in order, each begun, no error lost."""

import time
from threading import current_thread

import pytest

from study.support import cores as all_cores
from study.support import work
from study.support.cores import beside_others, side_by_side, two_at_once


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


def two_threads() -> int:
    return len(set(two_at_once(current_thread, current_thread)))


@pytest.mark.parametrize(("cores", "jobs", "threads"), [(1, 0, 1), (2, 0, 2), (2, 2, 1), (4, 2, 2)])
def test_a_second_thread_is_for_a_core_that_is_idle(
    cores: int, jobs: int, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(all_cores, "cores", lambda: cores)
    monkeypatch.setattr(all_cores, "_AT_WORK", list[object]())
    beside_others(jobs)
    assert two_threads() == threads
    assert list(side_by_side(lambda _: two_threads(), range(3), workers=1)) == [2 if cores - jobs > 1 else 1] * 3
    assert two_threads() == threads  # they have ended


@pytest.mark.parametrize("cores", [1, 2])
@pytest.mark.parametrize("failing", [{"one"}, {"other"}, {"one", "other"}])
def test_where_one_of_two_fails_as_much_is_counted_on_any_number_of_cores(
    cores: int, failing: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def done(name: str) -> None:
        work.add(1)
        if name in failing:
            raise ValueError(name)

    monkeypatch.setattr(all_cores, "cores", lambda: cores)
    with work.limited_to(10.0):
        with pytest.raises(ValueError, match="other" if "other" in failing else "one"):
            two_at_once(lambda: done("one"), lambda: done("other"))
        assert work.done() == 2
