"""Numbers in words."""

import pytest

from study.support.numbers import by_chance


@pytest.mark.parametrize(
    ("p_value", "records"),
    [(3e-13, "fewer than 1 of 1000"), (0.004, "about 4 of 1000"), (0.03, "about 3 of 100"), (0.4, "about 40 of 100")],
)
def test_a_p_value_is_said_as_a_number_of_records(p_value: float, records: str) -> None:
    assert by_chance(p_value) == f"chance alone would do as much in {records} records"
