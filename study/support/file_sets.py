"""All files of a comparison at once: either every one is in its place, or none is."""

import os
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

from study.support.errors import StudyError, expect
from study.support.files import move, reason, written_beside


def check_folder(folder: Path) -> None:
    """See that a folder can be written to, or made, before any work is done; nothing is made yet."""
    expect("\0" not in str(folder), f"{str(folder)!r}: no folder has such a name; expected another --out")
    there = next((p for p in (folder, *folder.absolute().parents) if p.exists()), Path("/"))
    why = "it is write-protected" if there.is_dir() else "it is no folder"
    usable = there.is_dir() and os.access(there, os.W_OK | os.X_OK)
    expect(usable, f"{folder}: cannot be written to ({there}: {why}); expected a writable folder")


def write_files(folder: Path, files: Mapping[str, bytes], inputs: Iterable[Path] = ()) -> None:
    """Write files into a folder, which is made if need be.

    All are written beside their places first and moved there when the last is complete: on a full disk
    the old ones stay.

    Raises
    ------
    StudyError
        If they cannot be written, or one would take the place of one of the ``inputs``.
    """
    keep(inputs, (folder / name for name in files))
    with made(folder), staged({folder / name: content for name, content in files.items()}) as moves:
        for each in moves:
            each()


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
def staged(files: Mapping[Path, bytes]) -> Generator[list[Callable[[], None]], None, None]:
    """All files written beside their places; each call given moves one of them there. What was not moved goes."""
    with ExitStack() as stack:
        moves: list[Callable[[], None]] = []
        for path, content in files.items():
            beside = stack.enter_context(written_beside(path, content))
            moves.append(partial(move, beside, path))
        yield moves
