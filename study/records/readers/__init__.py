"""Measured records from files of every usual kind.

What a file is is told by its content first and its name second. Formats are imported when they are met.
"""

from pathlib import Path

from study.records.readers.assemble import record_from
from study.records.readers.options import ReadOptions, assignments, beside, read_options
from study.records.readers.swapped import suspect_swapped
from study.records.readers.table import Table
from study.records.record import Record
from study.support.errors import StudyError
from study.support.files import reason

__all__ = ["ReadOptions", "assignments", "read_options", "read_record", "suspect_swapped"]

MAGIC = 1024  # bytes; MATLAB 7.3 begins its HDF5 part behind 512 of its own
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
BINARY_SUFFIXES = {
    ".mat": "a MATLAB file", ".h5": "an HDF5 file", ".hdf5": "an HDF5 file", ".hdf": "an HDF5 file",
    ".parquet": "a Parquet file", ".pq": "a Parquet file", ".uff": "a universal file", ".unv": "a universal file",
    ".uf": "a universal file",
}  # fmt: skip
OTHERS = {
    b"PK\x03\x04": "a ZIP archive or spreadsheet", b"\x1f\x8b": "a gzip archive",
    b"\xd0\xcf\x11\xe0": "an old spreadsheet", b"\x93NUMPY": "a NumPy array", b"%PDF": "a PDF",
}  # fmt: skip
RIGHT = "CSV, MATLAB, HDF5, UFF or Parquet is right"


def read_record(path: Path, mapping: ReadOptions | None = None) -> Record:
    """Read a measured record.

    Parameters
    ----------
    path : Path
        CSV and other text tables, MATLAB to 7.3, HDF5, UFF (dataset 58), or Parquet.
    mapping : ReadOptions, optional
        What the user says about it. Comes before ``<stem>.record.yaml`` beside the file, and that
        before what the file says itself.

    Returns
    -------
    Record
        Force and at least one motion, as measured; ``completion.complete`` gives the others.

    Raises
    ------
    StudyError
        If it cannot be read, or is no evenly sampled record; one sentence names file, column, place
        and what would be right.
    """
    path = Path(path)
    data = _head(path)
    options = mapping or ReadOptions()
    if beside(path).is_file():
        options = options.over(read_options(beside(path)))
    record = record_from(path, _table(path, data, options), options)
    suspicion = None if options.accept_swapped else suspect_swapped(record)
    if suspicion is not None:
        raise StudyError(f"{path}: {suspicion}")
    return record


def _head(path: Path) -> bytes:
    """The first bytes of a file that is there and may be read."""
    try:
        if path.is_dir():
            raise StudyError(f"{path}: this is a folder; {RIGHT}")
        with path.open("rb") as stream:
            return stream.read(MAGIC)
    except FileNotFoundError:
        raise StudyError(f"{path}: there is no such file; {RIGHT}") from None
    except (OSError, ValueError) as error:  # ValueError: a path with a null byte
        raise StudyError(f"{str(path)!r}: cannot be read ({reason(error)}); {RIGHT}") from None


def _kind(path: Path, head: bytes) -> str:
    """``hdf5``, ``matlab``, ``parquet``, ``uff`` or ``text``.

    Raises
    ------
    StudyError
        If content and name do not go together.
    """
    suffix = path.suffix.lower()
    if not head:
        raise StudyError(f"{path}: the file is empty; {RIGHT}")
    if HDF5_SIGNATURE in (head[:8], head[512:520]):
        return "hdf5"
    if head.startswith(b"MATLAB 5.0") or (suffix == ".mat" and head[1:4] == b"\0\0\0"):
        return "matlab"  # format 4 has no name of its own, only small numbers
    if head.startswith(b"PAR1"):
        return "parquet"
    if head.split(b"\n", 1)[0].strip() == b"-1":
        return "uff"
    if suffix in BINARY_SUFFIXES:
        raise StudyError(f"{path}: this is not {BINARY_SUFFIXES[suffix]}, whatever its name says; {RIGHT}")
    for signature, what in OTHERS.items():
        if head.startswith(signature):
            raise StudyError(f"{path}: this is {what}; {RIGHT}")
    return "text"


def _table(path: Path, head: bytes, options: ReadOptions) -> Table:
    kind = _kind(path, head)
    if kind == "text":
        from study.records.readers import text

        return text.read(path, path.read_bytes())
    import warnings

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _binary(kind, path, options)
    except StudyError:
        raise
    except Exception as error:  # decoders fail in many ways on a damaged file, and all mean this
        why = (str(error).splitlines() or [""])[0][:80] or type(error).__name__
        raise StudyError(f"{path}: the {kind.upper()} file is damaged or cut short ({why}); {RIGHT}") from None


def _binary(kind: str, path: Path, options: ReadOptions) -> Table:
    if kind == "hdf5":
        from study.records.readers import hdf5

        return hdf5.read(path, options.group)
    if kind == "matlab":
        from study.records.readers import matlab

        return matlab.read(path, options.group)
    if kind == "parquet":
        from study.records.readers import parquet

        return parquet.read(path)
    from study.records.readers import uff

    return uff.read(path)
