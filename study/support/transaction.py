"""Files that change together or not at all: under a lock, and with what was there kept until the last is in place.

A killed run leaves its journal. Whoever next reads one of the files puts back what was there before, so that nobody
ever sees one file changed without the other.
"""

import base64
import fcntl
import hashlib
import json
import os
import sys
from collections.abc import Generator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, cast

from study.support.errors import StudyError, expect
from study.support.file_sets import staged
from study.support.files import reason, replace_file

EXPECTED = "expected a writable folder with free space"
LARGEST = 10_000_000  # bytes of a journal


def journal_of(path: Path) -> Path:
    """Where it stands what a transaction on this file, and on others of its folder, has to undo."""
    return path.parent / f".{path.name}.undo"


@contextmanager
def locked(path: Path) -> Generator[None, None, None]:
    """Nobody else changes this file within the block; who comes second waits.

    The lock is a file beside it, which goes when the block ends. That of a killed run is taken over.

    Raises
    ------
    StudyError
        If the folder cannot be written to.
    """
    target = Path(os.path.realpath(path))
    beside = target.with_name(f".{target.name}.lock")
    writable = not target.exists() or os.access(target, os.W_OK)
    expect(writable, f"{path}: cannot be changed (it is write-protected); expected a file that may be written to")
    try:
        descriptor = _held(beside, path)
    except OSError as error:
        raise StudyError(f"{path}: cannot be changed ({reason(error)} for {beside.name}); {EXPECTED}") from None
    try:
        _undone(path)
        yield
    finally:
        with suppress(OSError):
            beside.unlink()
        os.close(descriptor)


def _held(beside: Path, path: Path) -> int:
    """A descriptor that holds the lock on the file which stands there when it is held."""
    said = False
    while True:
        descriptor = os.open(beside, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if not said:
                print(f"study: another run is changing {path}; this one waits for its end", file=sys.stderr)
            said = True
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), beside.stat()):
                return descriptor
        os.close(descriptor)  # the one who had it has taken it away


def replace_together(path: Path, files: Mapping[Path, bytes], others: Mapping[Path, bytes] | None = None) -> None:
    """Replace files of one folder in one step; to be called with ``path``, the first of them, :func:`locked`.

    Parameters
    ----------
    path : Path
        The file that is locked.
    files : mapping of Path to bytes
        New contents, by path within the folder of ``path``.
    others : mapping of Path to bytes, optional
        Results that are written with them; they are not put back.

    Raises
    ------
    StudyError
        If any cannot be written; then all are as they were.
    """
    expect(all(file.parent == path.parent for file in files), f"{path}: its folder holds not all of {list(files)}")
    with staged({**(others or {}), **files}) as moves:
        journal = journal_of(path)
        replace_file(journal, _journal(files))
        try:
            for move in moves:
                move()
        except StudyError:
            _undone(path)
            raise
        journal.unlink()


def recover(path: Path) -> None:
    """Put back what a killed run left half changed; where it cannot be put back, say so.

    Raises
    ------
    StudyError
        If the folder is write-protected, or the journal is none of this module's.
    """
    if os.path.exists(journal_of(path)):  # noqa: PTH110  (false also for a name that no file can have)
        with locked(path):  # whose first act it is
            pass


def _journal(files: Mapping[Path, bytes]) -> bytes:
    entries = {
        file.name: {
            "was": base64.b64encode(file.read_bytes()).decode() if file.exists() else None,
            "becomes": hashlib.sha256(content).hexdigest(),
        }
        for file, content in files.items()
    }
    return json.dumps(entries).encode()


def _undone(path: Path) -> None:
    """Put back those files that are as the transaction wanted them; what somebody has changed since stays."""
    journal = journal_of(path)
    if not journal.exists():
        return
    for name, (was, becomes) in _read(journal, path).items():
        file = path.with_name(name)
        now = file.read_bytes() if file.is_file() else None
        if now is None or hashlib.sha256(now).hexdigest() != becomes:
            continue
        if was is None:
            file.unlink()
        else:
            replace_file(file, was)
    journal.unlink()


def _read(journal: Path, path: Path) -> dict[str, tuple[bytes | None, str]]:
    """What a journal says: by name in its folder, content before and checksum after."""
    fault = f"{journal}: this is not what an interrupted run leaves for {path.name}; expected no such file, remove it"
    try:
        with journal.open("rb") as stream:
            content: object = json.loads(stream.read(LARGEST))
        entries = cast(dict[str, dict[str, Any]], content)
        found = {
            name: (None if e["was"] is None else base64.b64decode(e["was"], validate=True), str(e["becomes"]))
            for name, e in entries.items()
        }
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise StudyError(fault) from None
    usual = all(name == Path(name).name and name.endswith((path.name, ".history.json")) for name in found)
    expect(usual, fault)
    return found
