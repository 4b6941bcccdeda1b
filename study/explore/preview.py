"""What each candidate would leave: the residual plots once more, with it in the model."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.compare.comparison import Comparison
from study.compare.force_map import CLASSES, curve, surface
from study.compare.missing_force import MissingForce
from study.compare.noise import segments_of
from study.diagnose.ranking import Ranked
from study.explore import decimate
from study.explore.session import Rung
from study.records.spectra import autospectrum

if TYPE_CHECKING:
    from study.explore.view import Scales

Floats = NDArray[np.float64]
Columns = dict[str, Any]


def columns(rung: Rung, scales: "Scales") -> dict[str, Columns]:
    """For each candidate what it would leave, under its place: difference, its spectrum, and the missing force."""
    found, rows = rung.comparison, rung.shown
    lacking = [rung.would[row.name] for row in rows]
    return {
        "would_time": difference(rows, scales),
        "would_spectrum": {str(i): _spectrum(found, row, scales) for i, row in enumerate(rows)},
        "would_u": _curves([(r.displacement, r) for r in lacking], scales.displacement.factor, scales.force.factor),
        "would_v": _curves([(r.velocity, r) for r in lacking], scales.velocity.factor, scales.force.factor),
        "would_plane": {str(i): _map(r) / scales.force.factor for i, r in enumerate(lacking)},
    }


def _curves(lacking: Sequence[tuple[Floats, MissingForce]], along: float, factor: float) -> Columns:
    """A curve for each candidate, all of one length: what is short ends without value."""
    found: Columns = {}
    for i, (values, force) in enumerate(lacking):
        line = curve(values[force.inner], force.force[force.inner])
        for name, column in ((f"at{i}", line.at / along), (f"y{i}", line.mean / factor)):
            found[name] = np.pad(column, (0, CLASSES - len(column)), constant_values=np.nan)
    return found


def _map(lacking: MissingForce) -> Floats:
    return surface(*(x[lacking.inner] for x in (lacking.displacement, lacking.velocity, lacking.force))).mean.ravel()


def difference(rows: Sequence[Ranked], scales: "Scales", part: slice = slice(None)) -> Columns:
    """The difference that each candidate would leave, over time."""
    factor = scales.difference.factor
    return {str(i): decimate.extremes(row.residual[part]) / factor for i, row in enumerate(rows)}


def _spectrum(found: Comparison, row: Ranked, scales: "Scales") -> Floats:
    cut = segments_of(len(row.residual))
    frequency, density = autospectrum(row.residual, found.prediction.dt, cut)
    keep = (frequency > 0.0) & (frequency <= found.force.highest)
    return np.sqrt(density[keep]) / scales.difference.factor
