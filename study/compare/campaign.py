"""Many measured records on one page: the verdict of each, and every coefficient by record and level of response.

The numbers are those of each record's ``comparison.json`` and ``diagnosis.json``. Records of one rig are held against
each other: what is right has the same coefficients at all levels (the report's criterion, see ``across_levels``).
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import date
from typing import Any, Literal

from study.compare.fitted_coefficients import Coefficient, Level, across_levels
from study.equations.place import Kind, Place, place_in_words
from study.figures.labels import prefixed, term_names
from study.support import document
from study.support.numbers import percent

MEASURED_RECORDS = "Measured records"
VERDICTS_IN_WORDS = {
    "missing_effect": "an effect is missing", "missing_effects": "several effects are missing",
    "partly_known": "effects are missing, and something that has no name", "nothing_missing": "nothing is missing",
    "unknown_effect": "something is missing that no candidate explains",
}  # fmt: skip
By = Literal["record", "level", "date"]
DATED = re.compile(r"(?<![0-9])((?:19|20)[0-9]{2})[-_.]?([01][0-9])[-_.]?([0-3][0-9])(?![0-9])")


def day_of(name: str) -> date | None:
    """The day that the name of a record holds, as ``rig_2026-03-01`` or ``20260301_rig`` do; None if it holds none."""
    for found in DATED.finditer(name):
        with suppress(ValueError):
            return date(*map(int, found.groups()))
    return None


@dataclass(frozen=True)
class Measured:
    """One record: its rig (records of one rig and one model are held against each other), and what was found."""

    name: str
    rig: str
    comparison: Mapping[str, Any]
    diagnosis: Mapping[str, Any]

    @property
    def level(self) -> float:
        """Rms of the measured response, in the record's own unit; no number where there are several responses."""
        return float(self.comparison.get("rms", {}).get("response", math.nan))

    @property
    def shown_level(self) -> str:
        """With its unit."""
        factor, unit = prefixed(self.unit, self.level)
        return "" if math.isnan(self.level) else f"{self.level / factor:.3g} {unit}"

    @property
    def unit(self) -> str:
        """Unit of the level."""
        return str(self.comparison.get("rms", {}).get("unit", ""))

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        """As the comparison has them."""
        return tuple(
            Coefficient(c["key"], c["term"], c["value"], None if c["held"] else c["standard_error"], c["unit"])
            for c in self.comparison.get("coefficients", ())
        )


def measured_of_row(name: str, rig: str, comparison: Mapping[str, Any], diagnosis: Mapping[str, Any]) -> list[Measured]:
    """What the files of a row tell: one record, or each of several that were diagnosed together."""
    parts: Sequence[Mapping[str, Any]] = comparison.get("records", ())
    if not parts:
        return [Measured(name, rig, comparison, diagnosis)]
    return [
        Measured(f"{name} {part.get('record', number)}", rig, {**comparison, **part}, diagnosis)
        for number, part in enumerate(parts, 1)
    ]


def campaign_blocks(
    records: Iterable[Measured], by: By = "level", refused: Mapping[str, str] | None = None
) -> list[document.Block]:
    """The page: what differs in sentences, a table of verdicts, then the coefficients of each rig with their picture.

    Parameters
    ----------
    records : iterable of Measured
        What was found of each.
    by : str
        What the records of a rig stand in the order of: the ``level`` of the response, the ``date`` in their names, or
        ``record``, as they are given.
    refused : mapping of str, optional
        By name, why a record could not be used.
    """
    rigs = _by_rig(records, by)
    every = [record for rig in rigs.values() for record in rig]
    counts = [(word, sum(r.diagnosis["verdict"] == key for r in every)) for key, word in VERDICTS_IN_WORDS.items()]
    said = "; ".join(f"{word} in {count}" for word, count in counts if count)
    heading = ("record", "level", "error", "noise floor", "verdict", "effects", "explain", "error with them")
    page: list[document.Block] = [
        document.Heading(MEASURED_RECORDS, 1), document.Text(f"{len(every)} records: {said}."),
        document.Bullets(tuple(sentence for rig, rows in rigs.items() for sentence in _differences(rig[0], rows))),
        document.table(heading, [_verdict(record) for record in every]),
    ]  # fmt: skip
    page = [block for block in page if block != document.Bullets(())]
    if refused:
        page += [
            document.Heading("Records that could not be used"),
            document.table(("record", "why"), [*refused.items()]),
        ]
    for (rig, model, *_), rows in rigs.items():
        page += [document.Heading(f"{rig}: coefficients of the model {model}, by {by}"), *_coefficients(rig, rows, by)]
    return [
        *page,
        document.Text(
            "Level: rms of the measured response. Error: of the free run on the part that was not fitted, over that "
            "rms. Each record is fitted by itself, values with 95 % intervals; a model that lacks nothing has the same "
            "coefficients at all levels. p: the chance of such differences if a coefficient is the same in all "
            "records; 'no' accounts for the number of coefficients."
        ),
    ]  # fmt: skip


def _by_rig(records: Iterable[Measured], by: By) -> dict[tuple[str, str, str, tuple[str, ...]], list[Measured]]:
    """Records of one rig, one model, one unit and the same coefficients, in their order."""
    found: dict[tuple[str, str, str, tuple[str, ...]], list[Measured]] = {}
    for record in records:
        keys = tuple(c.key for c in record.coefficients)
        found.setdefault((record.rig, str(record.comparison["model"]["name"]), record.unit, keys), []).append(record)
    if by == "record":
        return found
    if by == "level":
        return {key: sorted(rows, key=lambda r: r.level) for key, rows in found.items()}
    return {key: sorted(rows, key=lambda r: day_of(r.name) or date.max) for key, rows in found.items()}


def _differences(rig: str, rows: Sequence[Measured]) -> list[str]:
    """Whether verdicts and coefficients of one rig's records are the same, in sentences."""
    if len(rows) < 2:
        return []
    told: dict[str, list[str]] = {}
    for record in rows:
        words, effects = _verdict(record)[4:6]
        told.setdefault(f"{words} ({effects})" if effects else words, []).append(record.name)
    one = len(told) == 1
    each = "; ".join(verdict if one else f"{verdict} in {_listed(names)}" for verdict, names in told.items())
    said = [f"{rig}: all {len(rows)} verdicts are the same: {each}." if one else f"**{rig}: verdicts differ**: {each}."]
    whole = [r for r in rows if r.diagnosis["verdict"] == "nothing_missing"]
    said.append(_moved(rig, rows, "between the records"))
    if len(whole) < len(rows):
        said.append(f"{rig}: where a model lacks an effect, its coefficients may differ for that reason alone.")
    if 1 < len(whole) < len(rows):
        said.append(_moved(rig, whole, f"between the {len(whole)} records in which nothing is missing"))
    return [sentence for sentence in said if sentence]


def _moved(rig: str, rows: Sequence[Measured], among: str) -> str:
    """Which coefficients differ by more than chance; empty where none was fitted."""
    levels = across_levels([r.level for r in rows], [r.coefficients for r in rows])
    moved = [
        f"{x.key} from {min(x.value):.4g} to {max(x.value):.4g} {x.unit} (p {x.chance})"
        for x in levels if x.moves
    ]  # fmt: skip
    same = ", ".join(x.key for x in levels if not x.moves)
    if not moved:
        return f"{rig}: no coefficient differs {among} by more than chance ({same})." if levels else ""
    counted = f"{len(moved)} of {len(levels)} coefficients differ {among} by more than chance"
    return f"**{rig}: {counted}**: {'; '.join(moved)}." + (f" The same in all: {same}." if same else "")


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")


def _verdict(record: Measured) -> tuple[str, ...]:
    found = record.diagnosis
    verdict = str(found["verdict"])
    several = verdict in ("missing_effects", "partly_known") and found.get("sets")
    first: Mapping[str, Any] = {}
    if several:
        first = found["sets"][0]
        effects = " and ".join(map(_effect, first["effects"]))
        effects += f" (or one of {len(found['sets']) - 1} other sets)" if len(found["sets"]) > 1 else ""
    elif verdict in ("missing_effect", "partly_known") and found["candidates"]:
        first = found["candidates"][0]
        effects = " or ".join(map(_effect, (first, *first.get("tied_with", ()))))
    else:
        effects = ""
    return (
        record.name, record.shown_level, percent(record.comparison["error"]["response"]),
        percent(record.comparison["noise_floor"]["response"]), VERDICTS_IN_WORDS.get(verdict, verdict),
        effects, percent(first["explained"]) if first else "",
        percent(first["response_error"]) if first else "",
    )  # fmt: skip


def _effect(told: str | Mapping[str, Any]) -> str:
    """An effect in words, with its place where that has a name."""
    if isinstance(told, str):
        return term_names(told)
    kinds: tuple[Kind, ...] = ("at", "between", "couples")
    ends: list[tuple[Kind, str | list[str]]] = [(kind, told[kind]) for kind in kinds if kind in told]
    where = [Place(kind, (end,) if isinstance(end, str) else tuple(end)) for kind, end in ends]
    return " ".join((term_names(told["term"]), *map(place_in_words, where)))


def _coefficients(rig: str, rows: Sequence[Measured], by: By) -> list[document.Block]:
    """Values with 95 % intervals, and of several records a picture and the chance of such differences."""
    own = [record.coefficients for record in rows]
    columns = [", ".join(filter(None, (record.name, record.shown_level))) for record in rows]
    if len(rows) == 1:
        return [document.table(("coefficient", *columns, "unit"), [(c.key, _value(c), c.unit) for c in own[0]])]
    levels = across_levels([record.level for record in rows], own)
    judged = {level.key: level for level in levels}
    lines = [
        (key[0].key, *map(_value, key), key[0].unit, *_judged(judged.get(key[0].key))) for key in zip(*own, strict=True)
    ]
    told = document.table(("coefficient", *columns, "unit", "the same in all?", "p"), lines)
    return [*_picture(rig, rows, levels, by), told]


def _picture(
    rig: str, rows: Sequence[Measured], levels: Sequence[Level], by: By
) -> list[document.Block]:  # fmt: skip
    """The coefficients that were fitted against record, level or day; none where there is no such order."""
    from study.compare.campaign_picture import coefficients_picture

    days = [day for record in rows if (day := day_of(record.name)) is not None]
    in_levels = by == "level" and not any(math.isnan(record.level) for record in rows)
    if not levels:
        return []
    if by == "date" and len(days) == len(rows):
        png = coefficients_picture(rig, levels, days, "date")
    elif in_levels:
        png = coefficients_picture(rig, levels, [r.level for r in rows], f"rms of the response ({rows[0].unit})")
    else:
        png = coefficients_picture(rig, levels, [record.name for record in rows], "record")
    return [document.Image(f"coefficients of {rig} by {by}", f"{rig}.png", png)]


def _value(found: Coefficient) -> str:
    return f"{found.value:.5g} (given)" if found.error is None else f"{found.value:.5g} ± {1.96 * found.error:.2g}"


def _judged(level: Level | None) -> tuple[str, str]:
    if level is None:
        return "", ""
    return "no" if level.moves else "yes", level.chance.removeprefix("= ")
