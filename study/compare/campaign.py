"""Many measured records on one page: the verdict of each, and every coefficient by record and level of response.

The numbers are those of each record's ``comparison.json`` and ``diagnosis.json``. Records of one rig are held against
each other: what is right has the same coefficients at all levels (the report's criterion, see ``across_levels``).
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from study.compare.fitted_coefficients import Coefficient, Level, across_levels
from study.equations.place import Kind, Place, place_in_words
from study.figures.labels import prefixed, term_names
from study.support import document
from study.support.numbers import percent

TITLE = "Measured records"
TINY = 1e-9  # a chance that is not written out
VERDICTS = {
    "missing_effect": "an effect is missing", "nothing_missing": "nothing is missing",
    "unknown_effect": "something unknown is missing",
}  # fmt: skip


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


def campaign_blocks(records: Iterable[Measured]) -> list[document.Block]:
    """The page: a table of verdicts, then the coefficients of each rig, its records in the order of their level."""
    rigs = _by_rig(records)
    every = [record for rig in rigs.values() for record in rig]
    counts = [(word, sum(r.diagnosis["verdict"] == key for r in every)) for key, word in VERDICTS.items()]
    said = "; ".join(f"{word} in {count}" for word, count in counts if count)
    heading = ("record", "level", "error", "noise floor", "verdict", "first effect", "explains", "error with it")
    page: list[document.Block] = [
        document.Heading(TITLE, 1),
        document.Text(
            f"{len(every)} records: {said}. Level: rms of the measured response. Error: of the free run on the part "
            "that was not fitted, over that rms. Each record is fitted by itself, values with 95 % intervals; a model "
            "that lacks nothing has the same coefficients at all levels. p: the chance of such differences if a "
            "coefficient is the same in all records; 'no' accounts for the number of coefficients."
        ),
        document.table(heading, [_verdict(record) for record in every]),
    ]
    for (rig, model, _), rows in rigs.items():
        page += [document.Heading(f"{rig}: coefficients of the model {model}, by level"), *_coefficients(rows)]
    return page


def _by_rig(records: Iterable[Measured]) -> dict[tuple[str, str, str], list[Measured]]:
    """Records of one rig, one model and one unit, by level."""
    found: dict[tuple[str, str, str], list[Measured]] = {}
    for record in records:
        found.setdefault((record.rig, str(record.comparison["model"]["name"]), record.unit), []).append(record)
    return {key: sorted(rows, key=lambda r: r.level) for key, rows in found.items()}


def _verdict(record: Measured) -> tuple[str, ...]:
    found = record.diagnosis
    verdict = str(found["verdict"])
    missing = verdict == "missing_effect"
    first: Mapping[str, Any] = found["candidates"][0] if found["candidates"] and missing else {}
    effects = " or ".join(map(_effect, (first, *first.get("tied_with", ())))) if first else ""
    return (
        record.name, record.shown_level, percent(record.comparison["error"]["response"]),
        percent(record.comparison["noise_floor"]["response"]), VERDICTS.get(verdict, verdict),
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


def _coefficients(rows: Sequence[Measured]) -> list[document.Block]:
    """Values with 95 % intervals, a column a record; of several records the chance of such differences."""
    own = [record.coefficients for record in rows]
    columns = [", ".join(filter(None, (record.name, record.shown_level))) for record in rows]
    if len(rows) == 1:
        return [document.table(("coefficient", *columns, "unit"), [(c.key, _value(c), c.unit) for c in own[0]])]
    judged = {level.key: level for level in across_levels([record.level for record in rows], own)}
    lines = [
        (key[0].key, *map(_value, key), key[0].unit, *_judged(judged.get(key[0].key))) for key in zip(*own, strict=True)
    ]
    return [document.table(("coefficient", *columns, "unit", "the same at all levels?", "p"), lines)]


def _value(found: Coefficient) -> str:
    return f"{found.value:.5g} (given)" if found.error is None else f"{found.value:.5g} ± {1.96 * found.error:.2g}"


def _judged(level: Level | None) -> tuple[str, str]:
    if level is None:
        return "", ""
    return "no" if level.moves else "yes", f"{level.p_value:.2g}" if level.p_value > TINY else f"< {TINY:g}"
