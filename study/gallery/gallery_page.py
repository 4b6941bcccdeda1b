"""The gallery of measured records: what is known of each, and what a climb left in its folder, read back.

It is one page for a browser, and blocks of the documentation: words, tables and pictures of an entry.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import BeforeValidator, Field

from study.compare import history
from study.diagnose import MISSING, NOTHING
from study.figures.labels import term_names
from study.support import document
from study.support.config_files import TableRow, Text, read_rows
from study.support.document import Block, Fold, Heading, Image, PageSection, Picture
from study.support.errors import StudyError, expect
from study.support.files import read_text
from study.support.numbers import percent

PICTURES: Mapping[str, str] = {  # of a climb's folder, and what they show
    "history.png": "every model of the climb and its held-out error",
    "climb/step_0/structure.png": "where a force is missing from the structure as given",
    "climb/step_0/candidates.png": "what could be missing from the model as given",
    "climb/step_0/constancy.png": "the test of a constant coefficient: a true effect has one",
    "climb/varying.png": "coefficients that vary, final model",
    "climb/decay.png": "frequency and damping ratio against amplitude, final model",
    "climb/loops.png": "loops of the force, final model",
    "climb/response.png": "final model and measurement",
    "climb/missing_force.png": "the force that the final model still lacks",
    "climb/force_error.png": "unexplained force by frequency, final model",
}
DOCUMENTED_PICTURES = (
    "climb/varying.png",
    "climb/decay.png",
    "climb/loops.png",
    "climb/step_0/structure.png",
    "climb/response.png",
    "climb/step_0/constancy.png",
)  # the first of these that there is stands in the documentation
Fields = dict[str, Any]


# ---- what is known, and what a climb found


class Literature(TableRow):
    """One row of ``config/literature.tsv``: an entry of the gallery."""

    entry: Text
    title: Text
    test: Text  # what was done to the structure
    source: Text  # whose record it is
    known: Text  # of the structure, before anything is fitted here


class Published(TableRow):
    """One row of ``config/published.tsv``: a value that others give.

    ``key`` names a coefficient as histories do, a quotient of two with a stroke between, of a free decay ``frequency``
    or ``damping`` with ``.loudest``, ``.largest`` or ``.quiet``, or of a mass whose stiffness varies ``frequency.at``
    and what it varies with.
    """

    record: Text
    step: Literal["given", "reached"]  # the model as it is given, or as the climb leaves it
    key: Text
    quantity: Text
    unit: str
    value: Annotated[
        float, BeforeValidator(lambda cell: float(cell) if isinstance(cell, str) else cell), Field(allow_inf_nan=False)
    ]
    within: Text  # how near one may expect to come, and why


def literature(folder: Path) -> dict[str, Literature]:
    """The entries by name, in the order in which the page shows them; a ``StudyError`` names the first fault."""
    path = folder / "literature.tsv"
    rows = [row for _, row in read_rows(path, Literature)]
    names = [row.entry for row in rows]
    twice = next((name for name in names if names.count(name) > 1), None)
    expect(twice is None, f"{path}: the entry {twice!r} stands twice; expected each once")
    return {row.entry: row for row in rows}


def published(folder: Path) -> list[Published]:
    """Values that others give."""
    return [row for _, row in read_rows(folder / "published.tsv", Published)]


@dataclass(frozen=True)
class RecordFindings:
    """What was found of one row of ``config/measurements.tsv``."""

    record: str
    steps: tuple[Fields, ...]  # of the history
    first: Fields  # the diagnosis of the model as given
    last: Fields  # of the model reached
    reached: Fields  # the comparison of that
    folder: Path

    @property
    def equation(self) -> str:
        """Of the model reached; empty for a structure, whose terms have places."""
        return str(self.reached.get("model", {}).get("equation", ""))


@dataclass(frozen=True)
class Beside:
    """A published value with the one found."""

    published: Published
    found: float | None  # None where the model has no such coefficient
    interval: tuple[float, float] | None  # 95 %


def read_findings(folder: Path, record: str) -> RecordFindings:
    """What the climb of a record left in ``folder``; a ``StudyError`` names a file that is not there or is no JSON."""
    steps = _json(folder / "history.json")["steps"]
    diagnoses = sorted((folder / "climb").glob("step_*/diagnosis.json"), key=lambda p: int(p.parent.name[5:]))
    if not diagnoses:
        raise StudyError(f"{folder}/climb holds no diagnosis; expected what 'snakemake {record}_climb' leaves there")
    reached = _json(folder / "climb" / "comparison.json")
    return RecordFindings(record, tuple(steps), _json(diagnoses[0]), _json(diagnoses[-1]), reached, folder)


def _json(path: Path) -> Fields:
    try:
        return cast(Fields, json.loads(read_text(path, "JSON")))
    except json.JSONDecodeError as error:
        raise StudyError(f"{path}: line {error.lineno} is not JSON") from None


def found_beside(row: Published, found: RecordFindings) -> Beside:
    """The value found of what a row of published values names."""
    what, _, where = row.key.partition(".")
    if what in ("frequency", "damping") and where in ("loudest", "largest", "quiet"):
        return Beside(row, *_of_decay(found.reached.get("decay"), what, where))
    step = found.steps[0 if row.step == "given" else -1]
    values = {c["key"]: c for c in step["coefficients"]}
    if what == "frequency" and where.startswith("at "):
        return Beside(row, *_natural_frequency(found.reached, values["m"]["value"], float(where.removeprefix("at "))))
    over, _, under = row.key.partition("/")
    if over not in values or (under and under not in values):
        return Beside(row, None, None)
    if under:
        return Beside(row, values[over]["value"] / values[under]["value"], None)
    interval = values[over]["interval"]
    return Beside(row, values[over]["value"], None if interval is None else (interval[0], interval[1]))


def _of_decay(decay: Fields | None, what: str, where: str) -> tuple[float | None, tuple[float, float] | None]:
    """Of the loudest window, the largest of all that stand out of their errors, or the mean of the quietest quarter."""
    if not decay:
        return None, None
    values, errors = decay["measured"][what], decay["measured"][f"{what}_error"]
    if where == "loudest":
        i = 0
    elif where == "largest":  # not where it is known worst, but where it is largest for certain
        i = max(range(len(values)), key=lambda j: values[j] - 1.96 * errors[j])
    else:
        quiet = range(len(values) - max(len(values) // 4, 2), len(values))
        mean = sum(values[j] for j in quiet) / len(quiet)
        error = (sum((values[j] - mean) ** 2 for j in quiet) / (len(quiet) * (len(quiet) - 1))) ** 0.5
        return mean, (mean - 1.96 * error, mean + 1.96 * error)
    return values[i], (values[i] - 1.96 * errors[i], values[i] + 1.96 * errors[i])


def _natural_frequency(reached: Fields, mass: float, at: float) -> tuple[float | None, tuple[float, float] | None]:
    """Of a mass on a stiffness that varies, where that with which it does has a value; in hertz."""
    stiffness = next((one for one in reached.get("varying", ()) if one["coefficient"] == "k"), None)
    if stiffness is None:
        return None, None
    along, values, errors = (np.array(stiffness[name], dtype=np.float64) for name in ("at", "value", "error"))
    value, error = float(np.interp(at, along, values)), float(np.interp(at, along, errors))
    low, found, high = (
        math.sqrt(max(value + side * 1.96 * error, 0.0) / mass) / (2.0 * math.pi) for side in (-1, 0, 1)
    )
    return found, (low, high)


@dataclass(frozen=True)
class Entry:
    """One entry of the gallery."""

    known: Literature
    found: tuple[RecordFindings, ...]  # a record each
    values: tuple[Beside, ...]


def entries(config: Path, results: Path, records: Mapping[str, Sequence[str]]) -> list[Entry]:
    """The entries of the gallery in the order of the literature, with the names of their records."""
    values = published(config)
    made: list[Entry] = []
    for name, known in literature(config).items():
        found = tuple(read_findings(results / record, record) for record in records.get(name, []))
        own = tuple(found_beside(row, one) for one in found for row in values if row.record == one.record)
        if found:
            made.append(Entry(known, found, own))
    return made


# ---- an entry in words and tables


def told(entry: Entry) -> list[Block]:
    """What stands in the literature, what each of the records shows, and published values beside those found."""
    blocks = of_literature(entry)
    for one in entry.found:
        blocks += of_record(one, named=len(entry.found) > 1)
    return blocks + published_and_found(entry)


def of_literature(entry: Entry) -> list[Block]:
    """What was done to the structure, and what is known of it."""
    known = entry.known
    return [document.Text(f"{known.test}. {known.source}"), document.Text(f"Known: {known.known}")]


def published_and_found(entry: Entry) -> list[Block]:
    """Published values beside those found, if there are any."""
    if not entry.values:
        return []
    reasons = "; ".join(f"({letter}) {within}" for within, letter in _letters(entry.values).items())
    return [beside_each_other(entry.values), document.Text(f"To be expected: {reasons}.")]


def of_record(found: RecordFindings, named: bool) -> list[Block]:
    """The ladder of one record: from the model as given to the one reached, and what is left of the response."""
    begins = ", ".join(term_names(name) for name in found.steps[0]["terms"])
    name = f"**`{found.record}`.** " if named else ""
    return [
        document.Text(f"{name}The model is given as {begins}. **What is found.** {found.first['says']}"),
        climb_block(found),
        document.Text(f"**What is left.** {left(found)}"),
    ]


def climb_block(found: RecordFindings) -> Block:
    """Every model of the climb with its held-out error."""
    rows = [
        ("as given" if number == 0 else term_names(history.label(step)), percent(step["error"]["response"]),
         f"{step['rms']:.3g} {step['unit']}" if step["unit"] else "", percent(step["noise_floor"]["response"]))
        for number, step in enumerate(found.steps)
    ]  # fmt: skip
    return document.table(("model", "held-out error", "rms", "noise floor"), rows)


def left(found: RecordFindings) -> str:
    """What the model reached leaves, and whether that is noise."""
    last, step = found.last, found.steps[-1]
    size = f"{percent(step['error']['response'])} of the response"
    floor = percent(step["noise_floor"]["response"])
    if step["error"]["response"] >= 1.0:
        return f"{size} (noise floor {floor}): more than the response itself, so the model predicts none of it."
    if last["verdict"] == NOTHING:
        return (
            f"{size} (noise floor {floor}). It depends neither on the motion nor on its past: noise, as far as this "
            "record shows."
        )
    if last["verdict"] == MISSING:
        first = last["candidates"][0]
        tied = [_effect(t) for t in first.get("tied_with", ())]
        also = f", which the record cannot tell from {', '.join(tied)}," if tied else ""
        return (
            f"{size} (noise floor {floor}). The diagnosis still names {_effect(first)}{also} and with it "
            f"{percent(first['response_error'])} would be left; the climb ends here."
        )
    depends = percent(unnamed(found)) if last.get("left") else "much"
    return (
        f"{size} (noise floor {floor}). General functions of the motion explain a part of it, {depends} of the "
        "response; no single candidate does."
    )


def unnamed(found: RecordFindings) -> float:
    """What depends on the motion and has no name, over the response; never more than is left in all."""
    return min(float(found.last["left"]), float(found.steps[-1]["error"]["response"]))


def candidates(found: RecordFindings) -> Block:
    """The first candidates of the model as given."""
    rows = [
        (_effect(c), percent(c["explained"]), percent(c["response_error"]),
         _changes(c),
         ", ".join(_effect(t) for t in c["tied_with"][:3]))
        for c in found.first["candidates"][:5]
    ]  # fmt: skip
    return document.table(("candidate", "explains", "error with it", "its coefficient changes by", "tied with"), rows)


def _changes(candidate: Fields) -> str:
    changes: Mapping[str, float | None] = candidate.get("changes") or {}
    known = [value for value in changes.values() if value is not None]
    return percent(max(known)) if known else ""


def beside_each_other(values: Sequence[Beside]) -> Block:
    """Published values and those found; a letter names what ``published_and_found`` says may be expected."""
    letters = _letters(values)
    rows = [
        (f"`{v.published.record}`, {v.published.quantity}", _number(v.published.value, v.published.unit),
         "not in the model" if v.found is None else _number(v.found, v.published.unit),
         "" if v.interval is None else f"{v.interval[0]:.4g} to {v.interval[1]:.4g}",
         "" if v.found is None else f"{v.found / v.published.value - 1.0:+z.1%}".replace("%", " %"),
         f"({letters[v.published.within]})")
        for v in values
    ]  # fmt: skip
    return document.table(("", "published", "found", "95 % interval", "differs by", "expected"), rows)


def _letters(values: Sequence[Beside]) -> dict[str, str]:
    """What may be expected of published values, each with a letter."""
    reasons = dict.fromkeys(v.published.within for v in values)
    return {reason: chr(ord("a") + number) for number, reason in enumerate(reasons)}


def _number(value: float, unit: str) -> str:
    return f"{value:.4g} {unit}".strip()


def _effect(candidate: Fields | str) -> str:
    """An effect, in a structure with its place."""
    if isinstance(candidate, str):
        return term_names(candidate)
    place = " and ".join(candidate.get("between", ()))
    where = f" between {place}" if place else f" at {candidate['at']}" if "at" in candidate else ""
    return term_names(candidate["term"]) + where


# ---- pages


def gallery_page(shown: Sequence[Entry]) -> bytes:
    """Everything on one page, with thumbnails that open."""
    first = PageSection("all", "All of them", document.fragment([climb_overview(shown)]))
    return document.picture_page("Measured records", [first, *(_section(entry) for entry in shown)])


def climb_overview(shown: Sequence[Entry]) -> Block:
    """One line a record: where the climb begins, what it adds, and where it ends."""
    rows = [
        (f"`{f.record}`", percent(f.steps[0]["error"]["response"]), _added(f),
         percent(f.steps[-1]["error"]["response"]), percent(f.steps[-1]["noise_floor"]["response"]),
         percent(unnamed(f)) if f.last.get("left") and f.last["verdict"] not in (NOTHING, MISSING) else "",
         f.last["verdict"].replace("_", " "))
        for e in shown for f in e.found
    ]  # fmt: skip
    head = ("record", "error as given", "added", "error at the end", "noise floor", "depends on motion", "last verdict")
    return document.table(head, rows)


def _added(found: RecordFindings) -> str:
    names = [s["added"] for s in found.steps if s.get("added")]
    gone = {s["dropped"] for s in found.steps if s.get("dropped")}
    return ", ".join(term_names(n) + (" (taken out again)" if n in gone else "") for n in names) or "nothing"


def _section(entry: Entry) -> PageSection:
    folds = [Fold(f"{f.record}: the first candidates", (candidates(f),)) for f in entry.found]
    shown = "".join(
        (f"<h3>{f.record}</h3>" if len(entry.found) > 1 else "") + document.thumbnails(climb_pictures(f))
        for f in entry.found
    )
    return PageSection(entry.known.entry, entry.known.title, document.fragment([*told(entry), *folds]) + shown)


def climb_pictures(found: RecordFindings) -> list[Picture]:
    """Those that the climb made."""
    return [
        Picture(found.record, found.record, shows, (found.folder / name).read_bytes())
        for name, shows in PICTURES.items()
        if (found.folder / name).is_file()
    ]


def kept(found: RecordFindings) -> list[str]:
    """Names of the pictures that the documentation keeps of a record."""
    return [name for name in DOCUMENTED_PICTURES if (found.folder / name).is_file()][:1]


def picture_name(found: RecordFindings, name: str) -> str:
    """What such a picture is called in the documentation."""
    return f"{found.record}_{name.rpartition('/')[2]}"


def documented(shown: Sequence[Entry], folder: str) -> list[Block]:
    """The gallery for the documentation; ``folder`` holds its pictures."""
    parts: list[Block] = [climb_overview(shown)]
    for entry in shown:
        parts.append(Heading(entry.known.title))
        parts += [*of_literature(entry), *published_and_found(entry)]
        first = entry.found[0]
        parts += [Image(PICTURES[name], f"{folder}/{picture_name(first, name)}") for name in kept(first)]
    return parts
