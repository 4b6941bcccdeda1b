"""A structure held against a record: how good it is, and where it fails."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from study.compare.prediction import Prediction, predict
from study.equations import model_file
from study.equations.coefficient_units import coefficient_unit, parameter_units
from study.equations.linear_part import Modes, modes_of, modes_table
from study.equations.model import Model, ModelTerm
from study.equations.place import HERE, Place, place_in_words
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import linearise, uncertainty
from study.identify.time_domain.weighted_fit import finished
from study.records.prepared import Prepared
from study.records.record import Record
from study.structure.missing_forces import MissingForces, missing_forces
from study.structure.structure_leftover import FamilyGain, explained_by_place, family_gains
from study.structure.structure_start import first_fit
from study.support.arrays import Floats
from study.support.errors import expect
from study.support.numbers import percent


@dataclass(frozen=True)
class PlacedCoefficient:
    """A coefficient or shape parameter of a fitted structure."""

    key: str
    term: str
    place: Place
    value: float
    error: float | None  # standard error; None where the value was held
    unit: str

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % confidence interval; None if the value was held."""
        return None if self.error is None else (self.value - 1.96 * self.error, self.value + 1.96 * self.error)


@dataclass(frozen=True, eq=False)
class StructureComparison:
    """A structure held against one record."""

    model: Model  # as it was given
    prepared: Prepared
    fit: FreeRunFit
    covariance: Floats  # of the estimates; shape (keys, keys)
    coefficients: tuple[PlacedCoefficient, ...]
    prediction: Prediction
    modes: Modes
    forces: MissingForces  # what each coordinate's equation leaves, and between which places
    notes: tuple[str, ...]

    @cached_property
    def leftovers(self) -> tuple[FamilyGain, ...]:
        """What general shapes of the motion at each place explain of what is left, held out; asked for when shown."""
        return tuple(family_gains(self.fit, self.prediction))


def compare_structure(
    model: Model,
    prepared: Prepared,
    fit: FreeRunFit | None = None,
    progress: Callable[[str], None] | None = None,
) -> StructureComparison:
    """Fit what a structure leaves open to one part of a record and judge it on the other.

    ``fit`` is the finished fit of a candidate.

    Raises
    ------
    StudyError
        If the model cannot be fitted.
    """
    report: Callable[[str], None] = progress or (lambda _: None)
    sentence = f"{model.name!r} has 'linear: modal'; expected a model with inertia at every coordinate here"
    expect(model.modal is None, f"{sentence}; 'study compare', 'diagnose', 'add' and 'drop' take this one")
    report("fit")
    if fit is None:
        fit = finished(first_fit(model, prepared), prepared)
    covariance = uncertainty(fit, prepared, linearise(fit, prepared))[: len(fit.keys), : len(fit.keys)]
    report("free run")
    prediction = predict(fit, prepared)
    report("where it fails")
    modes = modes_of(fit.model, fit.keys, covariance)
    notes = [*prepared.notes]
    if modes.rigid:
        notes.append(f"nothing ties the structure down in {modes.rigid} of its motions: it may drift away as a whole")
    if fit.undecided:
        notes.append(f"this record cannot tell apart, or does not show, {', '.join(fit.undecided)}")
    return StructureComparison(
        model, prepared, fit, covariance, _coefficients(fit, covariance, prepared.record), prediction, modes,
        missing_forces(fit.model, prediction), tuple(notes),
    )  # fmt: skip


def _coefficients(fit: FreeRunFit, covariance: Floats, record: Record) -> tuple[PlacedCoefficient, ...]:
    errors = dict(zip(fit.keys, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    return tuple(
        PlacedCoefficient(key, entry.term.name, entry.place, float(value), errors.get(key), unit)
        for entry in fit.model.terms
        for (key, value), unit in zip(entry.values.items(), _units(entry, record), strict=True)
        if value is not None
    )


def _units(entry: ModelTerm, record: Record) -> list[str]:
    own = [coefficient_unit(entry, symbol, record) for symbol in entry.term.symbols]
    return [*own, *parameter_units(entry, record).values()]


def structure_in_words(comparison: StructureComparison) -> str:
    """What a person wants to know, in sentences."""
    prediction, forces = comparison.prediction, comparison.forces
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


def structure_document(comparison: StructureComparison) -> dict[str, Any]:
    """What ``comparison.json`` holds."""
    prediction, fit, forces = comparison.prediction, comparison.fit, comparison.forces
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
                for c, r, f in zip(forces.coordinates, forces.rms, forces.size, strict=True)
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


def placed_coefficient_row(c: PlacedCoefficient) -> dict[str, Any]:
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


def structure_summary(comparison: StructureComparison) -> str:
    """The tables that a person reads first, and the sentences below them."""
    from tabulate import tabulate

    prediction, forces = comparison.prediction, comparison.forces
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


def _interval(c: PlacedCoefficient) -> str:
    return "held" if c.interval is None else f"{c.interval[0]:.5g} to {c.interval[1]:.5g}"


def structure_history_step(
    comparison: StructureComparison, added: str | None = None, dropped: str | None = None
) -> dict[str, Any]:
    """A comparison as a step of the history (``study.compare.history``)."""
    prediction = comparison.prediction
    return {
        "terms": [t.name for t in comparison.model.terms], "added": added, "dropped": dropped,
        "record": prediction.prepared.record.name,
        "error": {"force": comparison.forces.share, "response": prediction.error},
        "rms": float(np.sqrt(np.mean(prediction.misfit**2))), "unit": "",
        "noise_floor": {"response": prediction.floor}, "converged": comparison.fit.converged,
        "coefficients": [placed_coefficient_row(c) for c in comparison.coefficients],
    }  # fmt: skip
