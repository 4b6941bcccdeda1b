"""Lines of numbers by NumPy's parser, and tables as CSV: gaps are NaN on the way in, empty cells on the way out."""

import math

import numpy as np
import pytest

from study.records.number_table import number_table
from study.support.csv_text import columns_of, csv_bytes, filled, one_below_the_other


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_empty_cells_are_gaps_wherever_they_stand(mark: str) -> None:
    body = mark.join(("1", "", "3")) + "\n" + mark.join(("", "5", "")) + "\n\n" + mark * 2 + "\n"
    expected = [[1.0, np.nan, 3.0], [np.nan, 5.0, np.nan], [np.nan] * 3]
    np.testing.assert_array_equal(number_table(body.encode(), mark), expected)


@pytest.mark.parametrize("body", [b"1,2\n3\n", b"1,2\n3,4,5\n", b"1,2\n3,true\n", b"1,2\n3,0x1p3\n", b"1,2\n3,1_0\n"])
def test_what_is_no_table_of_numbers_is_an_error(body: bytes) -> None:
    with pytest.raises(ValueError, match=r".+"):
        number_table(body, ",")


def test_all_digits_come_back() -> None:
    values = np.random.default_rng(1).standard_normal((50, 2)) * 10.0 ** np.arange(-25, 25)[:, None]
    written = csv_bytes({"a": values[:, 0], "b": values[:, 1]}, "%.17g")
    np.testing.assert_array_equal(number_table(written.partition(b"\n")[2], ","), values)


def test_tables_of_unlike_columns_stand_below_each_other() -> None:
    one, other = filled({"x": np.array([1.0, 2.5]), "of": "a, b"}), columns_of([{"x": math.nan, "held": True}])
    written = csv_bytes(one_below_the_other([one, other]), "%.10g").decode()
    assert written == 'x,of,held\n1,"a, b",\n2.5,"a, b",\n,,True\n'
