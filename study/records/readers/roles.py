"""Which column is force, which is motion, which is time: what the user says, or the usual names and units.

A guess is made only where one reading exists. ``u`` and ``y``, ``V1`` and ``V2`` mean different things to
different people and are never guessed.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from study.records.readers.options import BESIDE, ReadOptions
from study.records.readers.table import Column, Table
from study.records.record import MOTIONS
from study.support.errors import StudyError
from study.support.units import ROLES, parse_unit

NAMES: dict[str, tuple[str, ...]] = {
    "force": ("f", "force", "input", "fin", "forcein", "inputforce", "excitation", "load", "appliedforce"),
    "displacement": ("x", "d", "displacement", "disp", "displ", "position", "pos", "deflection"),
    "velocity": ("v", "velocity", "vel", "speed"),
    "acceleration": ("a", "acceleration", "acc", "accel", "accelerometer"),
    "time": ("t", "time", "seconds"),
}
SUFFIX = re.compile(r"(.+)_([A-Za-z0-9]+)")


def assign(path: Path, table: Table, options: ReadOptions) -> dict[str, Column]:
    """Column of each channel, in the file's order; extra channels keep their names.

    Parameters
    ----------
    path : Path
        For messages.
    table : Table
        What the file holds.
    options : ReadOptions
        What the user says; its ``columns`` come before any guess.

    Raises
    ------
    StudyError
        If a column is missing, named twice or could be several things; lists the columns.
    """
    named = {role: _find(path, table, role, wanted) for role, wanted in options.columns.items()}
    rest = [c for c in table.columns if all(c is not n for n in named.values())]
    if "force" not in named or not any(m in named for m in MOTIONS):
        _check_duplicates(path, table)
        named |= _guessed(path, table, rest, set(named))
    elif "time" not in named:
        named |= {role: c for role, c in _guessed(path, table, rest, set(named)).items() if role == "time"}
    missing = _missing(named)
    if missing:
        raise _ask(path, table, f"no column is known to be the {missing}")
    place = {id(c): k for k, c in enumerate(table.columns)}
    return dict(sorted((named | _extra(table, named)).items(), key=lambda item: place[id(item[1])]))


def _missing(named: Mapping[str, Column]) -> str:
    if "force" not in named:
        return "force"
    return "" if any(m in named for m in MOTIONS) else "displacement, velocity or acceleration"


def _find(path: Path, table: Table, role: str, wanted: str | int) -> Column:
    """The column that the user names, by its name, the end of its path, or its number."""
    found = [c for c in table.columns if c.name == wanted]
    if not found and isinstance(wanted, str):
        ending = "/" + wanted.replace(".", "/")
        found = [c for c in table.columns if ("/" + c.name).endswith(ending)]
    if not found and re.fullmatch(r"[0-9]{1,9}", str(wanted)):
        number = int(wanted)
        found = list(table.columns[number - 1 : number]) if number > 0 else []
    if not found:
        raise _ask(path, table, f"there is no column {wanted!r} for {role}")
    if len(found) > 1:
        numbers = " and ".join(str(k) for k, c in enumerate(table.columns, start=1) if any(c is f for f in found))
        raise _ask(path, table, f"the column {wanted!r} for {role} is there {len(found)} times, as {numbers}")
    return found[0]


def _check_duplicates(path: Path, table: Table) -> None:
    names = [c.name for c in table.columns]
    for name in names:
        if name and names.count(name) > 1:
            numbers = " and ".join(str(k) for k, n in enumerate(names, start=1) if n == name)
            raise StudyError(
                f"{path}: the column {name!r} is there {names.count(name)} times, as columns {numbers}; "
                f"give columns by number, such as --column force={names.index(name) + 1}"
            )


def _guessed(path: Path, table: Table, columns: Sequence[Column], known: set[str]) -> dict[str, Column]:
    """Roles that names, and where these say nothing units, leave no doubt about."""
    possible: dict[str, list[Column]] = {}
    for role in (r for r in NAMES if r not in known):
        exact = [c for c in columns if c.name == role]
        possible[role] = exact or [c for c in columns if _role_of(c) == role]
    motions = [role for role in MOTIONS if role in possible]
    if any(_spelt_out(c, role) for role in motions for c in possible[role]):
        for role in motions:  # beside a motion that is spelt out, a column called v or a may be anything
            possible[role] = [c for c in possible[role] if _spelt_out(c, role)]
    for role, candidates in possible.items():
        if len(candidates) > 1:
            names = " and ".join(repr(c.name) for c in candidates)
            raise _ask(path, table, f"{names} could each be the {role}")
    return {role: candidates[0] for role, candidates in possible.items() if candidates}


def _spelt_out(column: Column, role: str) -> bool:
    """Whether more than a single letter says what a column is."""
    return len(_last(column)) > 1 or _unit_role(column.unit) == role


def _role_of(column: Column) -> str:
    """What a column is by what the file says, its name, or its unit; empty if these do not tell."""
    if column.role:
        return column.role
    name = _last(column)
    suffixed = SUFFIX.fullmatch(name)
    if suffixed and _plain_role(suffixed[1]) and _unit_role(suffixed[2]) == _plain_role(suffixed[1]):
        return _plain_role(suffixed[1])
    return _plain_role(name) or _unit_role(column.unit)


def _last(column: Column) -> str:
    """A column's name without the folders of its path."""
    return column.name.rsplit("/", 1)[-1]


def _plain_role(name: str) -> str:
    plain = re.sub(r"[^a-z0-9]", "", name.lower())
    return next((role for role, names in NAMES.items() if plain in names), "")


def _unit_role(unit: str) -> str:
    try:
        powers = parse_unit(unit).powers
    except StudyError:
        return ""
    return next((role for role, (own, _) in ROLES.items() if own == powers), "")


def own_unit(column: Column, role: str) -> str:
    """The unit that a file gives for a column, behind its name (``disp_mm``) or in a row of its own."""
    suffixed = SUFFIX.fullmatch(_last(column))
    if not column.unit and suffixed and _unit_role(suffixed[2]) == role == _plain_role(suffixed[1]):
        return suffixed[2]
    return column.unit


def _extra(table: Table, named: Mapping[str, Column]) -> dict[str, Column]:
    """Further channels of the same length, under their own names."""
    length = len(named["force"].values)
    taken = [id(c) for c in named.values()]
    names = [c.name for c in table.columns]
    return {
        c.name: c
        for c in table.columns
        if c.name and id(c) not in taken and c.name not in (*named, *NAMES) and not c.fault
        and len(c.values) == length and names.count(c.name) == 1
    }  # fmt: skip


def _ask(path: Path, table: Table, problem: str) -> StudyError:
    """The one sentence that shows the columns and the option to give."""
    if not table.columns:
        return StudyError(f"{path}: {problem}, since the file holds no column of numbers; force and motion are right")
    groups = sorted({c.name.rsplit("/", 1)[0] for c in table.columns if "/" in c.name})
    choose = f" and choose --group {groups[0]} or {groups[1]}" if len(groups) > 1 else ""
    return StudyError(
        f"{path}: {problem}; the columns are {table.listing()}: name them by --column force=NAME "
        f"--column displacement=NAME{choose}, or in {path.stem}{BESIDE}"
    )
