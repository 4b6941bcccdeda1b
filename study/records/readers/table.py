"""What every kind of file is read into: named columns, and what the file itself says about them."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.units import is_unit
from study.support.yaml_text import excerpt

Array = NDArray[Any]  # as a file holds it: of any kind of number, or of none
NO_VALUES = np.zeros(0)
RATES = ("fs", "samplerate", "samplingrate", "samplingfrequency", "samplefrequency")
INTERVALS = ("dt", "ts", "samplingtime", "samplingperiod", "sampletime", "samplinginterval")


@dataclass(frozen=True)
class Column:
    """A column as it stands in the file."""

    name: str  # without the unit
    values: Floats  # empty where ``fault`` says why there are none
    unit: str = ""  # what the file says it is; empty where it says nothing
    role: str = ""  # the same
    fault: str = ""  # a sentence for the user who asks for this column, if it cannot be used
    period: int | None = None  # samples in a period, if the file holds periods side by side


@dataclass(frozen=True)
class Table:
    """The columns of a file in its order, and what it states about their sampling."""

    columns: tuple[Column, ...]
    dt: float | None = None  # sampling interval in seconds
    start: float = 0.0  # time of the first sample in seconds
    place: Callable[[int], str] = "sample {}".format  # where in the file a sample stands, in words: ``line 17``

    def from_sample(self, first: int) -> "Table":
        """The same table, places counted from a later sample on."""

        def place(index: int) -> str:
            return self.place(index + first)

        return replace(self, place=place)

    def listing(self) -> str:
        """The columns as a message lists them."""
        shown = [f"{k} {excerpt(c.name, 30)!r}" for k, c in enumerate(self.columns[:12], start=1)]
        return ", ".join(shown) + (f" and {len(self.columns) - 12} more" if len(self.columns) > 12 else "")


def split_unit(text: str) -> tuple[str, str]:
    """Name and unit of a heading: ``Force [kN]``, ``force (kN)``, ``F / kN``.

    Square brackets always hold a unit; what stands in round ones or behind a stroke is one only if it
    can be.
    """
    text = text.strip()
    heading = re.fullmatch(r"(.*?)\s*\[([^\[\]]*)\]", text)
    if heading and heading[1]:
        return heading[1], heading[2].strip()
    for pattern in (r"(.*?)\s*\((.*)\)", r"([^/]*?)\s*/\s*(.*)"):
        heading = re.fullmatch(pattern, text)
        if heading and heading[1] and is_unit(heading[2]):
            return heading[1], heading[2].strip()
    return text, ""


def in_group(path: Path, names: Iterable[str], group: str | None, kind: str) -> list[str]:
    """Those of some paths within a file that lie in the group that the user named, if any.

    A rate that stands beside the groups holds for each of them that states none.
    """
    names = list(names)
    if group is None:
        return names
    chosen = [name for name in names if name.startswith(group.strip("/") + "/")]
    chosen = chosen or [name for name in names if _cell(name) == group]
    known = ", ".join(groups_in(names)) or "none"
    expect(chosen, f"{path}: there is no {kind} {group!r}; it holds {known}; expected one of these")
    rates = [name for name in names if "/" not in name and _states_rate(name)]
    return chosen if any(_states_rate(name) for name in chosen) else chosen + rates


def groups_in(names: Iterable[str]) -> list[str]:
    """What ``--group`` may choose: folders, structures and cells, or the number of a cell that every channel has."""
    names = list(names)
    cells = Counter(number for name in names if (number := _cell(name)))
    shared = [number for number, channels in cells.items() if channels > 1]
    return shared + sorted({name.rpartition("/")[0] for name in names if "/" in name})


def _cell(name: str) -> str:
    """The number of a cell whose array has no name but that of all cells: 2 of ``force/2/force``."""
    *_, array, number, channel = ("", "", *name.split("/"))
    return number if array == channel and number.isdigit() else ""


def _states_rate(name: str) -> bool:
    return _stem(name) in (*RATES, *INTERVALS)


def _stem(name: str) -> str:
    return re.sub(r"[^a-z]", "", name.rsplit("/", 1)[-1].lower())


def from_arrays(path: Path, arrays: Mapping[str, object], units: Mapping[str, str]) -> Table:
    """Columns from the named arrays of a binary file; lone numbers named fs or dt give the rate if they agree."""
    named: dict[str, Array] = {name: np.asarray(value) for name, value in arrays.items()}
    series = [name for name, array in named.items() if array.size > 1]
    columns: list[Column] = []
    intervals: set[float] = set()
    for name, array in named.items():
        if array.size == 1 and _states_rate(name):
            value = complex(array.reshape(-1)[0]) if array.dtype.kind in "iufc" else 0j
            if value.imag or not np.isfinite(value.real) or value.real <= 0.0:
                shown = str(array.reshape(-1)[0])
                raise StudyError(f"{path}: {name!r} is {shown}; expected a sampling rate or interval above zero")
            intervals.add(1.0 / value.real if _stem(name) in RATES else value.real)
        elif series == [name] and array.ndim == 2 and min(array.shape) > 1:  # a file's only matrix, channels in columns
            tall = array if array.shape[0] >= array.shape[1] else array.T
            columns += [_column(f"{name}:{k}", tall[:, k - 1], "") for k in range(1, tall.shape[1] + 1)]
        elif array.size > 1:
            columns.append(_column(name, array, units.get(name, "")))
    return Table(tuple(columns), intervals.pop() if len(intervals) == 1 else None)


def _column(name: str, array: Array, unit: str) -> Column:
    """One channel: a row of numbers, or (samples, periods) put end to end."""
    kind, shape, array = array.dtype.kind, array.shape, array.squeeze()
    fault = ""
    if kind not in "biuf":
        fault = f"holds {'complex numbers' if kind == 'c' else 'text or objects'}; expected real numbers"
    elif array.ndim > 2:
        fault = f"has the shape {shape}; expected (samples,) or (samples, periods)"
    elif array.ndim == 2 and array.shape[0] == array.shape[1]:
        fault = f"has the shape {shape}, samples and periods cannot be told apart; put them end to end"
    if fault:
        return Column(name, NO_VALUES, unit, fault=f"column {name!r} {fault}")
    if array.ndim < 2:
        return Column(name, np.atleast_1d(array).astype(np.float64), unit)
    tall = array if array.shape[0] > array.shape[1] else array.T
    return Column(name, tall.T.reshape(-1).astype(np.float64), unit, period=tall.shape[0])
