"""What each candidate would leave: the residual plots once more, with it in the model."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.compare.comparison import Comparison
from study.compare.noise import segments_of
from study.compare.restoring import missing_force
from study.compare.surface import curve, surface
from study.diagnose.ranking import Ranked
from study.errors import StudyError
from study.explore import decimate
from study.spectra import autospectrum

if TYPE_CHECKING:
    from study.explore.view import Scales

Floats = NDArray[np.float64]
Columns = dict[str, Any]


def columns(found: Comparison, rows: Sequence[Ranked], scales: "Scales") -> dict[str, Columns]:
    """For each candidate a column, named by its place: difference, its spectrum, and the missing force."""
    forces = [_force(found, row) for row in rows]
    lacking, keep = found.restoring, found.restoring.inner
    u, v = lacking.displacement[keep], lacking.velocity[keep]
    return {
        "would_time": difference(found, rows, scales),
        "would_spectrum": {str(i): _spectrum(found, row, scales) for i, row in enumerate(rows)},
        "would_u": {str(i): curve(u, f[keep]).mean / scales.force.factor for i, f in enumerate(forces)},
        "would_v": {str(i): curve(v, f[keep]).mean / scales.force.factor for i, f in enumerate(forces)},
        "would_plane": {str(i): surface(u, v, f[keep]).mean.ravel() for i, f in enumerate(forces)},
    }


def difference(found: Comparison, rows: Sequence[Ranked], scales: "Scales", part: slice = slice(None)) -> Columns:
    """The difference that each candidate would leave, over time."""
    factor = scales.difference.factor
    return {str(i): decimate.extremes(found.judged.above(row.residual)[part]) / factor for i, row in enumerate(rows)}


def _spectrum(found: Comparison, row: Ranked, scales: "Scales") -> Floats:
    cut = segments_of(len(row.residual))
    frequency, density = autospectrum(row.residual, found.judged.dt, cut)
    keep = (frequency > 0.0) & (frequency <= found.force.highest)
    return np.sqrt(density[keep]) / scales.difference.factor


def _force(found: Comparison, row: Ranked) -> Floats:
    """The missing force with a candidate in the model, along the same motion; as it is where that has no value."""
    lacking = found.restoring
    motion = {name: getattr(lacking, name) for name in ("displacement", "velocity", "acceleration")}
    record = found.record.part(*found.how.judge).with_channels(motion)
    try:
        return missing_force(row.found.model, (), record)[:, 0]
    except StudyError:
        return lacking.force
