"""Files that a user names: read with bounds, replaced in one step."""

import errno
import os
import secrets
import stat
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from study.support.errors import StudyError, expect

BESIDE = ".study-"  # begins the name of a file that is still being written
LARGEST = 1_000_000  # bytes; the longest sensible text file of a user has a few kilobytes


def read_text(path: Path, wanted: str) -> str:
    """The text of a file that may be anything; a message names what was ``wanted``.

    Raises
    ------
    StudyError
        If it is missing, no regular file, unreadable, over 1 MB, or not UTF-8.
    """
    try:
        mode = path.stat().st_mode
        kind = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
        expect(stat.S_ISREG(mode), f"{path}: this is {kind}; expected {wanted}")
        with path.open("rb") as stream:
            data = stream.read(LARGEST + 1)
    except FileNotFoundError:
        raise StudyError(f"{path}: there is no such file; expected {wanted}") from None
    except (OSError, ValueError) as error:  # ValueError: a path with a null byte
        raise StudyError(f"{path}: cannot be read ({reason(error)}); expected {wanted}") from None
    expect(len(data) <= LARGEST, f"{path}: the file has more than {LARGEST} bytes; expected {wanted}")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        byte = f"byte {error.start} is {data[error.start]:#04x}"
        raise StudyError(f"{path}: this is no UTF-8 text ({byte}); expected {wanted}") from None


def replace_file(path: Path, data: bytes) -> None:
    """Write a file in one step, as :func:`replacing` does."""
    with replacing(path) as beside:
        beside.write_bytes(data)


@contextmanager
def replacing(path: Path) -> Generator[Path, None, None]:
    """A new file beside ``path`` to write to, which takes its place if the block ends well.

    Readers see the old content or the new one, and any failure leaves the old one. Permission bits are
    kept; a symbolic link stays one.

    Raises
    ------
    StudyError
        If it cannot be written (no permission, no space).
    """
    with _beside(path) as beside:
        try:
            yield beside
        except OSError as error:
            raise _unwritten(path, error) from None
        move(beside, path)


@contextmanager
def written_beside(path: Path, data: bytes) -> Generator[Path, None, None]:
    """A complete file that waits beside ``path`` for :func:`move`, and is gone behind the block if it was not moved."""
    with _beside(path) as beside:
        try:
            beside.write_bytes(data)
            _flushed(beside)
        except OSError as error:
            raise _unwritten(path, error) from None
        yield beside


@contextmanager
def _beside(path: Path) -> Generator[Path, None, None]:
    """A name for a file beside ``path``; nothing is left under it."""
    target = Path(os.path.realpath(path))
    beside = target.with_name(f"{BESIDE}{secrets.token_hex(8)}{target.suffix}")
    try:
        os.stat(f"{target.parent}/.")  # noqa: PTH116  (the dot asks whether it is a folder)
    except OSError as error:
        raise _unwritten(path, error) from None
    if target.exists() and not os.access(target, os.W_OK):
        raise _unwritten(path, PermissionError(errno.EACCES, "it is write-protected"))
    try:
        yield beside
    finally:
        with suppress(OSError):
            beside.unlink(missing_ok=True)


def move(beside: Path, path: Path) -> None:
    """Have a file beside ``path`` take its place; a ``StudyError`` if that cannot be."""
    target = Path(os.path.realpath(path))
    try:
        _flushed(beside)
        if target.exists():
            beside.chmod(stat.S_IMODE(target.stat().st_mode))
        beside.replace(target)
    except OSError as error:
        raise _unwritten(path, error) from None


def _flushed(path: Path) -> None:
    with path.open("rb") as written:
        os.fsync(written.fileno())


def _unwritten(path: Path, error: OSError) -> StudyError:
    why = f"cannot be written ({reason(error)}) and is as it was"
    return StudyError(f"{path}: {why}; expected a writable folder with free space")


def reason(error: Exception) -> str:
    """What the operating system says went wrong."""
    return getattr(error, "strerror", None) or str(error) or type(error).__name__
