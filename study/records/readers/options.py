"""What the user says about a file: which column is what, in which unit, how often it was sampled."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import cast

from study.support.errors import StudyError, at, expect
from study.support.files import read_text
from study.support.yaml_text import as_list, as_mapping, read_plain, shown

OPTIONS_SUFFIX = ".record.yaml"
OPTIONS_FILE = "a YAML file with 'columns', 'units', 'scale', 'fs' or 'dt', 'group', 'samples', 'period', 'measurement'"


@dataclass(frozen=True)
class ReadOptions:
    """How to read a file; everything that is left out is looked for in the file itself.

    Roles are force, displacement, velocity, acceleration and time; any other name makes an extra channel of that name.
    """

    # Role to column, a name or its number counted from 1: {"force": "V1", "displacement": 2}.
    columns: Mapping[str, str | int] = field(default_factory=dict[str, "str | int"])
    units: Mapping[str, str] = field(default_factory=dict[str, str])  # role to unit: {"force": "kN"}
    dt: float | None = None  # sampling interval in seconds, or ...
    fs: float | None = None  # ... sampling rate in hertz
    group: str | None = None  # folder of an HDF5 file, or structure of a MATLAB file, that holds the channels
    samples: tuple[int, int | None] | None = None  # the first, counted from 0, and the one after the last
    period: int | None = None  # samples in one period of a periodic excitation
    accept_saturated: bool = False  # a channel that rests at its extreme value is like that (a trapezoidal force, say)
    accept_swapped: bool = False  # force and response are as named, though they seem exchanged
    # Faults of the measurement by name: a value that is known, or those of some channels, None for one not to be looked
    # for; empty for none.
    measurement: Mapping[str, float | Mapping[str, float] | None] | None = None
    free: bool = False  # no force acts: a free decay
    as_sampled: bool = False  # all samples are used, though the motion asks for fewer
    # Role to a factor on the numbers of its column, -1 for a force with the wrong sign; a unit that is given is that of
    # the product: {"force": -31.0} and {"force": "N"} for a motor that pulls with 31 N/A.
    scale: Mapping[str, float] = field(default_factory=dict[str, float])

    def __post_init__(self) -> None:
        if self.dt is not None and self.fs is not None:
            raise StudyError(f"both dt = {self.dt:g} and fs = {self.fs:g} are given; expected one of them")
        for name, value in (("dt", self.dt), ("fs", self.fs)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise StudyError(f"{name} is {value:g}; expected a number above zero")
        expect(self.period is None or self.period > 1, f"period is {self.period}; expected at least 2 samples")
        first, last = self.samples or (0, None)
        for role, factor in self.scale.items():
            usable = math.isfinite(factor) and factor != 0.0
            expect(usable, f"the scale of {role} is {factor:g}; expected a factor such as -1 or 31.0")
        ordered = first >= 0 and (last is None or last > first)
        expect(ordered, f"samples is {first} to {last}; expected a first sample of 0 or more and a later last one")

    @property
    def interval(self) -> float | None:
        """The sampling interval in seconds, if it is given."""
        return 1.0 / self.fs if self.fs is not None else self.dt

    def over(self, other: "ReadOptions") -> "ReadOptions":
        """These options, and where they say nothing, the other's."""
        rate = self if self.interval is not None else other
        return ReadOptions(
            {**other.columns, **self.columns}, {**other.units, **self.units}, rate.dt, rate.fs,
            self.group if self.group is not None else other.group,
            self.samples if self.samples is not None else other.samples,
            self.period if self.period is not None else other.period,
            self.accept_saturated or other.accept_saturated, self.accept_swapped or other.accept_swapped,
            self.measurement if self.measurement is not None else other.measurement,
            self.free or other.free, self.as_sampled or other.as_sampled, {**other.scale, **self.scale},
        )  # fmt: skip


OPTION_KEYS = tuple(option.name for option in fields(ReadOptions))


def assignments(texts: Sequence[str], option: str) -> dict[str, str]:
    """``["force=V1", "displacement=V2"]``, as the command line gives it, as a mapping; no role may come twice."""
    given: dict[str, str] = {}
    for text in texts:
        role, _, value = (part.strip() for part in text.partition("="))
        expect(role and value, f"{option} {text!r} is not understood; expected '{option} force=V1'")
        expect(role not in given, f"{option} names {role!r} twice, as {given.get(role)!r} and {value!r}; expected once")
        given[role] = value
    return given


def options_beside(path: Path) -> Path:
    """Where the options of a file may stand: ``rig.record.yaml`` for ``rig.csv``."""
    return path.with_suffix(OPTIONS_SUFFIX) if path.name else path


def read_options(path: Path) -> ReadOptions:
    """Read options from a YAML file."""
    text = read_text(path, OPTIONS_FILE)
    with at(path):
        given = as_mapping(read_plain(text) if text.strip() else {})
        if given is None:
            raise StudyError("this is no mapping; expected 'columns: {force: V1, displacement: V2}'")
        for key in given:
            expect(key in OPTION_KEYS, f"there is no key {shown(key)}; {', '.join(OPTION_KEYS)} are known")
        columns = _mapping(given, "columns").items()
        flags = ("accept_saturated", "accept_swapped", "free", "as_sampled")
        return ReadOptions(
            columns={r: c if type(c) is int else _text(f"the column of {r}", c) for r, c in columns},
            units={role: _text(f"the unit of {role}", unit) for role, unit in _mapping(given, "units").items()},
            dt=_number("dt", given.get("dt")),
            fs=_number("fs", given.get("fs")),
            group=_group(given.get("group")),
            samples=_samples(given.get("samples")),
            period=_whole("period", given.get("period")),
            measurement=_measurement(given),
            scale={role: _known(f"the scale of {role}", x, "a factor") for role, x in _mapping(given, "scale").items()},
            **{name: _flag(name, given.get(name, False)) for name in flags},
        )


def _measurement(given: Mapping[object, object]) -> dict[str, float | Mapping[str, float] | None] | None:
    content = given.get("measurement")
    if content is None or content is True or content == "on":
        return None
    if content is False or content == "off":
        return {}
    faults, wanted = as_mapping(content), "'off', or a mapping such as '{delay: 0.5, drift: off}'"
    if not faults:
        raise _wrong("measurement", content, wanted)
    held = dict[str, float | Mapping[str, float] | None]()
    for key, value in faults.items():
        name, channels = _text("a fault in measurement", key), as_mapping(value)
        if channels:
            each = {_text(f"a channel of {key} in measurement", c): v for c, v in channels.items()}
            held[name] = {c: _known(f"{key} of {c} in measurement", v, "a number") for c, v in each.items()}
        else:
            off = value is False or value == "off"
            held[name] = None if off else _known(f"{key} in measurement", value, "a number, or 'off'")
    return held


def _known(name: str, value: object, expected: str) -> float:
    number = _number(name, value) if type(value) in (int, float) else None
    if number is None or not math.isfinite(number):
        raise _wrong(name, value, expected)
    return number


def _mapping(given: Mapping[object, object], key: str) -> dict[str, object]:
    mapping = as_mapping(given.get(key, {}))
    if mapping is None:
        raise _wrong(key, given[key], "a mapping such as '{force: ...}'")
    return {_text(f"a role in {key}", role): value for role, value in mapping.items()}


def _wrong(name: str, value: object, expected: str) -> StudyError:
    return StudyError(f"{name} is {shown(value)}; expected {expected}")


def _text(name: str, value: object) -> str:
    if not isinstance(value, str) or not value.strip():
        raise _wrong(name, value, "a name")
    return value.strip()


def _group(value: object) -> str | None:
    """A name, or the number of a cell."""
    return str(value) if type(value) is int else None if value is None else _text("group", value)


def _number(name: str, value: object) -> float | None:
    if value is not None and type(value) not in (int, float):
        raise _wrong(name, value, "a number")
    try:
        return None if value is None else float(cast(float, value))
    except OverflowError:
        raise _wrong(name, value, "a smaller number") from None


def _whole(name: str, value: object) -> int | None:
    if value is None or type(value) is int:
        return value
    raise _wrong(name, value, "a whole number")


def _samples(value: object) -> tuple[int, int | None] | None:
    pair = as_list(value)
    if value is None:
        return None
    if pair is None or len(pair) != 2:
        raise _wrong("samples", value, "two whole numbers such as [100, 40575]")
    return _whole("the first sample", pair[0]) or 0, _whole("the last sample", pair[1])


def _flag(name: str, value: object) -> bool:
    if isinstance(value, bool):
        return value
    raise _wrong(name, value, "true or false")
