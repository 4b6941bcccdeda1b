"""Which column is force, which is motion, which is time: what the user says, or the usual names and units.

A guess is made only where one reading exists. ``u`` and ``y``, ``V1`` and ``V2`` mean different things to
different people and are never guessed. A motion of a named coordinate is called after both: ``floor1 acceleration``,
``floor1_acc``, ``floor1.a``, or ``floor1 [m/s^2]`` whose unit says what it is; a force has the name that the model
gives it. Where there is one coordinate, or one force, the usual names will do for it as they do for a single mass.
"""

import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from study.records.driven_by_motion import BASE
from study.records.readers.options import OPTIONS_SUFFIX, ReadOptions
from study.records.readers.table import Column, Table, groups_in
from study.records.record import ALONE, MOTIONS, Sensor
from study.support.errors import StudyError, expect
from study.support.units import ROLES, parse_unit
from study.support.yaml_text import shown

NAMES_OF_ROLES: dict[str, tuple[str, ...]] = {
    "force": ("f", "force", "input", "fin", "forcein", "inputforce", "excitation", "load", "appliedforce"),
    "displacement": ("x", "d", "displacement", "disp", "displ", "position", "pos", "deflection"),
    "velocity": ("v", "velocity", "vel", "speed"),
    "acceleration": ("a", "acceleration", "acc", "accel", "accelerometer"),
    "time": ("t", "time", "seconds"),
}


ROLE_SEPARATOR = re.compile(r"[ ._:/-]+")


@dataclass(frozen=True)
class Roles:
    """What the columns of a file may be, beside further channels: forces by name, and motions of coordinates."""

    coordinates: tuple[str, ...] = (ALONE,)
    forces: tuple[str, ...] = ("force",)

    @cached_property
    def kinds(self) -> dict[str, str]:
        """What each of these channels is by its name: ``time``, ``force`` or one of the motions."""
        motions = {str(Sensor(c, m)): m for c in self.coordinates for m in MOTIONS}
        return {**dict.fromkeys(self.forces, "force"), **motions, "time": "time"}

    @cached_property
    def plain(self) -> dict[str, str]:
        """The channel that a usual name such as ``force`` or ``displacement`` stands for: the only one of its kind."""
        kinds = list(self.kinds.values())
        return {kind: channel for channel, kind in self.kinds.items() if kinds.count(kind) == 1}

    @property
    def alone(self) -> bool:
        return self.coordinates == (ALONE,)

    def said(self, name: str, kind: str = "") -> str:
        """The channel that a name says, with what is said beside it: ``floor1.a`` is ``floor1 acceleration``.

        Empty if it says none of these. A coordinate alone is of the kind that is said beside it, or its displacement.
        """
        low = name.lower()
        if self.alone:
            return ""
        for channel in self.forces:
            if low == channel.lower():
                return channel
        for coordinate in self.coordinates:
            rest = low.removeprefix(coordinate.lower())
            motion = _plain_role(rest) if ROLE_SEPARATOR.match(rest) else "" if rest else kind
            if low != rest and (not rest or motion in MOTIONS):
                return str(Sensor(coordinate, motion if motion in MOTIONS else MOTIONS[0]))
        return self.plain.get(low, "")

    def motions(self, named: Collection[str]) -> list[str]:
        """The coordinates of which a motion is among some channels."""
        return [c for c in self.coordinates if any(str(Sensor(c, m)) in named for m in MOTIONS)]


def assign(path: Path, table: Table, options: ReadOptions, roles: Roles) -> dict[str, Column]:
    """Column of each channel, in the file's order; extra channels keep their names.

    What the user says in ``columns`` comes before any guess. If a column is missing, named twice or could be several
    things, the fault lists the columns.
    """
    named: dict[str, Column] = {}
    for role, wanted in options.columns.items():
        column = _named(path, table, role, wanted, roles)
        channel = roles.said(role, column.role or _unit_role(column.unit)) or role
        known = roles.alone or channel in roles.kinds or channel.isidentifier()
        some = f"a force, time, a motion such as {_motion_of(roles)}, or a name for a further channel"
        asked = f"{path}: --column, or 'columns' beside the file, names"
        expect(known, f"{asked} {role!r}, which the model does not have; expected {some}")
        expect(channel not in named, f"{asked} the {channel} twice; expected once")
        named[channel] = column
    given = set(named)
    complete = all(f in named for f in roles.forces) and roles.motions(named) == list(roles.coordinates)
    for name, count in Counter(c.name for c in table.columns if c.name and not complete).items():
        numbers = [str(k) for k, c in enumerate(table.columns, start=1) if c.name == name]
        twice = f"the column {name!r} is there {count} times, as columns {' and '.join(numbers)}"
        like = f"--column {(*roles.forces, _motion_of(roles))[0]}={numbers[0]}"
        expect(count == 1, f"{path}: {twice}; give columns by number, such as {like}")
    rest = [c for c in table.columns if all(c is not n for n in named.values())]
    if not complete or "time" not in named:
        guesses = _guessed(path, table, rest, named, roles)
        named |= {role: column for role, column in guesses.items() if role == "time" or not complete}
    motion = bool(roles.motions(named))
    base = roles.alone and any(name in BASE for name in (*named, *(c.name for c in table.columns)))
    lacking = [f for f in roles.forces if f not in named]
    told = [column for channel, column in named.items() if channel not in roles.forces]
    unforced = options.free or all(any(c is t for t in told) for c in table.columns)  # else a column may be a force
    if motion and not given.intersection(roles.forces) and (unforced or (base and lacking)):
        for force in roles.forces:  # a free decay: the user says so, or there is no column that could be a force
            named.pop(force, None)
    elif lacking or not motion:
        motions = (
            "the displacement, velocity or acceleration"
            if roles.alone
            else f"a motion of {', '.join(roles.coordinates)}"
        )
        missing = f"the force{'' if roles.alone else f' {lacking[0]!r}'}" if lacking else motions
        free = " (or say --free where no force acts)" if motion else ""
        raise _ask(path, table, roles, f"no column is known to be {missing}{free}")
    # Further channels are columns of the same length with names of their own.
    length, counts = len(next(iter(named.values())).values), Counter(c.name for c in table.columns)
    known, taken = {"", *named, *NAMES_OF_ROLES, *roles.kinds}, [id(c) for c in named.values()]
    usable = [c for c in table.columns if not c.fault and len(c.values) == length and id(c) not in taken]
    named |= {c.name: c for c in usable if counts[c.name] == 1 and c.name not in known}
    place = {id(c): k for k, c in enumerate(table.columns)}
    return dict(sorted(named.items(), key=lambda item: place[id(item[1])]))


def _named(path: Path, table: Table, role: str, wanted: str | int, roles: Roles) -> Column:
    """The column that the user names, by its name, the end of its path, or its number."""
    matches = [c for c in table.columns if c.name == wanted]
    if not matches and isinstance(wanted, str):
        ending = "/" + wanted.replace(".", "/")
        matches = [c for c in table.columns if ("/" + c.name).endswith(ending)]
    if not matches and re.fullmatch(r"[0-9]{1,9}", str(wanted)):
        matches = [c for k, c in enumerate(table.columns, start=1) if k == int(wanted)]
    if not matches:
        raise _ask(path, table, roles, f"there is no column {shown(wanted)} for {role}")
    if len(matches) > 1:
        numbers = " and ".join(str(k) for k, c in enumerate(table.columns, start=1) if any(c is m for m in matches))
        raise _ask(path, table, roles, f"the column {wanted!r} for {role} is there {len(matches)} times, as {numbers}")
    return matches[0]


def _guessed(
    path: Path, table: Table, columns: Sequence[Column], known: Collection[str], roles: Roles
) -> dict[str, Column]:
    """Channels that names, and where these say nothing units, leave no doubt about."""
    possible: dict[str, list[Column]] = {}
    said = {id(c): roles.said(_last(c), c.role or _unit_role(c.unit)) for c in columns}
    for channel in (channel for channel in roles.kinds if channel not in known):
        possible[channel] = [c for c in columns if c.name == channel] or [c for c in columns if said[id(c)] == channel]
    motions = [channel for kind, channel in roles.plain.items() if kind in MOTIONS and channel in possible]
    anew = not (roles.motions(known) or any(possible[channel] for channel in motions))
    for kind, channel in roles.plain.items():
        if channel in possible and not possible[channel] and (anew or kind not in MOTIONS or channel == kind):
            possible[channel] = [c for c in columns if _role_of(c) == kind]
    if any(_spelt_out(c, roles.kinds[channel]) for channel in motions for c in possible[channel]):
        for channel in motions:  # beside a motion that is spelt out, a column called v or a may be anything
            possible[channel] = [c for c in possible[channel] if _spelt_out(c, roles.kinds[channel])]
    for channel, candidates in possible.items():
        if len(candidates) > 1:
            names = " and ".join(repr(c.name) for c in candidates)
            raise _ask(path, table, roles, f"{names} could each be the {channel}")
    return {channel: candidates[0] for channel, candidates in possible.items() if candidates}


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
    return next((role for role, names in NAMES_OF_ROLES.items() if plain in names), "")


def _unit_role(unit: str) -> str:
    try:
        powers = parse_unit(unit).powers
    except StudyError:
        return ""
    return next((role for role, (own, _) in ROLES.items() if own == powers), "")


def _motion_of(roles: Roles) -> str:
    """A motion as the option ``--column`` has it: ``floor1.displacement``."""
    return f"{roles.coordinates[0]}.displacement".lstrip(".")


def _ask(path: Path, table: Table, roles: Roles, problem: str) -> StudyError:
    """The one sentence that shows the columns and the option to give."""
    if not table.columns:
        return StudyError(f"{path}: {problem}, since the file holds no column of numbers; expected force and motion")
    groups = groups_in(column.name for column in table.columns)
    choose = f" and choose --group {groups[0]} or {groups[1]}" if len(groups) > 1 else ""
    wanted = " ".join(f"--column {channel}=NAME" for channel in (*roles.forces[:1], _motion_of(roles)))
    of_places = [c.name for c in table.columns if roles.alone and c.name.lower().split()[1:] in ([m] for m in MOTIONS)]
    places = f"; {of_places[0]!r} is known to a model with coordinates: st.read(path, model=model)" if of_places else ""
    return StudyError(
        f"{path}: {problem}; the columns are {table.listing()}: name them by {wanted}{choose}, or in "
        f"{path.stem}{OPTIONS_SUFFIX}{places}"
    )
