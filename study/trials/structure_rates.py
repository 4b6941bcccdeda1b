"""How often effect and place are found in trials of structures: rates with intervals, and the two confusions."""

import math
from collections.abc import Callable, Sequence

import pandas as pd

from study.diagnose.verdict import NOTHING
from study.support.document import Block, Image, Text, table
from study.trials.rates import NO_TRIALS, Rate, proportion
from study.trials.structure_draw import NOISES

Row = dict[str, object]
NEAR = 1.05  # times the true model's error, which the error after adding may be
WANTED = {
    "effect and place first, noise to 1 %": 0.9, "effect and place first, noise of 5 %": 0.8,
    "tie set holds the truth": 0.95, "nothing missing where nothing is": 0.95,
    "error after adding within 5 % of the true model's": 0.9,
    "95 % intervals of the true model that hold its values": 0.95,
}  # fmt: skip
SAID = {"nothing_missing": "nothing missing", "unknown_effect": "unknown effect"}
EFFECTS, PLACES = "trials_of_structures_effects.png", "trials_of_structures_places.png"
SAME, END, OTHER = "the same place", "a place with an end in common", "another place"


def structure_rates(rows: Sequence[Row]) -> list[Row]:
    """How often effect and place come first, ties hold the truth, and nothing is found where nothing is.

    ``rows`` are as ``structure_runs.run_structure`` gives them, or as a table of them reads back; a trial that failed
    counts as missed.
    """
    hidden = [r for r in rows if r["hidden"] != "none"]
    none = [r for r in rows if r["hidden"] == "none"]
    first = [(_number(r, "noise"), _yes(r, "effect_first") and _yes(r, "place_first")) for r in hidden]
    near = [_number(r, "error_after") <= NEAR * _number(r, "error_true") + 1e-9 for r in hidden]
    counted = [r for r in rows if _number(r, "true_keys") > 0.0]
    inside, keys = ([_number(r, key) for r in counted] for key in ("true_inside", "true_keys"))
    return [
        _rate("effect and place first, noise to 1 %", [holds for noise, holds in first if noise <= NOISES[1]]),
        _rate("effect and place first, noise of 5 %", [holds for noise, holds in first if noise > NOISES[1]]),
        _rate("effect first", [_yes(r, "effect_first") for r in hidden]),
        _rate("place first", [_yes(r, "place_first") for r in hidden]),
        _rate("tie set holds the truth", [_yes(r, "tie_holds") for r in hidden]),
        _rate("nothing missing where nothing is", [r.get("verdict") == NOTHING for r in none]),
        _rate("error after adding within 5 % of the true model's", near),
        _line("95 % intervals of the true model that hold its values", proportion(inside, keys) if keys else NO_TRIALS),
    ]  # fmt: skip


def _yes(row: Row, key: str) -> bool:
    return str(row.get(key)) == "True"


def _number(row: Row, key: str) -> float:
    try:
        return float(str(row.get(key)))
    except ValueError:
        return math.nan


def _rate(what: str, holds: Sequence[bool]) -> Row:
    return _line(what, proportion([float(x) for x in holds]))


def _line(what: str, rate: Rate) -> Row:
    return {
        "what": what, "trials": rate.trials, "share": rate.value, "low": rate.low, "high": rate.high,
        "wanted": WANTED.get(what, math.nan),
    }  # fmt: skip


def confusion_of_effects(rows: Sequence[Row]) -> pd.DataFrame:
    """Hidden effects down, what was said across, numbers of trials, for ``trial_pictures.confusion_panel``."""
    return _counted(rows, _what_hidden, _what_said)


def _what_hidden(row: Row) -> str:
    return str(row["hidden"])


def _what_said(row: Row) -> str:
    return SAID.get(str(row.get("verdict", "")), str(row.get("first") or "")) or "not diagnosed"


def confusion_of_places(rows: Sequence[Row]) -> pd.DataFrame:
    """Kinds of the hidden effect's place down, where the first candidate was across, numbers of trials."""
    return _counted(rows, _where_hidden, _where_said)


def _where_hidden(row: Row) -> str:
    path = _path(row, "place")
    if not path:
        return "none"
    kind = "to the ground, or a force on it" if "ground" in path else "between two"
    return f"{kind}, {row['coordinates']} coordinates"


def _where_said(row: Row) -> str:
    said, true = _path(row, "first_place"), _path(row, "place")
    if not said:
        return _what_said(row)
    return SAME if said == true else END if (said & true) - {"ground"} else OTHER


def _path(row: Row, key: str) -> set[str]:
    """What a place lies between; empty if there is none."""
    text = str(row.get(key) or "")
    ends = set[str]() if text in ("", "nan") else set(text.split("-"))
    return ends | {"ground"} if len(ends) == 1 else ends


def _counted(rows: Sequence[Row], down: Callable[[Row], str], across: Callable[[Row], str]) -> pd.DataFrame:
    pairs = [(down(row), across(row)) for row in rows]
    hidden, said = (sorted({pair[i] for pair in pairs}, key=lambda name: (name == "none", name)) for i in (0, 1))
    said = sorted(said, key=lambda name: (name in (*SAID.values(), "not diagnosed"), name != SAME, name))
    counts = [[sum(pair == (one, other) for pair in pairs) for other in said] for one in hidden]
    found = pd.DataFrame(counts, columns=said)
    found.insert(0, "hidden", hidden)
    return found


def in_document(rows: Sequence[Row]) -> list[Block]:
    """What docs/structures.md says of the trials."""
    seeds = [int(_number(row, "seed")) for row in rows]
    failed = sum(bool(str(row.get("trouble") or "")) for row in rows)
    about = (
        f"{len(rows)} trials, seeds {min(seeds)} to {max(seeds)}, {failed} of which could not be made or diagnosed and "
        "count as missed; in brackets 95 % intervals and the number of trials."
    )
    lines = [(str(line["what"]), _shown(line), _wanted(line)) for line in structure_rates(rows)]
    return [
        Text(about), table(("", "reached", "wanted"), lines),
        Image("Effects: what was hidden and what was said", EFFECTS),
        Image("Places: where it was hidden and where it was found", PLACES),
    ]  # fmt: skip


def _shown(line: Row) -> str:
    share, low, high = (100.0 * _number(line, key) for key in ("share", "low", "high"))
    return "-" if math.isnan(share) else f"{share:.3g} % ({low:.3g} to {high:.3g}; {line['trials']})"


def _wanted(line: Row) -> str:
    wanted = _number(line, "wanted")
    return "" if math.isnan(wanted) else f"{100.0 * wanted:.3g} %"
