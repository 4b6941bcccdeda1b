"""MATLAB up to version 7 (format 4 and 5): every array of numbers, a structure's fields by ``name/field``."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
from scipy.io import loadmat

from study.records.readers.hdf5 import in_group
from study.records.readers.table import Table, from_arrays
from study.support.errors import StudyError


def read(path: Path, group: str | None) -> Table:
    """Read the arrays of a file, or of one structure in it.

    Raises
    ------
    StudyError
        If the structure is not there.
    """
    loaded: dict[str, Any] = loadmat(str(path), simplify_cells=True, appendmat=False)
    arrays = dict(_flat({k: v for k, v in loaded.items() if not k.startswith("__")}, ""))
    chosen = {name: value for name, value in arrays.items() if in_group(name, group)}
    if group is not None and not chosen:
        groups = sorted({n.rsplit("/", 1)[0] for n in arrays if "/" in n})
        raise StudyError(f"{path}: there is no structure {group!r}; it holds {', '.join(groups) or 'none'}")
    return from_arrays(path, chosen, {})


def _flat(fields: dict[str, Any], prefix: str) -> Iterator[tuple[str, object]]:
    for name, value in fields.items():
        if isinstance(value, dict):
            yield from _flat(cast("dict[str, Any]", value), f"{prefix}{name}/")
        elif isinstance(value, np.ndarray) or np.isscalar(value):
            yield f"{prefix}{name}", value
