"""Which modules a script rests on: Snakemake sees a change of a script by itself, of a module only when told."""

import ast
from collections.abc import Collection, Iterable, Iterator
from functools import cache
from pathlib import Path

from study.support.errors import StudyError

BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")
KERNELS = "kernels.py"  # the module whose loops are in C, in the folder beside it


def rests_on(script: Path, *, also: Iterable[str] = (), without: Collection[str] = ()) -> list[str]:
    """Sorted paths of the files of the package that a script imports, directly or through one another.

    ``also`` names modules that are imported while the script runs, such as estimators; those in ``without`` are not
    followed: what the script imports along with what it needs, and does not use.
    """
    root = script.parent.parent
    reached: set[Path] = set()
    waiting = [script, *(path for name in also for path in _files(name, root))]
    skipped = {path for name in without for path in _files(name, root)}
    while waiting:
        path = waiting.pop()
        if path not in reached and path not in skipped:
            reached.add(path)
            waiting += _next(path, root)
    compiled = {source for path in reached for source in (path.parent / "c").glob("*") if path.name == KERNELS}
    return sorted(str(path) for path in (reached | compiled) - {script})


@cache
def _next(path: Path, root: Path) -> tuple[Path, ...]:
    """Files of the package that a file imports itself."""
    return tuple(dict.fromkeys(other for name in _imported(path) for other in _files(name, root)))


def _imported(path: Path) -> tuple[str, ...]:
    """Names that a file imports, those inside functions included, those for the type checker alone not."""
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except (OSError, SyntaxError) as error:
        raise StudyError(f"{path} cannot be read as Python: {error}") from None
    return tuple(_names(tree))


def _statements(tree: ast.AST) -> Iterator[ast.AST]:
    """What stands in the blocks of a statement; no expression holds an import, and most of a file is expressions."""
    for block in BLOCKS:
        yield from getattr(tree, block, ())


def _names(tree: ast.AST) -> Iterator[str]:
    for node in _statements(tree):
        match node:
            case ast.Import(names=names):
                yield from (name.name for name in names)
            case ast.ImportFrom(module=str(module), names=names):
                yield module
                yield from (f"{module}.{name.name}" for name in names)
            case ast.If(test=ast.Name(id="TYPE_CHECKING")):
                pass
            case _:
                yield from _names(node)


@cache
def _files(name: str, root: Path) -> list[Path]:
    """The file of a module of the package, or of a package in it."""
    if not name.startswith("study."):
        return []
    stem = root.joinpath(*name.split("."))
    return [p for p in (stem.with_suffix(".py"), stem / "__init__.py") if p.is_file()]
