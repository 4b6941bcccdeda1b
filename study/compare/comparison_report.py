"""A comparison as a document (JSON), tables (CSV), and the lines that a person reads first."""

import io
import json
import math
from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np
import pandas as pd
from tabulate import tabulate

from study.compare.across_levels import Level
from study.compare.by_estimator import FREE_RUN
from study.compare.comparison import Comparison
from study.compare.comparison_sentences import comparison_in_words, says_of_all
from study.compare.decay import decays_of
from study.compare.fitted_coefficients import Coefficient
from study.compare.force_map import curve, surface
from study.equations import model_file
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
    return {
        "model": rows[0]["model"],
        "error": {key: _mean([r["error"][key] for r in rows], key) for key in ("force", "response")},
        "noise_floor": {key: _mean([r["noise_floor"][key] for r in rows], key) for key in ("force", "response")},
        "coefficients": [{"record": r["record"], **c} for r in rows for c in r["coefficients"]],
        "where": {
            **{key: [{"record": r["record"], **x} for r in rows for x in r["where"][key]] for key in rows[0]["where"]},
            "level": [level_row(level) for level in moving],
        },
        "says": says_of_all(comparisons, moving),
        "records": rows,
    }


def _mean(values: Sequence[float], key: str) -> float:
    """Mean of shares of power (force), root mean square of shares of rms (response)."""
    return float(np.mean(values)) if key == "force" else float(np.sqrt(np.mean(np.square(values))))


def _of_record(comparison: Comparison) -> Row:
    prediction, seen = comparison.prediction, comparison.prediction.of(0)
    return {
        "record": comparison.record.name,
        "model": {"name": comparison.model.name, "equation": comparison.model.equation(), "terms": [
            model_file.format_entry(t) for t in comparison.model.terms]},
        "error": {"force": comparison.force.total, "response": comparison.prediction.error},
        "noise_floor": {
            "force": comparison.force.noise_total, "response": prediction.floor,
            "response_error": seen.noise.error / seen.size, "from": seen.noise.source,
        },
        "rms": {
            "response_error": seen.error * seen.size, "response": seen.size,
            "unit": comparison.record.units.get(comparison.plan.response, ""),
        },
        "error_of_fitted_coefficients": {"force": comparison.force.parametric_total},
        "above_noise": {"response": prediction.above_noise, "standard_errors": seen.noise.significance},
        "coefficients": [coefficient_row(c) for c in comparison.coefficients],
        "fit": {
            "samples": list(comparison.spans[0]), "judged": list(comparison.spans[1]),
            "every_sample": comparison.prepared.every,
            "response": comparison.plan.response,
            "estimator": comparison.estimator, "converged": comparison.fit.converged, "message": comparison.fit.message,
        },
        "where": where(comparison),
        "test": {
            "time": {
                "p_value": comparison.time.p_value, "growth_with_level": comparison.time.growth,
                "level_changes_too": comparison.time.confounded,
            }
        },
        "notes": list(comparison.notes),
        "says": comparison_in_words(comparison),
        **({"decay": found.plain()} if (found := decays_of(comparison)) else {}),
    }  # fmt: skip


def where(comparison: Comparison) -> dict[str, list[Row]]:
    """Where the model fails, as plain rows; ``level`` is empty for one record."""
    ways = comparison.growths.ways if comparison.growths is not None else ()
    return {
        "frequency": [{"of": b.of, "from": b.low, "to": b.high, "share": b.share} for b in comparison.bands],
        "amplitude": [
            {
                "of": w.of, "parity": w.parity, "power": w.power, "power_error": w.power_error,
                "share": w.share, "share_error": w.share_error,
            }
            for w in ways
        ],
        "time": [
            {"from": s.begin, "to": s.end, "error": s.error, "response": s.response, "over_usual": s.ratio}
            for s in comparison.time.stretches
        ],
        "level": [],
    }  # fmt: skip


def coefficient_row(coefficient: Coefficient) -> Row:
    """A coefficient as a plain row."""
    return {
        "key": coefficient.key, "term": coefficient.term, "value": coefficient.value,
        "interval": None if coefficient.interval is None else list(coefficient.interval),
        "standard_error": coefficient.error, "unit": coefficient.unit, "held": coefficient.held,
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
    force = comparison.force.total
    return {
        "terms": [t.name for t in comparison.model.terms], "added": added, "dropped": dropped,
        "record": comparison.record.name,
        "error": {"force": None if math.isnan(force) else force, "response": comparison.prediction.error},
        "rms": float(comparison.prediction.error * comparison.prediction.of(0).size),
        "unit": comparison.record.units.get(comparison.plan.response, ""),
        "noise_floor": {"response": comparison.prediction.floor},
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
    builders: dict[str, Callable[[Comparison], pd.DataFrame]] = {
        "comparison": _summary, "coefficients": _coefficients, "force_error": _force_error,
        "response_spectrum": _response_spectrum, "missing_force_curves": _curves, "missing_force_map": _map,
        "growth": lambda c: pd.DataFrame(where(c)["amplitude"]),
        "error_in_time": lambda c: pd.DataFrame(where(c)["time"]),
    }  # fmt: skip
    made = {name: _joined([(c.record.name, build(c)) for c in comparisons]) for name, build in builders.items()}
    if moving:
        names = [c.record.name for c in sorted(comparisons, key=lambda c: c.level)]
        made["coefficients_by_level"] = _csv(pd.concat([_by_level(level, names) for level in moving]))
    return made


def _joined(parts: Sequence[tuple[str, pd.DataFrame]]) -> bytes:
    frames = [frame.assign(record=name) for name, frame in parts]
    table = pd.concat([f for f in frames if len(f)] or frames)
    return _csv(table[["record", *(c for c in table.columns if c != "record")]])


def _csv(table: pd.DataFrame) -> bytes:
    text = io.StringIO()
    table.to_csv(text, index=False, float_format="%.10g", lineterminator="\n")
    return text.getvalue().encode()


def _summary(comparison: Comparison) -> pd.DataFrame:
    prediction = comparison.prediction
    row = {
        "model": comparison.model.name, "response_error": prediction.error, "response_noise_floor": prediction.floor,
        "response_above_noise": prediction.above_noise, "force_error": comparison.force.total,
        "force_error_of_fitted_coefficients": comparison.force.parametric_total,
        "force_noise_floor": comparison.force.noise_total, "rms_force": comparison.level,
        "time_p_value": comparison.time.p_value, "converged": comparison.fit.converged,
    }  # fmt: skip
    return pd.DataFrame([row])


def _coefficients(comparison: Comparison) -> pd.DataFrame:
    rows = [coefficient_row(c) for c in comparison.coefficients]
    for row in rows:
        low, high = row.pop("interval") or (math.nan, math.nan)
        row |= {"low": low, "high": high}
    return pd.DataFrame(rows)


def _force_error(comparison: Comparison) -> pd.DataFrame:
    force = comparison.force
    columns: dict[str, Any] = {
        "frequency": force.frequency, "force_density": force.force, "unexplained": force.unexplained,
        "left_by_fitted": force.parametric, "noise": force.noise, "motion_above_noise": force.band,
    }  # fmt: skip
    return pd.DataFrame(
        columns | {f"cumulative {i.shape}": c for i, c in zip(force.inputs, force.cumulative, strict=True)}
    )


def _response_spectrum(comparison: Comparison) -> pd.DataFrame:
    noise = comparison.prediction.of(0).noise
    return pd.DataFrame({"frequency": noise.frequency, "difference": noise.residual, "noise": noise.density})


def _curves(comparison: Comparison) -> pd.DataFrame:
    lacking = comparison.missing_force
    inner = lacking.inner
    against = {"displacement": lacking.displacement[inner], "velocity": lacking.velocity[inner]}
    lines = {name: curve(values, lacking.force[inner]) for name, values in against.items()}
    return pd.concat([pd.DataFrame({"against": name, **vars(line)}) for name, line in lines.items()])


def _map(comparison: Comparison) -> pd.DataFrame:
    lacking = comparison.missing_force
    inner = lacking.inner
    plane = surface(lacking.displacement[inner], lacking.velocity[inner], lacking.force[inner])
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


def comparison_summary(comparisons: Sequence[Comparison], moving: Sequence[Level] = ()) -> str:
    """The table that a person reads in ten seconds, and the sentences below it."""
    first = comparisons[0]
    heads = ["", "response error", "in units", "noise floor", "force error", "noise alone"]
    rows = [
        [c.record.name, percent(c.prediction.error), _in_units(c), percent(c.prediction.floor),
         percent(c.force.total), percent(c.force.noise_total)] for c in comparisons
    ]  # fmt: skip
    errors = tabulate(rows, heads, tablefmt="simple", disable_numparse=True, stralign="right", colglobalalign="right")
    body = _levels(moving, comparisons) if moving else _values(first)
    text = f"{_headline(first)}\n\n{errors}\n\n{body}\n\n{says_of_all(comparisons, moving)}"
    notes = list(dict.fromkeys(note for c in comparisons for note in c.notes))
    return text + footnotes(notes)


def footnotes(notes: Sequence[str]) -> str:
    """What was converted, integrated or left out: a number and a line each, below all else; empty if nothing was."""
    return "\n" + "".join(f"\n[{number}] {note}" for number, note in enumerate(notes, start=1)) if notes else ""


def _in_units(comparison: Comparison) -> str:
    unit = comparison.record.units.get(comparison.plan.response, "")
    return f"{comparison.prediction.error * comparison.prediction.of(0).size:.3g} {unit}".strip()


def _headline(comparison: Comparison) -> str:
    low, high = comparison.force.frequency[comparison.force.band][[0, -1]]
    by = "" if comparison.estimator == FREE_RUN else f" by {comparison.estimator}"
    fit, judge = comparison.spans
    return (
        f"model {comparison.model.name}: fitted to samples {fit[0]} to {fit[1]}{by}, judged on {judge[0]} to "
        f"{judge[1]}\n"
        f"response: free run, rms difference over rms {comparison.plan.response}; "
        f"force: share of power unexplained, {low:.3g} to {high:.3g} Hz"
    )


def _values(comparison: Comparison) -> str:
    rows = [[c.key, c.term, f"{c.value:.5g}", _interval(c), c.unit] for c in comparison.coefficients]
    return tabulate(rows, ["", "term", "value", "95 % interval", "unit"], tablefmt="simple", disable_numparse=True)


def _interval(coefficient: Coefficient) -> str:
    return "held" if coefficient.interval is None else f"{coefficient.interval[0]:.5g} to {coefficient.interval[1]:.5g}"


def _levels(moving: Sequence[Level], comparisons: Sequence[Comparison]) -> str:
    unit = comparisons[0].record.units.get("force", "")
    heads = [f"rms force ({unit})", *(f"{x:.3g}" for x in moving[0].force), "moves?", "unit"]
    rows = [
        [level.key, *(f"{v:.4g} +- {1.96 * e:.2g}" for v, e in zip(level.value, level.error, strict=True)),
         f"{'yes' if level.moves else 'no'} (p = {level.p_value:.1g})", level.unit] for level in moving
    ]  # fmt: skip
    return tabulate(rows, heads, tablefmt="simple", disable_numparse=True)
