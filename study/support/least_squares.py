"""Linear least squares with columns of any size."""

from typing import Any, cast

import numpy as np

from study.support.arrays import Floats


def least_squares(columns: Floats, target: Floats, cutoff: float = 1e-12) -> Floats:
    """Amounts of the columns that approximate the target best, shape (columns,).

    Columns are scaled to unit length first; singular values below ``cutoff`` of the largest then count as zero.
    """
    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    solve = cast(Any, np.linalg.lstsq)  # its annotation leaves the element type open
    amounts: Floats = np.asarray(solve(columns / scale, target, rcond=cutoff)[0], dtype=np.float64)
    return amounts / scale
