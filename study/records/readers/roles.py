"""Which column is force, which is motion, which is time: what the user says, or the usual names and units.

A guess is made only where one reading exists. ``u`` and ``y``, ``V1`` and ``V2`` mean different things to
different people and are never guessed.
"""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from study.records.moving_base import BASE
from study.records.readers.options import BESIDE, ReadOptions
from study.records.readers.table import Column, Table
from study.records.record import MOTIONS
from study.support.errors import StudyError, expect
from study.support.units import ROLES, parse_unit
from study.support.yaml_text import shown

NAMES: dict[str, tuple[str, ...]] = {
    "force": ("f", "force", "input", "fin", "forcein", "inputforce", "excitation", "load", "appliedforce"),
    "displacement": ("x", "d", "displacement", "disp", "displ", "position", "pos", "deflection"),
    "velocity": ("v", "velocity", "vel", "speed"),
    "acceleration": ("a", "acceleration", "acc", "accel", "accelerometer"),
    "time": ("t", "time", "seconds"),
}


def assign(path: Path, table: Table, options: ReadOptions) -> dict[str, Column]:
    """Column of each channel, in the file's order; extra channels keep their names.

    What the user says in ``columns`` comes before any guess. If a column is missing, named twice or could be several
    things, the fault lists the columns.
    """
    named = {role: _named(path, table, role, wanted) for role, wanted in options.columns.items()}
    complete = "force" in named and any(m in named for m in MOTIONS)
    if not complete:
        _check_duplicates(path, table)
    rest = [c for c in table.columns if all(c is not n for n in named.values())]
    if not complete or "time" not in named:
        guesses = _guessed(path, table, rest, named)
        named |= {role: column for role, column in guesses.items() if role == "time" or not complete}
    motion = any(m in named for m in MOTIONS)
    base = any(c.name in BASE for c in table.columns) or any(role in BASE for role in named)
    unforced = options.free or not _unknown(table, named)
    if motion and "force" not in options.columns and (unforced or (base and "force" not in named)):
        named.pop("force", None)  # a free decay: the user says so, or there is no column that could be a force
    elif "force" not in named or not motion:
        missing = "displacement, velocity or acceleration" if "force" in named else "force"
        free = " (or say --free where no force acts)" if motion else ""
        raise _ask(path, table, f"no column is known to be the {missing}{free}")
    place = {id(c): k for k, c in enumerate(table.columns)}
    return dict(sorted((named | _extra(table, named)).items(), key=lambda item: place[id(item[1])]))


def _unknown(table: Table, named: Mapping[str, Column]) -> bool:
    """Whether a column that is no motion and no time may be a force."""
    return any(all(c is not n for r, n in named.items() if r != "force") for c in table.columns)


def _named(path: Path, table: Table, role: str, wanted: str | int) -> Column:
    """The column that the user names, by its name, the end of its path, or its number."""
    matches = [c for c in table.columns if c.name == wanted]
    if not matches and isinstance(wanted, str):
        ending = "/" + wanted.replace(".", "/")
        matches = [c for c in table.columns if ("/" + c.name).endswith(ending)]
    if not matches and re.fullmatch(r"[0-9]{1,9}", str(wanted)):
        matches = [c for k, c in enumerate(table.columns, start=1) if k == int(wanted)]
    if not matches:
        raise _ask(path, table, f"there is no column {shown(wanted)} for {role}")
    if len(matches) > 1:
        numbers = " and ".join(str(k) for k, c in enumerate(table.columns, start=1) if any(c is m for m in matches))
        raise _ask(path, table, f"the column {wanted!r} for {role} is there {len(matches)} times, as {numbers}")
    return matches[0]


def _check_duplicates(path: Path, table: Table) -> None:
    for name, count in Counter(c.name for c in table.columns if c.name).items():
        numbers = [str(k) for k, c in enumerate(table.columns, start=1) if c.name == name]
        twice = f"the column {name!r} is there {count} times, as columns {' and '.join(numbers)}"
        expect(count == 1, f"{path}: {twice}; give columns by number, such as --column force={numbers[0]}")


def _guessed(path: Path, table: Table, columns: Sequence[Column], known: Collection[str]) -> dict[str, Column]:
    """Roles that names, and where these say nothing units, leave no doubt about."""
    possible: dict[str, list[Column]] = {}
    for role in (r for r in NAMES if r not in known):
        possible[role] = [c for c in columns if c.name == role] or [c for c in columns if _role_of(c) == role]
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
    """What a column is by what the file says, its name, or its unit; empty if these do not tell.

    A motion of the base is none of the response, whatever its unit.
    """
    if _last(column) in BASE:
        return ""
    return column.role or _suffixed(column)[0] or _plain_role(_last(column)) or _unit_role(column.unit)


def own_unit(column: Column, role: str) -> str:
    """The unit that a file gives for a column, behind its name (``disp_mm``) or in a row of its own."""
    suffixed, unit = _suffixed(column)
    return column.unit or (unit if suffixed == role else "")


def _suffixed(column: Column) -> tuple[str, str]:
    """Role and unit of a name such as ``disp_mm``, whose parts agree; else two empty words."""
    stem, _, unit = _last(column).rpartition("_")
    role = _plain_role(stem)
    return (role, unit) if role and unit.isalnum() and unit.isascii() and _unit_role(unit) == role else ("", "")


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


def _extra(table: Table, named: Mapping[str, Column]) -> dict[str, Column]:
    """Further channels of the same length, under their own names."""
    length, taken = len(next(iter(named.values())).values), [id(c) for c in named.values()]
    counts = Counter(c.name for c in table.columns)
    usable = [c for c in table.columns if not c.fault and len(c.values) == length and id(c) not in taken]
    return {c.name: c for c in usable if c.name and counts[c.name] == 1 and c.name not in (*named, *NAMES)}


def _ask(path: Path, table: Table, problem: str) -> StudyError:
    """The one sentence that shows the columns and the option to give."""
    if not table.columns:
        return StudyError(f"{path}: {problem}, since the file holds no column of numbers; expected force and motion")
    groups = sorted({c.name.rsplit("/", 1)[0] for c in table.columns if "/" in c.name})
    choose = f" and choose --group {groups[0]} or {groups[1]}" if len(groups) > 1 else ""
    return StudyError(
        f"{path}: {problem}; the columns are {table.listing()}: name them by --column force=NAME "
        f"--column displacement=NAME{choose}, or in {path.stem}{BESIDE}"
    )
