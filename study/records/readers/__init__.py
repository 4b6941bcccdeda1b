"""Measured records from files of every usual kind.

What a file is is told by its content first and its name second. Packages for a format are imported when it is met.
"""

import errno
import os
import select
import stat
import tempfile
import warnings
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from study.records.readers import binary
from study.records.readers.assemble import record_from
from study.records.readers.checks import suspect_swapped
from study.records.readers.options import ReadOptions, assignments, options_beside, read_options
from study.records.readers.roles import Roles
from study.records.readers.table import Table
from study.records.record import Record
from study.support.errors import StudyError, expect
from study.support.files import reason

__all__ = [
    "ReadOptions", "Roles", "assignments", "not_swapped", "read_options", "read_record", "read_table",
    "suspect_swapped",
]  # fmt: skip

SINGLE_MASS = Roles()
EXPECTED_FORMATS = "expected CSV, MATLAB, HDF5, UFF or Parquet"
LARGEST_PIPE = 1 << 32  # bytes: what never ends must not fill the disk
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
BINARY = {
    "hdf5": binary.read_hdf5, "matlab": binary.read_matlab, "parquet": binary.read_parquet, "uff": binary.read_uff,
}  # fmt: skip
SUFFIXES = {
    ".mat": "a MATLAB file", **dict.fromkeys((".h5", ".hdf5", ".hdf"), "an HDF5 file"),
    **dict.fromkeys((".parquet", ".pq"), "a Parquet file"),
    **dict.fromkeys((".uff", ".unv", ".uf"), "a universal file"),
}  # fmt: skip
OTHERS = {
    b"PK\x03\x04": "a ZIP archive or spreadsheet", b"\x1f\x8b": "a gzip archive",
    b"\xd0\xcf\x11\xe0": "an old spreadsheet", b"\x93NUMPY": "a NumPy array", b"%PDF": "a PDF",
}  # fmt: skip


def read_record(path: Path, mapping: ReadOptions | None = None, roles: Roles = SINGLE_MASS) -> Record:
    """Read a measured record: CSV and other text tables, MATLAB to 7.3, HDF5, UFF (dataset 58), or Parquet.

    Parameters
    ----------
    path : Path
        The data file.
    mapping : ReadOptions, optional
        What the user says about it. Comes before ``<stem>.record.yaml`` beside the file, and that
        before what the file says itself.
    roles : Roles
        Coordinates and forces of the model; those of a single mass if left out.

    Returns
    -------
    Record
        Forces and at least one motion, as measured; ``completion.complete`` gives the others.
    """
    path = Path(path)
    table, options = read_table(path, mapping)
    return not_swapped(path, record_from(path, table, options, roles), options)


def not_swapped(path: Path, record: Record, options: ReadOptions) -> Record:
    """The record; a ``StudyError`` if its force and response seem exchanged, which the user may accept."""
    one = len(record.coordinates) == len(record.forces) == 1  # of several nobody can say which moves as a mass does
    suspicion = suspect_swapped(record) if one and not (options.accept_swapped or record.unforced) else None
    expect(suspicion is None, f"{path}: {suspicion}")
    return record


def read_table(path: Path, mapping: ReadOptions | None = None) -> tuple[Table, ReadOptions]:
    """The columns of a file, and what the user says about it there and beside the file; raises as `read_record`."""
    options = mapping or ReadOptions()
    with readable(path) as source:
        try:
            with source.open("rb") as stream:
                head = stream.read(1024)  # MATLAB 7.3 begins its HDF5 part behind 512 bytes of its own
        except OSError as error:
            raise StudyError(f"{path}: cannot be read ({reason(error)}); {EXPECTED_FORMATS}") from None
        expect(head, f"{path}: the file is empty; {EXPECTED_FORMATS}")
        if options_beside(path).is_file():
            options = options.over(read_options(options_beside(path)))
        return _table(path, source, head, options), options


@contextmanager
def readable(path: Path) -> Generator[Path, None, None]:
    """A file that may be read more than once: ``path`` itself, or within the block a copy of what a pipe gave.

    A sentence that a reader says of the copy names ``path``.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        raise StudyError(f"{path}: there is no such file; {EXPECTED_FORMATS}") from None
    except (OSError, ValueError) as error:  # ValueError: a path with a null byte
        raise StudyError(f"{str(path)!r}: cannot be read ({reason(error)}); {EXPECTED_FORMATS}") from None
    if stat.S_ISREG(mode):
        yield path
        return
    kind = "a folder" if stat.S_ISDIR(mode) else "neither a regular file nor a pipe"
    expect(stat.S_ISFIFO(mode), f"{path}: this is {kind}; {EXPECTED_FORMATS}")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / f"pipe{path.suffix}"
        _copied(path, copy)
        try:
            yield copy
        except StudyError as error:
            raise StudyError(str(error).replace(str(copy), str(path))) from None


def _copied(pipe: Path, copy: Path) -> None:
    """Everything that a pipe gives, in a file."""
    total = 0
    try:
        descriptor = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)  # else a pipe that nobody writes to waits for ever
        with os.fdopen(descriptor, "rb", buffering=0) as source, copy.open("wb") as target:
            while data := _next(source.fileno()):
                total += target.write(data)
                expect(total <= LARGEST_PIPE, f"{pipe}: this pipe gave {total} bytes and no end; {EXPECTED_FORMATS}")
    except OSError as error:
        raise StudyError(f"{pipe}: cannot be read ({reason(error)}); {EXPECTED_FORMATS}") from None
    expect(total, f"{pipe}: nobody writes to this pipe, or nothing is left in it; {EXPECTED_FORMATS}")


def _next(descriptor: int) -> bytes:
    """What comes next, waiting for it while somebody has the pipe open to write; empty at its end."""
    while True:
        try:
            return os.read(descriptor, 1 << 20)
        except OSError as error:
            if error.errno != errno.EAGAIN:
                raise
            select.select([descriptor], [], [])


def _kind(path: Path, head: bytes) -> str:
    """A key of ``BINARY``, or ``text``; content and name have to go together."""
    suffix = path.suffix.lower()
    if HDF5_SIGNATURE in (head[:8], head[512:520]):
        return "hdf5"
    if head.startswith(b"MATLAB 5.0") or (suffix == ".mat" and head[1:4] == b"\0\0\0"):
        return "matlab"  # format 4 has no name of its own, only small numbers
    if head.startswith(b"PAR1"):
        return "parquet"
    if head.split(b"\n", 1)[0].strip() == b"-1":
        return "uff"
    if suffix in SUFFIXES:
        raise StudyError(f"{path}: this is not {SUFFIXES[suffix]}, whatever its name says; {EXPECTED_FORMATS}")
    for signature, content in OTHERS.items():
        expect(not head.startswith(signature), f"{path}: this is {content}; {EXPECTED_FORMATS}")
    return "text"


def _table(path: Path, source: Path, head: bytes, options: ReadOptions) -> Table:
    kind = _kind(path, head)
    try:
        if kind == "text":
            from study.records.readers import text

            return text.read(path, source.read_bytes())
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return BINARY[kind](source, options.group)
    except StudyError:
        raise
    except MemoryError as error:
        why = f"it holds more than there is memory for ({error or 'out of memory'})"
        raise StudyError(f"{path}: {why}; expected a record that fits, or a --group of it that does") from None
    except Exception as error:  # decoders fail in many ways on a damaged file, and all mean this
        if kind == "text":
            raise
        why = (str(error).splitlines() or [""])[0][:80] or type(error).__name__
        raise StudyError(
            f"{path}: the {kind.upper()} file is damaged or cut short ({why}); {EXPECTED_FORMATS}"
        ) from None
