"""HDF5, and MATLAB 7.3 which is HDF5: every dataset of numbers, by its path in the file."""

from pathlib import Path
from typing import Any

import numpy as np

from study.records.readers.table import Table, from_arrays
from study.support.errors import StudyError
from study.support.extras import needed

UNIT_KEYS = ("units", "unit", "Units", "Unit")


def read(path: Path, group: str | None) -> Table:
    """Read the datasets of a file, or of one group of it.

    Raises
    ------
    StudyError
        If the group is not there.
    """
    h5py: Any = needed("h5py", f"{path}: reading HDF5", "formats")
    arrays: dict[str, object] = {}
    units: dict[str, str] = {}
    with h5py.File(path, "r") as file:
        for name in _names(h5py, file):
            dataset: Any = file[name]
            if not in_group(name, group) or dataset.dtype.kind not in "biufc":
                continue
            arrays[name] = np.asarray(dataset[()])
            units[name] = next((_text(dataset.attrs[k]) for k in UNIT_KEYS if k in dataset.attrs), "")
        if group is not None and not arrays:
            groups = sorted({n.rsplit("/", 1)[0] for n in _names(h5py, file) if "/" in n})
            raise StudyError(f"{path}: there is no group {group!r}; it holds {', '.join(groups) or 'none'}")
    return from_arrays(path, arrays, units)


def in_group(name: str, group: str | None) -> bool:
    """Whether a dataset's path lies in a group."""
    return group is None or name.startswith(group.strip("/") + "/")


def _names(h5py: Any, file: Any) -> list[str]:
    """Paths of all datasets; ``#refs#`` holds what MATLAB refers to from cells, no channels."""
    found: list[str] = []

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#"):
            found.append(name)

    file.visititems(visit)
    return found


def _text(value: Any) -> str:
    return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)
