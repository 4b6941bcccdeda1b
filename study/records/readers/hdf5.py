"""HDF5, and MATLAB 7.3 which is HDF5: every dataset of numbers, by its path in the file."""

from pathlib import Path
from typing import Any

import numpy as np

from study.records.readers.table import Table, from_arrays, in_group
from study.support.extras import needed

UNIT_KEYS = ("units", "unit", "Units", "Unit")


def read(path: Path, group: str | None) -> Table:
    """Read the datasets of a file, or of one group of it; ``#refs#`` holds what MATLAB refers to from cells."""
    h5py: Any = needed("h5py", f"{path}: reading HDF5", "formats")
    names: list[str] = []

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#"):
            names.append(name)

    with h5py.File(path, "r") as file:
        file.visititems(visit)
        datasets: dict[str, Any] = {name: file[name] for name in in_group(path, names, group, "group")}
        numbers = {name: data for name, data in datasets.items() if data.dtype.kind in "biufc"}
        units = {name: _unit(data.attrs) for name, data in numbers.items()}
        return from_arrays(path, {name: np.asarray(data[()]) for name, data in numbers.items()}, units)


def _unit(attributes: Any) -> str:
    value = next((attributes[key] for key in UNIT_KEYS if key in attributes), "")
    return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)
