"""Tables as CSV, each a column of cells by its heading."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

Columns = dict[str, list[Any]]  # cells by heading, as many in each


def columns_of(rows: Iterable[Mapping[str, Any]]) -> Columns:
    """Columns of rows, in the order in which their headings first appear; what a row lacks is None."""
    rows = list(rows)
    headings = dict.fromkeys(heading for row in rows for heading in row)
    return {heading: [row.get(heading) for row in rows] for heading in headings}


def filled(columns: Mapping[str, Any]) -> Columns:
    """Columns of arrays, one-dimensional and equally long, and of values that are the same in each row."""
    listed = {heading: cells.tolist() for heading, cells in columns.items() if isinstance(cells, np.ndarray)}
    size = max((len(cells) for cells in listed.values()), default=1)
    return {heading: listed.get(heading, [value] * size) for heading, value in columns.items()}


def one_below_the_other(tables: Sequence[Columns]) -> Columns:
    """Several tables as one, with the columns of all; what a table lacks is None."""
    headings = dict.fromkeys(heading for table in tables for heading in table)
    sizes = [len(next(iter(table.values()), list[Any]())) for table in tables]
    return {
        heading: [cell for table, size in zip(tables, sizes, strict=True) for cell in table.get(heading, [None] * size)]
        for heading in headings
    }


def csv_bytes(columns: Mapping[str, Any], form: str) -> bytes:
    """A table as CSV, floats written in a ``form`` such as ``%.10g``; NaN and None leave a cell empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(_texts(cells, form) for cells in columns.values()), strict=True))
    return text.getvalue().encode()


def _texts(cells: Any, form: str) -> list[str]:
    if isinstance(cells, np.ndarray):
        cells = cells.tolist()
    return [
        "" if cell is None or cell != cell else form % cell if isinstance(cell, float) else str(cell) for cell in cells
    ]
