"""What the literature says of the records of the gallery: in words, and in numbers to hold beside those found."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from study.support.config_files import TableRow, Text, read_rows
from study.support.errors import expect


def _number(text: object) -> object:
    return float(text) if isinstance(text, str) else text


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
    value: Annotated[float, BeforeValidator(_number), Field(allow_inf_nan=False)]
    within: Text  # how near one may expect to come, and why


def literature(folder: Path) -> dict[str, Literature]:
    """The entries by name, in the order in which the page shows them.

    Raises
    ------
    StudyError
        At the first fault, naming file, row and value.
    """
    path = folder / "literature.tsv"
    rows = [row for _, row in read_rows(path, Literature)]
    names = [row.entry for row in rows]
    twice = next((name for name in names if names.count(name) > 1), None)
    expect(twice is None, f"{path}: the entry {twice!r} stands twice; expected each once")
    return {row.entry: row for row in rows}


def published(folder: Path) -> list[Published]:
    """Values that others give; raises as :func:`literature`."""
    return [row for _, row in read_rows(folder / "published.tsv", Published)]
