"""MATLAB up to version 7 (format 4 and 5): every array of numbers, a structure's fields by ``name/field``."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
from scipy.io import loadmat

from study.records.readers.table import Table, from_arrays, in_group


def read(path: Path, group: str | None) -> Table:
    """Read the arrays of a file, or of one structure in it."""
    loaded: dict[str, Any] = loadmat(str(path), simplify_cells=True, appendmat=False)
    arrays = dict(_flat({k: v for k, v in loaded.items() if not k.startswith("__")}, ""))
    return from_arrays(path, {name: arrays[name] for name in in_group(path, arrays, group, "structure")}, {})


def _flat(fields: dict[str, Any], prefix: str) -> Iterator[tuple[str, object]]:
    for name, value in fields.items():
        if isinstance(value, dict):
            yield from _flat(cast("dict[str, Any]", value), f"{prefix}{name}/")
        elif isinstance(value, np.ndarray) or np.isscalar(value):
            yield f"{prefix}{name}", value
