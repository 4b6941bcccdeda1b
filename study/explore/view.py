"""What a page shows of a model, as columns by the name of their source: numbers in the units of the axes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.compare.comparison import Comparison
from study.compare.force_map import curve, surface
from study.compare.links import links
from study.diagnose.ranked import Ranked
from study.explore import check_columns, decimate, preview, record_words, words
from study.explore.axis_scales import Columns, Floats, Scales, heard, least_force, scales_of, within
from study.explore.page_units import Scale, in_text
from study.explore.session import Stage, on_record
from study.figures.labels import power_of_ten

NINETY_FIVE = 1.96  # standard errors to each side
DASH = 5.0  # pixels
DASHES = ("solid", "dashed", "dotdash", "dotted", "dashdot")
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#333333", "#E69F00")
SURE = 2.0  # standard errors: cells whose mean is below may be noise


@dataclass(frozen=True)
class View:
    """A model of the session as it is drawn."""

    columns: dict[str, Columns]  # of each source
    scales: Scales
    highest: float  # frequency in hertz at which the axes of frequency end
    quantity: str  # the measured motion
    limits: tuple[float, float]  # of the axis of the force
    least: float  # missing force, in the unit of its axis, below which nothing is to be seen
    force_unit: str  # of the record, as text
    kind: str  # of test, as ``check_columns`` tells them apart


def view(found: Stage, step: int, live: bool = True, record: int = 0) -> View:
    """The columns of a model, by its number in the session, on one of the records; only a ``live`` page can act."""
    stage = on_record(found, record)
    comparison, scales = stage.comparison, scales_of(stage.comparison)
    rows, force, least = stage.shown, scales.force, least_force(stage.comparison)
    u, v, missing = within(comparison.missing_force)
    columns = {
        "time": over_time(comparison, scales),
        "close": _close(comparison, scales),
        "noise": _noise(comparison, scales),
        "force": _force(comparison),
        "coherence": _coherence(comparison),
        "spectrum": _spectrum(comparison, scales),
        "plane": _plane(comparison, scales),
        "against_u": _against(u, missing, scales.displacement, force, least),
        "against_v": _against(v, missing, scales.velocity, force, least),
        "constancy": _constancy(rows),
        **preview.columns(stage, scales),
        **check_columns.columns(comparison, scales),
        **_links(comparison, scales),
        "words": _words(found, stage, step, live, force.unit),
    }
    limits, highest = force_limits(comparison), comparison.force.highest
    unit = in_text(comparison.record.units.get("force", ""))
    kind = check_columns.kind_of(comparison.prepared)
    return View(
        single_precision(columns), scales, highest, comparison.plan.response, limits, least / force.factor, unit, kind
    )


def _words(found: Stage, stage: Stage, step: int, live: bool, force_unit: str) -> Columns:
    """The words of a stage as one record shows it, and of all records."""
    said = words.words(stage, stage.shown, step, live, force_unit)
    more = record_words.words(found, stage.comparison.record.name, live)
    return {"place": [*said["place"], *more], "html": [*said["html"], *more.values()]}


def single_precision(sources: Mapping[str, Columns]) -> dict[str, Columns]:
    """Single precision: a screen shows no more, and a saved page is half as large. What is beyond it is not drawn."""

    def single(column: Any) -> Any:
        return np.asarray(column, dtype=np.float32) if getattr(column, "dtype", None) == np.float64 else column

    with np.errstate(over="ignore"):
        return {source: {name: single(c) for name, c in columns.items()} for source, columns in sources.items()}


def over_time(comparison: Comparison, scales: Scales, span: tuple[float, float] | None = None) -> Columns:
    """Measured and predicted response and their difference, over a span of time in seconds or all that is judged."""
    judged, part = comparison.prediction.of(0), stretch(comparison, span)
    shown = decimate.times(judged.time[part])
    places = decimate.gaps(judged.time[part], shown, judged.dt)
    lines = {
        "measured": (judged.measured, scales.response), "predicted": (judged.predicted, scales.response),
        "difference": (judged.residual, scales.difference),
    }  # fmt: skip
    drawn = {name: decimate.extremes(y[part]) / scale.factor for name, (y, scale) in lines.items()}
    return {"t": np.insert(shown, places, shown[places - 1])} | {
        name: decimate.broken(y, places) for name, y in drawn.items()
    }


def _close(comparison: Comparison, scales: Scales) -> Columns:
    """Every sample of the stretch where the model misses most."""
    judged, factor = comparison.prediction.of(0), scales.response.factor
    near = judged.closeup
    return {"t": judged.time[near], "measured": judged.measured[near] / factor,
            "predicted": judged.predicted[near] / factor}  # fmt: skip


def stretch(comparison: Comparison, span: tuple[float, float] | None) -> slice:
    """The samples of the judging part in a span of time and half of it to either side."""
    if span is None:
        return slice(None)
    time, reach = comparison.prediction.time, 0.5 * (span[1] - span[0])
    first, last = (int(i) for i in np.searchsorted(time, [span[0] - reach, span[1] + reach]))
    return slice(max(0, min(first, len(time) - 2)), max(last, 2))


def _noise(comparison: Comparison, scales: Scales) -> Columns:
    """Twice the rms of the noise to either side, as two horizontal lines."""
    level = 2.0 * comparison.prediction.of(0).noise.rms / scales.difference.factor
    ends = [float(comparison.prediction.time[0]), float(comparison.prediction.time[-1])]
    return {"t": [ends, ends], "level": [[level, level], [-level, -level]]}


def _force(comparison: Comparison) -> Columns:
    force = comparison.force
    keep = heard(comparison, force.frequency)
    shares = {"unexplained": force.unexplained, "parametric": force.parametric, "noise": force.noise}
    columns = {name: 100.0 * np.maximum(share[keep], 1e-9) for name, share in shares.items()}
    return {"f": force.frequency[keep], **columns}


def force_limits(comparison: Comparison) -> tuple[float, float]:
    """Ends of the axis of the force in per cent: where the motion is lost in noise, shares leave the panel."""
    force = comparison.force
    keep = heard(comparison, force.frequency)
    least = min(float(np.min(share[keep])) for share in (force.parametric, force.unexplained, force.noise))
    most = max(float(np.max(share[force.band])) for share in (force.parametric, force.unexplained))
    return 50.0 * max(least, 1e-9), max(200.0, 150.0 * most)


def _coherence(comparison: Comparison) -> Columns:
    force = comparison.force
    keep = heard(comparison, force.frequency)
    rows = [np.asarray(c[keep], dtype=np.float32) for c in force.cumulative]
    return {
        "f": [np.asarray(force.frequency[keep], dtype=np.float32)] * len(rows),
        "share": rows,
        "name": [in_text(i.shape) for i in force.inputs],
        "dash": [DASHES[k % len(DASHES)] for k in range(len(rows))],
        "colour": [COLOURS[k % len(COLOURS)] for k in range(len(rows))],
    }


def _spectrum(comparison: Comparison, scales: Scales) -> Columns:
    noise, factor = comparison.prediction.of(0).noise, scales.difference.factor
    keep = heard(comparison, noise.frequency)
    densities = {"difference": noise.residual, "noise": noise.density}
    return {"f": noise.frequency[keep]} | {name: np.sqrt(d[keep]) / factor for name, d in densities.items()}


def _plane(comparison: Comparison, scales: Scales) -> Columns:
    """Every cell of the map; those where the motion hardly came have no mean."""
    plane = surface(*within(comparison.missing_force))
    cells = len(plane.mean)
    left, right = (np.repeat(e, cells) for e in (plane.displacement[:-1], plane.displacement[1:]))
    low, high = (np.tile(e, cells) for e in (plane.velocity[:-1], plane.velocity[1:]))
    tiny = 1e-9 * float(np.std(comparison.record["force"]))  # rounding
    missing = plane.mean.ravel()
    mean, size, speed = missing / scales.force.factor, scales.displacement.factor, scales.velocity.factor
    return {
        "left": left / size, "right": right / size, "middle_u": 0.5 * (left + right) / size,
        "bottom": low / speed, "top": high / speed, "middle_v": 0.5 * (low + high) / speed, "mean": mean,
        "below": np.where(missing < -tiny, DASH, 0.0),
        "seen": np.where(np.isfinite(mean), 1.0, 0.0),
        "unsure": np.where(np.abs(missing) < SURE * plane.error.ravel(), 3.0, 0.0),
        "picked": np.zeros(len(mean)),
    }  # fmt: skip


def _against(motion: Floats, force: Floats, scale: Scale, unit: Scale, least: float) -> Columns:
    line = curve(motion, force)
    half = NINETY_FIVE * line.error
    ends = {"mean": line.mean, "low": line.mean - half, "high": line.mean + half}
    reach = np.resize([-least, least], len(line.at))
    return {"at": line.at / scale.factor} | {name: y / unit.factor for name, y in (ends | {"reach": reach}).items()}


def _constancy(rows: Sequence[Ranked]) -> Columns:
    """A_j(f) of every candidate whose coefficient was followed, one below the other; ``row`` tells whose it is."""
    columns: dict[str, list[Floats]] = {name: [np.zeros(0)] for name in ("row", "f", "value", "low", "high")}
    for i, row in enumerate(rows):
        if (line := row.flatness) is None:
            continue
        unit = power_of_ten(abs(row.coefficient))[0]  # of its axis
        bounds = {"low": -NINETY_FIVE, "value": 0.0, "high": NINETY_FIVE}
        values = {name: (line.value.real + errors * line.error) / unit for name, errors in bounds.items()}
        for name, column in {"row": np.full(len(line.at), float(i)), "f": line.at, **values}.items():
            columns[name].append(column)
    return {name: np.concatenate(parts) for name, parts in columns.items()}


def _links(comparison: Comparison, scales: Scales) -> dict[str, Columns]:
    """The tables that join selections: a row a line, a class or a cell, a column a block of time."""
    tied = links(comparison)
    keep = heard(comparison, tied.frequency)
    left, right = tied.edges[:-1], tied.edges[1:]
    columns: dict[str, Columns] = {
        "blocks": {
            "left": left, "right": right, "middle": 0.5 * (right + left), "weight": np.zeros(len(left)),
            "all": np.ones(len(left)),
        },
        "lines": {"f": tied.frequency[keep], "p": _by_block(tied.power[:, keep] / scales.difference.factor**2)},
        "cells": {"n": _by_block(np.minimum(tied.cells, 255).astype(np.uint8))},
    }  # fmt: skip
    motions = {"u": (tied.displacement, scales.displacement), "v": (tied.velocity, scales.velocity)}
    for name, (classes, scale) in motions.items():
        bounds, force = classes.edges / scale.factor, classes.force / scales.force.factor
        table = {"n": _by_block(classes.visits.astype(np.float64)), "s": _by_block(force)}
        columns[f"classes_{name}"] = {"left": bounds[:-1], "right": bounds[1:], **table}
    return columns


def _by_block(table: NDArray[Any]) -> NDArray[Any]:
    """One array of all blocks: each array is a message of its own to a page."""
    return np.ascontiguousarray(table.T)
