"""Work side by side: in order, each begun, no error lost."""

import time

import pytest

from study.support.cores import side_by_side


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
