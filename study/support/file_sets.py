"""All files of a comparison at once: either every one is in its place, or none is."""

import os
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

from study.support.errors import StudyError, expect
from study.support.files import reason, replacing


def check_folder(folder: Path) -> None:
    """See that a folder can be written to, or made, before any work is done; nothing is made yet."""
    expect("\0" not in str(folder), f"{str(folder)!r}: no folder has such a name; expected another --out")
    there = next((p for p in (folder, *folder.absolute().parents) if p.exists()), Path("/"))
    why = "it is write-protected" if there.is_dir() else "it is no folder"
    usable = there.is_dir() and os.access(there, os.W_OK | os.X_OK)
    expect(usable, f"{folder}: cannot be written to ({there}: {why}); expected a writable folder")


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder, which is made if need be.

    All are written beside their places first and moved there when the last is complete: on a full disk
    the old ones stay.

    Raises
    ------
    StudyError
        If they cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(f"{folder}: cannot be made ({reason(error)}); expected a writable folder") from None
    with ExitStack() as stack:
        for name, content in files.items():
            stack.enter_context(replacing(folder / name)).write_bytes(content)
