"""Linear least squares with columns of any size."""

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def least_squares(columns: Floats, target: Floats, cutoff: float = 1e-12) -> Floats:
    """Amounts of the columns that come nearest to the target, shape (columns,).

    Columns are scaled to unit length first; what is then weaker than ``cutoff`` counts as absent.
    """
    peak = np.max(np.abs(columns), axis=0, initial=0.0)
    peak = np.where(peak > 0.0, peak, 1.0)  # first of all, so that no square overflows
    length = np.linalg.norm(columns / peak, axis=0)
    scale = peak * np.where(length > 0.0, length, 1.0)
    solve = cast(Any, np.linalg.lstsq)  # its annotation leaves the element type open
    amounts: Floats = np.asarray(solve(columns / scale, target, rcond=cutoff)[0], dtype=np.float64)
    return amounts / scale
