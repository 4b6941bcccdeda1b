"""The diagnosis as a table for people and as fields for files."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

from tabulate import tabulate

from study.diagnose.diagnosis_sentences import all_asked
from study.diagnose.ranked import Ranked
from study.diagnose.verdict import Diagnosis
from study.equations.terms import LIBRARY
from study.support.numbers import percent
from study.support.statistics import Gain

TIES = 2  # ties named in the table; the file names all
ON_SCREEN = 8  # candidates in the table


def candidate_table(diagnosis: Diagnosis) -> str:
    """The first candidates as a person reads them in ten seconds."""
    head = ["", "effect", "where", "explains", "error with it", "coefficient", "p", "changes by", "tied with"]
    listed = shown_rows(diagnosis)
    rows = [head, *(_shown(number, row) for number, row in listed)]
    if not diagnosis.comparison.model.named:  # there is one place
        rows = [row[:2] + row[3:] for row in rows]
    shown = tabulate(rows[1:], rows[0], tablefmt="simple", disable_numparse=True)
    more, unfitted = len(diagnosis.candidates) - len(listed), diagnosis.asked - len(diagnosis.candidates)
    said = [f"... and {more} more, in diagnosis.json"] if more > 0 else []
    said += [_why_this_order(diagnosis)] if _contradicts([row for _, row in listed]) else []
    said += [f"{unfitted} of {all_asked(diagnosis)} explain too little, or cannot be fitted"] if unfitted > 0 else []
    return "\n".join([shown, "; ".join(said)]) if said else shown


def _contradicts(rows: Sequence[Ranked]) -> bool:
    """Whether a row stands behind one that explains less."""
    return any(later.gain.explained > row.gain.explained for row, later in itertools.pairwise(rows))


def _why_this_order(diagnosis: Diagnosis) -> str:
    named = "what is named first, then " if diagnosis.answer is not None else ""
    return f"ordered by {named}what is left of both parts of the record; 'explains' counts the judged part only"


def shown_rows(diagnosis: Diagnosis) -> list[tuple[int, Ranked]]:
    """The candidates that a table shows, each with its rank: the first, and all of the user's own."""
    every = list(enumerate(diagnosis.candidates, start=1))
    return every[:ON_SCREEN] + [(number, row) for number, row in every[ON_SCREEN:] if row.term.name not in LIBRARY]


def _shown(number: int, row: Ranked) -> list[str]:
    ties = ", ".join(row.tied_with[:TIES])
    ties += f" and {len(row.tied_with) - TIES} more" if len(row.tied_with) > TIES else ""
    share = explained_share(row.gain)
    return [
        str(number), row.term.name, row.entry.place.label, share, percent(row.response_error),
        shown_coefficient(row.effect.coefficient, 1.96 * row.effect.error, row.effect.unit), f"{row.p_value:.1g}",
        percent(row.unsteadiness, ".0f") if math.isfinite(row.unsteadiness) else "-", ties,
    ]  # fmt: skip


def explained_share(gain: Gain, with_error: bool = True) -> str:
    """What an effect explains, with half of its 95 % interval; how much worse a model is with it matters to nobody."""
    if gain.explained < -max(gain.error, 0.05):
        return "worse"
    return percent(gain.explained, "z.1f", 1.96 * gain.error if with_error else None, ".1f")


def shown_coefficient(value: float, half: float, unit: str) -> str:
    """A coefficient with half of its 95 % interval; one of zero width is narrower than these digits."""
    spread = f" +- {half:.2g}" if half > 0.0 else ""
    return f"{value:.4g}{spread} {unit}"


def diagnosis_fields(diagnosis: Diagnosis) -> dict[str, Any]:
    """What ``diagnosis.json`` holds of the diagnosis itself; candidates best first."""
    rows, named = {row.name: row for row in diagnosis.candidates}, diagnosis.comparison.model.named
    families = diagnosis.families
    on = [{**f.place.plain(), "on": f.family, "explained": f.gain.explained} for f in families[:ON_SCREEN]]
    return {
        "verdict": diagnosis.verdict,
        "candidates": [_candidate(row, rows, named) for row in diagnosis.candidates],
        "asked": diagnosis.asked,
        "sets": [_set(row, named) for row in diagnosis.sets],
        "in_sets": diagnosis.included,
        "left": diagnosis.left,
        "depends_on": on if named else {f.family: f.gain.explained for f in families},
        "converged": diagnosis.comparison.fit.converged,
    }


def set_table(diagnosis: Diagnosis) -> str:
    """The sets of effects that the record cannot tell from the best, the answer first; empty for a single effect."""
    if all(len(row.entries) == 1 for row in diagnosis.sets):
        return ""
    head = ["", "effects together", "explain", "error with them", "unknowns", "behind the first by"]
    rows = [
        [
            str(i), ", ".join(row.names), percent(row.gain.explained, "z.1f"), percent(row.response_error),
            str(row.unknowns), "-" if i == 1 else f"{max(row.distance, 0.0):.1f} standard errors",
        ]
        for i, row in enumerate(diagnosis.sets[:ON_SCREEN], start=1)
    ]  # fmt: skip
    more = len(diagnosis.sets) - ON_SCREEN
    shown = tabulate(rows, head, tablefmt="simple", disable_numparse=True)
    return shown + (f"\n... and {more} more, in diagnosis.json" if more > 0 else "")


def _set(row: Ranked, named: bool) -> dict[str, Any]:
    return {
        "effects": [
            {
                "term": e.entry.term.name, **(e.entry.place.plain() if named else {}), "coefficient": e.coefficient,
                "interval": list(e.interval), "parameters": e.parameters, "parameter_errors": e.parameter_errors,
            }
            for e in row.effects
        ],
        "response_error": row.response_error, "explained": row.gain.explained, "p_value": row.p_value,
        "unknowns": row.unknowns, "distance": row.distance if math.isfinite(row.distance) else None,
        "unphysical": row.unphysical, "converged": row.fit.converged,
    }  # fmt: skip


def _candidate(row: Ranked, rows: dict[str, Ranked], named: bool) -> dict[str, Any]:
    def where(other: Ranked) -> dict[str, Any]:
        return other.entry.place.plain() if named else {}

    return {
        "term": row.term.name, **where(row),
        "parameters": row.effect.parameters, "parameter_errors": row.effect.parameter_errors,
        "coefficient": row.effect.coefficient, "interval": list(row.effect.interval),
        "response_error": row.response_error, "noise_floor": row.prediction.floor,
        "explained": row.gain.explained, "explained_error": row.gain.error, "p_value": row.p_value,
        "changes": {
            "frequency": row.effect.flatness.spread() if row.effect.flatness else None,
            "amplitude": row.effect.steadiness.spread() if row.effect.steadiness else None,
        },
        "tied_with": [{"term": rows[n].term.name, **where(rows[n])} if named else n for n in row.tied_with],
        "distance": row.distance if math.isfinite(row.distance) else None,
        "unphysical": row.unphysical, "converged": row.fit.converged,
        **({"modes": row.fit.model.modal.count} if row.fit.model.modal else {}),
    }  # fmt: skip
