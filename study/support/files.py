"""Files that a user names: read with bounds, replaced in one step, several of them all together or none.

What is written stands complete beside its place before it is moved there: a killed run, a full disk and an interrupt
leave what was there. A run that is killed while it moves files that belong together leaves a journal; who next reads
one of them puts back what was there before, so that nobody ever sees one file changed without the other.
"""

import base64
import errno
import fcntl
import hashlib
import json
import os
import secrets
import stat
import sys
from collections.abc import Generator, Iterable, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, cast

from study.support.errors import StudyError, expect

UNFINISHED = ".study-"  # begins the name of a file that is still being written
TEXT_BYTES = 1_000_000  # the longest sensible text file of a user has a few kilobytes
FREE_SPACE = "expected a writable folder with free space"


def read_text(path: Path, wanted: str) -> str:
    """The text of a file that may be anything; a message names what was ``wanted``."""
    try:
        mode = path.stat().st_mode
        kind = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
        expect(stat.S_ISREG(mode), f"{path}: this is {kind}; expected {wanted}")
        with path.open("rb") as stream:
            data = stream.read(TEXT_BYTES + 1)
    except FileNotFoundError:
        raise StudyError(f"{path}: there is no such file; expected {wanted}") from None
    except (OSError, ValueError) as error:  # ValueError: a path with a null byte
        raise StudyError(f"{path}: cannot be read ({reason(error)}); expected {wanted}") from None
    expect(len(data) <= TEXT_BYTES, f"{path}: the file has more than {TEXT_BYTES} bytes; expected {wanted}")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        byte = f"byte {error.start} is {data[error.start]:#04x}"
        raise StudyError(f"{path}: this is no UTF-8 text ({byte}); expected {wanted}") from None


@contextmanager
def replacing(path: Path) -> Generator[Path, None, None]:
    """A new file beside ``path`` to write to, which takes its place if the block ends well.

    Readers see the old content or the new one, and any failure leaves the old one. Permission bits are
    kept; a symbolic link stays one.
    """
    target = Path(os.path.realpath(path))
    beside = target.with_name(f"{UNFINISHED}{secrets.token_hex(8)}{target.suffix}")
    try:
        os.stat(f"{target.parent}/.")  # noqa: PTH116  (the dot asks whether it is a folder)
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, "a folder is in its place")
        if target.exists() and not os.access(target, os.W_OK):
            raise PermissionError(errno.EACCES, "it is write-protected")
        yield beside
        _flush(beside)
        if target.exists():
            beside.chmod(stat.S_IMODE(target.stat().st_mode))
        beside.replace(target)
    except OSError as error:
        raise _unwritten(path, error) from None
    finally:
        with suppress(OSError):
            beside.unlink(missing_ok=True)


def replace_file(path: Path, data: bytes) -> None:
    """Write a file in one step, as :func:`replacing` does."""
    with replacing(path) as beside:
        beside.write_bytes(data)


def write_files(folder: Path, files: Mapping[str, bytes], inputs: Iterable[Path] = ()) -> None:
    """Write files into a folder, which is made if need be; none takes the place of one of the ``inputs``."""
    keep(inputs, (folder / name for name in files))
    with made(folder), _moved_together({folder / name: content for name, content in files.items()}):
        pass


@contextmanager
def _moved_together(files: Mapping[Path, bytes]) -> Generator[None, None, None]:
    """All files complete beside their places, to which they are moved if the block ends well."""
    with ExitStack() as stack:
        for path, content in files.items():
            beside = stack.enter_context(replacing(path))
            try:
                beside.write_bytes(content)
                _flush(beside)
            except OSError as error:
                raise _unwritten(path, error) from None
        yield


def check_folder(folder: Path) -> None:
    """See that a folder can be written to, or made, before any work is done; nothing is made yet."""
    expect("\0" not in str(folder), f"{str(folder)!r}: no folder has such a name; expected another --out")
    there = next((p for p in (folder, *folder.absolute().parents) if p.exists()), Path("/"))
    why = "it is write-protected" if there.is_dir() else "it is no folder"
    usable = there.is_dir() and os.access(there, os.W_OK | os.X_OK)
    expect(usable, f"{folder}: cannot be written to ({there}: {why}); expected a writable folder")


@contextmanager
def made(folder: Path) -> Generator[None, None, None]:
    """A folder that is there within the block; if that fails, what was made of it is taken away again."""
    absent = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(f"{folder}: cannot be made ({reason(error)}); expected a writable folder") from None
    try:
        yield
    except BaseException:
        for path in absent:
            with suppress(OSError):  # somebody else may have written there
                path.rmdir()
        raise


def keep(inputs: Iterable[Path], outputs: Iterable[Path]) -> None:
    """Refuse to write over what is read, by whatever name."""
    kept = {os.path.realpath(path): path for path in inputs}
    for path in outputs:
        same = kept.get(os.path.realpath(path))
        expect(same is None, f"{path}: this would be written over the input {same}; expected another --out")


@contextmanager
def locked(path: Path) -> Generator[None, None, None]:
    """Nobody else changes this file within the block; who comes second waits.

    The lock is a file beside it, which goes when the block ends. That of a killed run is taken over.
    """
    target = Path(os.path.realpath(path))
    beside = target.with_name(f".{target.name}.lock")
    writable = not target.exists() or os.access(target, os.W_OK)
    expect(writable, f"{path}: cannot be changed (it is write-protected); expected a file that may be written to")
    try:
        descriptor = _held(beside, path)
    except OSError as error:
        raise StudyError(f"{path}: cannot be changed ({reason(error)} for {beside.name}); {FREE_SPACE}") from None
    try:
        _put_back(path)
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


def journal_of(path: Path) -> Path:
    """Where it stands what is to be undone of this file, and of others of its folder that change with it."""
    return path.parent / f".{path.name}.undo"


def replace_together(path: Path, files: Mapping[Path, bytes], others: Mapping[Path, bytes] | None = None) -> None:
    """Replace files of one folder in one step, or none; to be called with ``path``, the first of them, :func:`locked`.

    Parameters
    ----------
    path : Path
        The file that is locked.
    files : mapping of Path to bytes
        New contents, by path within the folder of ``path``.
    others : mapping of Path to bytes, optional
        Results that are written with them; they are not put back.
    """
    expect(all(file.parent == path.parent for file in files), f"{path}: its folder holds not all of {list(files)}")
    try:
        with _moved_together({**files, **(others or {})}):
            entries = {
                file.name: {
                    "was": base64.b64encode(file.read_bytes()).decode() if file.exists() else None,
                    "becomes": hashlib.sha256(content).hexdigest(),
                }
                for file, content in files.items()
            }
            replace_file(journal_of(path), json.dumps(entries).encode())
    except StudyError:
        _put_back(path)
        raise
    journal_of(path).unlink()


def recover(path: Path) -> None:
    """Put back what a killed run left half changed; where it cannot be put back, say so."""
    if os.path.exists(journal_of(path)):  # noqa: PTH110  (false also for a name that no file can have)
        with locked(path):  # whose first act it is
            pass


def _put_back(path: Path) -> None:
    """Undo what the journal of a file tells; what somebody has changed since stays."""
    journal = journal_of(path)
    if not journal.exists():
        return
    fault = f"{journal}: this is not what an interrupted run leaves for {path.name}; expected no such file, remove it"
    try:
        with journal.open("rb") as stream:
            entries = cast(dict[str, dict[str, Any]], json.loads(stream.read(10 * TEXT_BYTES)))
        found = {
            name: (None if e["was"] is None else base64.b64decode(e["was"], validate=True), str(e["becomes"]))
            for name, e in entries.items()
        }
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise StudyError(fault) from None
    expect(all(name == Path(name).name and name.endswith((path.name, ".history.json")) for name in found), fault)
    for name, (was, becomes) in found.items():
        file = path.with_name(name)
        if not file.is_file() or hashlib.sha256(file.read_bytes()).hexdigest() != becomes:
            continue
        if was is None:
            file.unlink()
        else:
            replace_file(file, was)
    journal.unlink()


def _flush(path: Path) -> None:
    with path.open("rb") as written:
        os.fsync(written.fileno())


def _unwritten(path: Path, error: OSError) -> StudyError:
    return StudyError(f"{path}: cannot be written ({reason(error)}) and is as it was; {FREE_SPACE}")


def reason(error: Exception) -> str:
    """What the operating system says went wrong."""
    return getattr(error, "strerror", None) or str(error) or type(error).__name__
