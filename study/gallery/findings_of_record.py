"""What the literature says of a record of the gallery, and what a climb left in its folder, read back."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, cast

from pydantic import BeforeValidator, Field

from study.support.config_files import TableRow, Text, read_rows
from study.support.errors import StudyError, expect
from study.support.files import read_text

Fields = dict[str, Any]
QUIET = 4  # a quarter of the windows of a decay, the quietest, gives the values at small amplitudes


class Literature(TableRow):
    """One row of ``config/literature.tsv``: an entry of the gallery."""

    entry: Text
    title: Text
    test: Text  # what was done to the structure
    source: Text  # whose record it is
    known: Text  # of the structure, before anything is fitted here


class Published(TableRow):
    """One row of ``config/published.tsv``: a value that others give.

    ``key`` names a coefficient as histories do, a quotient of two with a stroke between, or of a free decay
    ``frequency`` or ``damping`` with ``.loudest``, ``.largest`` or ``.quiet``.
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
    over, _, under = row.key.partition("/")
    if over not in values or (under and under not in values):
        return Beside(row, None, None)
    if under:
        return Beside(row, values[over]["value"] / values[under]["value"], None)
    interval = values[over]["interval"]
    return Beside(row, values[over]["value"], None if interval is None else (interval[0], interval[1]))


def _of_decay(decay: Fields | None, what: str, where: str) -> tuple[float | None, tuple[float, float] | None]:
    """Of the loudest window, the largest of all that stand out of their errors, or the mean of the quietest."""
    if not decay:
        return None, None
    values, errors = decay["measured"][what], decay["measured"][f"{what}_error"]
    if where == "loudest":
        i = 0
    elif where == "largest":  # not where it is known worst, but where it is largest for certain
        i = max(range(len(values)), key=lambda j: values[j] - 1.96 * errors[j])
    else:
        quiet = range(len(values) - max(len(values) // QUIET, 2), len(values))
        mean = sum(values[j] for j in quiet) / len(quiet)
        error = (sum((values[j] - mean) ** 2 for j in quiet) / (len(quiet) * (len(quiet) - 1))) ** 0.5
        return mean, (mean - 1.96 * error, mean + 1.96 * error)
    return values[i], (values[i] - 1.96 * errors[i], values[i] + 1.96 * errors[i])
