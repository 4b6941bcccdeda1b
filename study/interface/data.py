"""Records: read from files or made of arrays, with their tables and pictures."""

# Matplotlib and pandas leave some of their arguments untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from study.interface.showing import TABLES, drawing_axes, pairs_html
from study.records import record as records
from study.support.errors import StudyError
from study.support.extras import needed

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from study.interface.equation import Model
    from study.records.readers import ReadOptions


@dataclass(frozen=True, eq=False, repr=False)
class Record(records.Record):
    """What was measured or simulated: evenly sampled force and motion with their units.

    Attributes
    ----------
    dt : float
        Sampling interval in seconds.
    channels : mapping of float64 arrays, shape (n,)
        ``force``, and at least one of ``displacement``, ``velocity``, ``acceleration``; any further ones, such as
        ``base_acceleration``. A force of zeros is a free decay, or a test on a moving base.
    units : mapping of str
        Unit of each channel.
    name : str
        What it is called in tables.
    start : float
        Time of the first sample in seconds.
    period : int, optional
        Samples in one period, where the excitation is periodic.
    source : Path, optional
        The file that it was read from.
    """

    source: Path | None = None

    @classmethod
    def of(cls, record: records.Record, source: Path | None = None) -> "Record":
        """A record of the packages below as one of this interface."""
        if isinstance(record, cls):
            return record
        own = {f.name: getattr(record, f.name) for f in fields(records.Record)}
        return cls(**own, source=source)

    def __repr__(self) -> str:
        """One line: name, length, rate and channels."""
        return f"<Record {self.name}: {self._size()}; {self._channels()}>"

    def _repr_html_(self) -> str:
        return pairs_html(f"Record {self.name}", {"samples": self._size(), "channels": self._channels()})

    def _size(self) -> str:
        return f"{len(self):,} samples at {1.0 / self.dt:.6g} Hz, {len(self) * self.dt:.4g} s"

    def _channels(self) -> str:
        return ", ".join(f"{name} [{self.units.get(name, '?')}]" for name in self.channels)

    def to_frame(self) -> "pd.DataFrame":
        """The channels as columns, indexed by the time in seconds."""
        needed(*TABLES)
        import pandas as pd

        return pd.DataFrame(dict(self.channels), index=pd.Index(self.time, name="time"))

    def save(self, path: str | Path) -> None:
        """Write time and channels as CSV with all digits of a double, in the form that :func:`read` reads.

        Raises
        ------
        OSError
            If the file cannot be written; one that was there survives.
        """
        from study.support.files import replacing

        with replacing(Path(path)) as beside:
            records.write_csv(self, beside)

    def plot(self, channel: str | None = None, ax: "Axes | None" = None) -> "Axes":
        """One channel over time; the first measured motion if none is named.

        Raises
        ------
        StudyError
            If there is no such channel.
        """
        name = self._known(channel or str(self.sensors[0]))
        with drawing_axes(ax) as (axes,):
            axes.plot(self.time, self[name], linewidth=0.8)
            axes.set(xlabel="time (s)", ylabel=f"{name} ({self.units.get(name, '')})", title=self.name)
        return axes

    def plot_spectrum(self, channel: str | None = None, ax: "Axes | None" = None) -> "Axes":
        """Root of one channel's autospectral density (Welch, Hann, half overlap), in unit/sqrt(Hz).

        That of the first force, or of the first measured motion where there is none, if no channel is named.

        Raises
        ------
        StudyError
            If there is no such channel.
        """
        from study.compare.noise import segments_of
        from study.records.spectra import autospectrum

        channel = self._known(channel or (*self.forces, *map(str, self.sensors))[0])
        values = self[channel]
        frequency, density = autospectrum(values, self.dt, segments_of(len(values)))
        with drawing_axes(ax) as (axes,):
            axes.semilogy(frequency[1:], np.sqrt(density[1:]), linewidth=1.0)
            unit = f"{self.units.get(channel, '')}/" + r"$\sqrt{\mathrm{Hz}}$"
            axes.set(xlabel="frequency (Hz)", ylabel=f"{channel} ({unit})", title=self.name)
        return axes

    def _known(self, channel: str) -> str:
        if channel not in self:
            raise StudyError(f"{self.name} has no channel {channel!r}; expected one of {', '.join(self.channels)}")
        return channel


def read(
    path: str | Path,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
    fs: float | None = None,
    dt: float | None = None,
    group: str | int | None = None,
    samples: tuple[int, int | None] | None = None,
    period: int | None = None,
    accept_saturated: bool = False,
    accept_swapped: bool = False,
    free: bool = False,
    model: "Model | None" = None,
) -> Record:
    """Read a measured record: CSV and other text tables, MATLAB to 7.3, HDF5, UFF (dataset 58), or Parquet.

    Parameters
    ----------
    path : str or Path
        The file. What ``<stem>.record.yaml`` beside it says holds where the arguments say nothing.
    columns : mapping, optional
        Role (force, displacement, velocity, acceleration, time, or a name for a further channel) to the column's name,
        or its number counted from 1.
    units : mapping of str, optional
        Role to unit: ``{"force": "kN"}``.
    scale : mapping of float, optional
        Role to a factor on the numbers of its column, whose unit is then that of the product: ``{"force": -1}`` where
        the force has the wrong sign, ``{"force": 31.0}`` beside ``units={"force": "N"}`` for the current of a motor.
    fs, dt : float, optional
        Sampling rate in hertz, or interval in seconds, if there is no column of times.
    group : str or int, optional
        Folder of an HDF5 file, structure or cell of a MATLAB file, that holds the channels.
    samples : pair of int, optional
        The first sample, counted from 0, and the one after the last.
    period : int, optional
        Samples in a period of a periodic excitation.
    accept_saturated, accept_swapped : bool
        Take a channel that rests at its extreme, or force and response that seem exchanged, for what they are.
    free : bool
        A free decay: no force acts, and a column of it is left out.
    model : Model, optional
        The structure that was measured, whose forces and coordinates the columns are named by: ``shaker``, ``floor1
        acceleration``. A single mass if left out.

    Returns
    -------
    Record

    Raises
    ------
    StudyError
        If it cannot be read or is no evenly sampled record, naming the file, the value and what was expected.
    """
    from study.records.readers import ReadOptions, read_record

    options = ReadOptions(
        dict(columns or {}), dict(units or {}), dt, fs, None if group is None else str(group), samples, period,
        accept_saturated, accept_swapped, free=free, scale=dict(scale or {}),
    )  # fmt: skip
    found = (
        read_record(Path(path), options) if model is None else read_record(Path(path), options, model.equation.roles)
    )
    return Record.of(found, Path(path))


def record(
    channels: "Mapping[str, ArrayLike] | pd.DataFrame",
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
    fs: float | None = None,
    dt: float | None = None,
    name: str = "record",
    period: int | None = None,
    accept_saturated: bool = False,
    accept_swapped: bool = False,
    free: bool = False,
    model: "Model | None" = None,
) -> Record:
    """Make a record of arrays or of a table, with the checks that a file has to pass.

    Parameters
    ----------
    channels : mapping of arrays of shape (n,), or DataFrame
        Named as :func:`read` would find them in a file (``force``, ``displacement``, ...), or as ``columns`` says.
    columns, units, scale, fs, dt, period, accept_saturated, accept_swapped, free, model
        As for :func:`read`.
    name : str
        What it is called in tables.

    Raises
    ------
    StudyError
        If they make no evenly sampled record.
    """
    from study.records.readers import ReadOptions

    options = ReadOptions(
        dict(columns or {}), dict(units or {}), dt, fs, None, None, period, accept_saturated, accept_swapped,
        free=free, scale=dict(scale or {}),
    )  # fmt: skip
    arrays = {str(key): values for key, values in channels.items()}
    return Record.of(_from_arrays(arrays, name, options, model))


def _from_arrays(arrays: Mapping[str, Any], name: str, options: "ReadOptions", model: "Model | None") -> records.Record:
    from study.records.readers import Roles, not_swapped
    from study.records.readers.assemble import record_from
    from study.records.readers.table import Column, Table, split_unit

    columns, roles = list[Column](), Roles() if model is None else model.equation.roles
    for heading, values in arrays.items():
        array = np.asarray(values)
        if array.ndim != 1 or array.dtype.kind not in "biuf":
            raise StudyError(
                f"{name}: {heading!r} has the shape {array.shape} of {array.dtype}; expected one row of numbers"
            )
        title, unit = split_unit(heading)
        columns.append(Column(title, array.astype(np.float64), unit))
    made = not_swapped(Path(name), record_from(Path(name), Table(tuple(columns)), options, roles), options)
    return replace(made, name=name) if name == "record" else made  # a file of this name is called after its folder
