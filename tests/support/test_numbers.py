"""Numbers in words."""

import math

import pytest

from study.support.numbers import by_chance, in_one_notation, percent


@pytest.mark.parametrize(
    ("p_value", "records"),
    [(3e-13, "fewer than 1 of 1000"), (0.004, "about 4 of 1000"), (0.03, "about 3 of 100"), (0.4, "about 40 of 100")],
)
def test_a_p_value_is_said_as_a_number_of_records(p_value: float, records: str) -> None:
    assert by_chance(p_value) == f"chance alone would do as much in {records} records"


@pytest.mark.parametrize(
    ("values", "shown"),
    [
        ((99962.0, 99803.0, 100121.0), ["99962", "99803", "100120"]),
        ((43531.0, 35312.0, 51748.0), ["43531", "35312", "51748"]),
        ((2e7, 1.999e7, 2.001e7), ["2e+07", "1.999e+07", "2.001e+07"]),
        ((1e6, -12.0, 2e6), ["1e+06", "-12", "2e+06"]),
    ],
)
def test_the_ends_of_an_interval_are_written_alike(values: tuple[float, ...], shown: list[str]) -> None:
    assert in_one_notation(values, 5) == shown


@pytest.mark.parametrize(
    ("share", "error", "shown"),
    [(0.318, 0.04, "31.8 +- 4.0 %"), (1.0, 4e-9, "100.0 %"), (1.0, 0.0, "100.0 %"), (math.nan, math.nan, "-")],
)
def test_a_standard_error_that_is_nothing_in_its_digits_is_left_out(share: float, error: float, shown: str) -> None:
    assert percent(share, "z.1f", error, ".1f") == shown
