"""The house: imports run one way, no name stands for two things, and named numbers and second names become fewer."""

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

STUDY = Path(__file__).parents[1] / "study"
FLOORS = (
    "cli", "commands", "interface", "explore", "trials", "gallery", "reproduction", "diagnose", "way_in",
    "faults", "compare", "figures", "identify", "export", "equations", "records", "support",
)  # fmt: skip
FILES = sorted(STUDY.rglob("*.py"))
LOOSE = {"__init__", "__main__", "cli"}

# What a notebook calls a record is a record below too: the class of the interface wraps or extends the one it names.
WRAPPED = {"Diagnosis", "Model", "Record", "Term"}
# One call for many modules of a kind (readers, estimators), and what a notebook calls as the command line does.
SHARED_CALLS = {
    "compare": ("compare/", "interface/"),
    "identify": ("identify/estimators/", "interface/"),
    "read": ("records/readers/", "interface/"),
    "simulate": ("equations/", "interface/"),
}
# A panel of the page is called after what it draws.
PANELS = {"explore/plots.py"}


def imported(path: Path) -> set[str]:
    """First part below ``study`` of every module that a file imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        match node:
            case ast.Import(names=found):
                names |= {name.name for name in found}
            case ast.ImportFrom(module="study", names=found):
                names |= {f"study.{name.name}" for name in found if not name.name.startswith("__")}
            case ast.ImportFrom(module=str(module)):
                names.add(module)
    return {name.split(".")[1] for name in names if name.startswith("study.")}


@pytest.mark.parametrize("package", FLOORS[1:])
def test_imports_run_downward(package):
    below = FLOORS[FLOORS.index(package) :]
    upward = {
        f"{path.relative_to(STUDY)} imports study.{name}"
        for path in (STUDY / package).rglob("*.py")
        for name in imported(path)
        if name not in below
    }
    assert not upward


def test_every_module_lives_in_a_package_that_says_what_it_is():
    assert {path.stem for path in STUDY.glob("*.py")} == LOOSE
    packages = {path.parent for path in FILES} - {STUDY}
    assert {p.relative_to(STUDY).parts[0] for p in packages} == set(FLOORS[1:])
    for package in packages:
        words = ast.get_docstring(ast.parse((package / "__init__.py").read_text(encoding="utf-8")))
        assert words, f"{package} does not say what it is"


def test_no_file_name_stands_for_two_things():
    # A command's file is called as the command is, and calls what it is named after.
    names = Counter(path.stem for path in FILES if path.stem != "__init__" and path.parent.name != "commands")
    assert [name for name, count in names.items() if count > 1] == []


def top_level(path: Path, kind: type[ast.stmt] | tuple[type[ast.stmt], ...]) -> list[str]:
    """Public names of this kind that stand at the top of a module."""
    return [
        node.name
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, kind) and not node.name.startswith("_")
    ]


def homes(kind: type[ast.stmt] | tuple[type[ast.stmt], ...]) -> dict[str, set[str]]:
    """Modules that define each public name of a kind."""
    found: dict[str, set[str]] = {}
    for path in FILES:
        for name in top_level(path, kind):
            found.setdefault(name, set()).add(path.relative_to(STUDY).as_posix())
    return found


def test_no_class_name_stands_for_two_things():
    twice = {name: where for name, where in homes(ast.ClassDef).items() if len(where) > 1}
    assert {
        name for name, where in twice.items() if len(where) == 2 and any("interface/" in w for w in where)
    } == WRAPPED
    assert {name: where for name, where in twice.items() if name not in WRAPPED} == {}


def test_no_function_name_stands_for_two_things():
    twice: dict[str, set[str]] = {}
    for name, where in homes((ast.FunctionDef, ast.AsyncFunctionDef)).items():
        if len(where - PANELS) > 1:
            twice[name] = where - PANELS
    assert {name: where for name, where in twice.items() if name not in SHARED_CALLS} == {}
    for name, packages in SHARED_CALLS.items():
        assert len(twice[name]) > 1
        assert all(where.startswith(packages) for where in twice[name])


NUMBERS = 381  # module-level names of a number or of several: each is a debt, and the limit follows them down


def constants(path: Path) -> Iterator[tuple[str, ast.expr]]:
    """Names in upper case that stand at the top of a module, with what they are; no variables of types."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        match node:
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)):
                pairs = list(zip(names, values, strict=True))
            case ast.Assign(targets=targets, value=value):
                pairs = [(target, value) for target in targets]
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                pairs = [(target, value)]
            case _:
                continue
        for name, value in pairs:
            if isinstance(name, ast.Name) and name.id.isupper() and "TypeVar" not in ast.unparse(value):
                yield name.id, value


def is_number(tree: ast.expr) -> bool:
    """Whether an expression is a number, or a tuple of some."""
    match tree:
        case ast.Constant(value=value):
            return isinstance(value, int | float) and not isinstance(value, bool)
        case ast.UnaryOp(operand=inner):
            return is_number(inner)
        case ast.BinOp(left=left, right=right):
            return is_number(left) and is_number(right)
        case ast.Tuple(elts=items):
            return bool(items) and all(map(is_number, items))
        case _:
            return False


def test_no_constant_name_stands_for_two_things():
    where: dict[str, set[str]] = {}
    for path in FILES:
        for name, _ in constants(path):
            if (name, path.parent.name) not in (
                ("COMMAND", "commands"),
                ("CHAPTER", "chapters"),
            ):  # each module has one
                where.setdefault(name, set()).add(path.relative_to(STUDY).as_posix())
    twice = {name: sorted(homes) for name, homes in where.items() if len(homes) > 1}
    assert twice == {}, "a name of its own"


def test_named_numbers_become_fewer():
    numbers = [f"{path.relative_to(STUDY)}: {name}" for path in FILES for name, v in constants(path) if is_number(v)]
    assert len(numbers) <= NUMBERS, "a named number more; expected a statistic that makes it needless"
