"""CSV, TSV and other tables of text: encoding, delimiter, decimal mark, header and units row are found.

How: among all pairs of delimiter and decimal mark, the one under which most lines of the file's head
fall into the same number of cells, most of them numbers. What stands above the first line of numbers is
the header; numbers are then read by a compiled parser (:mod:`study.records.number_table`), and where that meets
anything but a number, cell by cell.
"""

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice, zip_longest
from pathlib import Path

import numpy as np

from study.records.number_table import number_table
from study.records.readers.table import NO_VALUES, Column, Table, split_unit
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.units import is_unit
from study.support.yaml_text import excerpt

HEAD_BYTES = 200_000
BLANKS = r"\s+"
SPACE = " \t"  # what the compiled parser takes for blanks; Python knows more
DIALECTS = ((";", "."), (";", ","), ("\t", "."), ("\t", ","), (",", "."), (BLANKS, "."), (BLANKS, ","))
COMMENTS = ("#", "%", "!", "//")
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
EXPECTED_TABLE = "expected a table with one line for each sample"
NO_TEXT = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f]")  # control characters that no text file holds


Place = Callable[[int], str]


@dataclass(frozen=True)
class TextLayout:
    """How a text file is laid out."""

    delimiter: str  # between cells
    decimal: str  # within numbers
    first: int  # line of the first sample, counted from 0
    names: tuple[str, ...]
    units: tuple[str, ...]


def read(path: Path, data: bytes) -> Table:
    """Read the bytes of a text file, which must hold numbers, as many cells in each line."""
    data = _utf8(path, data.rstrip(b"\x1a"))  # some programs still end a text as CP/M did
    lines = data[:HEAD_BYTES].decode("utf-8", errors="replace").split("\n")
    if len(data) > HEAD_BYTES and len(lines) > 1:
        lines = lines[:-1]  # the last one is cut in two
    layout = _layout(path, lines[:200])
    return _table(path, data.split(b"\n", layout.first)[-1], layout)


def _utf8(path: Path, data: bytes) -> bytes:
    """The same text in UTF-8 without a byte order mark, lines ended alike."""
    for mark, encoding in ((b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"), (b"\xef\xbb\xbf", "utf-8-sig")):
        if data.startswith(mark):
            data = data.decode(encoding, errors="replace").encode("utf-8")
    expect(data and not data.isspace(), f"{path}: the file is empty; {EXPECTED_TABLE}")
    odd = NO_TEXT.search(data, 0, HEAD_BYTES)
    byte = odd.start() if odd is not None else data.find(b"\0")
    expect(byte < 0, f"{path}: this is no text (byte {byte} is {data[byte]:#04x}); {EXPECTED_TABLE}")
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
    full = [row for row in split.values() if any(_is_number(cell, decimal) for cell in row)]
    widths = Counter(len(row) for row in full)
    width = max(widths, key=lambda w: (widths[w], w), default=0)
    rows = [row for row in full if len(row) == width]
    numeric = tuple(c for c in range(width) if 2 * sum(_is_number(row[c], decimal) for row in rows) > len(rows))
    score = sum(len(numeric) > 0 and all(_is_number(r[c], decimal) or not r[c] for c in numeric) for r in rows)
    same = {k: row for k, row in split.items() if len(row) == width}
    others = {k: row for k, row in split.items() if len(row) != width}
    return _Reading(delimiter, decimal, same, others, width, numeric, score * (1 + (len(numeric) > 1)))


def _layout(path: Path, lines: Sequence[str]) -> TextLayout:
    best = max((_reading(lines, *dialect) for dialect in DIALECTS), key=lambda r: r.score)
    samples = [k for k in best.cells if best.is_sample(k)]
    expect(
        best.score and samples, f"{path}: no line with numbers is found among the first {len(lines)}; {EXPECTED_TABLE}"
    )
    above = [k for k in best.cells if k < samples[0]]
    words = [k for k in above if best.numbers(k) == 0 and any(best.cells[k])]
    units = best.cells[words.pop()] if len(words) > 1 and _is_units_row(best.cells[words[-1]]) else []
    heading = words[-1] if words else -1
    header = best.cells[heading] if words else _commented(lines[: samples[0]], best)
    first = min((k for k in above if k > heading and best.numbers(k)), default=samples[0])
    odd = next((k for k in best.others if heading < k < first and (words or best.is_numbers(k))), None)
    if odd is not None:  # a sample with a cell too many or too few must not be taken for a heading
        raise StudyError(f"{path}: line {odd + 1} has {len(best.others[odd])} cells; expected {best.width}")
    named = [split_unit(cell) for cell in header] or [(f"column {k + 1}", "") for k in range(best.width)]
    below = [cell.strip("[]() ") for cell in units] or [""] * best.width
    known = tuple(own or row for (_, own), row in zip(named, below, strict=True))  # a unit in the name comes first
    return TextLayout(best.delimiter, best.decimal, first, tuple(name for name, _ in named), known)


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


def _table(path: Path, body: bytes, layout: TextLayout) -> Table:
    """Cells as numbers at once, or where one holds text, cell by cell: a column with text is refused if asked for."""
    place, width = partial(_line, body, layout.first), len(layout.names)
    headings = list(zip(layout.names, layout.units, strict=True))
    comment = "%" if b"\n%" in body else "#"
    values = _numbers(body, layout, comment)
    if values is None:
        try:
            cells = list(zip_longest(*_rows(body, layout, comment), fillvalue=""))
        except (csv.Error, ValueError) as error:
            raise StudyError(f"{path}: {error}") from None
        found = len(cells)
    else:
        cells, found = [], values.shape[1]
    hidden = f"{path}: line {layout.first + 1} has {found} cells of numbers; expected {width}"
    expect(found == width, hidden)  # a comment behind the first sample can hide some of its cells
    if values is None:
        columns = [_checked(*heading, cells[k], layout.decimal, place) for k, heading in enumerate(headings)]
    else:
        columns = [Column(n, np.ascontiguousarray(values[:, k]), u) for k, (n, u) in enumerate(headings)]
    # A delimiter at the end of each line leaves an unnamed column without a number.
    kept = tuple(c for c in columns if c.name or c.fault or not bool(np.isnan(c.values).all()))
    return Table(kept, place=place)


def _numbers(body: bytes, layout: TextLayout, comment: str) -> Floats | None:
    """Cells as numbers, shape (lines, cells); None where one is none, or lines differ in their cells."""
    if not body.isascii() or (layout.decimal == "," and b"." in body):
        return None
    points = body.replace(b",", b".") if layout.decimal == "," else body
    try:
        return number_table(points, None if layout.delimiter == BLANKS else layout.delimiter, comment)
    except ValueError:
        return None


def _rows(body: bytes, layout: TextLayout, comment: str) -> Iterator[list[str]]:
    """Cells of each line that has some; a line with more of them than the first is refused (ValueError)."""
    first, width = 0, len(layout.names)
    blanks = " " if layout.delimiter == "\t" else SPACE
    for k, line in enumerate(body.decode("utf-8", errors="replace").split("\n"), start=layout.first + 1):
        text = line.partition(comment)[0].strip(blanks)
        if not text:
            continue
        if text.count('"') % 2:
            raise ValueError(f"line {k} has a quotation mark without another; expected two around a cell")
        in_blanks = layout.delimiter == BLANKS
        cells = [c.strip('"') for c in re.split(r"[ \t]+", text)] if in_blanks else _cells(text, layout.delimiter)
        first = first or len(cells)
        if len(cells) > first and first != width:  # the first line is the odd one
            raise ValueError(f"{_line(body, layout.first, 0)} has {first} cells of numbers; expected {width}")
        if len(cells) > first:
            raise ValueError(f"line {k} has {len(cells)} cells; expected {width} as in the lines above")
        yield cells


def _checked(name: str, unit: str, cells: Sequence[str], decimal: str, place: Place) -> Column:
    """Each cell on its own; a column with text says where it stands if it is asked for."""
    wrong = next((i for i, cell in enumerate(cells) if cell and not _is_number(cell, decimal)), None)
    if wrong is not None:
        fault = f"column {name!r} holds {excerpt(cells[wrong], 30)!r} in {place(wrong)}; expected a number"
        return Column(name, NO_VALUES, unit, fault=fault)
    numbers = (cell.replace(",", ".") if decimal == "," else cell for cell in cells)
    return Column(name, np.array([float(cell) if cell else np.nan for cell in numbers]), unit)


def _line(body: bytes, first: int, index: int) -> str:
    """In which line of the file a sample stands."""
    lines = enumerate(body.decode("utf-8", errors="replace").split("\n"))
    samples = (k for k, line in lines if line.strip() and not _is_comment(line))
    return f"line {next(islice(samples, index, None), index) + first + 1}"
