"""The diagnosis of a structure in words, as a table for people and as fields for files."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from study.compare.comparison_report import comparison_document, mode_rows
from study.diagnose.needless import needless_fields
from study.diagnose.verdict import MISSING, NOTHING
from study.equations.coefficient_units import parameter_units
from study.equations.linear_part import modes_table
from study.equations.place import place_in_words as placed
from study.figures.labels import term_names
from study.records.record import Sensor
from study.structure.placed_needless import PlacedNeedless
from study.structure.placed_ranking import PlacedRanked
from study.structure.structure_verdict import StructureDiagnosis
from study.support.numbers import percent

SHOWN, TIES = 8, 2  # candidates in the table on the screen; ties named there
DEPENDENCE = 0.1  # held-out share from which the unexplained force is said to depend on something
APART = 2.0  # times the error of the prediction by which two places must differ at a sensor that would tell them


def placed_candidate_table(diagnosis: StructureDiagnosis) -> str:
    """The first candidates as a person reads them in ten seconds."""
    from tabulate import tabulate

    head = ["", "effect", "where", "explains", "error with it", "coefficient", "p", "tied with"]
    rows = [_shown(i, row) for i, row in enumerate(diagnosis.candidates[:SHOWN], start=1)]
    shown = tabulate(rows, head, tablefmt="simple", disable_numparse=True)
    more = len(diagnosis.candidates) - SHOWN
    left_out = diagnosis.asked - len(diagnosis.candidates)
    return f"{shown}\n... and {max(more, 0)} more, in diagnosis.json; {left_out} explain too little to be fitted"


def _shown(number: int, row: PlacedRanked) -> list[str]:
    ties = ", ".join(row.tied_with[:TIES]) + (
        f" and {len(row.tied_with) - TIES} more" if len(row.tied_with) > TIES else ""
    )
    return [
        str(number), row.term.name, row.entry.place.label if row.entry.place else "",
        percent(row.gain.explained, "z.1f", row.gain.error, ".1f"), percent(row.prediction.error),
        f"{row.coefficient:.4g} +- {1.96 * row.error:.2g} {row.unit}", f"{row.p_value:.1g}", ties,
    ]  # fmt: skip


def structure_diagnosis_in_words(diagnosis: StructureDiagnosis) -> str:
    """What to tell the engineer."""
    if diagnosis.verdict == NOTHING:
        prediction = diagnosis.comparison.prediction
        return (
            f"Nothing is missing that this record could show: the error of the motions is {percent(prediction.error)}, "
            "and what is left depends no more than chance has it on the motion at any place or on its past; none of "
            f"{diagnosis.asked} effects and places explains any of it."
        )
    return " ".join(_missing(diagnosis) if diagnosis.verdict == MISSING else _unknown(diagnosis))


def _missing(diagnosis: StructureDiagnosis) -> list[str]:
    first = diagnosis.candidates[0]
    words = term_names(first.term.name)
    low, high = first.interval
    known = f"95 % interval {low:.5g} to {high:.5g}"
    said = [
        f"{words[0].upper()}{words[1:]} is missing {placed(first.entry.place)} ({first.term.meaning}).",
        f"With it the held-out error of the motions falls from {percent(diagnosis.comparison.prediction.error)} to "
        f"{percent(first.prediction.error)}; the noise floor is {percent(first.prediction.floor)}.",
        f"Its coefficient is {first.coefficient:.5g} {first.unit} ({known}){_shape(first)}.",
    ]
    if diagnosis.left > 0.0:
        said.append(f"Structure of {percent(diagnosis.left)} of the response is left beside it.")
    if first.unphysical:
        said.append(f"As fitted it is no physical effect: {first.unphysical}.")
    if first.tied_with:
        rows = {r.name: r for r in diagnosis.candidates}
        named = [f"{term_names(rows[n].term.name)} {placed(rows[n].entry.place)}" for n in first.tied_with]
        said.append(f"This record cannot tell it from {', '.join(named)}.")
        said.append(separating_sensor(first, [rows[n] for n in first.tied_with]))
    return [s for s in said if s]


def _shape(row: PlacedRanked) -> str:
    known = parameter_units(row.entry, row.record) | {"phase": "rad"}
    parts = [f"{n} = {x:.4g} +- {1.96 * row.parameter_errors[n]:.2g} {known[n]}" for n, x in row.parameters.items()]
    return f", with {', '.join(parts)}" if parts else ""


def separating_sensor(first: PlacedRanked, tied: list[PlacedRanked]) -> str:
    """A sentence on the sensor that would tell tied places apart; empty if the tie is of effects at one place."""
    places = [r for r in tied if r.entry.place and first.entry.place and r.entry.place.path != first.entry.place.path]
    if not places:
        return ""
    prepared = first.prediction.prepared
    seen = {s.coordinate for s in prepared.sensors}
    wanted = tuple(Sensor(c, "displacement") for c in first.fit.model.coordinates if c not in seen)
    if not wanted:
        return (
            "Every coordinate is measured: a larger force, or one at another coordinate, may tell these places apart."
        )
    one, other = (r.prediction.motions(wanted) for r in (first, places[0]))
    apart = np.sqrt(np.mean((one - other) ** 2, axis=0)) / np.std(one, axis=0)
    best = int(np.argmax(apart))
    if apart[best] < APART * first.prediction.error:
        return (
            f"No further sensor would show them {percent(float(apart[best]))} apart: try a force at another coordinate."
        )
    differ = percent(float(apart[best]))
    return f"A sensor at {wanted[best].coordinate} would tell the places apart: there they differ by {differ}."


def _unknown(diagnosis: StructureDiagnosis) -> list[str]:
    error = percent(diagnosis.comparison.prediction.error)
    said = [f"Something is missing that no candidate explains: the error of the motions is {error}."]
    if diagnosis.candidates and diagnosis.candidates[0].gain.explained > 0.0:
        best = diagnosis.candidates[0]
        said.append(
            f"The nearest, {term_names(best.term.name)} {placed(best.entry.place)}, leaves "
            f"{percent(best.prediction.error)}."
        )
    if diagnosis.families and diagnosis.families[0].gain.explained > DEPENDENCE:
        most = diagnosis.families[0]
        said.append(
            f"The missing force depends on {most.family} {placed(most.place)}: general functions of it explain "
            f"{percent(most.gain.explained)} of what is unexplained, held out."
        )
    return said


def structure_fields(diagnosis: StructureDiagnosis, unneeded: Sequence[PlacedNeedless] = ()) -> dict[str, Any]:
    """What ``diagnosis.json`` holds: candidates best first, and the terms that the structure does not need."""
    comparison = diagnosis.comparison
    whole = comparison_document([comparison])
    rows = {r.name: r for r in diagnosis.candidates}
    after = diagnosis.modes_after
    return {
        "verdict": diagnosis.verdict,
        "record": whole["record"],
        "error": whole["error"],
        "noise_floor": whole["noise_floor"],
        "candidates": [_candidate(row, rows) for row in diagnosis.candidates],
        "asked": diagnosis.asked,
        "left": diagnosis.left,
        "depends_on": [
            {**f.place.plain(), "on": f.family, "explained": f.gain.explained} for f in diagnosis.families[:SHOWN]
        ],
        "modes": {"before": whole["modes"], "after": mode_rows(after) if after is not None else None},
        "where": whole["where"],
        "converged": comparison.fit.converged,
        "not_needed": needless_fields(unneeded),
        "says": structure_diagnosis_in_words(diagnosis),
    }


def _candidate(row: PlacedRanked, rows: dict[str, PlacedRanked]) -> dict[str, Any]:
    return {
        "term": row.term.name, **_plain(row),
        "parameters": row.parameters, "parameter_errors": row.parameter_errors,
        "coefficient": row.coefficient, "interval": list(row.interval),
        "response_error": row.prediction.error, "noise_floor": row.prediction.floor,
        "explained": row.gain.explained, "explained_error": row.gain.error, "p_value": row.p_value,
        "changes": {
            "frequency": row.flatness.spread() if row.flatness else None,
            "amplitude": row.steadiness.spread() if row.steadiness else None,
        },
        "tied_with": [{"term": rows[n].term.name, **_plain(rows[n])} for n in row.tied_with],
        "distance": row.distance if math.isfinite(row.distance) else None,
        "unphysical": row.unphysical, "converged": row.fit.converged,
    }  # fmt: skip


def _plain(row: PlacedRanked) -> dict[str, Any]:
    return row.entry.place.plain() if row.entry.place else {}


def modes_before_and_after(diagnosis: StructureDiagnosis) -> str:
    """The modes of the structure as given, and with the first candidate."""
    comparison = diagnosis.comparison
    before, after = modes_table(comparison.modes, comparison.model.coordinates), diagnosis.modes_after
    if after is None:
        return f"modes\n{before}"
    return f"modes of the model as given\n{before}\n\nmodes with it\n{modes_table(after, comparison.model.coordinates)}"
