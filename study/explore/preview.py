"""What each candidate would leave: the residual plots once more, with it in the model."""

from collections.abc import Sequence

import numpy as np

from study.compare.comparison import Comparison
from study.compare.force_map import CLASSES, cells_of, curve, surface
from study.compare.noise import segments_of
from study.diagnose.ranked import Ranked
from study.explore import decimate
from study.explore.axis_scales import Columns, Floats, Scales, heard, within
from study.explore.session import Stage
from study.records.spectra import autospectrum


def columns(stage: Stage, scales: Scales) -> dict[str, Columns]:
    """For each candidate what it would leave, under its place: difference, its spectrum, and the missing force."""
    rows, force = stage.shown, scales.force.factor
    lacking = [within(stage.would[row.name][0]) for row in rows]
    cells = cells_of(*within(stage.comparison.missing_force)[:2])  # those of the map that is shown
    return {
        "would_time": difference(stage, scales),
        "would_spectrum": {str(i): _spectrum(stage.comparison, row, scales) for i, row in enumerate(rows)},
        "would_u": _curves([(u, f) for u, _, f in lacking], scales.displacement.factor, force),
        "would_v": _curves([(v, f) for _, v, f in lacking], scales.velocity.factor, force),
        "would_plane": {str(i): surface(u, v, f, cells).mean.ravel() / force for i, (u, v, f) in enumerate(lacking)},
    }


def _curves(pairs: Sequence[tuple[Floats, Floats]], along: float, factor: float) -> Columns:
    """A curve for each candidate, all of one length: what is short ends without value."""
    curves: Columns = {}
    for i, (motion, force) in enumerate(pairs):
        line = curve(motion, force)
        for name, column in ((f"at{i}", line.at / along), (f"y{i}", line.mean / factor)):
            curves[name] = np.pad(column, (0, CLASSES - len(column)), constant_values=np.nan)
    return curves


def difference(stage: Stage, scales: Scales, part: slice = slice(None)) -> Columns:
    """The difference that each candidate would leave, over time."""
    factor, judged = scales.difference.factor, stage.comparison.prediction
    time = judged.time[part]
    places = decimate.gaps(time, decimate.times(time), judged.dt)
    return {
        str(i): decimate.broken(decimate.extremes(row.residual[part]) / factor, places)
        for i, row in enumerate(stage.shown)
    }


def _spectrum(comparison: Comparison, row: Ranked, scales: Scales) -> Floats:
    cut = segments_of(len(row.residual))
    frequency, density = autospectrum(row.residual, comparison.prediction.dt, cut)
    return np.sqrt(density[heard(comparison, frequency)]) / scales.difference.factor
