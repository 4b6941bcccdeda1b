"""From columns to a record: roles, units, sampling interval, and every check a channel must pass."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from study.records.readers import checks, remarks
from study.records.readers.options import ReadOptions
from study.records.readers.roles import Roles, assign, own_unit
from study.records.readers.table import Column, Table
from study.records.record import MOTIONS, SI_UNITS, Record
from study.support.arrays import Floats
from study.support.errors import StudyError, at, expect
from study.support.numbers import LAST_DIGITS
from study.support.terminal import on_a_line
from study.support.units import is_unit, parse_unit, role_unit

T = TypeVar("T", str, float)


def record_from(path: Path, table: Table, options: ReadOptions, roles: Roles) -> Record:
    """The record that a table holds; its columns, units, times and values have to make one."""
    grouped = not options.group or any("/" in column.name for column in table.columns)
    expect(grouped, f"{path}: a group {options.group!r} is asked for and this file has none; leave it out")
    columns = assign(path, table, options, roles)
    for column in columns.values():
        expect(not column.fault, f"{path}: {column.fault}")
    lengths = {len(column.values) for column in columns.values()}
    each = ", ".join(f"{channel} ({column.name!r}) has {len(column.values)}" for channel, column in columns.items())
    expect(len(lengths) == 1, f"{path}: channels differ in length: {each} samples; expected the same number for all")
    given = _for_channels(path, "unit", options.units, columns, roles)
    scale = _for_channels(path, "scale", options.scale, columns, roles)
    expect("time" not in scale, f"{path}: a scale is given for time; expected a unit of it, such as --unit time=ms")
    _check_apart(path, columns, roles)
    units = _units(path, columns, given, roles, scale)
    length, (first, end) = lengths.pop(), options.samples or (0, None)
    last, asked = (length, f"from {first} on") if end is None else (end, f"{first} to {end}")
    within = f"the record has {length}; expected a range within, counted from 0"
    expect(first < length and last <= length, f"{path}: samples {asked} are asked for; {within}")
    few = f"{path}: {last - first} samples are too few; expected {checks.FEWEST_SAMPLES} or more"
    expect(last - first >= checks.FEWEST_SAMPLES, few)
    cut = table.from_sample(first)
    kept = {channel: replace(c, values=c.values[first:last]) for channel, c in columns.items()}
    kept = _usable(path, kept, cut, options, roles)
    dt, start = _sampling(path, kept, units, cut, options, first)
    channels = {channel: c.values * scale.get(channel, 1.0) for channel, c in kept.items() if channel != "time"}
    still = {force: np.zeros(last - first) for force in roles.forces if force not in channels}  # a free decay
    usual = {"time": "s"} | {channel: SI_UNITS[kind] for channel, kind in roles.kinds.items()}
    named = {channel: unit for channel, unit in units.items() if channel in channels}
    period = _period(path, columns, channels, options, roles)
    simulated = path.stem == "record"  # as all are called that the simulator writes, each in a folder of its own
    name = path.resolve().parent.name if simulated else path.stem
    name = f"{name}_{options.group.strip('/').replace('/', '_')}" if options.group else name
    # names of files have 255 bytes, and more is put to this one
    name = on_a_line(name)[:120]  # files are named after it, and pictures show it
    record = Record(
        dt, channels | still, usual | named, name, start, period, coordinates=roles.coordinates, forces=roles.forces
    )
    scaled = [
        f"{channel} is the column {columns[channel].name!r} times {factor:g}" for channel, factor in scale.items()
    ]
    return replace(record, remarks=(*scaled, *remarks.on_units(record, units), *remarks.on_samples(record)))


def _check_apart(path: Path, columns: Mapping[str, Column], roles: Roles) -> None:
    """Refuse one column in two places."""
    taken: dict[int, str] = {}
    for channel, column in columns.items():
        other = taken.setdefault(id(column), channel)
        expect(
            other == channel,
            f"{path}: column {column.name!r} is given as {other} and as {channel}; expected one of each",
        )
    for force in (f for f in roles.forces if f in columns):
        for motion in (c for c in columns if roles.kinds.get(c) in MOTIONS):
            same = np.array_equal(columns[force].values, columns[motion].values)
            expect(not same, f"{path}: {force} and {motion} hold the same numbers; expected two measured channels")


def _for_channels(
    path: Path, kind: str, given: Mapping[str, T], columns: Mapping[str, Column], roles: Roles
) -> dict[str, T]:  # fmt: skip
    """What the user gives, by channel; of a kind that of all such; a column's name will do."""
    found: dict[str, T] = {}
    for role, value in given.items():
        channel = roles.said(role) or role
        meant = [channel] if channel in (*columns, "time") else [c for c in columns if roles.kinds.get(c) == role]
        meant = meant or [c for c, column in columns.items() if column.name.rsplit("/", 1)[-1] == role]
        expect(meant, f"{path}: a {kind} is given for {role!r}; {', '.join(columns)} are the channels")
        found = dict.fromkeys(meant, value) | found if len(meant) > 1 else found | {meant[0]: value}
    return found


def _units(
    path: Path, columns: Mapping[str, Column], given: Mapping[str, str], roles: Roles, scale: Collection[str] = ()
) -> dict[str, str]:
    """Unit of each channel, as records write it; an extra channel's may be anything.

    That of a channel with a scale is what is given, whatever the file says.
    """
    units: dict[str, str] = {}
    for channel, column in columns.items():
        kind = roles.kinds.get(channel, "")
        own = own_unit(column, kind)
        text = given.get(channel) or own
        if (
            is_unit(text) and is_unit(own) and channel not in scale
        ):  # two that differ: one is a factor wrong, and nobody knows which
            one, other = parse_unit(text), parse_unit(own)
            expect(
                one.powers == other.powers and abs(one.factor / other.factor - 1.0) < LAST_DIGITS,
                f"{path}: column {column.name!r} is in {other.text} by the file and a unit of {one.text} is given; "
                "leave the unit out, or correct it in the file",
            )
        if text and kind:
            with at(f"{path}: column {column.name!r}"):
                units[channel] = role_unit(kind, text).text
        elif text:
            units[channel] = parse_unit(text).text if is_unit(text) else text
    motions = [channel for channel in columns if roles.kinds.get(channel) in MOTIONS]
    bare = next((channel for channel in motions if channel not in units), None)
    if bare is not None and not roles.alone and any(channel in units for channel in motions):
        names = ", ".join(f"{channel} in {units.get(channel, 'no unit')}" for channel in motions)
        like = f"--unit {bare.replace(' ', '.')}=UNIT"
        raise StudyError(f"{path}: {names}; expected a unit of every sensor, such as {like}, or of none, for SI units")
    return units


def _usable(
    path: Path, columns: Mapping[str, Column], table: Table, options: ReadOptions, roles: Roles
) -> dict[str, Column]:
    """The channels, each checked; an extra channel with gaps that nobody asked for is left out."""
    usable: dict[str, Column] = {}
    for channel, column in columns.items():
        kind = roles.kinds.get(channel, "")
        fault = checks.not_finite(column.values, table.place) or checks.beyond(column.values, table.place)
        if fault is not None and not kind and channel not in options.columns:
            continue
        resting = kind == "force" and not np.any(column.values)  # no force acts: a free decay
        if fault is None and kind in ("force", *MOTIONS) and not resting:
            fault = checks.constant(column.values)
            if fault is None and not options.accept_saturated:
                fault = checks.saturated(column.values)
        if fault is not None:
            meaning = "" if column.name == channel else f" ({channel})"
            raise StudyError(f"{path}: column {column.name!r}{meaning} {fault}")
        usable[channel] = column
    return usable


def _sampling(
    path: Path, columns: Mapping[str, Column], units: Mapping[str, str], table: Table, options: ReadOptions, first: int
) -> tuple[float, float]:
    """Interval and first time: what the user says, what the times say, what the file states."""
    stated = options.interval
    given = stated if stated is not None else table.dt
    usual = given is None or checks.SHORTEST <= given <= checks.LONGEST
    limits = f"{checks.SHORTEST:g} to {checks.LONGEST:g} s"
    expect(usual, f"{path}: the sampling interval is {given or 0.0:g} s; expected one of {limits}")
    if "time" in columns:
        time = columns["time"].values * parse_unit(units.get("time", "s")).factor
        if stated is None:
            return checks.even_interval(path, time, table.place)
        step = float(np.median(np.diff(time)))
        differ = (
            f"{path}: an interval of {stated:g} s is given (--fs or --dt), its times step by {step:g} s; leave the "
            "option out, or say with --unit time=UNIT what the times are in"
        )
        expect(abs(step / stated - 1.0) < checks.JITTER, differ)
        return stated, float(time[0])
    dt = stated if stated is not None else table.dt
    if dt is None:
        raise StudyError(
            f"{path}: it has no column of times and states no sampling rate; give --fs HERTZ, or a column of times "
            "by --column time=..."
        )
    return dt, table.start + dt * first


def _period(
    path: Path, columns: Mapping[str, Column], channels: Mapping[str, Floats], options: ReadOptions, roles: Roles
) -> int | None:  # fmt: skip
    length, period = len(next(iter(columns.values())).values), options.period
    forces = [force for force in roles.forces if force in columns]
    if period is None:
        return columns[forces[0]].period if forces else None
    given = f"{path}: a period of {period} samples is given"
    expect(period <= length, f"{given}, and the record has {length}; expected one that it holds")
    for force in forces:
        change, called = checks.change_after(channels[force], period), "force" if roles.alone else f"force {force!r}"
        differs = f"the {called} {period} samples later differs by {100.0 * change:.0f} % of its rms"
        # after a period a random force changes by 1.4 of its rms
        expect(change <= 0.7, f"{given}, and {differs}; expected the number of samples after which it repeats")
    return period
