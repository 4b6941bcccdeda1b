"""CSV, TSV and other tables of text: encoding, delimiter, decimal mark, header and units row are found.

How: among all pairs of delimiter and decimal mark, the one under which most lines of the file's head
fall into the same number of cells, most of them numbers. What stands above the first line of numbers is
the header; numbers are then read by the compiled parser of pandas.
"""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from study.records.readers.table import NONE, Column, Floats, Table, split_unit
from study.support.errors import StudyError
from study.support.units import is_unit

HEAD_BYTES = 200_000
HEAD_LINES = 200
BLANKS = r"\s+"
SPACE = " \t"  # what the compiled parser takes for blanks; Python knows more
DIALECTS = ((";", "."), (";", ","), ("\t", "."), ("\t", ","), (",", "."), (BLANKS, "."), (BLANKS, ","))
COMMENTS = ("#", "%", "!", "//")
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
RIGHT = "a table with one line for each sample is right"
NO_TEXT = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f]")  # control characters that no text file holds


@dataclass(frozen=True)
class Layout:
    """How a text file is laid out.

    Attributes
    ----------
    delimiter, decimal : str
        Between cells; within numbers.
    first : int
        Line of the first sample, counted from 0.
    names, units : tuple of str
        One each column.
    """

    delimiter: str
    decimal: str
    first: int
    names: tuple[str, ...]
    units: tuple[str, ...]


def read(path: Path, data: bytes) -> Table:
    """Read the bytes of a text file.

    Raises
    ------
    StudyError
        If they are no text, hold no numbers, or a line has more cells than the others.
    """
    data = _utf8(path, data.rstrip(b"\x1a"))  # some programs still end a text as CP/M did
    lines = data[:HEAD_BYTES].decode("utf-8", errors="replace").split("\n")
    if len(data) > HEAD_BYTES and len(lines) > 1:
        lines = lines[:-1]  # the last one is cut in two
    layout = _layout(path, lines[:HEAD_LINES])
    return _table(path, data.split(b"\n", layout.first)[-1], layout)


def _utf8(path: Path, data: bytes) -> bytes:
    """The same text in UTF-8 without a byte order mark, lines ended alike."""
    for mark, encoding in ((b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"), (b"\xef\xbb\xbf", "utf-8-sig")):
        if data.startswith(mark):
            data = data.decode(encoding, errors="replace").encode("utf-8")
    if not data or data.isspace():
        raise StudyError(f"{path}: the file is empty; {RIGHT}")
    odd = NO_TEXT.search(data, 0, HEAD_BYTES)
    byte = odd.start() if odd is not None else data.find(b"\0")
    if byte >= 0:
        raise StudyError(f"{path}: this is no text (byte {byte} is {data[byte]:#04x}); {RIGHT}")
    if not data.isascii():
        try:
            data.decode("utf-8")
        except UnicodeDecodeError:  # older programs write one byte a letter
            data = data.decode("cp1252", errors="replace").encode("utf-8")
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(COMMENTS)


def _cells(line: str, delimiter: str) -> list[str]:
    if delimiter == BLANKS:  # a unit in brackets belongs to the name before it
        return re.split(r"[ \t]+(?![\[(/])", line.strip(SPACE))
    rows = list(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    return [cell.strip(SPACE) for cell in rows[0]] if rows else []


def _is_number(cell: str, decimal: str) -> bool:
    if decimal == ",":
        if "." in cell or cell.endswith(","):
            return False
        cell = cell.replace(",", ".")
    return NUMBER.fullmatch(cell) is not None


@dataclass(frozen=True)
class _Reading:
    """The head of a file under one delimiter and decimal mark."""

    delimiter: str
    decimal: str
    cells: dict[int, list[str]]  # of the lines that have ``width`` cells, by line
    others: dict[int, list[str]]  # of the other lines
    width: int
    numeric: tuple[int, ...]  # columns that mostly hold numbers
    score: int

    def numbers(self, line: int) -> int:
        """How many cells of a line are numbers, of those that should be."""
        row = self.cells[line]
        return sum(_is_number(row[k], self.decimal) for k in self.numeric)

    def is_numbers(self, line: int) -> bool:
        """Whether a line of another width holds several numbers and nothing else."""
        row = self.others[line]
        return len(row) > 1 and all(_is_number(cell, self.decimal) for cell in row)

    def is_sample(self, line: int) -> bool:
        """Whether a line holds numbers, or gaps, wherever it should."""
        row = self.cells[line]
        return self.numbers(line) > 0 and all(not row[k] or _is_number(row[k], self.decimal) for k in self.numeric)


def _reading(lines: Sequence[str], delimiter: str, decimal: str) -> _Reading:
    try:
        split = {k: _cells(x, delimiter) for k, x in enumerate(lines) if x.strip() and not _is_comment(x)}
    except csv.Error:  # a field too large, a stray quote: not this delimiter
        split = {}
    full = {k: row for k, row in split.items() if any(_is_number(cell, decimal) for cell in row)}
    width = max(
        Counter(len(row) for row in full.values()).items(), key=lambda item: (item[1], item[0]), default=(0, 0)
    )[0]
    same = {k: row for k, row in split.items() if len(row) == width}
    rows = [row for row in full.values() if len(row) == width]
    numeric = tuple(c for c in range(width) if 2 * sum(_is_number(row[c], decimal) for row in rows) > len(rows))
    score = sum(len(numeric) > 0 and all(_is_number(r[c], decimal) or not r[c] for c in numeric) for r in rows)
    others = {k: row for k, row in split.items() if len(row) != width}
    return _Reading(delimiter, decimal, same, others, width, numeric, score * (1 + (len(numeric) > 1)))


def _layout(path: Path, lines: Sequence[str]) -> Layout:
    readings = [_reading(lines, *dialect) for dialect in DIALECTS]
    best = max(readings, key=lambda r: r.score)
    samples = [k for k in best.cells if best.is_sample(k)]
    if best.score == 0 or not samples:
        raise StudyError(f"{path}: no line with numbers is found among the first {len(lines)}; {RIGHT}")
    above = [k for k in best.cells if k < samples[0]]
    words = [k for k in above if best.numbers(k) == 0 and any(best.cells[k])]
    units: list[str] = []
    if len(words) > 1 and _is_units_row(best.cells[words[-1]]):
        units = best.cells[words[-1]]
        words = words[:-1]
    header = best.cells[words[-1]] if words else _commented(lines[: samples[0]], best)
    first = min((k for k in above if k > (words[-1] if words else -1) and best.numbers(k)), default=samples[0])
    odd = next((k for k in best.others if k < first and (k > words[-1] if words else best.is_numbers(k))), None)
    if odd is not None:  # a sample with a cell too many or too few must not be taken for a heading
        raise StudyError(f"{path}: line {odd + 1} has {len(best.others[odd])} cells; {best.width} are right")
    names, found = _headings(header, units, best.width)
    return Layout(best.delimiter, best.decimal, first, names, found)


def _headings(header: Sequence[str], units: Sequence[str], width: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Name and unit of each column; a unit in the name comes before one in a row of its own."""
    named = [split_unit(cell) for cell in header] or [(f"column {k + 1}", "") for k in range(width)]
    below = [cell.strip("[]() ") for cell in units] or [""] * width
    return tuple(n for n, _ in named), tuple(own or row for (_, own), row in zip(named, below, strict=True))


def _is_units_row(cells: Sequence[str]) -> bool:
    """Whether every cell is a unit, empty, a dash or in brackets, and at least one is a unit."""
    bare = [cell.strip("[]() ") for cell in cells]
    bracketed = [cell.startswith(("[", "(")) for cell in cells]
    known = [is_unit(cell) for cell in bare]
    return any(known) and all(k or b or cell in ("", "-") for k, b, cell in zip(known, bracketed, bare, strict=True))


def _commented(lines: Sequence[str], best: _Reading) -> list[str]:
    """A header behind a comment sign, as ``numpy.savetxt`` writes it; empty if there is none."""
    for line in reversed(lines):
        if _is_comment(line):
            cells = _cells(line.lstrip().lstrip("#%!/").strip(), best.delimiter)
            if len(cells) == best.width and not any(_is_number(cell, best.decimal) for cell in cells):
                return cells
    return []


def _table(path: Path, body: bytes, layout: Layout) -> Table:
    place = _Place(body, layout.first)
    try:
        frame = _parse(body, layout, "float64")
    except pd.errors.ParserError as error:
        raise StudyError(f"{path}: {_ragged(str(error), place, len(layout.names))}") from None
    except (ValueError, OverflowError):  # text in a cell: find which
        return _with_text(path, body, layout, place)
    _check_width(path, frame, layout)
    columns = [
        Column(name, frame[k].to_numpy(dtype=np.float64), unit)
        for k, (name, unit) in enumerate(zip(layout.names, layout.units, strict=True))
    ]
    return Table(_without_empty(columns), place=place)


def _parse(body: bytes, layout: Layout, dtype: str) -> pd.DataFrame:
    return pd.read_csv(
        BytesIO(body), sep=layout.delimiter, decimal=layout.decimal, header=None, index_col=False, dtype=dtype,
        comment="%" if b"\n%" in body else "#", skipinitialspace=True, engine="c",
        keep_default_na=False, na_values=[""],
    )  # fmt: skip


def _check_width(path: Path, frame: pd.DataFrame, layout: Layout) -> None:
    """A comment behind the first sample can hide some of its cells."""
    if frame.shape[1] != len(layout.names):
        told = f"line {layout.first + 1} has {frame.shape[1]} cells of numbers"
        raise StudyError(f"{path}: {told}; {len(layout.names)} are right")


def _with_text(path: Path, body: bytes, layout: Layout, place: "_Place") -> Table:
    """The slow road: each cell on its own; a column with text says where it stands if it is asked for."""
    try:
        frame = _parse(body, layout, "str")
    except (ValueError, pd.errors.ParserError) as error:
        raise StudyError(f"{path}: {_ragged(str(error), place, len(layout.names))}") from None
    _check_width(path, frame, layout)
    columns: list[Column] = []
    for k, (name, unit) in enumerate(zip(layout.names, layout.units, strict=True)):
        cells = [c.strip(SPACE) if isinstance(c, str) else "" for c in frame[k].tolist()]
        wrong = next((i for i, c in enumerate(cells) if c and not _is_number(c, layout.decimal)), None)
        if wrong is None:
            columns.append(Column(name, _floats(cells, layout.decimal), unit))
            continue
        shown = cells[wrong] if len(cells[wrong]) <= 30 else f"{cells[wrong][:27]}..."
        fault = f"column {name!r} holds {shown!r} in {place(wrong)}; a number is right"
        columns.append(Column(name, NONE, unit, fault=fault))
    return Table(tuple(columns), place=place)


def _floats(cells: Sequence[str], decimal: str) -> Floats:
    text = [c.replace(",", ".") if decimal == "," else c for c in cells]
    values: NDArray[np.float64] = np.array([float(c) if c else np.nan for c in text])
    return values


def _without_empty(columns: Sequence[Column]) -> tuple[Column, ...]:
    """All but unnamed columns without a number: what a delimiter at the end of each line leaves."""
    return tuple(c for c in columns if c.name or not bool(np.isnan(c.values).all()))


def _ragged(error: str, place: "_Place", width: int) -> str:
    found = re.search(r"Expected (\d+) fields in line (\d+), saw (\d+)", error)
    if found is None:
        return f"the table cannot be read; {RIGHT}"
    if int(found[1]) != width:  # the first line is the odd one
        return f"{place(0)} has {found[1]} cells of numbers; {width} are right"
    return f"line {int(found[2]) + place.first} has {found[3]} cells; {width} as in the lines above are right"


@dataclass(frozen=True)
class _Place:
    """In which line of the file a sample stands."""

    body: bytes
    first: int

    def __call__(self, index: int) -> str:
        samples = (
            k for k, line in enumerate(self.body.decode("utf-8", errors="replace").split("\n"))
            if line.strip() and not _is_comment(line)
        )  # fmt: skip
        return f"line {next((k for i, k in enumerate(samples) if i == index), index) + self.first + 1}"
