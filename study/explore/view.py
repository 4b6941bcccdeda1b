"""What a rung shows, as columns by the name of their source: numbers in the units of the axes, ready to be drawn."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.compare.comparison import Comparison
from study.compare.force_map import CELLS, curve, surface
from study.compare.links import links
from study.diagnose.constancy import Curve as Steadiness
from study.diagnose.ranking import Ranked
from study.explore import decimate, preview, words
from study.explore.page_units import Scale, in_text, length, power, rate
from study.explore.session import Rung
from study.figures.labels import power_of_ten

Floats = NDArray[np.float64]
Columns = dict[str, Any]
NINETY_FIVE = 1.96  # standard errors to each side
LEAST = 0.005  # of the rms force
DASH = 5.0  # pixels
SURE = 2.0  # standard errors: cells whose mean is below may be noise


@dataclass(frozen=True)
class Scales:
    """How the axes of a rung are scaled."""

    response: Scale
    difference: Scale
    displacement: Scale
    velocity: Scale
    force: Scale


@dataclass(frozen=True)
class View:
    """A rung as it is drawn.

    Attributes
    ----------
    columns : dict
        Columns of each source.
    scales : Scales
        Units of the axes.
    highest : float
        Frequency in hertz at which the axes of frequency end.
    quantity : str
        The measured motion.
    limits : (float, float)
        Ends of the axis of the force.
    least : float
        Missing force, in the unit of its axis, down to which axes are drawn: below lies nothing to be seen.
    """

    columns: dict[str, Columns]
    scales: Scales
    highest: float
    quantity: str
    limits: tuple[float, float]
    least: float


def view(rung: Rung, step: int, live: bool = True) -> View:
    """The columns of one rung.

    Parameters
    ----------
    rung : Rung
        A model with its comparison and, perhaps, its diagnosis.
    step : int
        Its number in the session.
    live : bool
        Whether the page can act (a saved one cannot).
    """
    found, scales = rung.comparison, scales_of(rung.comparison)
    rows = rung.shown
    columns = {
        "time": over_time(found, scales),
        "close": _close(found, scales),
        "noise": _noise(found, scales),
        "force": _force(found),
        "coherence": _coherence(found),
        "spectrum": _spectrum(found, scales),
        "plane": _plane(found, scales),
        "against_u": _against(found, "displacement", scales.displacement, scales.force),
        "against_v": _against(found, "velocity", scales.velocity, scales.force),
        "constancy": _constancy(rows),
        **preview.columns(rung, scales),
        **_links(found, scales),
        "words": words.words(rung, rows, step, live, scales.force.unit),
    }
    least = least_force(found) / scales.force.factor
    small = {name: _small(c) for name, c in columns.items()}
    return View(small, scales, found.force.highest, found.plan.response, force_limits(found), least)


def _small(columns: Columns) -> Columns:
    """Single precision: a screen shows no more, and a saved page is half as large. What is beyond it is not drawn."""
    with np.errstate(over="ignore"):
        return {
            name: np.asarray(c, dtype=np.float32) if getattr(c, "dtype", None) == np.float64 else c
            for name, c in columns.items()
        }


def least_force(found: Comparison) -> float:
    """Missing force down to which axes are drawn: below lies nothing to be seen."""
    return LEAST * float(np.std(found.record["force"]))


def scales_of(found: Comparison) -> Scales:
    """Units in which the numbers of a comparison are easy to read."""
    units, lacking = found.record.units, found.missing_force
    u, v = (float(np.max(np.abs(x))) for x in (lacking.displacement, lacking.velocity))
    least = least_force(found)
    motion = rate if found.plan.response != "displacement" else length
    unit = units.get(found.plan.response, "")
    return Scales(
        response=motion(unit, float(np.max(np.abs(found.prediction.measured)))),
        difference=motion(unit, float(np.max(np.abs(found.prediction.residual)))),
        displacement=length(units.get("displacement", ""), u),
        velocity=rate(units.get("velocity", ""), v),
        force=power(units.get("force", ""), float(np.max(np.abs(lacking.force[lacking.inner]), initial=least))),
    )


def over_time(found: Comparison, scales: Scales, span: tuple[float, float] | None = None) -> Columns:
    """Measured and predicted response and their difference, over a span of time in seconds or all that is judged."""
    judged, part = found.prediction, within(found, span)
    return {
        "t": decimate.times(judged.time[part]),
        "measured": decimate.extremes(judged.measured[part]) / scales.response.factor,
        "predicted": decimate.extremes(judged.predicted[part]) / scales.response.factor,
        "difference": decimate.extremes(judged.residual[part]) / scales.difference.factor,
    }


def _close(found: Comparison, scales: Scales) -> Columns:
    """Every sample of the stretch where the model misses most."""
    judged, near = found.prediction, found.prediction.closeup
    factor = scales.response.factor
    return {
        "t": judged.time[near], "measured": judged.measured[near] / factor, "predicted": judged.predicted[near] / factor
    }  # fmt: skip


def within(found: Comparison, span: tuple[float, float] | None) -> slice:
    """The samples of the judging part in a span of time and half of it to either side."""
    if span is None:
        return slice(None)
    time, reach = found.prediction.time, 0.5 * (span[1] - span[0])
    first, last = (int(i) for i in np.searchsorted(time, [span[0] - reach, span[1] + reach]))
    return slice(max(0, min(first, len(time) - 2)), max(last, 2))


def _noise(found: Comparison, scales: Scales) -> Columns:
    """Twice the rms of the noise to either side, as two horizontal lines."""
    level = 2.0 * found.prediction.noise.rms / scales.difference.factor
    ends = [float(found.prediction.time[0]), float(found.prediction.time[-1])]
    return {"t": [ends, ends], "level": [[level, level], [-level, -level]]}


def _heard(frequency: Floats, highest: float) -> NDArray[np.bool_]:
    return (frequency > 0.0) & (frequency <= highest)


def _force(found: Comparison) -> Columns:
    force = found.force
    keep = _heard(force.frequency, force.highest)
    share = {"unexplained": force.unexplained, "parametric": force.parametric, "noise": force.noise}
    return {
        "f": force.frequency[keep],
        **{name: 100.0 * np.maximum(values[keep], 1e-9) for name, values in share.items()},
    }


def force_limits(found: Comparison) -> tuple[float, float]:
    """Ends of the axis of the force in per cent: where the motion is lost in noise, shares leave the panel."""
    force = found.force
    keep = _heard(force.frequency, force.highest)
    inside = np.concatenate([force.parametric[force.band], force.unexplained[force.band]])
    least = np.concatenate([force.parametric[keep], force.unexplained[keep], force.noise[keep]])
    return 50.0 * max(float(np.min(least)), 1e-9), max(200.0, 150.0 * float(np.max(inside)))


def _coherence(found: Comparison) -> Columns:
    force = found.force
    keep = _heard(force.frequency, force.highest)
    rows = [np.asarray(c[keep], dtype=np.float32) for c in force.cumulative]
    dashes = ("solid", "dashed", "dotdash", "dotted", "dashdot")
    return {
        "f": [np.asarray(force.frequency[keep], dtype=np.float32)] * len(rows),
        "share": rows,
        "name": [in_text(i.shape) for i in force.inputs],
        "dash": [dashes[k % len(dashes)] for k in range(len(rows))],
        "colour": [("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#333333", "#E69F00")[k % 6] for k in range(len(rows))],
    }


def _spectrum(found: Comparison, scales: Scales) -> Columns:
    noise, factor = found.prediction.noise, scales.difference.factor
    keep = _heard(noise.frequency, found.force.highest)
    return {
        "f": noise.frequency[keep],
        "difference": np.sqrt(noise.residual[keep]) / factor,
        "noise": np.sqrt(noise.density[keep]) / factor,
    }


def _plane(found: Comparison, scales: Scales) -> Columns:
    """Every cell of the map; those where the motion hardly came have no mean."""
    lacking = found.missing_force
    plane = surface(*(x[lacking.inner] for x in (lacking.displacement, lacking.velocity, lacking.force)))
    left, right = (np.repeat(e, CELLS) for e in (plane.displacement[:-1], plane.displacement[1:]))
    low, high = (np.tile(e, CELLS) for e in (plane.velocity[:-1], plane.velocity[1:]))
    tiny = 1e-9 * float(np.std(found.record["force"]))  # rounding
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


def _against(found: Comparison, of: str, scale: Scale, force: Scale) -> Columns:
    lacking = found.missing_force
    values = lacking.displacement if of == "displacement" else lacking.velocity
    line = curve(values[lacking.inner], lacking.force[lacking.inner])
    half = NINETY_FIVE * line.error
    at = line.at / scale.factor
    return {
        "at": at, "mean": line.mean / force.factor, "low": (line.mean - half) / force.factor,
        "high": (line.mean + half) / force.factor,
        "reach": np.resize([-1.0, 1.0], len(at)) * least_force(found) / force.factor,
    }  # fmt: skip


def _constancy(rows: Sequence[Ranked]) -> Columns:
    """A_j(f) of every candidate whose coefficient was followed, one below the other; ``row`` tells whose it is."""
    parts = [(i, row, row.flatness) for i, row in enumerate(rows) if row.flatness is not None]
    return {
        "row": np.concatenate([np.full(len(c.at), float(i)) for i, _, c in parts] or [np.zeros(0)]),
        "f": np.concatenate([c.at for _, _, c in parts] or [np.zeros(0)]),
        **{name: np.concatenate([_relative(c, r, k) for _, r, c in parts] or [np.zeros(0)])
           for name, k in (("value", 0.0), ("low", -NINETY_FIVE), ("high", NINETY_FIVE))},
    }  # fmt: skip


def _relative(line: Steadiness, row: Ranked, errors: float) -> Floats:
    """The coefficient along frequency, some standard errors up or down, in the unit of its axis."""
    return (line.value.real + errors * line.error) / power_of_ten(abs(row.coefficient))[0]


def _links(found: Comparison, scales: Scales) -> dict[str, Columns]:
    """The tables that join selections: rows are blocks of time, columns lines, classes or cells."""
    tied = links(found)
    keep = _heard(tied.frequency, found.force.highest)
    middle = 0.5 * (tied.edges[1:] + tied.edges[:-1])
    found_links: dict[str, Columns] = {
        "blocks": {
            "left": tied.edges[:-1], "right": tied.edges[1:], "middle": middle, "weight": np.zeros(len(middle)),
            "all": np.ones(len(middle)),
        },
        "lines": {"f": tied.frequency[keep]} | _rows("p", tied.power[:, keep] / scales.difference.factor**2),
        "cells": _rows("n", np.minimum(tied.cells, 255).astype(np.uint8)),
    }  # fmt: skip
    for name, classes, scale in (
        ("classes_u", tied.displacement, scales.displacement), ("classes_v", tied.velocity, scales.velocity)
    ):  # fmt: skip
        bounds = classes.edges / scale.factor
        found_links[name] = {
            "left": bounds[:-1], "right": bounds[1:],
            **_rows("n", classes.visits), **_rows("s", classes.force / scales.force.factor),
        }  # fmt: skip
    return found_links


def _rows(prefix: str, table: NDArray[Any]) -> Columns:
    return {f"{prefix}{k}": row for k, row in enumerate(table)}
