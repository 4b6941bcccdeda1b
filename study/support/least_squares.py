"""Linear least squares with columns of any size."""

from typing import Any, cast

import numpy as np

from study.support.arrays import Floats

NOTHING = 1e-200  # of the largest column: what is so much smaller tells nothing, and its amount would overflow


def least_squares(columns: Floats, target: Floats, cutoff: float = 1e-12) -> Floats:
    """Amounts of the columns that approximate the target best, shape (columns,).

    Columns are scaled to unit length first; singular values below ``cutoff`` of the largest then count as zero.
    """
    peak = np.max(np.abs(columns), axis=0, initial=0.0)
    peak = np.where(peak > NOTHING * np.max(peak, initial=0.0), peak, np.inf)  # first, so that no square overflows
    length = np.linalg.norm(columns / peak, axis=0)
    scale = peak * np.where(length > 0.0, length, 1.0)
    solve = cast(Any, np.linalg.lstsq)  # its annotation leaves the element type open
    amounts: Floats = np.asarray(solve(columns / scale, target, rcond=cutoff)[0], dtype=np.float64)
    return amounts / scale
