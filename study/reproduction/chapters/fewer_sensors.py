"""Recommendation 4: which effect, at which connection of a structure, and with how few sensors it still works.

The cases of ``config/structures.tsv`` show that MI/SO places an effect where every coordinate is measured. Where one is
not, the reverse system lacks its motion; the free run of a model has it. Candidates, an effect at a connection each,
are fitted in free run to what the sensors show and judged on the part of the record that was not fitted.
"""

# Matplotlib leaves the **kwargs of its methods untyped, pandas what comes out of a mask or a group.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from study.compare.prediction import predict
from study.equations.linear_part import connections
from study.equations.model import Model, free
from study.equations.model_file import read_model
from study.equations.place import Place
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.figures import page
from study.figures.labels import term_names
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.records.excitation import Excitation, displacement_noise, force
from study.records.prepared import Prepared
from study.records.record import MOTIONS, Record, Sensor
from study.records.record_layout import Layout
from study.reproduction.chapters.chapter import Chapter, SensedStructure, SensorSettings, Tables, judges
from study.reproduction.claims.judgement import Condition
from study.reproduction.claims.reported import Reported
from study.reproduction.settings import ClaimSettings
from study.support.cores import side_by_side
from study.support.document import Block, Text, table
from study.support.errors import StudyError
from study.support.numbers import percent
from study.way_in.compare_records import made_ready

BY_SENSORS = ["structure", "sensors"]


def make_sensors(_: ClaimSettings, own: SensorSettings, models: Path) -> Tables:
    """Every candidate of every structure from every set of sensors, and the values of the model that is right.

    ``error`` is the held-out error of the free run over the response's rms, all sensors together, ``floor`` what noise
    alone leaves; ``right`` are the effect and the connection that the structure has.
    """
    asked: list[tuple[dict[str, str], SensedStructure, Model, Record]] = []
    for structure, case in own.structures.items():
        truth = read_model(models / "structures" / f"{structure}.yaml")
        full = _motions(truth, own, case.level)
        for sensors in case.sensors:
            about = {"structure": structure, "sensors": sensors}
            asked.append((about, case, truth, _seen(full, sensors.split(), own)))
    tried, values = zip(*side_by_side(lambda one: _told(*one), asked), strict=True)
    return {"sensors": pd.DataFrame(list(chain(*tried))), "sensor_values": pd.DataFrame(list(chain(*values)))}


def _told(
    about: dict[str, str], case: SensedStructure, truth: Model, record: Record
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:  # fmt: skip
    """Every candidate by one set of sensors, and the values of the model that is right."""
    without = replace(truth, terms=tuple(t for t in truth.terms if t.term.name != case.hidden))
    without = without.with_values(dict.fromkeys(k for k in without.values if "." not in k))  # shapes are known
    opened = truth.with_values(dict.fromkeys(k for k in truth.values if "." not in k))
    # The candidates differ in a term, which asks for no other layout.
    opened, prepared = made_ready([record], opened, Layout())
    tried: list[dict[str, Any]] = []
    right = fit_model(opened, prepared)
    for effect, place, model in _candidates(without, case.effects):
        hidden = any(t.term.name == effect and t.place.path == place.path for t in truth.terms)
        told = {**about, "effect": effect, "place": "-".join(place.ends), "right": hidden}
        tried.append({**told, **_judged(model, prepared, right if hidden else None)})
    values = [
        {**about, "parameter": key, "true": truth.numbers()[key], "estimate": right.estimate[key],
         "standard_error": right.estimate.error(key), "note": "" if right.converged else right.message}
        for key in right.estimate.symbols
    ]  # fmt: skip
    return tried, values


def _motions(truth: Model, own: SensorSettings, level: float) -> Record:
    (name, _), *_ = truth.forces
    drive = force(Excitation(level=level, reading="filtered", cutoff=own.cutoff), own.sampling.samples, own.sampling.dt,
                  own.seed)  # fmt: skip
    return simulate(truth, {name: drive}, own.sampling.dt, Integrator("rk4", own.steps_per_sample))


def _seen(full: Record, sensors: Sequence[str], own: SensorSettings) -> Record:
    """What sensors of displacement at some coordinates show, with noise of their own."""
    kept = {}
    for number, coordinate in enumerate(sensors):
        sensor = Sensor(coordinate, MOTIONS[0])
        kept[sensor] = full[sensor] + displacement_noise(full[sensor], own.sensor_noise, own.seed + number)
    return full.with_motions(kept)


def _candidates(without: Model, effects: Sequence[str]) -> Iterator[tuple[str, Place, Model]]:
    """Every effect at every connection that has not the same already."""
    for effect in effects:
        for place in connections(without):
            if not any(t.term.name == effect and t.place.path == place.path for t in without.terms):
                yield effect, place, replace(without, terms=(*without.terms, free(get(effect), place)))


def _judged(model: Model, prepared: Prepared, fit: FreeRunFit | None) -> dict[str, Any]:
    """What a candidate leaves; ``fit`` is its fit, if there is one."""
    try:
        found = predict(fit or fit_model(model, prepared), prepared)
    except StudyError as error:
        return {"error": np.nan, "floor": np.nan, "note": str(error)}
    return {"error": found.error, "floor": found.floor, "note": ""}


# ---- claims


def _ranked(tables: Tables) -> Iterator[tuple[str, "pd.Series[Any]", "pd.Series[Any]"]]:
    """Of each set of sensors the best candidate and the second best."""
    for (structure, sensors), group in tables["sensors"].groupby(BY_SENSORS, sort=False):
        ranked = group.sort_values("error")
        yield f"{str(structure).replace('_', ' ')} by {_and(str(sensors))}", ranked.iloc[0], ranked.iloc[1]


def _and(sensors: str) -> str:
    return sensors.replace(" ", " and ")


def _candidate(row: "pd.Series[Any]") -> str:
    return f"{term_names(str(row['effect']))} of {row['place']}"


def sensors_place(tables: Tables, _: Reported) -> Iterator[Condition]:
    """Whether the effect and its place are found, sensors being few."""
    for words, best, _second in _ranked(tables):
        yield Condition(
            f"{words}: the effect that is there, at its connection, leaves least",
            f"{words}: {_candidate(best)} {percent(best['error'])}", bool(best["right"]),
        )  # fmt: skip


def sensors_apart(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Whether the next candidate is clearly worse."""
    times = expected.value("sensors_apart.times")
    for words, best, second in _ranked(tables):
        yield Condition(
            f"{words}: the second best leaves more than {times:g} times as much",
            f"{words}: {percent(best['error'])}, then {_candidate(second)} {percent(second['error'])}",
            bool(second["error"] > times * best["error"]),
        )  # fmt: skip


def sensors_values(tables: Tables, expected: Reported) -> Iterator[Condition]:
    """Every value of the right model from every set of sensors."""
    limit, t = expected.limit("sensors_value"), tables["sensor_values"]
    for (structure, sensors), group in t.groupby(BY_SENSORS, sort=False):
        off = group["estimate"] / group["true"] - 1.0
        at = off.abs().idxmax()
        words = f"{str(structure).replace('_', ' ')} by {_and(str(sensors))}"
        yield Condition(
            f"{words}: every value within {percent(limit)}",
            f"{words}: {group['parameter'][at]} "
            f"{percent(off[at], '+.2g', group['standard_error'][at] / abs(group['true'][at]))}",
            bool(abs(off[at]) <= limit),
            because="far from the sensor a motion is small beside the noise on the one measured",
        )  # fmt: skip


# ---- figure and words


def sensors_map(tables: Tables) -> Figure:
    """Held-out error of every candidate from every set of sensors."""
    t = tables["sensors"]
    structures = list(dict.fromkeys(str(s) for s in t["structure"]))
    figure, axes = page.empty_page(
        "Which effect, at which connection, with how few sensors", "held-out error (%) of each candidate; bold: the "
        "effect that is there", columns=len(structures), width=5.6 * len(structures), panel=2.9, legend_rows=0,
        share=False,
    )  # fmt: skip
    figure.subplots_adjust(left=0.24, bottom=0.22, wspace=0.85)
    for panel, structure in zip(axes, structures, strict=True):
        own = t[t["structure"] == structure].assign(candidate=lambda rows: [_candidate(r) for _, r in rows.iterrows()])
        errors = own.pivot_table(index="candidate", columns="sensors", values="error", sort=False)
        right = set(own[own["right"]]["candidate"])
        panel.imshow(np.log10(errors.to_numpy()), cmap="Greys", vmin=-2.5, vmax=1.5, aspect="auto")
        for (i, j), value in np.ndenumerate(errors.to_numpy()):
            weight = "bold" if errors.index[i] in right else "normal"
            panel.text(j, i, f"{100.0 * value:.3g}", ha="center", va="center", fontsize=8.5, fontweight=weight)
        page.frame_cells(panel, list(errors.index), [str(c).replace(" ", "\n") for c in errors.columns])
        panel.set_xlabel("sensors")
    page.letter(axes, [s.replace("_", " ") for s in structures])
    return figure


def told_sensors(tables: Tables) -> list[Block]:
    """The worst value from every set of sensors."""
    rows: list[list[str]] = []
    for (structure, sensors), group in tables["sensor_values"].groupby(BY_SENSORS, sort=False):
        off = (group["estimate"] / group["true"] - 1.0).abs()
        at = off.idxmax()
        rows.append([
            str(structure).replace("_", " "), _and(str(sensors)), f"{group['parameter'][at]} {percent(off[at], '.2g')}",
            percent(group["standard_error"][at] / abs(group["true"][at]), ".2g"),
        ])  # fmt: skip
    said = (
        "Fits in free run of the model with all its terms, every coefficient open, from displacement sensors with 1 % "
        "of noise: the value that is farthest off."
    )
    return [Text(said), table(("structure", "sensors", "farthest off", "its standard error"), rows)]


CHAPTER = Chapter(
    judges(sensors_place, sensors_apart, sensors_values), {"sensors_map": sensors_map}, told_sensors,
    ("sensors_apart.times", "limit.sensors_value"),
    make=make_sensors,
)  # fmt: skip
