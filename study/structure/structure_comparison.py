"""A structure held against a record: how good it is, and where it fails."""

from typing import Any

import numpy as np

from study.compare.comparison import Comparison
from study.compare.fitted_coefficients import Coefficient
from study.compare.leftover_by_place import explained_by_place
from study.equations import model_file
from study.equations.linear_part import Modes, modes_table
from study.equations.place import HERE, place_in_words
from study.support.numbers import percent


def structure_in_words(comparison: Comparison) -> str:
    """What a person wants to know, in sentences."""
    prediction, forces = comparison.prediction, comparison.missing
    worst = int(np.argmax(prediction.errors))
    said = [
        f"The free run leaves {percent(prediction.error)} of the motion, {percent(prediction.errors[worst])} at "
        f"{prediction.prepared.sensors[worst].coordinate}; noise alone would leave {percent(prediction.floor)}."
    ]
    if forces.lacking:
        said.append(f"The reverse system says no force of {', '.join(forces.lacking)}, which no sensor shows.")
    if np.any(forces.rms > 0.0):
        i = int(np.argmax(forces.rms))
        unit = forces.units(forces.coordinates[i])["force"]
        left = f"{forces.rms[i]:.3g} {unit} rms are left of its forces"
        said.append(f"The equation of {forces.coordinates[i]} is violated most: {left}.")
    if len(prediction.prepared.sensors) > 1 and forces.aligned:
        place, share = forces.aligned[0]
        said.append(
            f"A single force {place_in_words(place)} could make {percent(share)} of what stands above the noise."
        )
    return " ".join(said)


def structure_document(comparison: Comparison) -> dict[str, Any]:
    """What ``comparison.json`` holds."""
    prediction, fit, forces = comparison.prediction, comparison.fit, comparison.missing
    explained = explained_by_place(comparison.leftovers)
    return {
        "record": prediction.prepared.record.name,
        "model": {
            "name": comparison.model.name, "coordinates": list(comparison.model.coordinates),
            "terms": [model_file.format_entry(t) for t in comparison.model.terms],
        },
        "error": {
            "response": prediction.error, "force": forces.share,
            "sensors": {str(s): float(e) for s, e in zip(prediction.prepared.sensors, prediction.errors, strict=True)},
        },
        "noise_floor": {
            "response": prediction.floor,
            "sensors": {str(s): float(e) for s, e in zip(prediction.prepared.sensors, prediction.floors, strict=True)},
        },
        "coefficients": [placed_coefficient_row(c) for c in comparison.coefficients],
        "modes": mode_rows(comparison.modes),
        "fit": {
            "samples": list(prediction.prepared.plan.fit), "judged": list(prediction.prepared.plan.judge),
            "converged": fit.converged, "message": fit.message,
        },
        "where": {
            "coordinates": [
                {"coordinate": c, "residual_force": float(r), "force": float(f)}
                for c, r, f in zip(forces.coordinates, forces.rms, forces.inertia, strict=True)
            ],
            "places": [
                {**place.plain(), "share": share, "explained": explained.get(place.path, 0.0)}
                for place, share in forces.aligned
            ],
            "shared_force": forces.matrix.tolist(),
            "maps": {
                label: {"at": c.at.tolist(), "force": c.mean.tolist(), "error": c.error.tolist()}
                for label, c in forces.curves.items()
            },
        },
        "notes": list(comparison.notes),
        "says": structure_in_words(comparison),
    }  # fmt: skip


def placed_coefficient_row(c: Coefficient) -> dict[str, Any]:
    """A coefficient as a plain row."""
    return {
        "key": c.key, "term": c.term, **({} if c.place == HERE else c.place.plain()), "value": c.value,
        "interval": None if c.interval is None else list(c.interval), "standard_error": c.error, "unit": c.unit,
        "held": c.error is None,
    }  # fmt: skip


def mode_rows(modes: Modes) -> list[dict[str, Any]]:
    """Modes as plain rows."""
    return [
        {
            "frequency": float(modes.frequency[i]), "frequency_error": float(modes.frequency_error[i]),
            "damping": float(modes.damping[i]), "damping_error": float(modes.damping_error[i]),
            "shape": modes.shape[i].tolist(), "shape_error": modes.shape_error[i].tolist(),
        }
        for i in range(len(modes.frequency))
    ]  # fmt: skip


def structure_summary(comparison: Comparison) -> str:
    """The tables that a person reads first, and the sentences below them."""
    from tabulate import tabulate

    prediction, forces = comparison.prediction, comparison.missing
    left = {c: f"{rms:.3g} {forces.units(c)['force']}" for c, rms in zip(forces.coordinates, forces.rms, strict=True)}
    rows = [
        [
            str(s),
            percent(e),
            percent(f),
            left.get(s.coordinate, "-"),
        ]
        for s, e, f in zip(prediction.prepared.sensors, prediction.errors, prediction.floors, strict=True)
    ]
    first, last = prediction.prepared.plan.fit, prediction.prepared.plan.judge
    heads = ["sensor", "error", "noise floor", "force left there"]
    values = [[c.key, f"{c.value:.5g}", _interval(c), c.unit] for c in comparison.coefficients]
    parts = [
        f"model {comparison.model.name}: fitted to samples {first[0]} to {first[1]}, judged on {last[0]} to {last[1]}",
        tabulate(rows, heads, tablefmt="simple", disable_numparse=True),
        tabulate(values, ["", "value", "95 % interval", "unit"], tablefmt="simple", disable_numparse=True),
        modes_table(comparison.modes, comparison.model.coordinates),
        structure_in_words(comparison),
    ]
    return "\n\n".join(parts) + (f"\n({'; '.join(comparison.notes)})" if comparison.notes else "")


def _interval(c: Coefficient) -> str:
    return "held" if c.interval is None else f"{c.interval[0]:.5g} to {c.interval[1]:.5g}"


def structure_history_step(
    comparison: Comparison, added: str | None = None, dropped: str | None = None
) -> dict[str, Any]:
    """A comparison as a step of the history (``study.compare.history``)."""
    prediction = comparison.prediction
    return {
        "terms": [t.name for t in comparison.model.terms], "added": added, "dropped": dropped,
        "record": prediction.prepared.record.name,
        "error": {"force": comparison.missing.share, "response": prediction.error},
        "rms": float(np.sqrt(np.mean(prediction.misfit**2))), "unit": "",
        "noise_floor": {"response": prediction.floor}, "converged": comparison.fit.converged,
        "coefficients": [placed_coefficient_row(c) for c in comparison.coefficients],
    }  # fmt: skip
