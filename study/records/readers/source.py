"""Where the bytes of a record come from: a regular file, or a pipe that ends, which is read once."""

import errno
import os
import select
import stat
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from study.support.errors import StudyError, expect
from study.support.files import reason

EXPECTED = "expected CSV, MATLAB, HDF5, UFF or Parquet"
CHUNK = 1 << 20  # bytes
LARGEST_PIPE = 1 << 32  # bytes: what never ends must not fill the disk


@contextmanager
def readable(path: Path) -> Generator[Path, None, None]:
    """A file that may be read more than once: ``path`` itself, or within the block a copy of what a pipe gave.

    A sentence that a reader says of the copy names ``path``.

    Raises
    ------
    StudyError
        If there is no such file, or it is neither a regular file nor a pipe somebody writes to.
    """
    mode = _mode(path)
    if stat.S_ISREG(mode):
        yield path
        return
    kind = "a folder" if stat.S_ISDIR(mode) else "neither a regular file nor a pipe"
    expect(stat.S_ISFIFO(mode), f"{path}: this is {kind}; {EXPECTED}")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / f"pipe{path.suffix}"
        _copied(path, copy)
        try:
            yield copy
        except StudyError as error:
            raise StudyError(str(error).replace(str(copy), str(path))) from None


def _mode(path: Path) -> int:
    try:
        return path.stat().st_mode
    except FileNotFoundError:
        raise StudyError(f"{path}: there is no such file; {EXPECTED}") from None
    except (OSError, ValueError) as error:  # ValueError: a path with a null byte
        raise StudyError(f"{str(path)!r}: cannot be read ({reason(error)}); {EXPECTED}") from None


def _copied(pipe: Path, copy: Path) -> None:
    """Everything that a pipe gives, in a file."""
    total = 0
    try:
        descriptor = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)  # else a pipe that nobody writes to waits for ever
        with os.fdopen(descriptor, "rb", buffering=0) as source, copy.open("wb") as target:
            while data := _next(source.fileno()):
                total += target.write(data)
                expect(total <= LARGEST_PIPE, f"{pipe}: this pipe gave {total} bytes and no end; {EXPECTED}")
    except OSError as error:
        raise StudyError(f"{pipe}: cannot be read ({reason(error)}); {EXPECTED}") from None
    expect(total, f"{pipe}: nobody writes to this pipe, or nothing is left in it; {EXPECTED}")


def _next(descriptor: int) -> bytes:
    """What comes next, waiting for it while somebody has the pipe open to write; empty at its end."""
    while True:
        try:
            return os.read(descriptor, CHUNK)
        except OSError as error:
            if error.errno != errno.EAGAIN:
                raise
            select.select([descriptor], [], [])
