"""The diagnosis as a table for people and as fields for files."""

import math
from typing import Any

from tabulate import tabulate

from study.diagnose.ranked import Ranked
from study.diagnose.verdict import Diagnosis
from study.support.numbers import percent
from study.support.statistics import Gain

TIES = 2  # ties named in the table; the file names all
SHOWN = 8  # candidates in the table on the screen


def candidate_table(diagnosis: Diagnosis) -> str:
    """The first candidates as a person reads them in ten seconds."""
    head = ["", "effect", "explains", "error with it", "coefficient", "p", "changes by", "tied with"]
    units = diagnosis.comparison.record.units
    force, length = units.get("force", "N"), units.get("displacement", "m")
    rows = [_shown(i, row, force, length) for i, row in enumerate(diagnosis.candidates[:SHOWN], start=1)]
    shown = tabulate(rows, head, tablefmt="simple", disable_numparse=True)
    more = len(diagnosis.candidates) - SHOWN
    return f"{shown}\n... and {more} more, in diagnosis.json" if more > 0 else shown


def _shown(place: int, row: Ranked, force: str, length: str) -> list[str]:
    unit = row.term.unit(row.term.symbols[0], force, length)
    half = 1.96 * row.error
    return [
        str(place), row.name, _share(row.gain), percent(row.response_error),
        f"{row.coefficient:.4g} +- {half:.2g} {unit}", f"{row.p_value:.1g}",
        percent(row.unsteadiness, ".0f") if math.isfinite(row.unsteadiness) else "-", _few(row.tied_with),
    ]  # fmt: skip


def _share(gain: Gain) -> str:
    """The share explained; of what leaves twice as much as there was, how much more matters to nobody."""
    return "below -100 %" if gain.explained < -1.0 else percent(gain.explained, "z.1f", gain.error, ".1f")


def _few(names: tuple[str, ...]) -> str:
    shown = ", ".join(names[:TIES])
    return f"{shown} and {len(names) - TIES} more" if len(names) > TIES else shown


def diagnosis_fields(diagnosis: Diagnosis) -> dict[str, Any]:
    """What ``diagnosis.json`` holds of the diagnosis itself; candidates best first."""
    prediction = diagnosis.comparison.prediction
    return {
        "verdict": diagnosis.verdict,
        "error": {"response": prediction.error, "force": diagnosis.comparison.force.total},
        "noise_floor": {"response": prediction.floor},
        "candidates": [_candidate(row) for row in diagnosis.candidates],
        "pair": list(diagnosis.pair),
        "left": diagnosis.left,
        "depends_on": diagnosis.families,
        "converged": diagnosis.comparison.fit.converged,
    }


def _candidate(row: Ranked) -> dict[str, Any]:
    return {
        "term": row.name,
        "parameters": row.parameters,
        "parameter_errors": row.parameter_errors,
        "coefficient": row.coefficient,
        "interval": list(row.interval),
        "response_error": row.response_error,
        "noise_floor": row.prediction.floor,
        "explained": row.gain.explained,
        "explained_error": row.gain.error,
        "p_value": row.p_value,
        "changes": {
            "frequency": row.flatness.spread() if row.flatness else None,
            "amplitude": row.steadiness.spread() if row.steadiness else None,
        },
        "tied_with": list(row.tied_with),
        "unphysical": row.unphysical,
        "converged": row.fit.converged,
    }
