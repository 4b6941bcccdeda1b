"""What the user says about a file: which column is what, in which unit, how often it was sampled."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from study.support.errors import StudyError
from study.support.files import read_text
from study.support.yaml_text import as_list, as_mapping, read_plain, shown

BESIDE = ".record.yaml"
WANTED = "a YAML file with 'columns', 'units', 'fs' or 'dt', 'group', 'samples', 'period'"
KEYS = ("columns", "units", "dt", "fs", "group", "samples", "period", "accept_saturated", "accept_swapped")


@dataclass(frozen=True)
class ReadOptions:
    """How to read a file; everything that is left out is looked for in the file itself.

    Attributes
    ----------
    columns : dict
        Role to column: ``{"force": "V1", "displacement": 2}``. A column is a name or its number,
        counted from 1. Roles are force, displacement, velocity, acceleration and time; any other
        name makes an extra channel of that name.
    units : dict of str
        Role to unit: ``{"force": "kN", "displacement": "mm"}``.
    dt, fs : float, optional
        Sampling interval in seconds, or sampling rate in hertz.
    group : str, optional
        Folder of an HDF5 file, or structure of a MATLAB file, that holds the channels.
    samples : pair of int, optional
        First sample, counted from 0, and the one after the last (None: to the end).
    period : int, optional
        Samples in one period of a periodic excitation.
    accept_saturated : bool
        Take a channel that rests at its extreme value for what it is (a trapezoidal force, say).
    accept_swapped : bool
        Take force and response as they are, though they seem to stand in each other's place.
    """

    columns: Mapping[str, str | int] = field(default_factory=dict[str, "str | int"])
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    dt: float | None = None
    fs: float | None = None
    group: str | None = None
    samples: tuple[int, int | None] | None = None
    period: int | None = None
    accept_saturated: bool = False
    accept_swapped: bool = False

    def __post_init__(self) -> None:
        """Refuse what contradicts itself or no record can have."""
        if self.dt is not None and self.fs is not None:
            raise StudyError(f"both dt = {self.dt:g} and fs = {self.fs:g} are given; one of them is right")
        for name, value in (("dt", self.dt), ("fs", self.fs)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise StudyError(f"{name} is {value:g}; a number above zero is right")
        if self.period is not None and self.period < 2:
            raise StudyError(f"period is {self.period}; at least 2 samples are right")
        _check_range(self.samples)

    @property
    def interval(self) -> float | None:
        """The sampling interval in seconds, if it is given."""
        return 1.0 / self.fs if self.fs is not None else self.dt

    def over(self, other: "ReadOptions") -> "ReadOptions":
        """These options, and where they say nothing, the other's."""
        rate = self if self.interval is not None else other
        return replace(
            other,
            columns={**other.columns, **self.columns},
            units={**other.units, **self.units},
            dt=rate.dt,
            fs=rate.fs,
            group=self.group if self.group is not None else other.group,
            samples=self.samples if self.samples is not None else other.samples,
            period=self.period if self.period is not None else other.period,
            accept_saturated=self.accept_saturated or other.accept_saturated,
            accept_swapped=self.accept_swapped or other.accept_swapped,
        )


def _check_range(samples: tuple[int, int | None] | None) -> None:
    if samples is None:
        return
    first, last = samples
    if first < 0 or (last is not None and last <= first):
        raise StudyError(f"samples is {first} to {last}; a first sample of 0 or more and a later last one are right")


def assignments(texts: Sequence[str], option: str) -> dict[str, str]:
    """``["force=V1", "displacement=V2"]``, as the command line gives it, as a mapping.

    Raises
    ------
    StudyError
        If a text is not of this form, or names a role twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        role, sign, value = (part.strip() for part in text.partition("="))
        if not (role and sign and value):
            raise StudyError(f"{option} {text!r} is not understood; '{option} force=V1' is right")
        if role in found:
            raise StudyError(f"{option} names {role!r} twice, as {found[role]!r} and {value!r}; once is right")
        found[role] = value
    return found


def beside(path: Path) -> Path:
    """Where the options of a file may stand: ``rig.record.yaml`` for ``rig.csv``."""
    return path.with_suffix(BESIDE) if path.name else path


def read_options(path: Path) -> ReadOptions:
    """Read options from a YAML file.

    Raises
    ------
    StudyError
        If it cannot be read, or holds a key or value that no record has.
    """
    text = read_text(path, WANTED)
    try:
        return _options(read_plain(text) if text.strip() else {})
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None


def _options(value: object) -> ReadOptions:
    given = as_mapping(value)
    if given is None:
        raise StudyError("this is no mapping; 'columns: {force: V1, displacement: V2}' is right")
    for key in given:
        if key not in KEYS:
            raise StudyError(f"there is no key {shown(key)}; {', '.join(KEYS)} are known")
    return ReadOptions(
        columns={role: _column(role, c) for role, c in _mapping(given, "columns").items()},
        units={role: _text(f"the unit of {role}", u) for role, u in _mapping(given, "units").items()},
        dt=_number("dt", given.get("dt")),
        fs=_number("fs", given.get("fs")),
        group=None if given.get("group") is None else _text("group", given["group"]),
        samples=_samples(given.get("samples")),
        period=_whole("period", given.get("period")),
        accept_saturated=_flag("accept_saturated", given.get("accept_saturated", False)),
        accept_swapped=_flag("accept_swapped", given.get("accept_swapped", False)),
    )


def _mapping(given: dict[object, object], key: str) -> dict[str, object]:
    found = as_mapping(given.get(key, {}))
    if found is None:
        raise StudyError(f"{key} is {shown(given[key])}; a mapping such as '{{force: ...}}' is right")
    return {_text(f"a role in {key}", role): value for role, value in found.items()}


def _column(role: str, value: object) -> str | int:
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    return _text(f"the column of {role}", value)


def _text(what: str, value: object) -> str:
    if not isinstance(value, str) or not value.strip():
        raise StudyError(f"{what} is {shown(value)}; a name is right")
    return value.strip()


def _number(what: str, value: object) -> float | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise StudyError(f"{what} is {shown(value)}; a number is right")
    try:
        return float(value)
    except OverflowError:
        raise StudyError(f"{what} is {shown(value)}; a smaller number is right") from None


def _whole(what: str, value: object) -> int | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int):
        raise StudyError(f"{what} is {shown(value)}; a whole number is right")
    return value


def _samples(value: object) -> tuple[int, int | None] | None:
    if value is None:
        return None
    pair = as_list(value)
    if pair is None or len(pair) != 2:
        raise StudyError(f"samples is {shown(value)}; two whole numbers such as [100, 40575] are right")
    first = _whole("the first sample", pair[0])
    return (first or 0, _whole("the last sample", pair[1]))


def _flag(what: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise StudyError(f"{what} is {shown(value)}; true or false is right")
    return value
