"""A diagnosis between sensors in words, as a table for people and as fields for files."""

import math
from typing import Any

from study.compare.modal_comparison import modal_document, modal_says
from study.diagnose.modal_diagnosis import ModalDiagnosis, ModalRanked
from study.diagnose.verdict import MISSING, NOTHING
from study.equations.place import place_in_words as placed
from study.figures.labels import term_names
from study.support.numbers import percent

SHOWN, TIES = 8, 2  # candidates in the table on the screen; ties named there


def modal_table(diagnosis: ModalDiagnosis) -> str:
    """The first candidates as a person reads them in ten seconds."""
    from tabulate import tabulate

    head = ["", "effect", "where", "explains", "error with it", "coefficient", "modes", "p", "tied with"]
    rows = [_shown(i, row) for i, row in enumerate(diagnosis.candidates[:SHOWN], start=1)]
    more = max(len(diagnosis.candidates) - SHOWN, 0)
    rest = diagnosis.asked - len(diagnosis.candidates)
    shown = tabulate(rows, head, tablefmt="simple", disable_numparse=True)
    return f"{shown}\n... and {more} more, in diagnosis.json; {rest} promise too little to be fitted"


def _shown(number: int, row: ModalRanked) -> list[str]:
    more = f" and {len(row.tied_with) - TIES} more" if len(row.tied_with) > TIES else ""
    return [
        str(number), row.term.name, row.entry.place.label if row.entry.place else "",
        percent(row.gain.explained, "z.1f", row.gain.error, ".1f"), percent(row.prediction.error),
        f"{row.coefficient:.4g} +- {1.96 * row.error:.2g} {_unit(row)}", str(row.modes), f"{row.p_value:.1g}",
        ", ".join(row.tied_with[:TIES]) + more,
    ]  # fmt: skip


def _unit(row: ModalRanked) -> str:
    return row.term.unit(row.term.symbols[0], *row.prediction.prepared.record.force_and_length)


def _named(row: ModalRanked) -> str:
    return f"{term_names(row.term.name)} {placed(row.entry.place) if row.entry.place else ''}".strip()


def modal_in_words(diagnosis: ModalDiagnosis) -> str:
    """What to tell the engineer."""
    before = diagnosis.comparison.prediction
    if diagnosis.verdict == NOTHING:
        return (
            f"Nothing is missing between the sensors that this record could show: the error of the motions is "
            f"{percent(before.error)}, what is left is white, and none of {diagnosis.asked} effects and places "
            "explains any of it."
        )
    if diagnosis.verdict != MISSING:
        return _unknown(diagnosis)
    first = diagnosis.candidates[0]
    words, (low, high) = _named(first), first.interval
    said = [
        f"{words[0].upper()}{words[1:]} is missing ({first.term.meaning}).",
        f"With it and {first.modes} modes instead of {len(diagnosis.comparison.modes.frequency)} the held-out "
        f"error of the motions falls from {percent(before.error)} to {percent(first.prediction.error)}; white noise "
        f"alone would leave {percent(first.prediction.floor)}.",
        f"Its coefficient is {first.coefficient:.5g} {_unit(first)} (95 % interval {low:.5g} to {high:.5g}).",
        *(f"Line by line {s.key} is {s.mean[0]:.4g} +- {1.96 * s.mean[1]:.2g}, its imaginary part "
          f"{s.imaginary[0]:.2g} +- {1.96 * s.imaginary[1]:.2g}." for s in first.spectra),
    ]  # fmt: skip
    if diagnosis.left > 0.0:
        said.append(f"Beside it {percent(diagnosis.left)} of the motion stands above white noise.")
    if first.unphysical:
        said.append(f"As fitted it is no physical effect: {first.unphysical}.")
    if first.tied_with:
        rows = {r.name: r for r in diagnosis.candidates}
        said.append(f"This record cannot tell it from {', '.join(_named(rows[n]) for n in first.tied_with)}.")
    return " ".join(said)


def _unknown(diagnosis: ModalDiagnosis) -> str:
    before = diagnosis.comparison.prediction
    said = (
        f"Something is missing that no candidate between the sensors explains: the error of the motions is "
        f"{percent(before.error)}, white noise alone would leave {percent(before.floor)}. It may sit where no sensor "
        "is, or be a mode that the fit has not."
    )
    best = diagnosis.candidates[0] if diagnosis.candidates else None
    if best is not None and best.gain.explained > 0.0:
        said += f" The nearest, {_named(best)}, leaves {percent(best.prediction.error)}."
    return said


def modal_fields(diagnosis: ModalDiagnosis) -> dict[str, Any]:
    """What ``diagnosis.json`` holds; candidates best first."""
    whole = modal_document(diagnosis.comparison)
    rows = {r.name: r for r in diagnosis.candidates}
    return {
        "verdict": diagnosis.verdict, "record": whole["record"], "model": whole["model"], "error": whole["error"],
        "noise_floor": whole["noise_floor"], "candidates": [_candidate(r, rows) for r in diagnosis.candidates],
        "asked": diagnosis.asked, "left": diagnosis.left, "modes": {"before": whole["modes"]},
        "converged": diagnosis.comparison.fit.converged,
        "says": f"{modal_says(diagnosis.comparison)} {modal_in_words(diagnosis)}",
    }  # fmt: skip


def _candidate(row: ModalRanked, rows: dict[str, ModalRanked]) -> dict[str, Any]:
    return {
        "term": row.term.name, **_place(row), "parameters": row.parameters, "parameter_errors": row.parameter_errors,
        "coefficient": row.coefficient, "interval": list(row.interval), "response_error": row.prediction.error,
        "noise_floor": row.prediction.floor, "explained": row.gain.explained, "explained_error": row.gain.error,
        "p_value": row.p_value, "modes": row.modes,
        "by_frequency": [
            {"key": s.key, "mean": list(s.mean), "imaginary": list(s.imaginary), "trend": list(s.trend)}
            for s in row.spectra
        ],
        "tied_with": [{"term": rows[n].term.name, **_place(rows[n])} for n in row.tied_with],
        "distance": row.distance if math.isfinite(row.distance) else None, "unphysical": row.unphysical,
        "converged": row.fit.converged,
    }  # fmt: skip


def _place(row: ModalRanked) -> dict[str, Any]:
    return row.entry.place.plain() if row.entry.place else {}
