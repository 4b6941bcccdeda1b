"""What every step of the workflow does beside its work: say faults in one sentence, and run alone."""

import fcntl
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from study.support.errors import StudyError
from study.support.files import BESIDE
from study.support.terminal import harmless

FAILED = 2  # as the command line ends on input that cannot be used


@contextmanager
def one_sentence() -> Generator[None, None, None]:
    """End the process with a sentence where a ``StudyError`` would end it with a traceback."""
    try:
        yield
    except StudyError as error:
        print("study:", harmless(" ".join(str(error).split())), file=sys.stderr)
        sys.exit(FAILED)


def alone(path: Path) -> TextIO:
    """A lock on a file, held until the process ends, in whatever way: nothing is left to be removed by hand."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = path.open("w", encoding="utf-8")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        raise StudyError(f"another run is at work in {Path.cwd()}; wait for its end, or stop it") from None
    return lock


def remove_half_written(*folders: Path) -> None:
    """Remove what killed runs left half written. Only who runs alone may do this."""
    for folder in folders:
        for path in folder.rglob(f"{BESIDE}*"):
            path.unlink(missing_ok=True)
