"""What a page shows of a model, as columns by the name of their source: numbers in the units of the axes.

Some columns belong to the record, others to the sensor or to the place that is looked at. A single mass has one sensor
and one place; of a structure the page turns from one to another.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.compare import history
from study.compare.comparison import Comparison
from study.compare.connection_spectra import DynamicStiffness, dynamic_stiffnesses
from study.compare.force_map import CLASSES, curve, surface
from study.compare.links import power_in_blocks, times_of_blocks, visits_in_blocks
from study.compare.noise import segments_of
from study.compare.place_sketch import sketch_of
from study.diagnose.diagnosis_sketch import sketch_of_diagnosis
from study.diagnose.ranked import Ranked
from study.equations.coefficient_units import units_at
from study.equations.place import HERE, Place
from study.explore import axes, check_columns, decimate, place_words, record_words, words
from study.explore.axis_scales import LEAST_FORCE, Columns, Focus, heard, rms_force
from study.explore.check_columns import NINETY_FIVE
from study.explore.page_units import in_text, power
from study.explore.session import Session, Stage, on_record
from study.figures.labels import power_of_ten, term_names
from study.figures.sketch import Sketch
from study.records.spectra import autospectrum
from study.support.arrays import Floats

DASH = 5.0  # pixels
DASHES = ("solid", "dashed", "dotdash", "dotted", "dashdot")
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#333333", "#E69F00")
SURE_CELL = 2.0  # standard errors: cells whose mean is below may be noise


@dataclass(frozen=True, eq=False)
class View:
    """A model of the session on one of its records, as a page shows it."""

    found: Stage  # of all records
    step: int  # its number in the session
    live: bool = True  # only a live page can act
    record: int = 0

    @cached_property
    def stage(self) -> Stage:
        """The stage as this record shows it."""
        return on_record(self.found, self.record)

    @cached_property
    def sketch(self) -> Sketch | None:
        """The sketch of a structure, of what was found of all records together; a single mass has none."""
        if not self.found.model.named:
            return None
        return sketch_of(self.found.comparison) if self.found.diagnosis is None else sketch_of_diagnosis(
            self.found.diagnosis
        )  # fmt: skip

    @cached_property
    def places(self) -> dict[str, Place]:
        """What can be looked at, by its label: the connections of the sketch, that which glows most first."""
        links = self.sketch.links if self.sketch is not None else ()
        return {link.place.label: link.place for link in sorted(links, key=lambda link: -link.share)} or {"": HERE}

    @property
    def sensors(self) -> tuple[str, ...]:
        """The names of the sensors that are compared."""
        return tuple(str(seen.sensor) for seen in self.stage.comparison.views)

    def nearest(self, label: str) -> str:
        """The sensor to look at beside a place: of those on it, or of all, that with the largest error."""
        views, ends = self.stage.comparison.views, self.places[label].moving
        return str(max([v for v in views if v.sensor.coordinate in ends] or views, key=lambda v: v.error).sensor)

    def focus(self, sensor: str, label: str) -> Focus:
        """A sensor, and a place: where no force can be seen to be missing, as of a place without a sensor, another."""
        shown = {place.path: place for place in self.stage.comparison.missing.shown}
        place = shown.get(self.places[label].path, next(iter(shown.values())))
        return Focus(self.stage.comparison, self.sensors.index(sensor), place)

    @cached_property
    def stiffnesses(self) -> dict[frozenset[str], DynamicStiffness]:
        """The dynamic stiffness of every connection that an equation shows; of a structure."""
        return dynamic_stiffnesses(self.stage.comparison) if self.sketch is not None else {}

    def of_record(self, session: Session) -> dict[str, Columns]:
        """The columns of the record, beside the history of the session."""
        comparison = self.stage.comparison
        columns = {
            "history": history_columns(session, self.step),
            "sensors": _sensors(comparison),
            "blocks": _blocks(comparison),
            "constancy": _constancy(self.stage.shown),
        }
        said = words.words(self.stage, self.step, self.live)
        said |= record_words.several_records(self.found, comparison.record.name, self.live)
        said |= place_words.several_places(
            self.found, self.stage, self.sketch, {p: self.nearest(p) for p in self.places}
        )
        columns["words"] = _table(("place", "html"), said.items())
        return single_precision({**columns, "frame": _settings(axes.record_axes(comparison, columns), {})})

    def of_sensor(self, sensor: str) -> dict[str, Columns]:
        """The columns of one of the sensors."""
        focus, rows = self.focus(sensor, next(iter(self.places))), self.stage.shown
        factor, views = focus.difference.factor, [row.prediction.of(focus.number).residual for row in rows]
        f, density = power_in_blocks(focus.sensor)
        keep = heard(focus.comparison, f)
        columns = {
            "time": over_time(focus),
            "close": _close(focus),
            "noise": _noise(focus),
            "spectrum": _spectrum(focus),
            "lines": {"f": f[keep], "p": _by_block(density[:, keep] / factor**2)},
            "would_time": would_differ(focus, rows),
            "would_spectrum": {str(i): _density(focus, residual) / factor for i, residual in enumerate(views)},
            **_in_reverse(focus),
            **check_columns.columns(focus),
        }
        return single_precision({**columns, "frame_sensor": _settings(axes.sensor_axes(focus, columns), {})})

    def of_place(self, label: str) -> dict[str, Columns]:
        """The columns of one of the places; those of another, which are not shown, where no sensor shows its motion."""
        comparison, place = self.stage.comparison, self.places[label]
        focus = self.focus(self.sensors[0], label)
        u, v, missing = focus.within
        least = LEAST_FORCE * rms_force(comparison) / focus.force.factor
        stiffness = self.stiffnesses.get(place.path)
        largest = 1.0 if stiffness is None else float(np.max(np.abs(stiffness.model), initial=0.0))
        scale = power("/".join(units_at(place, comparison.record)), largest)
        columns = {
            "plane": _plane(focus),
            "against_u": _against(u, missing, focus.displacement.factor, focus.force.factor, least),
            "against_v": _against(v, missing, focus.velocity.factor, focus.force.factor, least),
            **_visits(focus),
            **_would_lack(focus, self.stage),
        }
        if self.sketch is not None:
            columns |= {"lacking": _lacking(focus), "stiffness": _stiffness(stiffness, scale.factor)}
        said = place_words.one_place(focus, focus.place.path == place.path, stiffness is not None)
        frame = _settings(axes.place_axes(focus, columns, scale, least), said)
        return single_precision({**columns, "frame_place": frame})


def _settings(rows: Iterable[axes.Row], said: Mapping[str, str]) -> Columns:
    """What the page's script sets: properties of models, and words by their place."""
    return _table(("model", "property", "value"), [*rows, *((place, "html", html) for place, html in said.items())])


def _table(names: Sequence[str], rows: Iterable[Sequence[Any]]) -> Columns:
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def history_columns(session: Session, step: int = -1) -> Columns:
    """The history as columns: errors and noise floor in per cent by the name of the step, the dot of one larger."""
    steps, own = session.steps, [stage.label for stage in session.stages]
    named = [*[history.label(s) for s in steps[: len(steps) - len(own)]], *own]
    size = np.full(len(steps), 6.0)
    size[len(steps) - len(own) + step % len(own)] = 10.0
    return {
        "name": [f"{i} {words.in_words(done)}" for i, done in enumerate(named)],
        "response": [100.0 * s["error"]["response"] for s in steps],
        "force": [100.0 * (s["error"]["force"] or np.nan) for s in steps],
        "floor": [100.0 * s["noise_floor"]["response"] for s in steps],
        "size": size.tolist(),
    }


def single_precision(sources: Mapping[str, Columns]) -> dict[str, Columns]:
    """Single precision: a screen shows no more, and a saved page is half as large. What is beyond it is not drawn."""

    def single(column: Any) -> Any:
        return np.asarray(column, dtype=np.float32) if getattr(column, "dtype", None) == np.float64 else column

    with np.errstate(over="ignore"):
        return {source: {name: single(c) for name, c in columns.items()} for source, columns in sources.items()}


# ---- of the record


def _sensors(comparison: Comparison) -> Columns:
    """Error of every sensor in per cent of its rms motion, and what noise alone would leave."""
    prediction = comparison.prediction
    names = [str(seen.sensor) for seen in comparison.views]
    return {"name": names, "error": 100.0 * prediction.errors, "floor": 100.0 * prediction.floors}


def _blocks(comparison: Comparison) -> Columns:
    """The stretches of time through which selections are joined."""
    edges = times_of_blocks(comparison.prediction)
    left, right = edges[:-1], edges[1:]
    return {"left": left, "right": right, "middle": 0.5 * (right + left), "weight": np.zeros(len(left)),
            "all": np.ones(len(left))}  # fmt: skip


def _constancy(rows: Sequence[Ranked]) -> Columns:
    """A_j(f) of every candidate whose coefficient was followed, one below the other; ``row`` tells whose it is."""
    columns: dict[str, list[Floats]] = {name: [np.zeros(0)] for name in ("row", "f", "value", "low", "high")}
    for i, row in enumerate(rows):
        if (line := row.effect.flatness) is None:
            continue
        unit = power_of_ten(abs(row.effect.coefficient))[0]  # of its axis
        bounds = {"low": -NINETY_FIVE, "value": 0.0, "high": NINETY_FIVE}
        values = {name: (line.value.real + errors * line.error) / unit for name, errors in bounds.items()}
        for name, column in {"row": np.full(len(line.at), float(i)), "f": line.at, **values}.items():
            columns[name].append(column)
    return {name: np.concatenate(parts) for name, parts in columns.items()}


# ---- of a sensor


def _in_reverse(focus: Focus) -> dict[str, Columns]:
    """What the equation of the sensor's coordinate leaves of the force, and what its inputs explain, one after another.

    Empty where that equation has a motion that no sensor shows; nothing beside modes.
    """
    comparison = focus.comparison
    if not comparison.forces:
        return {}
    force = next((f for f in comparison.forces if f.coordinate == focus.sensor.sensor.coordinate), None)
    if force is None:
        of_force, of_inputs = ("f", "unexplained", "parametric", "noise"), ("f", "share", "name", "dash", "colour")
        return {"force": {name: [] for name in of_force}, "coherence": {name: [] for name in of_inputs}}
    keep = heard(comparison, force.frequency)
    shares = {"unexplained": force.unexplained, "parametric": force.parametric, "noise": force.noise}
    columns = {name: 100.0 * np.maximum(share[keep], 1e-9) for name, share in shares.items()}
    rows = [np.asarray(c[keep], dtype=np.float32) for c in force.cumulative]
    changing = {e.name for e in comparison.fit.model.terms if e.term.variation}
    names = [term_names(", ".join(i.terms)) if changing.issuperset(i.terms) else in_text(i.shape) for i in force.inputs]
    return {
        "force": {"f": force.frequency[keep], **columns},
        "coherence": {
            "f": [np.asarray(force.frequency[keep], dtype=np.float32)] * len(rows),
            "share": rows,
            "name": names,
            "dash": [DASHES[k % len(DASHES)] for k in range(len(rows))],
            "colour": [COLOURS[k % len(COLOURS)] for k in range(len(rows))],
        },
    }


def over_time(focus: Focus, span: tuple[float, float] | None = None) -> Columns:
    """Measured and predicted response and their difference, over a span of time in seconds or all that is judged."""
    judged, part = focus.sensor, stretch(focus.comparison, span)
    shown = decimate.times(judged.time[part])
    places = decimate.gaps(judged.time[part], shown, judged.dt)
    lines = {
        "measured": (judged.measured, focus.response), "predicted": (judged.predicted, focus.response),
        "difference": (judged.residual, focus.difference),
    }  # fmt: skip
    drawn = {name: decimate.extremes(y[part]) / scale.factor for name, (y, scale) in lines.items()}
    return {"t": np.insert(shown, places, shown[places - 1])} | {
        name: decimate.broken(y, places) for name, y in drawn.items()
    }


def would_differ(focus: Focus, rows: Sequence[Ranked], span: tuple[float, float] | None = None) -> Columns:
    """The difference that each candidate would leave, over the same times."""
    part = stretch(focus.comparison, span)
    time = focus.sensor.time[part]
    places = decimate.gaps(time, decimate.times(time), focus.sensor.dt)
    left = [row.prediction.of(focus.number).residual[part] / focus.difference.factor for row in rows]
    return {str(i): decimate.broken(decimate.extremes(x), places) for i, x in enumerate(left)}


def stretch(comparison: Comparison, span: tuple[float, float] | None) -> slice:
    """The samples of the judging part in a span of time and half of it to either side."""
    if span is None:
        return slice(None)
    time, reach = comparison.prediction.time, 0.5 * (span[1] - span[0])
    first, last = (int(i) for i in np.searchsorted(time, [span[0] - reach, span[1] + reach]))
    return slice(max(0, min(first, len(time) - 2)), max(last, 2))


def _close(focus: Focus) -> Columns:
    """Every sample of the stretch where the model misses most."""
    judged, factor = focus.sensor, focus.response.factor
    near = judged.closeup
    return {"t": judged.time[near], "measured": judged.measured[near] / factor,
            "predicted": judged.predicted[near] / factor}  # fmt: skip


def _noise(focus: Focus) -> Columns:
    """Twice the rms of the noise to either side, as two horizontal lines."""
    level, time = 2.0 * focus.sensor.noise.rms / focus.difference.factor, focus.sensor.time
    ends = [float(time[0]), float(time[-1])]
    return {"t": [ends, ends], "level": [[level, level], [-level, -level]]}


def _spectrum(focus: Focus) -> Columns:
    noise = focus.sensor.noise
    keep = heard(focus.comparison, noise.frequency)
    densities = {"difference": noise.residual, "noise": noise.density}
    shown = {name: np.sqrt(d[keep]) / focus.difference.factor for name, d in densities.items()}
    return {"f": noise.frequency[keep]} | shown


def _density(focus: Focus, values: Floats) -> Floats:
    """Root of the autospectral density on the lines that axes show."""
    frequency, density = autospectrum(values, focus.sensor.dt, segments_of(len(values)))
    return np.sqrt(density[heard(focus.comparison, frequency)])


# ---- of a place


def _plane(focus: Focus) -> Columns:
    """Every cell of the map; those where the motion hardly came have no mean."""
    plane = surface(*focus.within)
    cells = len(plane.mean)
    left, right = (np.repeat(e, cells) for e in (plane.displacement[:-1], plane.displacement[1:]))
    low, high = (np.tile(e, cells) for e in (plane.velocity[:-1], plane.velocity[1:]))
    tiny = 1e-9 * rms_force(focus.comparison)  # rounding
    missing = plane.mean.ravel()
    mean, size, speed = missing / focus.force.factor, focus.displacement.factor, focus.velocity.factor
    return {
        "left": left / size, "right": right / size, "middle_u": 0.5 * (left + right) / size,
        "bottom": low / speed, "top": high / speed, "middle_v": 0.5 * (low + high) / speed, "mean": mean,
        "found": mean,  # which stays when a candidate is previewed
        "below": np.where(missing < -tiny, DASH, 0.0),
        "seen": np.where(np.isfinite(mean), 1.0, 0.0),
        "unsure": np.where(np.abs(missing) < SURE_CELL * plane.error.ravel(), 3.0, 0.0),
        "picked": np.zeros(len(mean)),
    }  # fmt: skip


def _against(moved: Floats, force: Floats, along: float, unit: float, least: float) -> Columns:
    line = curve(moved, force)
    half = NINETY_FIVE * line.error
    ends = {"mean": line.mean, "low": line.mean - half, "high": line.mean + half}
    reach = {"reach": np.resize([-least, least], len(line.at))}
    return {"at": line.at / along, **{name: y / unit for name, y in ends.items()}, **reach}


def _visits(focus: Focus) -> dict[str, Columns]:
    """The tables that join selections: a row a class or a cell, a column a block of time."""
    tied = visits_in_blocks(focus.lacking)
    columns: dict[str, Columns] = {"cells": {"n": _by_block(np.minimum(tied.cells, 255).astype(np.uint8))}}
    motions = {"u": (tied.displacement, focus.displacement), "v": (tied.velocity, focus.velocity)}
    for name, (classes, scale) in motions.items():
        bounds, force = classes.edges / scale.factor, classes.force / focus.force.factor
        table = {"n": _by_block(classes.visits.astype(np.float64)), "s": _by_block(force)}
        columns[f"classes_{name}"] = {"left": bounds[:-1], "right": bounds[1:], **table}
    return columns


def _by_block(table: NDArray[Any]) -> NDArray[Any]:
    """One array of all blocks: each array is a message of its own to a page."""
    return np.ascontiguousarray(table.T)


def _would_lack(focus: Focus, stage: Stage) -> dict[str, Columns]:
    """The force that would still be missing with each candidate in the model: its curves and its map."""
    lacking = [stage.would[row.name][0][focus.place.label] for row in stage.shown]
    u, v, f = focus.displacement.factor, focus.velocity.factor, focus.force.factor
    maps = {str(i): found.plane.ravel() / f for i, found in enumerate(lacking)}
    curves: dict[str, Columns] = {"would_u": {}, "would_v": {}}
    for i, found in enumerate(lacking):
        lines = found.against_displacement, found.against_velocity
        for source, line, scale in zip(curves, lines, (u, v), strict=True):
            for name, column in ((f"at{i}", line.at / scale), (f"y{i}", line.mean / f)):  # all of one length
                curves[source][name] = np.pad(column, (0, CLASSES - len(column)), constant_values=np.nan)
    return {**curves, "would_plane": maps}


def _lacking(focus: Focus) -> Columns:
    """Root of the density of the force that is missing."""
    force = focus.within[2]
    f, density = autospectrum(force, focus.sensor.dt, segments_of(len(force)))
    keep = heard(focus.comparison, f)
    return {"f": f[keep], "force": np.sqrt(density[keep]) / focus.force.factor}


def _stiffness(found: DynamicStiffness | None, factor: float) -> Columns:
    """Dynamic stiffness of a connection with 95 % intervals, and that of the model."""
    if found is None:  # an axis needs two points; nobody sees it
        return {name: np.array([0.0, 1.0]) for name in ("f", "measured", "low", "high", "model", "reach")}
    half, largest = NINETY_FIVE * found.error, float(np.max(np.abs(found.model), initial=0.0))
    values = {
        "measured": found.measured, "low": found.measured - half, "high": found.measured + half,
        "model": found.model, "reach": found.model + np.resize([-largest, largest], len(found.model)),
    }  # fmt: skip
    return {"f": found.frequency, **{name: x / factor for name, x in values.items()}}
