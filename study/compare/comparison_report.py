"""A comparison as a document (JSON), tables (CSV), and the lines that a person reads first."""

import io
import json
import math
from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np
import pandas as pd

from study.compare.across_levels import Level
from study.compare.by_estimator import FREE_RUN
from study.compare.comparison import Comparison
from study.compare.comparison_sentences import says, says_of_all
from study.compare.fitted_coefficients import Coefficient
from study.compare.force_map import curve, surface
from study.equations import model_file
from study.support.numbers import percent

Row = dict[str, Any]


def document(found: Sequence[Comparison], moving: Sequence[Level] = ()) -> Row:
    """What ``comparison.json`` holds.

    Of several records, ``error`` and ``noise_floor`` are root mean squares over the records, and
    ``records`` holds a document of each.
    """
    if len(found) == 1:
        return _one(found[0])
    rows = [_one(c) for c in found]
    return {
        "model": rows[0]["model"],
        "error": {key: _mean([r["error"][key] for r in rows], key) for key in ("force", "response")},
        "noise_floor": {key: _mean([r["noise_floor"][key] for r in rows], key) for key in ("force", "response")},
        "coefficients": [{"record": r["record"], **c} for r in rows for c in r["coefficients"]],
        "where": {
            **{key: [{"record": r["record"], **x} for r in rows for x in r["where"][key]] for key in rows[0]["where"]},
            "level": [level_row(level) for level in moving],
        },
        "says": says_of_all(found, moving),
        "records": rows,
    }


def _mean(values: Sequence[float], key: str) -> float:
    """Mean of shares of power (force), root mean square of shares of rms (response)."""
    return float(np.mean(values)) if key == "force" else float(np.sqrt(np.mean(np.square(values))))


def _one(found: Comparison) -> Row:
    prediction = found.prediction
    return {
        "record": found.record.name,
        "model": {"name": found.model.name, "equation": found.model.equation(), "terms": [
            model_file.format_entry(t) for t in found.model.terms]},
        "error": {"force": found.force.total, "response": found.prediction.error},
        "noise_floor": {
            "force": found.force.noise_total, "response": prediction.floor,
            "response_error": prediction.noise.error / prediction.size, "from": prediction.noise.source,
        },
        "rms": {
            "response_error": found.prediction.error * found.prediction.size, "response": found.prediction.size,
            "unit": found.record.units.get(found.plan.response, ""),
        },
        "error_of_fitted_coefficients": {"force": found.force.parametric_total},
        "above_noise": {"response": found.prediction.structure, "standard_errors": found.prediction.noise.significance},
        "coefficients": [coefficient_row(c) for c in found.coefficients],
        "fit": {
            "samples": list(found.plan.fit), "judged": list(found.plan.judge), "response": found.plan.response,
            "estimator": found.estimator, "converged": found.fit.converged, "message": found.fit.message,
        },
        "where": where(found),
        "test": {
            "time": {
                "p_value": found.time.p_value, "growth_with_level": found.time.growth,
                "level_changes_too": found.time.confounded,
            }
        },
        "notes": list(found.notes),
        "says": says(found),
    }  # fmt: skip


def where(found: Comparison) -> dict[str, list[Row]]:
    """Where the model fails, as plain rows; ``level`` is empty for one record."""
    ways = found.growths.ways if found.growths is not None else ()
    return {
        "frequency": [{"of": b.of, "from": b.low, "to": b.high, "share": b.share} for b in found.bands],
        "amplitude": [
            {
                "of": w.of, "parity": w.parity, "power": w.power, "power_error": w.power_error,
                "share": w.share, "share_error": w.share_error,
            }
            for w in ways
        ],
        "time": [
            {"from": s.begin, "to": s.end, "error": s.error, "response": s.response, "over_usual": s.ratio}
            for s in found.time.stretches
        ],
        "level": [],
    }  # fmt: skip


def coefficient_row(found: Coefficient) -> Row:
    """A coefficient as a plain row."""
    return {
        "key": found.key, "term": found.term, "value": found.value,
        "interval": None if found.interval is None else list(found.interval),
        "standard_error": found.error, "unit": found.unit, "held": found.held,
    }  # fmt: skip


def level_row(found: Level) -> Row:
    """A coefficient by level as a plain row."""
    return {
        "key": found.key, "unit": found.unit, "rms_force": list(found.force), "value": list(found.value),
        "standard_error": list(found.error), "p_value": found.p_value, "moves": found.moves, "change": found.change,
    }  # fmt: skip


def rung(found: Comparison, added: str | None = None) -> Row:
    """A comparison as a rung of the ladder (``study.compare.history``); ``added`` names the term that is new in it."""
    return {
        "terms": [t.name for t in found.model.terms],
        "added": added,
        "record": found.record.name,
        "error": {"force": found.force.total, "response": found.prediction.error},
        "rms": float(found.prediction.error * found.prediction.size),
        "unit": found.record.units.get(found.plan.response, ""),
        "noise_floor": {"response": found.prediction.floor},
        "converged": found.fit.converged,
        "coefficients": [coefficient_row(c) for c in found.coefficients],
    }


def as_json(content: Row) -> bytes:
    """A document as JSON; what is not finite becomes null."""
    return (json.dumps(_finite(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def _finite(value: object) -> object:
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in cast("dict[object, object]", value).items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in cast("Sequence[object]", value)]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def tables(found: Sequence[Comparison], moving: Sequence[Level] = ()) -> dict[str, bytes]:
    """Every table by file name; the first column names the record."""
    builders: dict[str, Callable[[Comparison], pd.DataFrame]] = {
        "comparison": _summary, "coefficients": _coefficients, "force_error": _force_error,
        "response_spectrum": _response_spectrum, "missing_force_curves": _curves, "missing_force_map": _map,
        "growth": lambda c: pd.DataFrame(where(c)["amplitude"]), "error_in_time": lambda c: _rows(where(c)["time"]),
    }  # fmt: skip
    made = {name: _joined([(c.record.name, build(c)) for c in found]) for name, build in builders.items()}
    if moving:
        names = [c.record.name for c in sorted(found, key=lambda c: c.level)]
        made["coefficients_by_level"] = _csv(pd.concat([_by_level(level, names) for level in moving]))
    return made


def _rows(rows: list[Row]) -> pd.DataFrame:
    return pd.DataFrame(rows)


def _joined(parts: Sequence[tuple[str, pd.DataFrame]]) -> bytes:
    frames = [frame.assign(record=name) for name, frame in parts]
    table = pd.concat([f for f in frames if len(f)] or frames)
    return _csv(table[["record", *(c for c in table.columns if c != "record")]])


def _csv(table: pd.DataFrame) -> bytes:
    text = io.StringIO()
    table.to_csv(text, index=False, float_format="%.10g", lineterminator="\n")
    return text.getvalue().encode()


def _summary(found: Comparison) -> pd.DataFrame:
    prediction = found.prediction
    row = {
        "model": found.model.name, "response_error": prediction.error, "response_noise_floor": prediction.floor,
        "response_above_noise": prediction.structure, "force_error": found.force.total,
        "force_error_of_fitted_coefficients": found.force.parametric_total,
        "force_noise_floor": found.force.noise_total, "rms_force": found.level, "time_p_value": found.time.p_value,
        "converged": found.fit.converged,
    }  # fmt: skip
    return pd.DataFrame([row])


def _coefficients(found: Comparison) -> pd.DataFrame:
    rows = [coefficient_row(c) for c in found.coefficients]
    for row in rows:
        low, high = row.pop("interval") or (math.nan, math.nan)
        row |= {"low": low, "high": high}
    return pd.DataFrame(rows)


def _force_error(found: Comparison) -> pd.DataFrame:
    force = found.force
    columns: dict[str, Any] = {
        "frequency": force.frequency, "force_density": force.force, "unexplained": force.unexplained,
        "left_by_fitted": force.parametric, "noise": force.noise, "motion_above_noise": force.band,
    }  # fmt: skip
    return pd.DataFrame(
        columns | {f"cumulative {i.shape}": c for i, c in zip(force.inputs, force.cumulative, strict=True)}
    )


def _response_spectrum(found: Comparison) -> pd.DataFrame:
    noise = found.prediction.noise
    return pd.DataFrame({"frequency": noise.frequency, "difference": noise.residual, "noise": noise.density})


def _curves(found: Comparison) -> pd.DataFrame:
    lacking = found.missing_force
    inner = lacking.inner
    against = {"displacement": lacking.displacement[inner], "velocity": lacking.velocity[inner]}
    frames: list[pd.DataFrame] = []
    for name, values in against.items():
        line = curve(values, lacking.force[inner])
        frames.append(pd.DataFrame({"against": name, "at": line.at, "mean": line.mean, "error": line.error}))
    return pd.concat(frames)


def _map(found: Comparison) -> pd.DataFrame:
    lacking = found.missing_force
    plane = surface(*(x[lacking.inner] for x in (lacking.displacement, lacking.velocity, lacking.force)))
    i, j = np.nonzero(np.isfinite(plane.mean))
    u, v = (0.5 * (x[1:] + x[:-1]) for x in (plane.displacement, plane.velocity))
    return pd.DataFrame({"displacement": u[i], "velocity": v[j], "mean": plane.mean[i, j], "error": plane.error[i, j]})


def _by_level(level: Level, names: Sequence[str]) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "key": level.key, "record": names, "rms_force": level.force, "value": level.value, "error": level.error,
            "unit": level.unit, "p_value": level.p_value, "moves": level.moves,
        }
    )  # fmt: skip


def summary(found: Sequence[Comparison], moving: Sequence[Level] = ()) -> str:
    """The table that a person reads in ten seconds, and the sentences below it."""
    from tabulate import tabulate

    first = found[0]
    heads = ["", "response error", "in units", "noise floor", "force error", "noise alone"]
    rows = [
        [c.record.name, percent(c.prediction.error), _in_units(c), percent(c.prediction.floor),
         percent(c.force.total), percent(c.force.noise_total)] for c in found
    ]  # fmt: skip
    errors = tabulate(rows, heads, tablefmt="simple", disable_numparse=True, stralign="right", colglobalalign="right")
    body = _levels(moving, found) if moving else _values(first)
    text = f"{_headline(first)}\n\n{errors}\n\n{body}\n\n{says_of_all(found, moving)}"
    notes = list(dict.fromkeys(note for c in found for note in c.notes))
    return text + ("\n(" + "; ".join(notes) + ")" if notes else "")


def _in_units(found: Comparison) -> str:
    unit = found.record.units.get(found.plan.response, "")
    return f"{found.prediction.error * found.prediction.size:.3g} {unit}".strip()


def _headline(found: Comparison) -> str:
    low, high = found.force.frequency[found.force.band][[0, -1]]
    by = "" if found.estimator == FREE_RUN else f" by {found.estimator}"
    return (
        f"model {found.model.name}: fitted to samples {found.plan.fit[0]} to {found.plan.fit[1]}{by}, "
        f"judged on {found.plan.judge[0]} to {found.plan.judge[1]}\n"
        f"response: free run, rms difference over rms {found.plan.response}; "
        f"force: share of power unexplained, {low:.3g} to {high:.3g} Hz"
    )


def _values(found: Comparison) -> str:
    from tabulate import tabulate

    rows = [[c.key, c.term, f"{c.value:.5g}", _interval(c), c.unit] for c in found.coefficients]
    return tabulate(rows, ["", "term", "value", "95 % interval", "unit"], tablefmt="simple", disable_numparse=True)


def _interval(found: Coefficient) -> str:
    return "held" if found.interval is None else f"{found.interval[0]:.5g} to {found.interval[1]:.5g}"


def _levels(moving: Sequence[Level], found: Sequence[Comparison]) -> str:
    from tabulate import tabulate

    unit = found[0].record.units.get("force", "")
    heads = [f"rms force ({unit})", *(f"{x:.3g}" for x in moving[0].force), "moves?", "unit"]
    rows = [
        [level.key, *(f"{v:.4g} +- {1.96 * e:.2g}" for v, e in zip(level.value, level.error, strict=True)),
         f"{'yes' if level.moves else 'no'} (p = {level.p_value:.1g})", level.unit] for level in moving
    ]  # fmt: skip
    return tabulate(rows, heads, tablefmt="simple", disable_numparse=True)
