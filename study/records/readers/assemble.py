"""From columns to a record: roles, units, sampling interval, and every check a channel must pass."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.records.readers import checks
from study.records.readers.options import ReadOptions
from study.records.readers.roles import assign, own_unit
from study.records.readers.sampling import even_interval
from study.records.readers.table import Column, Table
from study.records.record import MOTIONS, SI_UNITS, Record
from study.support.errors import StudyError, at, expect
from study.support.terminal import harmless
from study.support.units import ROLES, is_unit, parse_unit, role_unit

Floats = NDArray[np.float64]
LONGEST_NAME = 120  # characters of a record's name: names of files have 255 bytes, and more is put to it
ROUNDING = 1e-9  # of a unit's factor
AGREE = 0.01  # share by which a given interval may differ from that of the times
AGAIN = 0.7  # of its rms: a force that changes by more after a period does not repeat (a random one changes by 1.4)


def record_from(path: Path, table: Table, options: ReadOptions) -> Record:
    """The record that a table holds; its columns, units, times and values have to make one."""
    grouped = not options.group or any("/" in column.name for column in table.columns)
    expect(grouped, f"{path}: a group {options.group!r} is asked for and this file has none; leave it out")
    roles = assign(path, table, options)
    for column in roles.values():
        expect(not column.fault, f"{path}: {column.fault}")
    _check_lengths(path, roles, options)
    _check_apart(path, roles)
    units = _units(path, roles, options)
    first, last = _range(path, len(next(iter(roles.values())).values), options)
    cut = table.from_sample(first)
    kept = _usable(path, {r: replace(c, values=c.values[first:last]) for r, c in roles.items()}, cut, options)
    dt, start = _sampling(path, kept, units, cut, options, first)
    channels = {role: c.values for role, c in kept.items() if role != "time"}
    named = {role: unit for role, unit in units.items() if role in channels}
    if "force" not in channels:  # a free decay
        channels["force"] = np.zeros(last - first)
    period = _period(path, roles, channels["force"], options)
    return Record(dt, channels, {**SI_UNITS, **named}, _name(path, options), start, period)


def _name(path: Path, options: ReadOptions) -> str:
    """The file's own name; the folder's for what the simulator writes, which is always ``record.csv``."""
    stem = path.resolve().parent.name if path.stem == "record" else path.stem
    name = f"{stem}_{options.group.strip('/').replace('/', '_')}" if options.group else stem
    return harmless(name)[:LONGEST_NAME]  # files are named after it, and pictures show it


def _check_apart(path: Path, roles: Mapping[str, Column]) -> None:
    """Refuse one column in two places."""
    taken: dict[int, str] = {}
    for role, column in roles.items():
        other = taken.setdefault(id(column), role)
        expect(other == role, f"{path}: column {column.name!r} is given as {other} and as {role}; expected one of each")
    for motion in (m for m in MOTIONS if m in roles and "force" in roles):
        same = np.array_equal(roles["force"].values, roles[motion].values)
        expect(not same, f"{path}: force and {motion} hold the same numbers; expected two measured channels")


def _check_lengths(path: Path, roles: Mapping[str, Column], options: ReadOptions) -> None:
    lengths = {len(column.values) for column in roles.values()}
    each = ", ".join(f"{role} ({column.name!r}) has {len(column.values)}" for role, column in roles.items())
    expect(len(lengths) == 1, f"{path}: channels differ in length: {each} samples; expected the same number for all")
    for role in options.units:
        known = role in (*roles, "time")
        expect(known, f"{path}: a unit is given for {role!r}; {', '.join(roles)} are the channels")


def _units(path: Path, roles: Mapping[str, Column], options: ReadOptions) -> dict[str, str]:
    """Unit of each channel, as records write it; an extra channel's may be anything."""
    units: dict[str, str] = {}
    for role, column in roles.items():
        text = options.units.get(role) or own_unit(column, role)
        _refuse_contradiction(path, column, role, options)
        if text and role in ROLES:
            with at(f"{path}: column {column.name!r}"):
                units[role] = role_unit(role, text).text
        elif text:
            units[role] = parse_unit(text).text if is_unit(text) else text
    return units


def _refuse_contradiction(path: Path, column: Column, role: str, options: ReadOptions) -> None:
    """Refuse a unit that is given where the file says another: one is a factor wrong, and nobody knows which."""
    given, own = options.units.get(role, ""), own_unit(column, role)
    if not (is_unit(given) and is_unit(own)):
        return
    one, other = parse_unit(given), parse_unit(own)
    same = one.powers == other.powers and abs(one.factor / other.factor - 1.0) < ROUNDING
    expect(
        same,
        f"{path}: column {column.name!r} is in {other.text} by the file and a unit of {one.text} is given; "
        "leave the unit out, or correct it in the file",
    )


def _range(path: Path, length: int, options: ReadOptions) -> tuple[int, int]:
    first, last = options.samples or (0, None)
    end = length if last is None else last
    asked = f"from {first} on" if last is None else f"{first} to {last}"
    inside = first < length and end <= length
    expect(
        inside,
        f"{path}: samples {asked} are asked for; the record has {length}; expected a range within, counted from 0",
    )
    few = f"{path}: {end - first} samples are too few; expected {checks.FEWEST_SAMPLES} or more"
    expect(end - first >= checks.FEWEST_SAMPLES, few)
    return first, end


def _usable(path: Path, roles: Mapping[str, Column], table: Table, options: ReadOptions) -> dict[str, Column]:
    """The channels, each checked; an extra channel with gaps that nobody asked for is left out."""
    usable: dict[str, Column] = {}
    for role, column in roles.items():
        fault = checks.not_finite(column.values, table.place) or checks.beyond(column.values, table.place)
        if fault is not None and role not in (*ROLES, *options.columns):
            continue
        resting = role == "force" and not np.any(column.values)  # no force acts: a free decay
        if fault is None and role in ("force", *MOTIONS) and not resting:
            fault = checks.constant(column.values)
            if fault is None and not options.accept_saturated:
                fault = checks.saturated(column.values)
        if fault is not None:
            meaning = "" if column.name == role else f" ({role})"
            raise StudyError(f"{path}: column {column.name!r}{meaning} {fault}")
        usable[role] = column
    return usable


def _sampling(
    path: Path, roles: Mapping[str, Column], units: Mapping[str, str], table: Table, options: ReadOptions, first: int
) -> tuple[float, float]:
    """Interval and first time: what the user says, what the times say, what the file states."""
    stated = options.interval
    given = stated if stated is not None else table.dt
    usual = given is None or checks.SHORTEST <= given <= checks.LONGEST
    limits = f"{checks.SHORTEST:g} to {checks.LONGEST:g} s"
    expect(usual, f"{path}: the sampling interval is {given or 0.0:g} s; expected one of {limits}")
    if "time" in roles:
        time = roles["time"].values * parse_unit(units.get("time", "s")).factor
        if stated is None:
            return even_interval(path, time, table.place)
        step = float(np.median(np.diff(time)))
        differ = (
            f"{path}: an interval of {stated:g} s is given (--fs or --dt), its times step by {step:g} s; leave the "
            "option out, or say with --unit time=UNIT what the times are in"
        )
        expect(abs(step / stated - 1.0) < AGREE, differ)
        return stated, float(time[0])
    dt = stated if stated is not None else table.dt
    if dt is None:
        raise StudyError(
            f"{path}: it has no column of times and states no sampling rate; give --fs HERTZ, or a column of times "
            "by --column time=..."
        )
    return dt, table.start + dt * first


def _period(path: Path, roles: Mapping[str, Column], force: Floats, options: ReadOptions) -> int | None:
    length, period = len(next(iter(roles.values())).values), options.period
    if period is None:
        return roles["force"].period if "force" in roles else None
    given = f"{path}: a period of {period} samples is given"
    expect(period <= length, f"{given}, and the record has {length}; expected one that it holds")
    change = checks.change_after(force, period)
    differs = f"the force {period} samples later differs by {100.0 * change:.0f} % of its rms"
    expect(change <= AGAIN, f"{given}, and {differs}; expected the number of samples after which it repeats")
    return period
