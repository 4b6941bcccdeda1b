"""Parquet: columns by name."""

from pathlib import Path
from typing import Any

import numpy as np

from study.records.readers.table import NONE, Column, Table, split_unit
from study.support.extras import needed


def read(path: Path, _group: str | None = None) -> Table:
    """Read every column; moments in time become seconds from the first."""
    parquet: Any = needed("pyarrow.parquet", f"{path}: reading Parquet", "formats")
    table: Any = parquet.ParquetFile(path).read()  # one file, with nothing inferred from the folder's name
    return Table(tuple(_column(str(name), data) for name, data in zip(table.column_names, table.columns, strict=True)))


def _column(heading: str, data: Any) -> Column:
    name, unit = split_unit(heading)
    values: Any = np.asarray(data.to_numpy())
    if values.dtype.kind == "M":
        values = (values - values[:1]) / np.timedelta64(1, "s")
    if values.dtype.kind not in "biuf":
        return Column(name, NONE, unit, fault=f"column {name!r} holds {data.type}; expected real numbers")
    return Column(name, values.astype(np.float64), unit)
