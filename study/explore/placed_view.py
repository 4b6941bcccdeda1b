"""What a page shows of a structure, as columns by the name of their source.

What belongs to a place, a sensor or a candidate stands there for all of them, marked by the column ``of``: the page's
script draws that of the selected one.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from study.compare.comparison import Comparison
from study.compare.connection_spectra import dynamic_stiffnesses, highest_frequency, missing_force_spectra
from study.compare.noise import segments_of
from study.compare.place_pictures import sketch_of
from study.compare.residual_checks import own_checks
from study.diagnose.diagnosis_pictures import sketch_of_diagnosis
from study.explore import decimate
from study.explore.axis_scales import Columns, Floats
from study.explore.check_columns import by_itself
from study.explore.page_units import Scale, in_text, length, power, rate
from study.explore.placed_words import placed_words
from study.explore.session import Stage, on_record
from study.explore.view import NINETY_FIVE, single_precision
from study.figures.labels import power_of_ten
from study.figures.sketch import Sketch
from study.records.spectra import autospectrum


@dataclass(frozen=True, eq=False)
class PlacedView:
    """A structure of the session as it is drawn."""

    columns: dict[str, Columns]  # of each source; all of one have the same length
    drawn: Sketch
    highest: float  # frequency in hertz at which the axes of frequency end
    labels: dict[str, str]  # of axes, by the axis


def placed_view(found: Stage, step: int, live: bool = True, record: int = 0) -> PlacedView:
    """The columns of a structure, by its number in the session, on one of the records; only a ``live`` page can act.

    What the sketch shows was found of all records together.
    """
    stage = on_record(found, record)
    comparison = stage.comparison
    drawn = sketch_of(found.comparison) if found.diagnosis is None else sketch_of_diagnosis(found.diagnosis)
    labels = {link.place.path: link.place.label for link in drawn.links}
    lengths, forces = _scales(comparison)
    stiffness, unit = _stiffness(comparison, labels)
    columns = {
        "sensors": _sensors(comparison),
        "all_motion": _motions(comparison),
        "all_close": _motions(comparison, close=True),
        "all_map": _maps(comparison, labels, lengths, forces),
        "all_force": _force(comparison, labels, forces),
        "all_stiffness": stiffness,
        "all_spectrum": _spectra(comparison),
        "all_constancy": _constancy(stage),
        **_checks(comparison),
        "words": placed_words(found, stage, drawn, step, live),
    }  # fmt: skip
    force = in_text(forces.unit)
    axes = {
        "map_x": f"relative displacement / {in_text(lengths.unit)}", "map_y": f"missing force / {force}",
        "force_y": f"missing force / ({force}/√Hz)", "stiffness_y": f"stiffness / ({unit})",
    }  # fmt: skip
    return PlacedView(single_precision(columns), drawn, highest_frequency(comparison), axes)


def _scales(comparison: Comparison) -> tuple[Scale, Scale]:
    """Units in which relative displacements and missing forces of all places are easy to read."""
    curves = [c for c in comparison.missing.curves.values() if len(c.at)]
    far = max((float(np.max(np.abs(c.at))) for c in curves), default=1.0)
    most = max((float(np.max(np.abs(c.mean))) for c in curves), default=1.0)
    (force, unit), turns = comparison.prepared.record.force_and_length, _turns(comparison)
    return _length(comparison, far), power(f"{force} or {force} {unit}" if turns else force, most)


def _turns(comparison: Comparison) -> bool:
    """Whether a coordinate is a rotation."""
    return bool(comparison.prepared.record.rotations)


def _length(comparison: Comparison, largest: float) -> Scale:
    """Metres become mm where that is easier to read; beside angles they stay."""
    unit = comparison.prepared.record.force_and_length[1]
    return power(f"{unit} or rad", largest) if _turns(comparison) else length(unit, largest)


def _sensors(comparison: Comparison) -> Columns:
    prediction = comparison.prediction
    names = [str(s) for s in prediction.prepared.sensors]
    units = [
        f"{s.motion} / {in_text(_motion_scale(comparison, i).unit)}" for i, s in enumerate(prediction.prepared.sensors)
    ]
    at = [s.coordinate for s in prediction.prepared.sensors]
    errors, floors = 100.0 * prediction.errors, 100.0 * prediction.floors
    return {"name": names, "at": at, "unit": units, "error": errors, "floor": floors}


def _joined(parts: Iterator[tuple[str, Mapping[str, Floats]]], names: Sequence[str]) -> Columns:
    """Columns of all places, sensors or candidates below each other; each part is what marks it, and its columns."""
    marks, found = list[str](), {name: list[Floats]() for name in names}
    for mark, columns in parts:
        marks += [mark] * len(columns[names[0]])
        for name in names:
            found[name].append(columns[name])
    return {"of": marks, **{n: np.concatenate(c) if c else np.empty(0) for n, c in found.items()}}


def _motion_scale(comparison: Comparison, i: int) -> Scale:
    """Unit in which the motion of a sensor is easy to read."""
    sensor = comparison.prediction.prepared.sensors[i]
    unit = comparison.prepared.record.unit(sensor)
    most = float(np.max(np.abs(comparison.prediction.measured[:, i]), initial=0.0))
    if sensor.coordinate in comparison.prepared.record.rotations:
        return power(unit, most)
    return rate(unit, most) if "/" in unit else length(unit, most)


def _motions(comparison: Comparison, close: bool = False) -> Columns:
    """Measured and predicted motion of every sensor and their difference, on the part that is judged.

    Or ``close`` up where that is largest.
    """
    prediction = comparison.prediction
    time = prediction.prepared.record.time[slice(*prediction.prepared.plan.judge)]

    def parts() -> Iterator[tuple[str, Mapping[str, Floats]]]:
        for i, sensor in enumerate(prediction.prepared.sensors):
            near = prediction.of(i).closeup if close else slice(None)
            motions = {
                "measured": prediction.measured[near, i], "predicted": prediction.predicted[near, i],
                "difference": prediction.misfit[near, i],
            }  # fmt: skip
            factor = _motion_scale(comparison, i).factor
            shown = {name: decimate.extremes(x) / factor for name, x in motions.items()}
            yield str(sensor), {"t": decimate.times(time[near]), **shown}

    return _joined(parts(), ("t", "measured", "predicted", "difference"))


def _spectra(comparison: Comparison) -> Columns:
    """Density of the difference of every sensor, and of its noise, over its rms motion."""
    prediction = comparison.prediction

    def parts() -> Iterator[tuple[str, Mapping[str, Floats]]]:
        for i, sensor in enumerate(prediction.prepared.sensors):
            left, dt = prediction.misfit[:, i] / prediction.size[i], prediction.prepared.dt
            f, density = autospectrum(left, dt, segments_of(len(left)))
            inside = (f > 0.0) & (f <= highest_frequency(comparison))
            noise = prediction.floors[i] / np.sqrt(0.5 / dt)
            values = {"f": f[inside], "difference": np.sqrt(density[inside]), "noise": np.full(inside.sum(), noise)}
            yield str(sensor), values

    return _joined(parts(), ("f", "difference", "noise"))


def _checks(comparison: Comparison) -> dict[str, Columns]:
    """Autocorrelation and distribution of every sensor's residual; all have as many samples, so one band is for all."""
    prediction = comparison.prediction
    found = [by_itself(own_checks(x, prediction.prepared.dt)) for x in prediction.misfit.T]

    def parts(source: str) -> Iterator[tuple[str, Mapping[str, Floats]]]:
        for sensor, columns in zip(prediction.prepared.sensors, found, strict=True):
            yield str(sensor), columns[source]

    each = {"autocorrelation": ("lag", "value"), "histogram": ("left", "right", "top")}
    joined = {f"all_{source}": _joined(parts(source), names) for source, names in each.items()}
    return {**joined, "autocorrelation_band": found[0]["autocorrelation_band"], "normal": found[0]["normal"]}


def _maps(
    comparison: Comparison, labels: Mapping[frozenset[str], str], along: Scale, force: Scale
) -> Columns:  # fmt: skip
    def parts() -> Iterator[tuple[str, Mapping[str, Floats]]]:
        for place, _ in comparison.missing.aligned:
            curve = comparison.missing.curves.get(place.label)
            if curve is not None and place.path in labels:
                half = NINETY_FIVE * curve.error
                values = {"mean": curve.mean, "low": curve.mean - half, "high": curve.mean + half}
                scaled = {name: x / force.factor for name, x in values.items()}
                yield labels[place.path], {"at": curve.at / along.factor, **scaled}

    return _joined(parts(), ("at", "mean", "low", "high"))


def _force(comparison: Comparison, labels: Mapping[frozenset[str], str], force: Scale) -> Columns:
    """Density of the force that each place lacks."""
    frequency, densities = missing_force_spectra(comparison)
    inside = (frequency > 0.0) & (frequency <= highest_frequency(comparison))

    def parts() -> Iterator[tuple[str, Mapping[str, Floats]]]:
        for path, density in densities.items():
            if path in labels and np.all(density[inside] > 0.0):
                yield labels[path], {"f": frequency[inside], "force": np.sqrt(density[inside]) / force.factor}

    return _joined(parts(), ("f", "force"))


def _stiffness(comparison: Comparison, labels: Mapping[frozenset[str], str]) -> tuple[Columns, str]:
    """Dynamic stiffness of each connection with 95 % intervals and that of the model, and their unit."""
    found = dynamic_stiffnesses(comparison)
    unit = "/".join(comparison.prepared.record.force_and_length)
    scale = power(unit, max((float(np.max(np.abs(s.model), initial=0.0)) for s in found.values()), default=1.0))

    def parts() -> Iterator[tuple[str, Mapping[str, Floats]]]:
        for path, read in found.items():
            if path in labels:
                half = NINETY_FIVE * read.error
                values = {
                    "measured": read.measured, "low": read.measured - half, "high": read.measured + half,
                    "model": read.model,
                }  # fmt: skip
                scaled = {name: x / scale.factor for name, x in values.items()}
                yield labels[path], {"f": read.frequency, **scaled}

    return _joined(parts(), ("f", "measured", "low", "high", "model")), in_text(scale.unit)


def _constancy(stage: Stage) -> Columns:
    """A(f) of each candidate with 95 % intervals."""

    def parts() -> Iterator[tuple[str, Mapping[str, Floats]]]:
        for row in stage.diagnosis.candidates if stage.diagnosis is not None else ():
            if row.flatness is not None:
                factor = power_of_ten(abs(row.coefficient))[0]
                value, half = row.flatness.value.real / factor, NINETY_FIVE * row.flatness.error / factor
                yield row.name, {"f": row.flatness.at, "value": value, "low": value - half, "high": value + half}

    return _joined(parts(), ("f", "value", "low", "high"))
