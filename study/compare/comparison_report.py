"""A comparison as a document (JSON), tables (CSV), and the lines that a person reads first."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import numpy as np
from tabulate import tabulate

from study.compare.by_estimator import FREE_RUN
from study.compare.comparison import Comparison
from study.compare.comparison_sentences import comparison_in_words, says_of_all
from study.compare.decay import decays_of
from study.compare.dependence import explained_by_place
from study.compare.fitted_coefficients import Coefficient, Level, value_and_interval
from study.compare.force_error import ForceError, mean_share
from study.compare.force_map import curve, surface
from study.compare.varying_coefficients import varying_fields
from study.equations import model_file
from study.equations.linear_part import Modes, modes_table
from study.equations.place import HERE
from study.identify.frequency_domain.coefficient_spectra import CoefficientSpectrum
from study.support.csv_text import Columns, columns_of, csv_bytes, filled, one_below_the_other
from study.support.numbers import percent

Row = dict[str, Any]


def comparison_document(comparisons: Sequence[Comparison], moving: Sequence[Level] = ()) -> Row:
    """What ``comparison.json`` holds.

    Of several records, ``error`` and ``noise_floor`` are root mean squares over the records, and
    ``records`` holds a document of each.
    """
    if len(comparisons) == 1:
        return _of_record(comparisons[0])
    rows = [_of_record(c) for c in comparisons]
    listed = [key for key, found in rows[0]["where"].items() if isinstance(found, list) and key != "shared_force"]
    return {
        "model": rows[0]["model"],
        **{
            of: {k: _mean([r[of][k] for r in rows], k) for k in ("force", "response") if k in rows[0][of]}
            for of in ("error", "noise_floor")
        },
        "coefficients": [{"record": r["record"], **c} for r in rows for c in r["coefficients"]],
        "where": {
            **{key: [{"record": r["record"], **x} for r in rows for x in r["where"][key]] for key in listed},
            "level": [level_row(level) for level in moving],
        },
        "says": says_of_all(comparisons, moving),
        "records": rows,
    }  # fmt: skip


def _mean(values: Sequence[float], key: str) -> float:
    """Mean of shares of power (force), root mean square of shares of rms (response)."""
    return float(np.mean(values)) if key == "force" else float(np.sqrt(np.mean(np.square(values))))


def _of_record(comparison: Comparison) -> Row:
    prediction, model, document = comparison.prediction, comparison.model, Row()
    how = {"coordinates": list(model.coordinates)} if model.named else {"equation": model.equation()}
    how |= {"linear": "modal"} if model.modal else {}
    document |= {
        "record": comparison.record.name,
        "model": {"name": model.name, **how, "terms": [model_file.format_entry(t) for t in model.terms]},
        "error": {"force": comparison.force_error, "response": prediction.error},
        "noise_floor": {"response": prediction.floor},
        "rms": {}, "above_noise": {"response": prediction.above_noise},
        "coefficients": [coefficient_row(c) for c in comparison.coefficients],
        **({"by_frequency": [_line_row(s) for s in comparison.by_line]} if model.modal else {}),
        **({"varying": [varying_fields(one) for one in comparison.varying]} if comparison.varying else {}),
        "fit": {
            "samples": list(comparison.spans[0]), "judged": list(comparison.spans[1]),
            "every_sample": comparison.prepared.every, "response": comparison.plan.response,
            "estimator": comparison.estimator, "converged": comparison.fit.converged, "message": comparison.fit.message,
        },
        "where": where(comparison),
        "test": {
            "time": {
                "p_value": comparison.time.p_value, "growth_with_level": comparison.time.growth,
                "level_changes_too": comparison.time.confounded,
                **({"sensor": str(comparison.worst.sensor)} if model.named else {}),
            }
        },
        "notes": list(comparison.notes),
        "says": comparison_in_words(comparison),
    }  # fmt: skip
    for of, row in (_of_all(comparison) | ({"modes": mode_rows(comparison.modes)} if model.named else {})).items():
        document[of] = document[of] | row if of in document and isinstance(row, dict) else row
    return document


def _of_all(comparison: Comparison) -> Row:
    """What else a document holds of errors and noise, by the field that it joins; of a structure by place too."""
    views, forces, floors = comparison.views, comparison.forces, comparison.prediction.floors
    errors = np.array([v.noise.error / v.size for v in views])
    floor, (size, left, unit) = comparison.prediction.floor, _sizes(comparison)
    weights = floors / floor if floor > 0.0 else np.ones(len(views))
    found: Row = {
        "noise_floor": {
            **({"force": mean_share([f.noise_total for f in forces])} if forces else {}),
            "response_error": math.hypot(*(weights * errors)) / len(views),
            "from": "; ".join(dict.fromkeys(v.noise.source for v in views)),
        },
        "rms": {"response_error": left, "response": size, "unit": unit},
        **({"error_of_fitted_coefficients": {"force": mean_share([f.parametric_total for f in forces])}}
           if forces else {}),
        "above_noise": {"standard_errors": max(v.noise.significance for v in views)},
        **_decays(comparison),
    }  # fmt: skip
    if not comparison.model.named:
        return found
    by_place: Row = {
        "error": {"sensors": {str(v.sensor): v.error for v in views}}
        | _by_coordinate({f.coordinate: f.total for f in forces}),
        "noise_floor": {"sensors": {str(v.sensor): v.noise.rms / v.size for v in views}}
        | _by_coordinate({f.coordinate: f.noise_total for f in forces}),
        "rms": {"sensors": {str(v.sensor): _in_its_unit(comparison, i) for i, v in enumerate(views)}},
        "error_of_fitted_coefficients": _by_coordinate({f.coordinate: f.parametric_total for f in forces}),
        "above_noise": {"sensors": {str(v.sensor): {"standard_errors": v.noise.significance} for v in views}},
    }  # fmt: skip
    joined = {of: found.get(of, {}) | row for of, row in by_place.items()}
    return found | {of: row for of, row in joined.items() if row}


def _by_coordinate(shares: dict[str, float]) -> Row:
    return {"coordinates": shares} if shares else {}


def _decays(comparison: Comparison) -> Row:
    """Frequency and damping against amplitude of a free decay; of several sensors each by its name."""
    every = {str(v.sensor): decays_of(comparison, i) for i, v in enumerate(comparison.views)}
    found = {name: decays.plain() for name, decays in every.items() if decays is not None}
    if not found:
        return {}
    return {"decay": found if len(every) > 1 else next(iter(found.values()))}


def _sizes(comparison: Comparison) -> tuple[float, float, str]:
    """Rms of what the sensors measure, and of what they miss, in their unit; of several units, over their own rms."""
    views, units = comparison.views, {comparison.record.units.get(str(v.sensor), "") for v in comparison.views}
    if len(units) > 1:
        return 1.0, comparison.prediction.error, ""
    sizes = ([v.size for v in views], [v.error * v.size for v in views])
    whole, left = (math.hypot(*values) / math.sqrt(len(views)) for values in sizes)
    return whole, left, units.pop()


def _in_its_unit(comparison: Comparison, sensor: int) -> Row:
    seen = comparison.prediction.of(sensor)
    return {
        "response_error": seen.error * seen.size, "response": seen.size,
        "unit": comparison.record.units.get(str(seen.sensor), ""),
    }  # fmt: skip


def mode_rows(modes: Modes) -> list[Row]:
    """Modes as plain rows."""
    return [
        {
            "frequency": float(modes.frequency[i]), "frequency_error": float(modes.frequency_error[i]),
            "damping": float(modes.damping[i]), "damping_error": float(modes.damping_error[i]),
            "shape": modes.shape[i].tolist(), "shape_error": modes.shape_error[i].tolist(),
        }
        for i in range(len(modes.frequency))
    ]  # fmt: skip


def where(comparison: Comparison) -> Row:
    """Where the model fails, as plain rows; ``level`` is empty for one record."""
    ways = comparison.growths.ways if comparison.growths is not None else ()
    at: Row = comparison.place.plain() if comparison.model.named else {}
    return {
        "frequency": [{"of": b.of, "from": b.low, "to": b.high, "share": b.share} for b in comparison.bands],
        "amplitude": [
            {
                **at, "of": w.of, "parity": w.parity, "power": w.power, "power_error": w.power_error,
                "share": w.share, "share_error": w.share_error,
            }
            for w in ways
        ],
        "time": [
            {"from": s.begin, "to": s.end, "error": s.error, "response": s.response, "over_usual": s.ratio}
            for s in comparison.time.stretches
        ],
        "level": [],
        **(_between_equations(comparison) if comparison.model.named else {}),
    }  # fmt: skip


def _between_equations(comparison: Comparison) -> Row:
    """What each equation of a structure leaves, and between which places a force may be missing."""
    missing, explained = comparison.missing, explained_by_place(comparison.leftovers)
    return {
        "coordinates": [
            {"coordinate": c, "residual_force": float(r), "force": float(f)}
            for c, r, f in zip(missing.equations, missing.rms, missing.inertia, strict=True)
        ],
        "places": [
            {**place.plain(), "share": share, "explained": explained.get(place.path, 0.0)}
            for place, share in missing.aligned
        ],
        "shared_force": missing.matrix.tolist(),
        "maps": {
            label: {"at": c.at.tolist(), "force": c.mean.tolist(), "error": c.error.tolist()}
            for label, c in missing.curves.items()
        },
    }  # fmt: skip


def coefficient_row(coefficient: Coefficient) -> Row:
    """A coefficient as a plain row."""
    return {
        "key": coefficient.key, "term": coefficient.term,
        **({} if coefficient.place == HERE else coefficient.place.plain()), "value": coefficient.value,
        "interval": None if coefficient.interval is None else list(coefficient.interval),
        "standard_error": coefficient.error, "unit": coefficient.unit, "held": coefficient.held,
    }  # fmt: skip


def _line_row(spectrum: CoefficientSpectrum) -> Row:
    """A coefficient line by line as a plain row."""
    of_all = {"mean": spectrum.mean, "imaginary": spectrum.imaginary, "trend": spectrum.trend}
    return {
        "key": spectrum.key, **spectrum.place.plain(),
        **{name: {"value": value, "standard_error": error} for name, (value, error) in of_all.items()},
        "frequency": spectrum.frequency.tolist(), "real": spectrum.values.real.tolist(),
        "imaginary_part": spectrum.values.imag.tolist(), "standard_error": spectrum.error.tolist(),
    }  # fmt: skip


def level_row(level: Level) -> Row:
    """A coefficient by level as a plain row."""
    return {
        "key": level.key, "unit": level.unit, "rms_force": list(level.force), "value": list(level.value),
        "standard_error": list(level.error), "p_value": level.p_value, "moves": level.moves, "change": level.change,
    }  # fmt: skip


def history_step(comparison: Comparison, added: str | None = None, dropped: str | None = None) -> Row:
    """A comparison as a step of the history (``study.compare.history``).

    ``added`` names the term that is new in it, ``dropped`` the one that was taken out.
    """
    force, prediction = comparison.force_error, comparison.prediction
    _, rms, unit = _sizes(comparison)
    return {
        "terms": [t.name for t in comparison.model.terms], "added": added, "dropped": dropped,
        "record": comparison.record.name,
        "error": {"force": None if math.isnan(force) else force, "response": prediction.error},
        "rms": rms, "unit": unit,
        "noise_floor": {"response": prediction.floor},
        "converged": comparison.fit.converged, "coefficients": [coefficient_row(c) for c in comparison.coefficients],
    }  # fmt: skip


def as_json(content: Row) -> bytes:
    """A document as JSON; what is not finite becomes null."""
    return (json.dumps(_finite(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def _finite(value: object) -> object:
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in cast("dict[object, object]", value).items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in cast("Sequence[object]", value)]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def tables(comparisons: Sequence[Comparison], moving: Sequence[Level] = ()) -> dict[str, bytes]:
    """Every table by file name; the first column names the record."""
    builders: dict[str, Callable[[Comparison], Columns]] = {
        "comparison": _summary, "coefficients": _coefficients,
        **({"force_error": _force_error} if comparisons[0].forces else {}),
        "response_spectrum": _response_spectrum, "missing_force_curves": _curves, "missing_force_map": _map,
        "growth": lambda c: columns_of(where(c)["amplitude"]),
        "error_in_time": lambda c: columns_of(where(c)["time"]),
    }  # fmt: skip
    made = {name: _joined([(c.record.name, build(c)) for c in comparisons]) for name, build in builders.items()}
    if moving:
        names = [c.record.name for c in sorted(comparisons, key=lambda c: c.level)]
        made["coefficients_by_level"] = _csv(one_below_the_other([_by_level(level, names) for level in moving]))
    return made


def _joined(parts: Sequence[tuple[str, Columns]]) -> bytes:
    """Tables of several records as one, the first column naming which; one without a row counts for nothing."""
    return _csv(one_below_the_other([_named("record", name, table) for name, table in parts]))


def _named(what: str, name: str, table: Columns) -> Columns:
    """A table with a column before the others that says the same in each row."""
    return {what: [name] * len(next(iter(table.values()), list[Any]())), **table}


def _csv(table: Columns) -> bytes:
    return csv_bytes(table, "%.10g")


def _summary(comparison: Comparison) -> Columns:
    prediction = comparison.prediction
    forces = comparison.forces
    of_force = {
        "force_error_of_fitted_coefficients": mean_share([f.parametric_total for f in forces]),
        "force_noise_floor": mean_share([f.noise_total for f in forces]),
    } if forces else {}  # fmt: skip
    row = {
        "model": comparison.model.name, "response_error": prediction.error, "response_noise_floor": prediction.floor,
        "response_above_noise": prediction.above_noise, "force_error": comparison.force_error, **of_force,
        "rms_force": comparison.level, "time_p_value": comparison.time.p_value, "converged": comparison.fit.converged,
    }  # fmt: skip
    return columns_of([row])


def _coefficients(comparison: Comparison) -> Columns:
    rows: list[Row] = []
    for c in comparison.coefficients:
        low, high = c.interval or (math.nan, math.nan)
        row = {name: value for name, value in coefficient_row(c).items() if name not in ("interval", *c.place.plain())}
        rows.append(row | {"low": low, "high": high})
    return columns_of(rows)


def _force_error(comparison: Comparison) -> Columns:
    return _of_each("coordinate", {force.coordinate: _by_frequency(force) for force in comparison.forces})


def _by_frequency(force: ForceError) -> Columns:
    columns: dict[str, Any] = {
        "frequency": force.frequency, "force_density": force.force, "unexplained": force.unexplained,
        "left_by_fitted": force.parametric, "noise": force.noise, "motion_above_noise": force.band,
    }  # fmt: skip
    return filled(columns | {f"cumulative {i.shape}": c for i, c in zip(force.inputs, force.cumulative, strict=True)})


def _response_spectrum(comparison: Comparison) -> Columns:
    return _of_each("sensor", {
        str(v.sensor): filled(
            {"frequency": v.noise.frequency, "difference": v.noise.residual, "noise": v.noise.density}
        ) for v in comparison.views
    })  # fmt: skip


def _curves(comparison: Comparison) -> Columns:
    found: dict[str, Columns] = {}
    for place in comparison.missing.shown:
        lacking = comparison.missing.at(place)
        against = {"displacement": lacking.displacement, "velocity": lacking.velocity}
        lines = {name: curve(x[lacking.inner], lacking.force[lacking.inner]) for name, x in against.items()}
        tables = [filled({"against": name, **vars(line)}) for name, line in lines.items()]
        found[place.label] = one_below_the_other(tables)
    return _of_each("place", found)


def _of_each(what: str, tables: Mapping[str, Columns]) -> Columns:
    """Tables of several sensors or places, the first column naming which; one alone as it is."""
    if len(tables) == 1:
        return next(iter(tables.values()))
    return one_below_the_other([_named(what, name, table) for name, table in tables.items()])


def _map(comparison: Comparison) -> Columns:
    lacking = comparison.missing_force
    inner = lacking.inner
    plane = surface(lacking.displacement[inner], lacking.velocity[inner], lacking.force[inner])
    i, j = np.nonzero(np.isfinite(plane.mean))
    u, v = (0.5 * (x[1:] + x[:-1]) for x in (plane.displacement, plane.velocity))
    place = {"place": comparison.place.label} if comparison.model.named else {}
    columns = {"displacement": u[i], "velocity": v[j], "mean": plane.mean[i, j], "error": plane.error[i, j]}
    return filled({**place, **columns})


def _by_level(level: Level, names: Sequence[str]) -> Columns:
    return columns_of(
        {
            "key": level.key, "record": name, "rms_force": force, "value": value, "error": error, "unit": level.unit,
            "p_value": level.p_value, "moves": level.moves,
        } for name, force, value, error in zip(names, level.force, level.value, level.error, strict=True)
    )  # fmt: skip


def comparison_summary(comparisons: Sequence[Comparison], moving: Sequence[Level] = ()) -> str:
    """The table that a person reads in ten seconds, and the sentences below it."""
    named, (heads, rows) = comparisons[0].model.named, _error_rows(comparisons)
    errors = tabulate(rows, heads, tablefmt="simple", disable_numparse=True, stralign="right", colglobalalign="right")
    bodies = [_levels(moving, comparisons)] if moving else [_values(comparisons[0])]
    if named and len(comparisons) == 1 and not comparisons[0].model.prescribed:
        bodies.append(modes_table(comparisons[0].modes, comparisons[0].model.coordinates))
    text = "\n\n".join([_headline(comparisons[0]), errors, *bodies, says_of_all(comparisons, moving)])
    notes = list(dict.fromkeys(note for c in comparisons for note in c.notes))
    return text + footnotes(notes)


def _error_rows(comparisons: Sequence[Comparison]) -> tuple[list[str], list[list[str]]]:
    """Heads, and a row for each record; of a structure for each sensor in it."""
    first, several = comparisons[0], len(comparisons) > 1
    named, reversed_too, left_too = first.model.named, bool(first.forces), bool(first.missing.equations)
    heads = [""] * (several or not named) + ["sensor"] * named + ["response error", "in units", "noise floor"]
    heads += ["force error", "noise alone"] * reversed_too + ["force left there"] * (named and left_too)
    rows = list[list[str]]()
    for c in comparisons:
        forces, rms = {f.coordinate: f for f in c.forces}, dict(zip(c.missing.equations, c.missing.rms, strict=True))
        for i, (v, floor) in enumerate(zip(c.views, c.prediction.floors, strict=True)):
            where, force = v.sensor.coordinate, forces.get(v.sensor.coordinate)
            in_reverse = [percent(force.total), percent(force.noise_total)] if force is not None else ["-", "-"]
            left = f"{rms[where]:.3g} {c.missing.units(where)['force']}" if where in rms and named else "-"
            rows.append([
                *[c.record.name] * (several or not named), *[str(v.sensor)] * named,
                percent(v.error), _in_units(c, i), percent(floor), *in_reverse * reversed_too,
                *[left] * (named and left_too),
            ])  # fmt: skip
    return heads, rows


def footnotes(notes: Sequence[str]) -> str:
    """What was converted, integrated or left out: a number and a line each, below all else; empty if nothing was."""
    return "\n" + "".join(f"\n[{number}] {note}" for number, note in enumerate(notes, start=1)) if notes else ""


def _in_units(comparison: Comparison, sensor: int) -> str:
    row = _in_its_unit(comparison, sensor)
    return f"{row['response_error']:.3g} {row['unit']}".strip()


def _headline(comparison: Comparison) -> str:
    by = "" if comparison.estimator == FREE_RUN else f" by {comparison.estimator}"
    fit, judge = comparison.spans
    response = "of each sensor" if comparison.model.named else comparison.plan.response
    force = ""
    if comparison.forces:
        ends = np.array([f.frequency[f.band][[0, -1]] for f in comparison.forces])
        force = f"; force: share of power unexplained, {np.min(ends):.3g} to {np.max(ends):.3g} Hz"
    if comparison.model.named and comparison.missing.equations:
        force += f"{',' if force else '; force:'} rms that the equation of motion leaves"
    return (
        f"model {comparison.model.name}: fitted to samples {fit[0]}:{fit[1]}{by}, judged on "
        f"{judge[0]}:{judge[1]}\nresponse: free run, rms difference over rms {response}{force}"
    )


def _values(comparison: Comparison) -> str:
    rows = [[c.key, c.term, *value_and_interval(c), c.unit] for c in comparison.coefficients]
    return tabulate(rows, ["", "term", "value", "95 % interval", "unit"], tablefmt="simple", disable_numparse=True)


def _levels(moving: Sequence[Level], comparisons: Sequence[Comparison]) -> str:
    unit = comparisons[0].record.units.get(next(iter(comparisons[0].record.forces), ""), "")
    heads = [f"rms force ({unit})", *(f"{x:.3g}" for x in moving[0].force), "moves?", "unit"]
    rows = [
        [level.key, *(f"{v:.4g} +- {1.96 * e:.2g}" for v, e in zip(level.value, level.error, strict=True)),
         f"{'yes' if level.moves else 'no'} (p = {level.p_value:.1g})", level.unit] for level in moving
    ]  # fmt: skip
    return tabulate(rows, heads, tablefmt="simple", disable_numparse=True)
