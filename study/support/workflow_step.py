"""What steps of the workflow share beside their work: faults in one sentence, one run at a time, what they rest on."""

import ast
import fcntl
import sys
from collections.abc import Collection, Generator, Iterable
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TextIO

from study.support.errors import StudyError
from study.support.files import UNFINISHED
from study.support.terminal import harmless

BRANCHES = ("body", "orelse", "finalbody", "handlers", "cases")  # of a statement: no expression holds an import
KERNELS = "kernels.py"  # the module whose loops are in C, in the folder beside it


@contextmanager
def one_sentence() -> Generator[None, None, None]:
    """End the process with a sentence where a ``StudyError`` would end it with a traceback."""
    try:
        yield
    except StudyError as error:
        print("study:", harmless(" ".join(str(error).split())), file=sys.stderr)
        sys.exit(2)  # as the command line ends on input that cannot be used


def only_run(path: Path) -> TextIO:
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
        for path in folder.rglob(f"{UNFINISHED}*"):
            path.unlink(missing_ok=True)


def rests_on(script: Path, *, also: Iterable[str] = (), without: Collection[str] = ()) -> list[str]:
    """Sorted paths of the files of the package that a script imports, directly or through one another.

    Snakemake sees a change of a script by itself, of a module only when told. ``also`` names modules that are imported
    while the script runs, such as estimators; those in ``without`` are not followed: what the script imports along with
    what it needs, and does not use.
    """
    root, reached = script.parent.parent, set[Path]()
    waiting = [script, *(path for name in also for path in _files(name, root))]
    skipped = {path for name in without for path in _files(name, root)}
    while waiting:
        path = waiting.pop()
        if path not in reached and path not in skipped:
            reached.add(path)
            waiting += _imported(path, root)
    compiled = {source for path in reached for source in (path.parent / "c").glob("*") if path.name == KERNELS}
    return sorted(str(path) for path in (reached | compiled) - {script})


@cache
def _imported(path: Path, root: Path) -> tuple[Path, ...]:
    """Files of the package that a file imports itself, in functions too; not what is for the type checker alone."""
    try:
        waiting: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    except (OSError, SyntaxError) as error:
        raise StudyError(f"{path} cannot be read as Python: {error}") from None
    names = list[str]()
    while waiting:
        match node := waiting.pop():
            case ast.Import(names=found):
                names += [name.name for name in found]
            case ast.ImportFrom(module=str(module), names=found):
                names += [module, *(f"{module}.{name.name}" for name in found)]
            case ast.If(test=ast.Name(id="TYPE_CHECKING")):
                pass
            case _:
                waiting += [inner for branch in BRANCHES for inner in getattr(node, branch, ())]
    return tuple(dict.fromkeys(file for name in names for file in _files(name, root)))


@cache
def _files(name: str, root: Path) -> list[Path]:
    """The file of a module of the package, or of a package in it."""
    if not name.startswith("study."):
        return []
    stem = root.joinpath(*name.split("."))
    return [p for p in (stem.with_suffix(".py"), stem / "__init__.py") if p.is_file()]
